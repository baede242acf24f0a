"""The keys of the dashboard: a line below the screen, and a panel with all of them."""

from __future__ import annotations

from collections.abc import Set
from typing import Literal

from rich.console import Group, RenderableType
from rich.text import Text

# What a run and a terminal may have, and keys need: a robot, a block that follows goals, one that
# follows velocities, and a terminal that can be trusted with a robot that keeps driving.
Need = Literal["", "robot", "goal", "drive", "latch"]
LAST_KEY = "? help"  # in the line whatever the width
KEYS: tuple[
    tuple[str, Need], ...
] = (  # what is important first: a narrow terminal shows the first ones
    ("1-5 views", ""),
    ("g goal", "goal"),
    ("r resume", "robot"),
    ("p plot", ""),
    ("f follow", "robot"),
    ("[ ] zoom", "robot"),
    ("t keys", "drive"),
    ("b latch", "latch"),
    ("v save", ""),
)
KEYS_WIDTH = 20  # columns of the keys in the panel
# With the letters that drive not more rows than a terminal of 60x20 has, each not wider.
HELP: tuple[tuple[str, str, Need], ...] = (
    ("arrows", "drive; so do the letters below", "drive"),
    ("click, drag", "set a goal; drag for its heading", "goal"),
    ("g", "enter a goal in numbers", "goal"),
    ("space, r", "stop driving, or the robot; resume", "robot"),
    ("1 2 3 4 5, n", "map plots parameters blocks log; next", ""),
    ("wheel, [ ]", "zoom", "robot"),
    ("right drag, {} ()", "pan", "robot"),
    ("f, 0", "follow the robot; all in view", "robot"),
    ("p, < >", "plotted fields; seconds of the plots", ""),
    ("3, arrows, enter", "change a parameter", ""),
    ("5, enter", "set the log level of a block", ""),
    ("v", "save this view to a file", ""),
    ("t", "the other letters", "drive"),
    ("b", "hold or latched keys", "latch"),
    ("ctrl-c", "leave", ""),
)


def help_line(width: int, met: Set[Need]) -> str:
    """As many keys whose needs are `met` as fit, and how to see all."""
    line = ""
    for key, need in KEYS:
        if need not in met:
            continue
        if len(line) + len(key) + 2 + len(LAST_KEY) > width:
            break
        line += f"{key}  "
    return line + LAST_KEY


def help_panel(letters: str, met: Set[Need]) -> RenderableType:
    """Every key whose need is `met`; `letters` describes those that drive."""
    rows = [
        Text.assemble((f"{keys:<{KEYS_WIDTH}}", "bold"), effect)
        for keys, effect, need in HELP
        if need in met
    ]
    return Group(*rows, *([Text(letters)] if "drive" in met else []))
