"""The keys of the dashboard: a line below the screen, and a panel with all of them."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.text import Text

LAST_KEY = "? help"  # in the line whatever the width
KEYS = (  # what is important first: a narrow terminal shows the first ones
    "1-5 views",
    "g goal",
    "r resume",
    "p plot",
    "f follow",
    "[ ] zoom",
    "t keys",
    "b latch",
    "v save",
)
KEYS_WIDTH = 20  # columns of the keys in the panel
# With the letters that drive not more rows than a terminal of 60x20 has, each not wider.
HELP = (
    ("arrows", "drive; so do the letters below"),
    ("click, drag", "set a goal; drag for its heading"),
    ("g", "enter a goal in numbers"),
    ("space, r", "stop driving, or the robot; resume"),
    ("1 2 3 4 5, n", "map plots parameters blocks log; next"),
    ("wheel, [ ]", "zoom"),
    ("right drag, {} ()", "pan"),
    ("f, 0", "follow the robot; all in view"),
    ("p, < >", "plotted fields; seconds of the plots"),
    ("3, arrows, enter", "change a parameter"),
    ("5, enter", "set the log level of a block"),
    ("v", "save this view to a file"),
    ("t, b", "other letters; hold or latched keys"),
    ("ctrl-c", "leave"),
)


def help_line(width: int) -> str:
    """As many keys as fit, and how to see all."""
    line = ""
    for key in KEYS:
        if len(line) + len(key) + 2 + len(LAST_KEY) > width:
            break
        line += f"{key}  "
    return line + LAST_KEY


def help_panel(letters: str) -> RenderableType:
    """Every key; `letters` describes those that drive."""
    rows = [Text.assemble((f"{keys:<{KEYS_WIDTH}}", "bold"), effect) for keys, effect in HELP]
    return Group(*rows, Text(letters))
