"""What the command line asks of a full-screen program.

A full-screen program at a running engine: connected, looking, and with a person's hand on it.

textual reads keys and mouse and lays out; what is shown are rich renderables. Every way out
restores the terminal, and every way out of driving ends in zero.
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
from diffbotctl.control_socket.client import AsyncControlClient, Fields
from diffbotctl.control_socket.protocol import RefusalError
from diffbotctl.errors import RunError
from diffbotctl.ui.dash.state import RunView
from diffbotctl.ui.teleop.deadman import (
    CURSOR_QUERY,
    SEND_PERIOD_S,
    TeleopDeadman,
    multiplexer_name,
)
from diffbotctl.ui.teleop.keyboard import KeyboardVelocity


class ScreenOptions(NamedTuple):
    """Keys and mode of the hand, pictures a second, speeds to begin with, letters only."""

    keys: str = "twist"
    mode: str = "hold"
    hz: float = 10.0
    speed: float | None = None  # m/s
    turn: float | None = None  # rad/s
    ascii_only: bool = False


EXIT_TIMEOUT_S = 3.0  # s for the terminal to take what restores it
SLOW_POLL_PERIOD_S = 1.0  # s between two looks at rates and blocks


class EngineApp(App[int]):
    """Connected to `engine` as `tool`. Programs add what they show in `show`."""

    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("ctrl+c", "leave", "leave", priority=True),
        Binding("ctrl+q", "leave", "leave", priority=True),
    ]

    def __init__(self, engine: EngineAddress, tool: str, wishes: ScreenOptions) -> None:
        super().__init__()
        self.engine, self.tool, self.wishes = engine, tool, wishes
        self.sight = RunView({})
        self.caller = AsyncControlClient(self._heard, self._run_ended)
        self.reins: TeleopDeadman | None = None
        self.problem: RunError | None = None
        self.said = ""  # the last thing that the engine refused, or that was done
        self.looks: asyncio.Task[None] | None = None
        self.slow_look = 0.0
        self.leaving: threading.Timer | None = None

    # What programs fill in.

    def show(self) -> None:
        """Draw what is known now."""

    def draw(self) -> None:
        """Show it, unless the widgets have gone already: the last answer may come after them."""
        with suppress(NoMatches):
            self.show()

    def own_key(self, key: str) -> bool:
        """Take a key before the hand gets it. False when it means nothing here."""
        return False

    # The connection.

    async def on_mount(self) -> None:
        """Connect, then look and beat."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGHUP):
            with suppress(NotImplementedError, RuntimeError, ValueError):
                loop.add_signal_handler(number, self._signalled, number)
        try:
            await self.caller.connect(self.engine, self.tool)
            self.sight.engine = str(self.caller.about.get("engine", ""))
            self.sight.take_scene(await self.caller.ask("scene"))
            self.sight.take_topics(await self.caller.ask("topics"))
            self.sight.take_look(await self.caller.ask("look"))
        except RunError as error:
            self.problem = error
            self.exit(1)
            return
        except RefusalError as refusal:
            self.said = str(refusal)
        self._take_hand()
        self.draw()
        self.set_interval(1.0 / self.wishes.hz, self._tick)
        self.set_interval(SEND_PERIOD_S, self._beat)

    def _take_hand(self) -> None:
        robot, wishes = self.sight.scene.robot, self.wishes
        limits = (robot.speed, robot.turn_rate) if robot else (0.0, 0.0)
        hand = KeyboardVelocity(limits, wishes.keys, wishes.mode)
        hand.speed = min(wishes.speed or hand.speed, limits[0])
        hand.turn = min(wishes.turn or hand.turn, limits[1])
        self.reins = TeleopDeadman(hand, self._say, self._question, time.monotonic())
        if hand.mode == "latched":
            self._latch(hand)

    async def _look(self) -> None:
        now = time.monotonic()
        try:
            self.sight.take_look(await self.caller.ask("look"))
            if now - self.slow_look > SLOW_POLL_PERIOD_S:
                self.slow_look = now
                await self.look_slowly()
        except RefusalError as refusal:
            self.said = str(refusal)
        self.draw()

    async def look_slowly(self) -> None:
        """What is looked at once a second: rates; programs add to it."""
        self.sight.take_topics(await self.caller.ask("topics"))

    def _tick(self) -> None:
        if self.sight.ended:
            return
        if self.looks is None or self.looks.done():  # a slow engine is not asked twice
            self.looks = asyncio.create_task(self._look())

    def _heard(self, said: Fields) -> None:
        if said.get("ok") is False:
            self.said = ": ".join(x for x in (said.get("cause"), said.get("fix")) if x)
            if said.get("id") == "drive" and self.reins is not None:
                self.reins.refused()

    def _run_ended(self) -> None:
        self.sight.ended = True
        if self.reins is not None:
            self.reins.refused()
        self.draw()
        self.exit(0)

    # The hand.

    def _beat(self) -> None:
        if self.reins is None or self.sight.ended:
            return
        self.reins.beat(time.monotonic())
        if self.reins.is_unproven:
            self.reins.hand.use(mode="hold")
            self.said = "no latched mode: this terminal does not answer whether it is there"

    def _say(self, do: str, **fields: Any) -> None:
        self.caller.send(id=do, do=do, **fields)

    def _question(self) -> None:
        if self._driver is not None and not self.is_headless:
            self._driver.write(CURSOR_QUERY)  # through textual's own writer: nothing is cut in two
            self._driver.flush()

    def on_cursor_position(self, event: events.CursorPosition) -> None:
        """The terminal answered."""
        if self.reins is not None:
            self.reins.answered(time.monotonic())

    def on_app_blur(self, event: events.AppBlur) -> None:
        """The window is no longer looked at: the robot stands."""
        if self.reins is not None and self.reins.drives:
            self.reins.hand.let_go()
            self.said = "the window lost the focus: the robot stands"

    def on_key(self, event: events.Key) -> None:
        """A key that is not for a question on the screen."""
        if len(self.screen_stack) > 1:
            return
        key = key_of(event)
        if self.own_key(key) or (self.reins is not None and self.hand_key(key)):
            event.stop()
            self.draw()

    def hand_key(self, key: str) -> bool:
        """Drive, change speed, or stop."""
        assert self.reins is not None
        if key == "space" and not self.reins.drives:
            self.do("stop", why="space was pressed")
            return True
        if self.reins.hand.press(key, time.monotonic()):
            self.said = ""
            self._beat()
            return True
        return False

    def next_keys(self) -> None:
        """The other set of keys."""
        assert self.reins is not None
        self.reins.hand.use(keys="turtle" if self.reins.hand.keys.name == "twist" else "twist")

    def next_mode(self) -> None:
        """Hold or latched."""
        assert self.reins is not None
        hand = self.reins.hand
        if hand.mode == "latched":
            hand.use(mode="hold")
            self.said = ""
        else:
            self._latch(hand)

    def _latch(self, hand: KeyboardVelocity) -> None:
        """Latched mode, if somebody can prove to be there."""
        assert self.reins is not None
        inside = multiplexer_name(os.environ)
        if inside:
            hand.use(mode="hold")
            self.said = f"no latched mode inside {inside}: it would answer for a terminal that died"
        else:
            hand.use(mode="latched")
            self.said = ""

    # Requests.

    def do(self, verb: str, **fields: Any) -> None:
        """Ask for something; a refusal is shown."""
        asyncio.create_task(self._do(verb, fields))  # noqa: RUF006  the app holds what it needs

    async def _do(self, verb: str, fields: Fields) -> None:
        try:
            await self.caller.ask(verb, **fields)
            self.said = ""
        except RefusalError as refusal:
            self.said = f"{refusal}; {refusal.fix}" if refusal.fix else str(refusal)
        self.draw()

    # Leaving.

    async def action_leave(self) -> None:
        """Stand, let go, leave."""
        if self.reins is not None:
            self.reins.release()
        await asyncio.sleep(0)
        self.caller.close()
        self.exit(0)

    def _signalled(self, number: int) -> None:
        if number == signal.SIGHUP:
            if self.reins is not None:
                self.reins.lose("its terminal was closed")
            os._exit(128 + number)  # there is no terminal to restore, and none to write to
        if self.reins is not None:
            self.reins.release()
        self.caller.close()
        self.exit(128 + number)

    def exit(self, *arguments: Any, **named: Any) -> None:
        """Leave, whatever happens: textual waits for ever to write to a terminal that is gone."""
        if self.leaving is None:
            self.leaving = threading.Timer(EXIT_TIMEOUT_S, os._exit, [1])
            self.leaving.daemon = True
            self.leaving.start()
        super().exit(*arguments, **named)

    def run_to_end(self) -> int:
        """Run; the exit code."""
        code = self.run()
        if self.leaving is not None:
            self.leaving.cancel()
        return code or 0


def key_of(event: events.Key) -> str:
    """A key as the tables name it: its character, or its name where it has none."""
    if event.key == "space":
        return "space"
    if event.character is not None and event.character.isprintable():
        return event.character
    return event.key
