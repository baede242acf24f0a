"""What each kind of board does with commands and edges, and when its frames reach the host.

`stock` runs the published rosserial firmware: raw duty, counts in steps, late and with jitter.
`counts` and `edges` run ours: a wheel-speed loop and a dead-man's stop; frames of `edges` also hold
the time of each wheel's last edge. All times are logical nanoseconds.
"""

from collections import deque
from random import Random
from typing import Literal, NamedTuple

from diffbotctl.control.speed_loop import LOOP_PERIOD, SpeedGains, WheelSpeedLoop
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_commands import in_frame
from diffbotctl.messages import Duty, Encoders, Wheels
from diffbotctl.time import MILLISECOND as MS
from diffbotctl.time import NEVER, SECOND

COMMAND_WIRE_TIME = 10_400_000  # ns; ten bytes at 9600 baud with the Mega's divider
RADIO_DELAY = 4_500_000  # ns each way through the Bluetooth modules: 35 ms in all for a count loop
JITTER_MAX_SD = 2  # standard deviations of the arrival; keeps frames in order

STALL_FLAGS = (frames.FLAG_LEFT_STALL, frames.FLAG_RIGHT_STALL)

BoardKind = Literal["stock", "counts", "edges", "simulated"]


class BoardModel(NamedTuple):
    """Timing of one kind of board. Times are ns."""

    period: int  # between two frames
    frame_delay: int  # from a frame's sample to its arrival
    command_delay: int  # from the host to the motor
    stamp_jitter: int = 0  # standard deviation of the arrival
    command_spread: int = 0  # largest difference of one wheel's delay from `command_delay`
    has_speed_loop: bool = True  # takes rad/s, and stops by itself without commands
    edge_times: bool = True


