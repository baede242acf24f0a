"""A full-screen program connected to a running engine, with keyboard teleoperation.

textual reads keys and mouse and lays out; what is shown are rich renderables. Every exit path
restores the terminal, and every way to end driving ends in a commanded zero.
"""

from __future__ import annotations

import asyncio
import os
import signal
import threading
import time
from contextlib import suppress
from typing import Any, ClassVar, NamedTuple

from textual import events
from textual.app import App
from textual.binding import Binding, BindingType
from textual.css.query import NoMatches

from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.client import AsyncControlClient
from diffbotctl.control_socket.protocol import Fields, RefusalError
from diffbotctl.errors import UserError
from diffbotctl.ui.dash.key_help import Need
from diffbotctl.ui.dash.state import REQUESTS, Request, RunView
from diffbotctl.ui.run_text import odometry_topic
from diffbotctl.ui.teleop.deadman import (
    CURSOR_QUERY,
    SEND_PERIOD_S,
    TeleopDeadman,
    multiplexer_name,
)
from diffbotctl.ui.teleop.keyboard import DriveMode, KeyboardVelocity, KeySetName


class ScreenOptions(NamedTuple):
    """Keys and mode, pictures a second, initial speeds, letters only."""

    keys: KeySetName = "twist"
    mode: DriveMode = "hold"
    hz: float = 10.0
    speed: float | None = None  # m/s
    turn_rate: float | None = None  # rad/s
    ascii_only: bool = False


EXIT_TIMEOUT_S = 3.0  # for the terminal to accept what restores it
SLOW_POLL_PERIOD_S = 1.0
STATUS_MAX_AGE_S = 10.0  # a message is read within it


