"""The dashboard's panels printed once: for a pipe, a log, or a glance."""

from __future__ import annotations

from rich.console import Console
from rich.panel import Panel

from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.client import ControlClient
from diffbotctl.ui.dash import panels
from diffbotctl.ui.dash.panels import facts_panel
from diffbotctl.ui.dash.state import LOG_MAX_LINES, RunView
from diffbotctl.ui.engine_app import ScreenOptions
from diffbotctl.ui.map import layers

HEIGHT = 16  # lines of the map


def print_once(engine: EngineAddress, wishes: ScreenOptions, fields: list[str]) -> None:
    """Ask the engine, print, leave. Raises RunError when it does not answer."""
    caller = ControlClient(engine, "diffbotctl dash --once")
    try:
        sight = RunView(caller.about)
        sight.take_scene(caller.ask("scene"))
        sight.take_topics(caller.ask("topics"))
        sight.take_look(caller.ask("look"))
        sight.blocks = caller.ask("blocks")["blocks"]
        sight.take_log(caller.ask("log", last=LOG_MAX_LINES))
        sight.parameters = caller.ask("parameters")["parameters"]
    finally:
        caller.close()
    show(sight, Console(highlight=False), wishes.ascii_only)
    for name in fields:
        known = sight.numbers.get(name)
        print(f"{name} {known[-1][1]:.6g}" if known else f"{name} unknown")


def show(sight: RunView, console: Console, plain: bool) -> None:
    """Every panel, one below the other."""
    from rich import box

    lines = box.ASCII if plain else box.ROUNDED
    console.print(panels.title_line(sight))
    if sight.held:
        console.print(panels.stop_banner(sight))
    width = console.width - 4
    seen = (sight.scene, sight.picture, sight.trail.places)
    camera = layers.overview_camera(*seen, width, HEIGHT)
    drawing = layers.draw_map(*seen, camera, width, HEIGHT, plain, sight.sheet)
    console.print(Panel(drawing.text(), title="map", box=lines))
    console.print(Panel(facts_panel(sight, width, plain), title="robot", box=lines))
    console.print(
        Panel(panels.blocks_panel(sight, len(sight.blocks) + 1), title="blocks", box=lines)
    )
    rows = len(panels.live_parameters(sight)) + 1
    console.print(Panel(panels.parameters_panel(sight, -1, rows), title="parameters", box=lines))
    console.print(Panel(panels.log_panel(sight, len(sight.log)), title="log", box=lines))
