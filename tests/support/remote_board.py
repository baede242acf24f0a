"""An emulated board at the far end of a radio that is late, lossy and sometimes away.

In virtual time, so that how busy this machine is changes nothing. The radio is the one of the tests
(`RadioDirection`): 10 to 50 ms late, in order, a frame lost now and then, and a module that keeps
what fits its buffer while the radio is away.
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from diffbotctl.emulator.emulated_robot import EmulatedBoard, EmulatedRobotDriver
from diffbotctl.engine.driver import Delivery
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.time import SECOND
from tests.support.radio_module import BUFFER, DeliveredFrame, RadioDirection

DELAY = (0.010, 0.050)  # s
LOSS = 0.01
TURNS = 0.1  # duty beyond which a motor has begun to turn


class RemoteBoard(EmulatedRobotDriver):
    """A robot driver. `outage` is (kind, seconds after the first motion, seconds long); its kinds:
    `away`, the connection stays and bytes come late; `hung up`, it breaks, and is made again."""

    def __init__(
        self, board: EmulatedBoard, host: DiffbotHost, seed: int, outage: tuple[str, float, float]
    ) -> None:
        super().__init__(board, host)
        rng = Random(seed)
        self.up, self.down = (RadioDirection(rng, DELAY, LOSS) for _ in range(2))
        self.kind, self.after, self.long = outage
        self.begins = self.ends = float("inf")  # s, of the outage
        self.broken = False
        self.passed: list[DeliveredFrame] = []
        self.person: Callable[[int], None] = lambda now: None
        """asked at each step whether the robot should be let go on"""

    def deliver(self, now: int) -> list[Delivery]:
        """As the near one, and the person looks on."""
        delivered = super().deliver(now)
        if self.begins == float("inf") and max(self.board.duty) > TURNS:
            self.begins = now / SECOND + self.after
            self.ends = self.begins + self.long
        if now / SECOND > self.ends or self.kind == "none":
            self.person(now)
        return delivered

    def _send(self, now: int) -> None:
        if self.host.due() <= now and (data := self.host.send(now)):
            self.down.take(now / SECOND, data, self._is_full(now))
        if not self._away(now):
            for frame in self.down.due(now / SECOND):
                self.passed.append(DeliveredFrame(now / SECOND, False, frame))
                self.board.send(now, self.uart, frame)

    def _receive(self, now: int) -> list[Delivery]:
        messages = self._connect(now)
        waiting = self.board.received
        while waiting and waiting[0][0] <= now:
            time, uart, data = waiting.popleft()
            if uart == self.uart:
                self.up.take(time / SECOND, data, self._is_full(now))
        if not self._away(now):
            for frame in self.up.due(now / SECOND):
                self.passed.append(DeliveredFrame(now / SECOND, True, frame))
                messages += self.host.receive(now, frame)
        messages += self.host.on_time(now)
        return [Delivery(f"robot.{port}", message) for port, message in messages]

    def _connect(self, now: int) -> list:  # type: ignore[type-arg]
        """The connection breaks, or is made again: as SerialRobot reports to the protocol."""
        should = self.kind == "hung up" and self._away(now)
        if should == self.broken:
            return []
        self.broken = should
        if should:
            return self.host.closed(now, "the module hung up")
        self.host.opened(now)
        self.host.stop(now)
        return []

    def _away(self, now: int) -> bool:
        return self.kind != "none" and self.begins <= now / SECOND < self.ends

    def _is_full(self, now: int) -> Callable[[int], bool]:
        away, broken = self._away(now), self.broken
        return lambda size: broken or (away and size > BUFFER)
