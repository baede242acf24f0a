"""The host's copy of the board's speed loop, against the loop that the simulated board runs."""

from math import pi
from random import Random

import pytest

from diffbotctl.control.speed_loop import (
    LOOP_PERIOD,
    EvenEdges,
    SpeedGains,
    SpeedLoopMirror,
    WheelSpeedLoop,
    default_gains,
)

RATED = 100 * pi / 30  # rad/s
SLOPE = 0.9 / RATED
GAINS = SpeedGains(0.1, SLOPE, *default_gains(SLOPE))
SLOTS = 20
FRAME = 25_000_000  # ns
LAG_S = 0.1


def run(targets, factors, slots=SLOTS, offset=0, delay=5_000_000):
    """Run both loops on a wheel that follows its targets times `factors`; both duties per frame.

    `offset` (ns): phase of the board's timer; `delay` (ns): of a target, in its frame.
    """
    board, mirror = WheelSpeedLoop(GAINS, slots), SpeedLoopMirror(GAINS, slots, 0)
    pitch, angle, now, tick = 2 * pi / slots, 0.3, 0, LOOP_PERIOD - offset
    last, speed = 0, 0.0
    for target, factor in zip(targets, factors, strict=True):
        frame_start = now
        since = frame_start + delay
        steps, commanded = 0, False
        while now < frame_start + FRAME:
            now += 100_000
            if not commanded and now >= since:
                board.command(now, target)
                commanded = True
            speed += (board.target * factor - speed) * 1e-4 / LAG_S
            angle += abs(speed) * 1e-4
            while angle >= pitch:
                angle -= pitch
                steps, last = steps + 1, now
                board.edge(now)
            if now >= tick:
                board.tick(now)
                tick += LOOP_PERIOD
        yield board.duty, mirror.update(now, steps, last, [(since, target)])[-1]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("slots", [20, 374])
def test_the_mirror_agrees_with_the_board(seed, slots):
    rng = Random(seed)
    targets, factors, target = [], [], 0.0
    for _ in range(400):
        if rng.random() < 0.05:
            target = rng.choice([0.0, *(rng.uniform(2.0, 9.0) for _ in range(3))])
        targets.append(target)
        factors.append(rng.uniform(0.9, 1.1))
    pairs = list(run(targets, factors, slots, rng.randrange(LOOP_PERIOD)))
    assert any(board > 0.3 for board, _ in pairs)
    # The ticks of the two lie up to 10 ms apart, so the reference model of the one may be ahead by
    # a tenth of a step of the target, and an edge may be used one period earlier.
    differences = sorted(abs(board - mirror) for board, mirror in pairs)
    assert differences[len(pairs) // 2] < 0.02
    assert differences[int(0.95 * len(pairs))] < 0.06


@pytest.mark.parametrize("slots", [20, 51, 374])
def test_the_mirror_agrees_when_every_frame_has_a_new_target(slots):
    """Of several edges in a frame some come before the change, and some after it."""
    targets = [min(0.3 * frame, 9.0 + 0.05 * (frame % 2)) for frame in range(200)]
    pairs = list(run(targets, [1.0] * 200, slots, delay=20_000_000))
    assert max(abs(board - mirror) for board, mirror in pairs) < 0.08


def test_a_stop_resets_the_integral():
    targets = [6.0] * 80 + [0.0] * 20 + [6.0]
    duties = [mirror for _, mirror in run(targets, [0.9] * 80 + [1.0] * 21)]
    ahead = 0.1 + SLOPE * 6.0
    assert duties[79] > ahead + 0.05, "a wheel that is too slow gets more and more"
    assert duties[80] == 0.0
    assert duties[100] == pytest.approx(ahead)


def test_the_edges_of_a_frame_are_evenly_spaced():
    """Four edges after 100, the last at 140: at 110, 120, 130 and 140."""
    edges = EvenEdges(100, 140, 4)
    assert [edges.pass_until(time) for time in (90, 109, 110, 125, 125, 200)] == [
        (0, 100),
        (0, 100),
        (1, 110),
        (1, 120),
        (0, 120),
        (2, 140),
    ]
    assert edges.remaining == 0


def test_edges_at_one_time_pass_together():
    edges = EvenEdges(100, 100, 3)
    assert edges.pass_until(99) == (0, 100) and edges.pass_until(100) == (3, 100)
