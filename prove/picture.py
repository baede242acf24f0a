"""Make the dashboard pictures (SVG) of README and docs from a run of the simulated robot."""

from __future__ import annotations

import asyncio
import os
import subprocess
import tempfile
from pathlib import Path
from time import monotonic, sleep

from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.client import ControlClient, choose_engine
from diffbotctl.errors import UserError
from diffbotctl.ui.dash.app import Dashboard
from diffbotctl.ui.engine_app import ScreenOptions
from tests.support.command_process import command_line

SIZES = {"docs/dash.svg": (80, 24), "docs/dash_wide.svg": (160, 50)}
PIPELINE = Path(__file__).parent / "data" / "picture.yaml"
GOAL_DISTANCE_M = 1.0  # when the picture is taken
TIMEOUT_S = 60.0


def draw(path: Path, size: tuple[int, int]) -> str:
    """Start the run, attach a dashboard of `size` (columns, lines), write its screen to `path`."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_RUNTIME_DIR"] = folder
        words = ["run", str(PIPELINE), "--name", "picture", "--quiet", "--stay"]
        engine = subprocess.Popen(command_line(*words), stdout=subprocess.PIPE)
        try:
            asyncio.run(_picture(_engine(), path, size))
        finally:
            engine.kill()
            engine.wait()
    return path.read_text()


def _engine() -> EngineAddress:
    """Wait until the engine answers; returns its address."""
    deadline = monotonic() + TIMEOUT_S
    while True:
        try:
            address = choose_engine("picture")
            ControlClient(address, "picture").close()
            return address
        except UserError:
            if monotonic() > deadline:
                raise
            sleep(0.05)


async def _picture(engine: EngineAddress, path: Path, size: tuple[int, int]) -> None:
    dashboard = Dashboard(engine, "picture", ScreenOptions())
    async with dashboard.run_test(size=size) as pilot, asyncio.timeout(TIMEOUT_S):
        while not _is_near(dashboard):
            await pilot.pause(0.1)
        await pilot.pause(0.1)
        path.write_text(dashboard.export_screenshot(title="diffbotctl dash"))


def _is_near(dashboard: Dashboard) -> bool:
    state = dashboard.run_view.snapshot.messages.get("follower.state")
    is_driving = bool(dashboard.run_view.blocks) and dashboard.run_view.held is None
    is_near = getattr(state, "distance", 9.0) < GOAL_DISTANCE_M
    return is_driving and getattr(state, "number", 0) == 2 and is_near


if __name__ == "__main__":
    for name, size in SIZES.items():
        draw(Path(name), size)
