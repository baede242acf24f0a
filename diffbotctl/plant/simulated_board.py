"""What each kind of board makes of commands and edges, and when the host hears of it.

`stock` runs the published rosserial firmware: raw duty, counts in steps, late and jittering.
`counts` and `edges` run ours: a wheel-speed loop and a dead-man's stop; `edges` also tells when
each wheel's last edge came. All times are logical nanoseconds.
"""

from __future__ import annotations

from collections import deque
from random import Random
from typing import NamedTuple

from diffbotctl.control.speed_loop import LOOP_PERIOD, SpeedGains, WheelSpeedLoop
from diffbotctl.messages import Duty, Encoders, Wheels
from diffbotctl.time import MILLISECOND, NEVER

COMMAND_WIRE = 10_400_000  # ns; ten bytes at 9600 baud with the Mega's divider
RADIO = 4_500_000  # ns each way through the Bluetooth modules: 35 ms in all for a loop of counts


class BoardModel(NamedTuple):
    """Timing of one kind of board."""

    period: int  # ns between two frames
    frame: int  # ns; how long after its sample a frame has arrived
    stamp_jitter: int  # ns; standard deviation of the arrival
    command_delay: int  # ns; from the host to the motor
    command_spread: int  # ns; largest difference of one wheel's delay from that
    regulates: bool  # takes rad/s, and stops by itself when it hears nothing
    edge_times: bool


KINDS = {
    # 16.5 Hz and 100 ms were measured with the published firmware; 12 bytes come after the sample.
    "stock": BoardModel(
        60_606_061,
        17 * MILLISECOND,
        8 * MILLISECOND,
        100 * MILLISECOND,
        25 * MILLISECOND,
        False,
        False,
    ),
    "counts": BoardModel(
        20 * MILLISECOND, 15_600_000 + RADIO, 0, COMMAND_WIRE + RADIO, 0, True, False
    ),
    # No radio and no cable: a robot that lives in the simulator alone. Its file says how often.
    "simulated": BoardModel(40 * MILLISECOND, MILLISECOND, 0, MILLISECOND, 0, True, True),
    "edges": BoardModel(
        25 * MILLISECOND, 21_900_000 + RADIO, 0, COMMAND_WIRE + RADIO, 0, True, True
    ),
}
MOST_JITTER = 2  # standard deviations; keeps frames in order


class BoardSide:
    """What a board keeps for one wheel."""

    __slots__ = ("coming", "count", "duty", "edge", "hold", "loop", "raw", "sign", "since")

    def __init__(self, loop: WheelSpeedLoop | None) -> None:
        self.loop = loop
        self.count = 0
        self.sign = 1
        self.edge: int | None = None
        self.duty = 0.0
        self.hold = 0.0  # the command in force
        self.since: int | None = None
        self.raw = loop is None  # whether the command in force is a duty
        self.coming: deque[tuple[int, float, bool]] = deque()


