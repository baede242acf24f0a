"""The host's copy of the board's speed loop, against the loop that the simulated board runs."""

from math import pi
from random import Random

import pytest

from diffbotctl.config.robot import SpeedLoopSection as Settings
from diffbotctl.control.speed_loop import LOOP_PERIOD, SpeedGains, SpeedLoopMirror, WheelSpeedLoop

RATED = 100 * pi / 30  # rad/s
SLOTS = 20
FRAME = 25_000_000  # ns


def run(targets, speeds, settings):
    """Run both loops on a wheel that turns at `speeds` (rad/s); yields both duties per frame."""
    slope = (1.0 - settings.static) / RATED
    gains = SpeedGains(settings.static, slope, settings.proportional, settings.integral)
    board, mirror = WheelSpeedLoop(gains, SLOTS), SpeedLoopMirror(gains, SLOTS, 0)
    pitch, angle, now, tick = 2 * pi / SLOTS, 0.3, 0, LOOP_PERIOD
    last, count = 0, 0
    for target, speed in zip(targets, speeds, strict=True):
        frame_start = now
        since = frame_start + 5_000_000
        steps, commanded = 0, False
        while now < frame_start + FRAME:
            now += 100_000
            if not commanded and now >= since:
                board.command(now, target)
                commanded = True
            angle += abs(speed) * 1e-4
            if angle >= pitch:
                angle -= pitch
                steps, last = steps + 1, now
                board.edge(now)
            if now >= tick:
                board.tick(now)
                tick += LOOP_PERIOD
        count += steps
        yield board.duty, mirror.update(now, steps, last, target, since)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("proportional", [0.0, 0.005])
def test_the_mirror_agrees_with_the_board(seed, proportional):
    settings = Settings(proportional=proportional)
    rng = Random(seed)
    targets, speeds, target = [], [], 0.0
    for _ in range(160):
        if rng.random() < 0.1:
            target = rng.choice([0.0, *(rng.uniform(2.0, 9.0) for _ in range(3))])
        targets.append(target)
        speeds.append(target * rng.uniform(0.85, 1.15))
    pairs = list(run(targets, speeds, settings))
    assert any(board > 0.3 for board, _ in pairs)
    # The ticks of the two lie up to 10 ms apart: that is 0.02 * 3 rad/s * 0.01 s of the integral,
    # and what a period of one slot more or less means to the proportional part.
    tolerance = 0.004 + proportional * 4.0
    assert max(abs(board - mirror) for board, mirror in pairs) < tolerance


def test_a_stop_resets_the_integral():
    targets = [6.0] * 60 + [0.0] * 4 + [6.0]
    speeds = [5.0] * 60 + [0.0] * 4 + [0.0]
    duties = [mirror for _, mirror in run(targets, speeds, Settings())]
    ahead = 0.1 + 0.9 / RATED * 6.0
    assert duties[59] > ahead + 0.01, "a wheel that is 1 rad/s too slow gets more and more"
    assert duties[60] == 0.0
    assert duties[64] == pytest.approx(ahead)
