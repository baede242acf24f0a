"""Travel of a wheel whose encoder shows the direction."""

from math import pi
from types import SimpleNamespace

import pytest

from diffbotctl.estimation.fine_wheel import DirectedWheelOdometer
from diffbotctl.estimation.wheel_frame import BoardFrame
from diffbotctl.estimation.wheel_side import LinkTiming

MS = 1_000_000
DIAMETER, SLOTS = 0.065, 1000
PITCH = pi * DIAMETER / SLOTS
LOOP = SimpleNamespace(static=0.1, speed=None, proportional=None, integral=None)
SIDE = SimpleNamespace(
    motor=SimpleNamespace(rated=10.0, lag=0.1, loop=LOOP, decay="slow", friction=None),
    wheel=SimpleNamespace(diameter=DIAMETER),
    encoder=SimpleNamespace(channels=2, slots=SLOTS, counts=SLOTS, open_share=None),
)


@pytest.mark.parametrize("has_edge_times", [True, False])
@pytest.mark.parametrize("command", [0.0, 5.0, -5.0])
def test_the_travel_is_that_of_the_counts_whatever_the_command(has_edge_times, command):
    """30 counts forward, 80 backward: the command is a lie, or somebody turns the wheel."""
    wheel = DirectedWheelOdometer(SIDE, 0, 0, LinkTiming(0.0, 0.0, has_edge_times))
    count, travel = 0, 0.0
    for frame in range(1, 12):
        count += 10 if frame <= 3 else -10
        time = frame * 25 * MS
        edge = time - MS if has_edge_times else None
        wheel.update(BoardFrame(time, count, edge, command, 0))
        wheel.report()
        travel += wheel.travel
    assert travel == pytest.approx(-50 * PITCH, abs=1.5 * PITCH)
    assert wheel.speed == pytest.approx(-10 * PITCH / 0.025, rel=0.35)
    assert wheel.direction == -1 and wheel.reversals == 1
