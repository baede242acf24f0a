"""The dashboard's panels printed once: for a pipe, a log, or a glance."""

from __future__ import annotations

from rich.console import Console
from rich.panel import Panel

from diffbotctl.hub.caller import Caller
from diffbotctl.hub.place import Engine
from diffbotctl.ui import floor
from diffbotctl.ui.dash import panels
from diffbotctl.ui.dash.facts import facts
from diffbotctl.ui.dash.sight import MOST_LINES, Sight
from diffbotctl.ui.wishes import Wishes

HEIGHT = 16  # lines of the map


def print_once(engine: Engine, wishes: Wishes, fields: list[str]) -> None:
    """Ask the engine, print, leave. Raises RunError when it does not answer."""
    caller = Caller(engine, "diffbotctl dash --once")
    try:
        sight = Sight(caller.about)
        sight.take_scene(caller.ask("scene"))
        sight.take_topics(caller.ask("topics"))
        sight.take_look(caller.ask("look"))
        sight.blocks = caller.ask("blocks")["blocks"]
        sight.take_log(caller.ask("log", last=MOST_LINES))
        sight.parameters = caller.ask("parameters")["parameters"]
    finally:
        caller.close()
    show(sight, Console(highlight=False), wishes.ascii_only)
    for name in fields:
        known = sight.numbers.get(name)
        print(f"{name} {known[-1][1]:.6g}" if known else f"{name} unknown")


def show(sight: Sight, console: Console, plain: bool) -> None:
    """Every panel, one below the other."""
    from rich import box

    lines = box.ASCII if plain else box.ROUNDED
    console.print(panels.title(sight))
    if sight.held:
        console.print(panels.banner(sight))
    width = console.width - 4
    seen = (sight.scene, sight.picture, sight.trail.places)
    camera = floor.look(*seen, width, HEIGHT)
    drawing = floor.draw(*seen, camera, width, HEIGHT, plain, sight.sheet)
    console.print(Panel(drawing.text(), title="map", box=lines))
    console.print(Panel(facts(sight, width, plain), title="robot", box=lines))
    console.print(Panel(panels.blocks(sight, len(sight.blocks) + 1), title="blocks", box=lines))
    rows = len(panels.live(sight)) + 1
    console.print(Panel(panels.parameters(sight, -1, rows), title="parameters", box=lines))
    console.print(Panel(panels.log(sight, len(sight.log)), title="log", box=lines))
