"""Keys of the dashboard: what each key does, and the help page."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from rich.console import Group
from rich.text import Text

from diffbotctl.ui.dash.widgets import ZOOM_STEP, MapBox

if TYPE_CHECKING:
    from diffbotctl.ui.dash.app import Dashboard

VIEWS = ("map", "plots", "parameters", "blocks", "log")
HELP = "1-5 views  g goal  p plot  f follow  [ ] zoom  t keys  b latch  r resume  ? help"
PAN = 4  # characters a key press

LINES = (
    ("click", "a goal there"),
    ("drag", "a goal with a heading"),
    ("wheel, [ ]", "zoom"),
    ("right drag, { } ( )", "pan left, right, up, down"),
    ("1 2 3 4 5, n", "map, plots, parameters, blocks, log; the next of them"),
    ("3, arrows, enter", "change a parameter"),
    ("5, enter", "hear a block in the log from another level on"),
    ("g", "a goal in numbers"),
    ("space", "stop: while driving stand, else hold until r"),
    ("r", "resume"),
    ("f, 0", "keep the robot in the middle; keep everything in view"),
    ("p", "choose what is plotted"),
    ("arrows", "drive"),
    ("t", "the other set of letters"),
    ("b", "hold a key to drive, or latched until the next key"),
    ("ctrl-c", "leave"),
)


def help_page(letters: str) -> Group:
    """Every key; `letters` says which of them drive."""
    rows = [Text.assemble((f"{name:<21}", "bold"), what) for name, what in LINES]
    return Group(*rows, Text(letters))


def press(dashboard: Dashboard, key: str) -> bool:
    """Do what `key` means. False when it means nothing here."""
    action = KEYS.get(key)
    if action is None:
        return False
    action(dashboard)
    return True


def _turn_to(view: str, dashboard: Dashboard) -> None:
    dashboard.turn_to(view)


def _help(dashboard: Dashboard) -> None:
    dashboard.turn_to("map" if dashboard.view == "help" else "help")


def _map(does: Callable[[MapBox], None], dashboard: Dashboard) -> None:
    does(dashboard.query_one(MapBox))


KEYS: dict[str, Callable[[Dashboard], None]] = {
    **{str(number): partial(_turn_to, view) for number, view in enumerate(VIEWS, 1)},
    "escape": partial(_turn_to, "map"),
    "?": _help,
    "n": lambda dashboard: dashboard.next_view(),
    "g": lambda dashboard: dashboard.ask_goal(),
    "p": lambda dashboard: dashboard.ask_fields(),
    "r": lambda dashboard: dashboard.do("resume"),
    "t": lambda dashboard: dashboard.next_keys(),
    "b": lambda dashboard: dashboard.next_mode(),
    "f": partial(_map, MapBox.follow),
    "0": partial(_map, MapBox.fit),
    "]": partial(_map, lambda box: box.zoom(ZOOM_STEP)),
    "[": partial(_map, lambda box: box.zoom(1 / ZOOM_STEP)),
    "{": partial(_map, lambda box: box.pan(-PAN, 0)),
    "}": partial(_map, lambda box: box.pan(PAN, 0)),
    "(": partial(_map, lambda box: box.pan(0, -PAN)),
    ")": partial(_map, lambda box: box.pan(0, PAN)),
}
