"""The dashboard's panels: each turns what is known of a run into something that rich can print."""

from __future__ import annotations

from itertools import islice
from typing import Any

from rich.table import Table
from rich.text import Text

from diffbotctl.ui import words
from diffbotctl.ui.chart import chart
from diffbotctl.ui.dash.sight import Fields, Sight
from diffbotctl.ui.teleop.reins import Reins

HELD = "bold white on red"
SPAN = 30.0  # s of a chart


def title(sight: Sight) -> Text:
    """Pipeline, robot, time, and SIMULATED where it is."""
    out = Text(no_wrap=True, overflow="ellipsis")
    out.append(sight.scene.title or sight.engine, "bold")
    out.append(f"  {sight.picture.time / 1e9:.1f} s")
    if sight.scene.simulated:
        out.append(f"  {sight.scene.simulated}", "black on yellow")
    if sight.ended:
        out.append("  the run has ended", HELD)
    return out


def banner(sight: Sight) -> Text:
    """What holds the robot, over the whole width; empty when nothing does."""
    held = sight.held
    if held is None:
        return Text()
    way_out = "r: resume" if held["latched"] else "ends by itself"
    said = f" STOPPED  {held['code']}: {held['cause']}  ({way_out}) "
    return Text(said, HELD)


def hand_line(reins: Reins) -> Text:
    """How the keys drive: mode, speeds, whether they do just now, and how far the terminal is."""
    out, hand = Text(no_wrap=True, overflow="ellipsis"), reins.hand
    out.append(" DRIVING " if reins.drives else " keys ", *(["black on green"] if reins.drives
               else ["reverse"]))  # fmt: skip
    held = hand.mode == "hold"
    out.append(" HOLD a key " if held else " LATCHED until the next key ", "" if held else "bold")
    out.append(f" {hand.speed:.2f} m/s {hand.turn:.2f} rad/s")
    if reins.pulse.round_trip is not None:
        out.append(f"  terminal {reins.pulse.round_trip * 1e3:.0f} ms", "dim")
    if hand.stuttered:
        out.append("  gap: the keyboard repeats late", "yellow")
    return out


def plots(
    sight: Sight, names: list[str], width: int, height: int, plain: bool = False
) -> Text:  # fmt: skip
    """The chosen fields over the last half minute."""
    if not names:
        return Text("p chooses what is plotted", "dim")
    return chart([(name, list(sight.numbers.get(name, ()))) for name in names], SPAN, width,
                 height, plain)  # fmt: skip


def blocks(sight: Sight, height: int) -> Table:
    """Each block with its rate, what it costs and its last error."""
    columns = [name for name in ("busy", "overruns", "last_error")
               if any(row.get(name) is not None for row in sight.blocks)]  # fmt: skip
    table = Table(box=None, pad_edge=False, header_style="bold", expand=True)
    for name in ("block", "rate", "age", *columns):
        rest = 1 if name == "last_error" else None  # it takes what the figures leave
        table.add_column(name.replace("_", " "), no_wrap=True, overflow="ellipsis", ratio=rest)
    for row in islice(sight.blocks, max(height - 1, 1)):
        age = "" if row["age"] is None else f"{row['age']:.1f} s"
        table.add_row(
            row["block"],
            f"{row['rate']:.0f} Hz",
            age,
            *(_cell(name, row.get(name)) for name in columns),
        )
    return table


def _cell(name: str, value: Any) -> str:
    if value is None:
        return ""
    if name == "last_error":
        return f"{value['time'] / 1e9:.1f} s: {value['text']}"
    return f"{100 * value:.2f} %" if name == "busy" else str(value)


def parameters(sight: Sight, at: int, height: int) -> Table:
    """The live parameters, the one at `at` marked, as many as there is room for."""
    rows = live(sight)
    table = Table(box=None, pad_edge=False, header_style="bold", expand=True)
    for name in ("parameter", "value", "unit"):
        table.add_column(name, no_wrap=True)
    table.add_column("what it is", no_wrap=True, overflow="ellipsis", ratio=1)
    room = max(height - 1, 1)
    first = min(max(at - room // 2, 0), max(len(rows) - room, 0))
    for number, row in enumerate(rows[first : first + room], first):
        style = "reverse" if number == at else "bold" if row["changed"] else ""
        value = row["value"]
        shown = f"{value:.6g}" if isinstance(value, float) else str(value)
        table.add_row(row["parameter"], shown, row["unit"], row["help"], style=style)
    if not rows:
        table.add_row("no block of this pipeline has a parameter that may change while it runs")
    return table


def live(sight: Sight) -> list[Fields]:
    """The parameters that may change while the pipeline runs."""
    return [row for row in sight.parameters if row["live"]]


def log(sight: Sight, height: int) -> Text:
    """The newest lines that fit."""
    lines = [
        Text(words.line(line), words.STYLES.get(line.level, "")) for line in sight.log[-height:]
    ]
    return Text("\n", no_wrap=True, overflow="ellipsis").join(lines)
