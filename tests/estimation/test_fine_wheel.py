"""A fine encoder: directions at reversals, by exact counts that the board signs by its command."""

from math import copysign, exp, sqrt
from types import SimpleNamespace

import pytest

from diffbotctl.estimation.fine_wheel import FineWheelOdometer
from diffbotctl.estimation.wheel_frame import BoardFrame
from diffbotctl.estimation.wheel_side import LinkTiming
from tests.sampling import each_once

FRAME = 20_000_000  # ns
LAG = 0.1  # s
SLOTS = 1000
RISE = 10.0  # pitches/s in a frame, of the speed at which the drive settles
STEP = 1e-4  # s, of the simulated wheel
SIDE = SimpleNamespace(
    motor=SimpleNamespace(
        rated=20.0,
        lag=LAG,
        decay="slow",
        friction=None,
        loop=SimpleNamespace(static=0.1, speed=None, proportional=None, integral=None),
    ),
    wheel=SimpleNamespace(diameter=0.1),
    encoder=SimpleNamespace(channels=1, slots=SLOTS, counts=SLOTS),
)


def profile(frame: int) -> float:
    """A rise, a fall to rest, and a rise backward, slow enough for the wheel to follow."""
    ramp = min(frame, max(50 - frame, 0), 20) - min(max(frame - 55, 0), 40)
    return RISE * ramp


def sudden(frame: int) -> float:
    """Full speed forward, backward and forward again."""
    return 300.0 if frame < 40 or frame >= 80 else -300.0


class DrivenWheel:
    """A wheel with a motor, whose encoder misses nothing, and its odometer.

    With a `gain` of the speed and a constant `friction` (pitches/s) it is not the motor that the
    odometer knows.
    """

    def __init__(self, lag: float, gain: float, friction: float, has_edge_times: bool) -> None:
        self.lag, self.gain, self.friction = lag, gain, friction
        self.odometer = FineWheelOdometer(SIDE, 0, 0, LinkTiming(0.0, 0.0, has_edge_times))
        self.has_edge_times = has_edge_times
        self.place, self.speed, self.count, self.time = 0.5, 0.0, 0, 0
        self.edge_time: int | None = 0

    def frame(self, drive: float) -> None:
        """Move for one frame, and report it."""
        edges = int(self.place)
        for _ in range(round(FRAME * 1e-9 / STEP)):
            settled = copysign(max(self.gain * abs(drive) - self.friction, 0.0), drive)
            self.speed += (settled - self.speed) * (1.0 - exp(-STEP / self.lag))
            self.place += self.speed * STEP
            self.time += round(STEP * 1e9)
            if int(self.place) != edges:
                edges = int(self.place)
                self.count += -1 if drive < 0.0 else 1
                self.edge_time = self.time
        command = drive / self.odometer.pitches_per_rad
        edge_time = self.edge_time if self.has_edge_times else None
        self.odometer.update(
            BoardFrame(self.time, self.count, edge_time, command, self.time - FRAME)
        )
        self.odometer.report()

    def error(self) -> float:
        """Of the estimated travel, in pitches."""
        return self.odometer.position + self.odometer.beyond - self.place

    def sd(self) -> float:
        """Of the estimated travel, in pitches."""
        wheel = self.odometer
        slot = (wheel.variance + wheel.end_variance) / wheel.pitch**2
        return sqrt(slot + wheel.reversal_variance)


@each_once(
    drive=[profile, sudden],
    motor=[(LAG, 1.0), (1.6 * LAG, 0.6), (0.5 * LAG, 1.3)],
    friction=[0.0, 50.0, 100.0],
    has_edge_times=[True, False],
)
def test_a_wheel_that_reverses_is_followed(drive, motor, friction, has_edge_times):
    wheel = DrivenWheel(*motor, friction, has_edge_times)
    for number in range(1, 151):
        wheel.frame(drive(number))
    assert wheel.odometer.reversals == (2 if drive is sudden else 1)
    assert abs(wheel.error()) < 3.0 * wheel.sd()
    assert abs(wheel.error()) < 8.0  # of about 600 pitches there and back


@pytest.mark.parametrize("has_edge_times", [True, False])
def test_without_a_reversal_the_travel_is_as_good_as_a_slot(has_edge_times):
    wheel = DrivenWheel(2.0 * LAG, 0.8, 0.0, has_edge_times)
    for _ in range(100):
        wheel.frame(250.0)
        assert abs(wheel.error()) <= 1.0
    assert wheel.sd() == pytest.approx(sqrt(2 / 12))  # uniform at both ends
    assert wheel.odometer.speed == pytest.approx(wheel.speed * wheel.odometer.pitch, rel=0.05)


def test_a_wheel_that_is_pushed_at_rest_may_turn_in_either_direction():
    wheel = DrivenWheel(LAG, 1.0, 50.0, has_edge_times=False)
    for number in range(100):
        wheel.frame(200.0 if number < 30 else 0.0)
    before = wheel.odometer.reversal_variance
    wheel.count += 7
    wheel.frame(0.0)
    assert wheel.odometer.reversal_variance - before == pytest.approx(2 * 7**2)


def test_edges_before_any_command_may_be_in_either_direction():
    wheel = FineWheelOdometer(SIDE, 0, 0, LinkTiming(0.0, 0.0, False))
    for frame in range(1, 6):
        wheel.update(BoardFrame(frame * FRAME, 2 * frame, None, 0.0, 0))
        wheel.report()
    assert sqrt(wheel.reversal_variance) == pytest.approx(sqrt(2) * 5 * 2)


def test_a_wheel_that_friction_holds_does_not_jump_when_its_drive_reverses():
    """Otherwise the follower sees a heading error of a pitch, and reverses the drive for ever."""
    odometer = FineWheelOdometer(SIDE, 0, 0, LinkTiming(0.0, 0.0, has_edge_times=True))
    odometer.update(BoardFrame(FRAME, 1, FRAME // 2, 0.2, 0))
    odometer.report()
    for frame in range(2, 40):
        before = odometer.position + odometer.beyond
        command = 0.2 if frame % 4 < 2 else -0.2  # rad/s: 32 pitches/s, 0.64 in a frame
        odometer.update(BoardFrame(frame * FRAME, 1, None, command, 0))
        assert abs(odometer.position + odometer.beyond - before) < 0.65
        assert 0.0 <= odometer.beyond <= 1.0


@pytest.mark.parametrize("counted", [0, 2])
def test_a_frame_whose_edges_cancel_does_not_turn_a_wheel_that_rolls(counted):
    """At 80 pitches/s it passes 1.6 edges in the frame in which the sign changes, one before it and
    one after, and two more until it stops. A wheel that had turned would be four edges away."""
    odometer = FineWheelOdometer(SIDE, 0, 0, LinkTiming(0.0, 0.0, has_edge_times=False))
    command, time, count = 80.0 / odometer.pitches_per_rad, 0, 0
    for frame in range(1, 31):
        time = frame * FRAME
        count = int(80.0 * time * 1e-9)
        odometer.update(BoardFrame(time, count, None, command, time - FRAME))
    odometer.report()
    before = odometer.reversal_variance
    odometer.update(BoardFrame(time + FRAME, count, None, -0.1 * command, time + FRAME // 2))
    odometer.update(BoardFrame(time + 2 * FRAME, count - counted, None, -0.1 * command, time))
    odometer.report()
    assert odometer.reversals == (0 if counted else 1)
    assert odometer.position - count == counted
    # Of the two edges that have cancelled, none to both.
    assert odometer.reversal_variance - before > 0.5
