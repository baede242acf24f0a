"""The dashboard's panels: each renders a part of a RunView with rich."""

from __future__ import annotations

from collections import deque
from typing import Any, Literal, get_args

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from diffbotctl.printable import fold_words
from diffbotctl.time import SECOND
from diffbotctl.ui.dash.state import RunView
from diffbotctl.ui.plot.chart import ChartCurve, render_chart
from diffbotctl.ui.run_text import LOG_STYLES, log_line_text
from diffbotctl.ui.teleop.deadman import TeleopDeadman
from diffbotctl.ui.text import fold_text, shorten_text

PanelName = Literal["map", "plots", "parameters", "blocks", "log", "help"]
PANELS: tuple[PanelName, ...] = get_args(PanelName)[:-1]  # in the order of their keys
STOP_STYLE = "bold white on red"
LOG_HANG = 12  # columns of the time of a line


def title_line(view: RunView) -> Text:
    """Pipeline, robot, time, and SIMULATED where it is."""
    out = Text(no_wrap=True, overflow="ellipsis")
    out.append(view.scene.title or view.engine, "bold")
    out.append(f"  {view.snapshot.time / SECOND:.1f} s")
    if view.scene.simulated:
        out.append("  ")
        out.append(f" {view.scene.simulated} ", "black on yellow")
    if view.ended:
        out.append("  ")
        out.append(" the run has ended ", STOP_STYLE)
    return out


def stop_banner(view: RunView) -> Text:
    """The stop in force, over the whole width; empty when there is none. How it ends is first."""
    stop = view.held
    if stop is None:
        return Text()
    end = "r: resume" if stop["latched"] else "ends by itself"
    return Text(f" STOPPED ({end})  {stop['code']}: {stop['cause']} ", STOP_STYLE)


def keyboard_line(deadman: TeleopDeadman, width: int) -> Text:
    """Mode and speeds of the keys, whether they drive now, and the terminal's round-trip time.

    The last parts are left out where they do not fit.
    """
    keyboard = deadman.keyboard
    mode = "HOLD a key" if keyboard.mode == "hold" else "LATCHED until the next key"
    parts = [
        (" DRIVING ", "black on green") if deadman.is_driving else (" keys ", "reverse"),
        (f" {mode}", "" if keyboard.mode == "hold" else "bold"),
        (f"  {keyboard.speed:.2f} m/s {keyboard.turn_rate:.2f} rad/s", ""),
    ]
    if keyboard.has_gap:
        parts.append(("  the first key repeat was late", "yellow"))
    if deadman.heartbeat.round_trip is not None:
        parts.append((f"  terminal {deadman.heartbeat.round_trip * 1e3:.0f} ms", "dim"))
    out = Text(no_wrap=True, overflow="ellipsis")
    for text, style in parts:
        if len(out) + len(text) <= width:
            out.append(text, style)
    return out


def plots_panel(
    view: RunView, names: list[str], span: float, width: int, height: int, plain: bool = False
) -> Text:
    """The chosen fields over the last `span` seconds."""
    if not names:
        return Text("press p to choose the plotted fields", "dim")
    curves = [ChartCurve(name, view.unit(name), list(view.numbers.get(name, ()))) for name in names]
    return render_chart(curves, span, width, height, plain)


BLOCK_COLUMNS = ("block", "rate", "age", "busy", "overruns", "last_error")
OPTIONAL_COLUMNS = ("last_error", "busy", "overruns", "age")  # as far as the width goes
COLUMN_GAP = 2
ERROR_MIN_WIDTH = 20


def blocks_panel(view: RunView, width: int, height: int) -> Table:
    """Each block with its rate, the processor time that it takes and its last error."""
    rows = view.blocks[: max(height - 1, 1)]
    cells = {name: [_cell(name, row.get(name)) for row in rows] for name in BLOCK_COLUMNS}
    widths = {name: max(len(name), *map(len, texts), 0) for name, texts in cells.items()}
    widths["last_error"] = ERROR_MIN_WIDTH  # it takes what remains
    shown, used = ["block", "rate"], widths["block"] + COLUMN_GAP + widths["rate"]
    for name in OPTIONAL_COLUMNS:
        if any(cells[name]) and used + COLUMN_GAP + widths[name] <= width:
            shown.append(name)
            used += COLUMN_GAP + widths[name]
    free = width - used + ERROR_MIN_WIDTH
    cells["last_error"] = [shorten_text(text, free) for text in cells["last_error"]]
    table = _table()
    names = [name for name in BLOCK_COLUMNS if name in shown]
    for name in names:
        table.add_column(name.replace("_", " "), no_wrap=True, overflow="ellipsis")
    for texts in zip(*(cells[name] for name in names), strict=True):
        table.add_row(*texts)
    return table


def _table() -> Table:
    return Table(box=None, padding=(0, COLUMN_GAP, 0, 0), pad_edge=False, header_style="bold")


def _cell(name: str, value: Any) -> str:
    match name, value:
        case _, None:
            return ""
        case "last_error", _:
            return f"{value['time'] / SECOND:.1f} s: {value['text']}"
        case "busy", _:
            return f"{100 * value:.2f} %"
        case "rate", _:
            return f"{value:.0f} Hz"
        case "age", _:
            return f"{value:.1f} s"
    return str(value)


def parameters_panel(view: RunView, selected: int, width: int, height: int) -> RenderableType:
    """The live parameters around the selected one, as many as fit.

    What that one means follows below where the row is too short for it.
    """
    rows = view.live_parameters
    if not rows:
        return Text("this pipeline has no parameter that can change during a run")
    texts = [(row["parameter"], _value(row["value"]), row["unit"]) for row in rows]
    names = ("parameter", "value", "unit")
    used = sum(max(map(len, column)) + COLUMN_GAP for column in zip(names, *texts, strict=True))
    meaning = rows[selected]["help"] if selected >= 0 else ""
    if len(meaning) <= width - used:
        meaning = ""
    folded = fold_text(meaning, width=max(width, 1))
    below = folded.count("\n") + 2 if meaning else 0
    count = max(height - 1 - below, 1)
    first = min(max(selected - count // 2, 0), max(len(rows) - count, 0))
    shown = rows[first : first + count]
    table = _table()
    for name in (*names, "description"):
        table.add_column(name, no_wrap=True, overflow="ellipsis")
    for number, row in enumerate(shown, first):
        style = "reverse" if number == selected else "bold" if row["changed"] else ""
        table.add_row(*texts[number], shorten_text(row["help"], width - used), style=style)
    return Group(table, Text(f"\n{folded}", "dim")) if meaning else table


def _value(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def log_panel(view: RunView, width: int, height: int) -> Text:
    """The newest lines of the log that fit, folded between words."""
    shown: deque[Text] = deque()
    for line in reversed(view.log):
        folded = fold_words(log_line_text(line), max(width, 2 * LOG_HANG), rest=" " * LOG_HANG)
        rows = [Text(row, LOG_STYLES.get(line.level, "")) for row in folded]
        if shown and len(shown) + len(rows) > height:
            break
        shown.extendleft(reversed(rows[:height]))
    return Text("\n", no_wrap=True, overflow="ellipsis").join(shown)
