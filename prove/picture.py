"""The picture in the README: the live view of a real run on the simulated robot, as SVG."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from rich.console import Console

from diffbotctl.config.load import load
from diffbotctl.hub.latest import Snapshot
from diffbotctl.runs.run import Options, Run
from diffbotctl.runs.scene import scene
from diffbotctl.ui.live import LiveView
from diffbotctl.ui.scene import scene_of

WIDTH, HEIGHT = 80, 24
MOMENT = 4.0  # s into the run: driving, with the goal in sight
STEP = 100_000_000  # ns between two pictures, as on a screen


def draw(path: Path) -> None:
    """Run the shipped goal pipeline and write its view at `MOMENT` to `path`."""
    setup = load("goal")
    run = Run(setup, Options(fast=True, duration=MOMENT))
    view = LiveView(scene_of(scene(setup, run.assembly.graph, "sim")))
    wires = run.assembly.graph.wires
    latest: dict[str, Any] = {}
    due = [0]
    shown: list[Any] = []

    def record(instant: tuple[Any, ...]) -> None:
        for wire, message in zip(wires, instant[1:], strict=True):
            if message is not None:
                latest[wire] = message
        if instant[0] >= due[0] and instant[0] < MOMENT * 1e9:
            due[0] = instant[0] + STEP
            shown[:] = [view.render(Snapshot(instant[0], dict(latest), 0, 1), WIDTH, HEIGHT)]

    run.engine.compiled = run.assembly.graph.compile(run.engine.sinks, record)
    run.go()
    console = Console(record=True, width=WIDTH, height=HEIGHT, file=sys.stderr, force_terminal=True)
    console.print(shown[0])
    path.write_text(console.export_svg(title="diffbotctl run goal"))


if __name__ == "__main__":
    draw(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/live.svg"))