BOARD_MODELS: dict[BoardKind, BoardModel] = {
    # 16.5 Hz and 100 ms were measured with the published firmware; 12 bytes come after the sample.
    "stock": BoardModel(
        60_606_061, 17 * MS, 100 * MS, 8 * MS, 25 * MS, has_speed_loop=False, edge_times=False
    ),
    "counts": BoardModel(
        SECOND // 48, 18_700_000 + RADIO_DELAY, COMMAND_WIRE_TIME + RADIO_DELAY, edge_times=False
    ),
    # No radio and no cable: a robot that exists in the simulator alone; its file has the period.
    "simulated": BoardModel(40 * MS, MS, MS),
    "edges": BoardModel(SECOND // 38, 22_900_000 + RADIO_DELAY, COMMAND_WIRE_TIME + RADIO_DELAY),
}


class PendingCommand(NamedTuple):
    """A command of one wheel that takes hold at `time` (ns): rad/s, or a duty."""

    time: int
    value: float
    is_duty: bool


class BoardSide:
    """What a board keeps for one wheel."""

    __slots__ = (
        "command",
        "command_time",
        "count",
        "direction",
        "duty",
        "is_duty",
        "is_shown",
        "last_edge",
        "loop",
        "pending",
        "skipped",
    )

    def __init__(self, loop: WheelSpeedLoop | None) -> None:
        self.loop = loop
        self.count = 0
        self.direction = 1  # in which edges are counted
        self.last_edge: int | None = None
        self.duty = 0.0
        self.command = 0.0  # in force: rad/s, or a duty if `is_duty`
        self.command_time: int | None = None
        self.is_shown = True  # a frame has shown the command
        # A command that no frame has shown, and when it took effect.
        self.skipped: tuple[int, float] | None = None
        self.is_duty = loop is None
        self.pending: deque[PendingCommand] = deque()

    def apply(self, command: PendingCommand) -> None:
        """Put a command into force."""
        if not self.is_shown and self.command_time is not None:
            self.skipped = self.command_time, self.command
        self.is_shown = False
        self.command, self.command_time = command.value, command.time
        loop = self.loop
        if loop is None:
            self.duty = command.value
            # The published firmware counts forward at zero.
            self.direction = -1 if command.value < 0.0 else 1
            return
        if command.is_duty is not self.is_duty:
            self.is_duty = command.is_duty
            loop.command(command.time, 0.0)  # a command of the other kind begins from rest
        if self.is_duty:
            loop.set_duty(command.value)
        else:
            loop.command(command.time, command.value)
        self.direction = loop.direction
        self.duty = loop.duty


class SimulatedBoard:
    """Both sides of a board, its link and its dead-man's stop.

    `due` is when something next happens on the board; `serve` makes it happen. `fault_flags` are
    the bits FLAG_... of a wheel fault, which holds the motors off until `clear_fault`. The stop
    button holds them off while it is pressed.
    """

    def __init__(
        self,
        model: BoardModel,
        gains: tuple[SpeedGains, SpeedGains],
        counts: tuple[int, int],
        lag: float | None,
        glitch: int,
        deadman: int,
        rng: Random,
        boot: int = 0,
        now: int = 0,
        has_encoders: bool = True,
    ) -> None:
        """`glitch`, `deadman` in ns; `gains`, `counts` (per turn) left and right; `lag` (s) of the
        slower motor, None if unknown; started at `now`.

        Without encoders no stall is noticed.
        """
        self._has_encoders = has_encoders
        self.model = model
        self.boot = boot
        self.fault_flags = 0
        self.button_pressed = False
        self._glitch, self._deadman, self._rng = glitch, deadman, rng
        self.sides = tuple(
            BoardSide(WheelSpeedLoop(gain, count, lag) if model.has_speed_loop else None)
            for gain, count in zip(gains, counts, strict=True)
        )
        self._deadman_due = NEVER
        self._loop_due = (now // LOOP_PERIOD + 1) * LOOP_PERIOD if model.has_speed_loop else NEVER
        # Commands that the driver of a stock board assumes: (ns, left, right).
        self._sent: deque[tuple[int, float, float]] = deque([(-NEVER, 0.0, 0.0)])
        self.due = self._loop_due

    def command(self, now: int, command: Wheels | Duty) -> None:
        """The host sends `command` at `now`; it takes hold later.

        Raises TypeError for Wheels where the board has no speed loop.
        """
        is_duty = isinstance(command, Duty)
        if not is_duty and not self.model.has_speed_loop:
            raise TypeError(f"this board does not take {type(command).__name__}")
        arrival = now + self.model.command_delay
        if not self.model.has_speed_loop:
            self._sent.append((arrival, command.left, command.right))
        for side, value in zip(self.sides, (command.left, command.right), strict=True):
            # The speeds in a frame are whole numbers.
            received = value if is_duty else in_frame(value, frames.SPEED_ONE) / frames.SPEED_ONE
            self._queue(side, arrival, received, is_duty)
        self._update_due()

    def _queue(self, side: BoardSide, arrival: int, value: float, is_duty: bool) -> None:
        """Let a command of one wheel take hold at about `arrival`, after those before."""
        spread = self.model.command_spread
        if spread:
            arrival += self._rng.randint(-spread, spread)
        if side.pending:
            arrival = max(arrival, side.pending[-1].time)
        side.pending.append(PendingCommand(arrival, value, is_duty))

    def press(self, now: int, pressed: bool) -> None:
        """Press or release the stop button. The published firmware knows none."""
        self.button_pressed = pressed and self.model.has_speed_loop
        if self.button_pressed:
            for side in self.sides:
                self._apply(side, PendingCommand(now, 0.0, side.is_duty))

    def clear_fault(self) -> None:
        """End a wheel fault; the motors stay off until the next command."""
        self.fault_flags = 0
        for side in self.sides:
            if side.loop is not None:
                side.loop.clear_fault()

    def serve(self, now: int) -> None:
        """Let everything happen that is due at `now`."""
        for side in self.sides:
            pending = side.pending
            while pending and pending[0][0] <= now:
                self._receive(side, pending.popleft())
        if now >= self._deadman_due:
            self._deadman_due = NEVER
            for side in self.sides:
                if side.command:
                    self._apply(side, PendingCommand(now, 0.0, side.is_duty))
        if now >= self._loop_due:
            self._run_loops(now)
        self._update_due()

    def edge(self, side: BoardSide, time: int, direction: int = 0) -> None:
        """A counted edge at the pin of `side`; one within the glitch time is ignored.

        `direction`: 1 or -1 as two channels show it; 0: one channel, the direction of the drive.
        """
        if direction:
            side.direction = direction
        elif side.last_edge is not None and time - side.last_edge < self._glitch:
            return
        side.last_edge = time
        side.count += side.direction
        if side.loop is not None:
            side.loop.edge(time)

    def sample(self, now: int) -> Encoders:
        """The frame sampled at `now`, as it will reach the graph. `time` is still the sample's."""
        if not self.model.has_speed_loop:
            return self._stock_sample(now)
        left, right = self.sides
        times = self.model.edge_times
        since = left.command_time
        if since is None or (right.command_time is not None and right.command_time > since):
            since = right.command_time
        frame = Encoders(
            now,
            left.count,
            right.count,
            left.last_edge if times else None,
            right.last_edge if times else None,
            left.command,
            right.command,
            "duty" if left.is_duty else "wheels",
            since if times else None,
            self.boot,
        )
        return self._with_skipped(frame) if times else frame

    def _with_skipped(self, frame: Encoders) -> Encoders:
        """`frame` with the command that no frame has shown, as the host knows it."""
        left_side, right_side = self.sides
        left, right = left_side.skipped, right_side.skipped
        left_side.skipped = right_side.skipped = None
        left_side.is_shown = right_side.is_shown = True
        if left is None or right is None:
            return frame
        return frame._replace(
            skipped_left_command=left[1],
            skipped_right_command=right[1],
            skipped_command_time=max(left[0], right[0]),
        )

    def _stock_sample(self, now: int) -> Encoders:
        """Stock firmware echoes nothing: the driver assumes what it sent 100 ms ago."""
        while len(self._sent) > 1 and self._sent[1][0] <= now:
            self._sent.popleft()
        since, left, right = self._sent[0]
        a, b = self.sides
        time = since if since > -NEVER else None
        return Encoders(now, a.count, b.count, None, None, left, right, "duty", time, self.boot)

    def _receive(self, side: BoardSide, command: PendingCommand) -> None:
        """Restart the dead-man's time; a command equal to the one in force changes nothing else."""
        self._deadman_due = command.time + self._deadman if self.model.has_speed_loop else NEVER
        if self.fault_flags or self.button_pressed:
            return
        if (
            side.command != command.value
            or side.is_duty is not command.is_duty
            or side.command_time is None
        ):
            self._apply(side, command)

    def _apply(self, side: BoardSide, command: PendingCommand) -> None:
        side.apply(command)
        if side.loop is not None and self._loop_due == NEVER:
            self._loop_due = -(-command.time // LOOP_PERIOD) * LOOP_PERIOD  # the timer's next tick

    def _run_loops(self, now: int) -> None:
        """Run the speed loops, and not again before a command comes if they have come to rest."""
        at_rest = True
        for side in self.sides:
            loop = side.loop
            if loop is None:
                continue
            if self._has_encoders:
                side.duty = loop.tick_duty() if side.is_duty else loop.tick(now)
            at_rest = at_rest and loop.is_at_rest
            if loop.fault and not self.fault_flags:  # the first one ends the drive, as on the board
                self.fault_flags = STALL_FLAGS[self.sides.index(side)]
        if self.fault_flags:
            for side in self.sides:
                self._apply(side, PendingCommand(now, 0.0, side.is_duty))
            at_rest = True
        self._loop_due = NEVER if at_rest else now + LOOP_PERIOD

    def _update_due(self) -> None:
        due = self._loop_due if self._loop_due < self._deadman_due else self._deadman_due
        left, right = self.sides
        if left.pending and left.pending[0].time < due:
            due = left.pending[0].time
        if right.pending and right.pending[0].time < due:
            due = right.pending[0].time
        self.due = due