class SimulatedBoard:
    """Both sides of a board, its link and its dead-man's stop.

    `due` is when something next happens on the board; `serve` makes it happen.
    """

    def __init__(
        self,
        kind: BoardModel,
        gains: tuple[SpeedGains, SpeedGains],
        slots: int,
        glitch: int,
        deadman: int,
        chance: Random,
        boot: int = 0,
        now: int = 0,
    ) -> None:
        """`glitch`, `deadman` in ns; `gains` left and right; started at `now`."""
        self.boot = boot
        self.kind = kind
        self._glitch, self._deadman, self._chance = glitch, deadman, chance
        self.sides = tuple(
            BoardSide(WheelSpeedLoop(gain, slots) if kind.regulates else None) for gain in gains
        )
        self._silent = NEVER
        self._tick = (now // LOOP_PERIOD + 1) * LOOP_PERIOD if kind.regulates else NEVER
        self._sent: deque[tuple[int, float, float]] = deque([(-NEVER, 0.0, 0.0)])
        self.due = self._tick

    def command(self, now: int, wanted: Wheels | Duty) -> None:
        """The host sends `wanted` at `now`; it takes hold later.

        Raises TypeError for Wheels where the board has no speed loop.
        """
        raw = isinstance(wanted, Duty)
        if not raw and not self.kind.regulates:
            raise TypeError(f"this board does not take {type(wanted).__name__}")
        self._sent.append((now + self.kind.command_delay, wanted.left, wanted.right))
        for side, value in zip(self.sides, (wanted.left, wanted.right), strict=True):
            spread = self.kind.command_spread
            late = self._chance.randint(-spread, spread) if spread else 0
            time = now + self.kind.command_delay + late
            if side.coming:
                time = max(time, side.coming[-1][0])
            side.coming.append((time, value, raw))
        self._look_ahead()

    def serve(self, now: int) -> None:
        """Let everything happen that is due at `now`."""
        for side in self.sides:
            coming = side.coming
            while coming and coming[0][0] <= now:
                self._take(side, *coming.popleft())
        if now >= self._silent:
            self._silent = NEVER
            for side in self.sides:
                if side.hold:
                    self._hold(side, now, 0.0, side.raw)
        if now >= self._tick:
            self._run_loops(now)
        self._look_ahead()

    def _run_loops(self, now: int) -> None:
        """Run the speed loops, and not again before a command comes if they have come to rest."""
        at_rest = True
        for side in self.sides:
            loop = side.loop
            if loop is None:
                continue
            if side.raw:
                at_rest = at_rest and not loop.check_stall(now, side.duty)
                side.duty = loop.duty
            else:
                side.duty = loop.tick(now)
                at_rest = at_rest and loop.is_at_rest
        self._tick = NEVER if at_rest else now + LOOP_PERIOD

    def edge(self, side: BoardSide, time: int) -> None:
        """A rising edge at the pin of `side`."""
        if side.edge is not None and time - side.edge < self._glitch:
            return
        side.edge = time
        side.count += side.sign
        if side.loop is not None:
            side.loop.edge(time)

    def sample(self, now: int) -> Encoders:
        """The frame taken at `now`, as it will reach the graph. `time` is still the sample's."""
        left, right = self.sides
        if not self.kind.regulates:
            return self._stock_sample(now)
        times = self.kind.edge_times
        since = [side.since for side in self.sides if side.since is not None]
        return Encoders(
            now,
            left.count,
            right.count,
            left.edge if times else None,
            right.edge if times else None,
            left.hold,
            right.hold,
            "duty" if left.raw else "wheels",
            max(since) if since and times else None,
            self.boot,
        )

    def clear(self) -> None:
        """Forget a stall, as the host's `clear` does."""
        for side in self.sides:
            if side.loop is not None:
                side.loop.fault = False

    def _stock_sample(self, now: int) -> Encoders:
        """Stock firmware echoes nothing: the driver reckons with what it sent 100 ms ago."""
        while len(self._sent) > 1 and self._sent[1][0] <= now:
            self._sent.popleft()
        since, left, right = self._sent[0]
        a, b = self.sides
        return Encoders(
            now,
            a.count,
            b.count,
            None,
            None,
            left,
            right,
            "duty",
            since if since > -NEVER else None,
            self.boot,
        )

    def _take(self, side: BoardSide, time: int, value: float, raw: bool) -> None:
        self._silent = time + self._deadman if self.kind.regulates else NEVER
        if value != side.hold or raw is not side.raw or side.since is None:
            self._hold(side, time, value, raw)

    def _hold(self, side: BoardSide, time: int, value: float, raw: bool) -> None:
        side.hold, side.since = value, time
        loop = side.loop
        if loop is None:
            side.duty = value
            side.sign = -1 if value < 0.0 else 1  # the published code counts forward at zero
            return
        if raw is not side.raw:
            side.raw = raw
            loop.command(time, 0.0)  # another kind of command begins from rest
        if raw:
            loop.set_duty(time, value)
        else:
            loop.command(time, value)
        if self._tick == NEVER:
            self._tick = (
                -(-time // LOOP_PERIOD) * LOOP_PERIOD
            )  # the timer has gone on; this is its next
        side.sign = loop.direction
        side.duty = loop.duty

    def _look_ahead(self) -> None:
        due = self._tick if self._tick < self._silent else self._silent
        for side in self.sides:
            if side.coming and side.coming[0][0] < due:
                due = side.coming[0][0]
        self.due = due