class EngineApp(App[int]):
    """Connected to `engine` as `tool`. Programs draw in `draw_run`."""

    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("ctrl+c", "leave", "leave", priority=True),
        Binding("ctrl+q", "leave", "leave", priority=True),
    ]
    slow_requests: ClassVar[tuple[Request, ...]] = ("list_topics",)  # sent every SLOW_POLL_PERIOD_S

    def __init__(self, engine: EngineAddress, tool: str, options: ScreenOptions) -> None:
        super().__init__()
        self.engine, self.tool, self.options = engine, tool, options
        self.run_view = RunView()
        self.client = AsyncControlClient(self._on_line, self._on_run_end)
        self.keyboard = KeyboardVelocity((0.0, 0.0), options.keys, options.mode)
        self.deadman = TeleopDeadman(
            self.keyboard, self._send, self._query_terminal, time.monotonic()
        )
        self.is_connected = False
        self.problem: UserError | None = None
        self._status, self._status_time = "", 0.0
        self.poll_task: asyncio.Task[None] | None = None
        self.last_slow_poll = 0.0
        self.histories: set[str] = set()  # topics whose past was asked for
        self.exit_timer: threading.Timer | None = None

    @property
    def status(self) -> str:
        """The last refusal of the engine, or a note, for STATUS_MAX_AGE_S."""
        return self._status if time.monotonic() - self._status_time < STATUS_MAX_AGE_S else ""

    @status.setter
    def status(self, text: str) -> None:
        self._status, self._status_time = text, time.monotonic()

    @property
    def met_needs(self) -> set[Need]:
        """What keys may need and this run and terminal have."""
        scene = self.run_view.scene
        met: set[Need] = {""}
        if self.run_view.has_map:
            met.add("robot")
        if "operator.goal" in scene.commands:
            met.add("goal")
        if "operator.twist" in scene.commands:
            met.add("drive")
            if not multiplexer_name(os.environ):
                met.add("latch")
        return met

    # Overridden by programs.

    def draw_run(self) -> None:
        """Draw the present state."""

    def handle_key(self, key: str) -> bool:
        """Handle a key before it can drive. False when it has no meaning here."""
        return False

    def plotted_topics(self) -> set[str]:
        """The topics whose past is drawn."""
        return set()

    def redraw(self) -> None:
        """Draw, unless the widgets are gone already: the last reply may come after them."""
        with suppress(NoMatches):
            if self.screen_stack:
                self.draw_run()

    # The connection.

    async def on_mount(self) -> None:
        """Connect, then poll and send commands periodically."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGHUP):
            with suppress(NotImplementedError, RuntimeError, ValueError):
                loop.add_signal_handler(number, self._on_signal, number)
        try:
            await self.client.connect(self.engine, self.tool)
            self.run_view.engine = str(self.client.about.get("engine", ""))
            await self._poll("scene", "list_topics", "snapshot")
            await self._read_trail()
        except UserError as error:
            self.problem = error
            self.exit(1)
            return
        except RefusalError as refusal:
            self.status = str(refusal)
        self._start_driving()
        self.redraw()
        self.set_interval(1.0 / self.options.hz, self._tick)
        self.set_interval(SEND_PERIOD_S, self._beat)

    def _start_driving(self) -> None:
        robot, options = self.run_view.scene.robot, self.options
        if robot is not None:
            self.keyboard.set_limits(robot.speed, robot.turn_rate, options.speed, options.turn_rate)
        self.deadman.restart(time.monotonic())
        self.is_connected = True
        if self.keyboard.mode == "latched":
            self._latch()

    async def _poll(self, *requests: Request) -> None:
        for request in requests:
            reply = await self.client.request(request, **REQUESTS[request])
            self.run_view.take_reply(request, reply)

    async def _read_trail(self) -> None:
        """The way before this screen was attached."""
        topic = odometry_topic(self.run_view.snapshot)
        if topic is not None:
            with suppress(RefusalError):
                reply = await self.client.request("read_history", topic=topic)
                self.run_view.take_trail(reply)

    async def _read_map(self) -> None:
        while (fields := self.run_view.map_request) is not None:
            if not self.run_view.take_map(await self.client.request("read_map", **fields)):
                return

    async def _read_histories(self) -> None:
        """The past of the topics that are plotted, each once."""
        for topic in self.plotted_topics() - self.histories:
            self.histories.add(topic)
            with suppress(RefusalError):
                reply = await self.client.request("read_history", topic=topic)
                self.run_view.take_history(topic, reply)

    async def _refresh_view(self) -> None:
        now = time.monotonic()
        try:
            await self._poll("snapshot")
            await self._read_map()
            if now - self.last_slow_poll > SLOW_POLL_PERIOD_S:
                self.last_slow_poll = now
                await self._poll(*self.slow_requests)
                await self._read_histories()
        except RefusalError as refusal:
            self.status = str(refusal)
        self.redraw()

    def _tick(self) -> None:
        if self.run_view.ended:
            return
        if self.poll_task is None or self.poll_task.done():  # a slow engine is not asked twice
            self.poll_task = asyncio.create_task(self._refresh_view())

    def _on_line(self, line: Fields) -> None:
        if line.get("ok") is False:
            self.status = ": ".join(filter(None, (line.get("cause"), line.get("fix"))))
            if line.get("id") == "drive":
                self.deadman.on_refusal()

    def _on_run_end(self) -> None:
        self.run_view.ended = True
        self.deadman.on_refusal()
        self.redraw()
        self.exit(0)

    # Driving.

    def _beat(self) -> None:
        if self.run_view.ended:
            return
        self.deadman.beat(time.monotonic())
        if self.deadman.is_unproven:
            self.keyboard.configure(mode="hold")
            self.status = "no latched mode: this terminal does not report the cursor position"

    def _send(self, request: str, **fields: Any) -> None:
        self.client.send(request, request, **fields)

    def _query_terminal(self) -> None:
        if self._driver is not None and not self.is_headless:
            self._driver.write(CURSOR_QUERY)  # through textual's writer, between its sequences
            self._driver.flush()

    def on_cursor_position(self, event: events.CursorPosition) -> None:
        self.deadman.on_reply(time.monotonic())

    def on_app_blur(self, event: events.AppBlur) -> None:
        """The window lost the focus: stop the robot."""
        if self.deadman.is_driving:
            self.keyboard.release()
            self.status = "the window lost the focus: the robot is stopped"

    def on_key(self, event: events.Key) -> None:
        if len(self.screen_stack) > 1:
            return
        key = key_name(event)
        if self.handle_key(key) or (self.is_connected and self._drive_key(key)):
            event.stop()
            self.redraw()

    def _drive_key(self, key: str) -> bool:
        """Drive, change speed, or stop."""
        if key == "space" and not self.deadman.is_driving:
            self.request("stop", reason="space was pressed")
            return True
        if self.keyboard.press(key, time.monotonic()):
            self.status = ""
            self._beat()
            return True
        return False

    def next_key_set(self) -> None:
        is_twist = self.keyboard.keys.name == "twist"
        self.keyboard.configure(keys="turtle" if is_twist else "twist")
        self.status = f"letters: {self.keyboard.keys.help}"

    def next_mode(self) -> None:
        """Change between hold and latched."""
        if self.keyboard.mode == "latched":
            self.keyboard.configure(mode="hold")
            self.status = ""
        else:
            self._latch()

    def _latch(self) -> None:
        """Latched mode, unless a multiplexer answers for the terminal."""
        multiplexer = multiplexer_name(os.environ)
        self.keyboard.configure(mode="hold" if multiplexer else "latched")
        self.status = (
            f"no latched mode inside {multiplexer}: it would answer for a disconnected terminal"
            if multiplexer
            else ""
        )

    # Requests.

    def request(self, method: str, **fields: Any) -> None:
        asyncio.create_task(self._request(method, fields))  # noqa: RUF006  the app holds what it needs

    async def _request(self, method: str, fields: Fields) -> None:
        try:
            await self.client.request(method, **fields)
            self.status = ""
        except RefusalError as refusal:
            self.status = refusal.text
        self.redraw()

    # Leaving.

    async def action_leave(self) -> None:
        """Stop driving, disconnect, exit."""
        self.deadman.release()
        await asyncio.sleep(0)
        self.client.close()
        self.exit(0)

    def _on_signal(self, number: int) -> None:
        if number == signal.SIGHUP:
            self.deadman.lose("its terminal was closed")
            os._exit(128 + number)  # there is no terminal to restore, and none to write to
        self.deadman.release()
        self.client.close()
        self.exit(128 + number)

    def exit(self, *arguments: Any, **named: Any) -> None:
        """Exit in any case: textual waits without limit to write to a terminal that is gone."""
        if self.exit_timer is None:
            self.exit_timer = threading.Timer(EXIT_TIMEOUT_S, os._exit, [1])
            self.exit_timer.daemon = True
            self.exit_timer.start()
        super().exit(*arguments, **named)

    def run_to_end(self) -> int:
        code = self.run()
        if self.exit_timer is not None:
            self.exit_timer.cancel()
        return code or 0


def key_name(event: events.Key) -> str:
    """A key as the tables name it: its character, or its name where it has none."""
    if event.key != "space" and event.character is not None and event.character.isprintable():
        return event.character
    return event.key
