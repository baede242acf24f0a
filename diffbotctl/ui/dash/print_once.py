"""The dashboard's panels printed once: for a pipe, a log, or one look."""

from __future__ import annotations

from rich import box
from rich.console import RenderableType
from rich.panel import Panel

from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.client import ControlClient
from diffbotctl.ui.console import PrintableConsole
from diffbotctl.ui.dash import panels
from diffbotctl.ui.dash.facts import facts_panel
from diffbotctl.ui.dash.state import REQUESTS, RunView
from diffbotctl.ui.map.layers import draw_map, overview_camera
from diffbotctl.ui.run_text import odometry_topic

MAP_ROWS, FACTS_ROWS, LOG_ROWS = 16, 100, 1000  # the last two: more than there are


def print_once(engine: EngineAddress, fields: list[str], plain: bool) -> None:
    """Print every panel, and the value of each field. Raises RunError when no engine answers."""
    client = ControlClient(engine, "diffbotctl dash --once")
    try:
        view = RunView(str(client.about.get("engine", "")))
        for request, arguments in REQUESTS.items():
            view.take_reply(request, client.request(request, **arguments))
        topic = odometry_topic(view.snapshot)
        if topic is not None:
            view.take_trail(client.request("read_history", topic=topic))
        while (fields_of_map := view.map_request) is not None:
            if not view.take_map(client.request("read_map", **fields_of_map)):
                break
    finally:
        client.close()
    _print_panels(view, PrintableConsole(highlight=False), plain)
    for name in fields:
        history = view.numbers.get(name)
        print(f"{name} {history[-1][1]:.6g}" if history else f"{name} unknown")


def _print_panels(view: RunView, console: PrintableConsole, plain: bool) -> None:
    console.print(panels.title_line(view))
    if view.held:
        console.print(panels.stop_banner(view))
    width = console.width - 4
    canvas = draw_map(view, overview_camera(view, width, MAP_ROWS), width, MAP_ROWS, plain)
    contents: dict[str, RenderableType] = {
        **({"map": canvas.text()} if view.has_map else {}),
        "robot": facts_panel(view, width, FACTS_ROWS, plain),
        "blocks": panels.blocks_panel(view, width, len(view.blocks) + 1),
        "parameters": panels.parameters_panel(view, -1, width, len(view.live_parameters) + 1),
        "log": panels.log_panel(view, width, LOG_ROWS),
    }
    for title, content in contents.items():
        console.print(Panel(content, title=title, box=box.ASCII if plain else box.ROUNDED))
