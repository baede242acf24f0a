"""Latency of our commands, measured with the state frames of a board."""

from itertools import pairwise
from math import isnan
from random import Random

import pytest

from diffbotctl.links import diffbot_frames
from diffbotctl.links.diffbot_frames import COMMAND_AGE_NONE, StateFrame
from diffbotctl.links.diffbot_telemetry import COMMAND_AGE, TICK, SentCommand, Telemetry
from diffbotctl.time import MILLISECOND

FRAME_DELAY = 5  # ms from the board's stamp to the frame's arrival; both clocks start together
NUMBER = 5  # sequence number of the command


def state(board, command, age, left=0):
    """A frame stamped at `board` ms, whose command is in force for `age` ms; None: unknown."""
    units = COMMAND_AGE_NONE if age is None else age * MILLISECOND // COMMAND_AGE
    return StateFrame(
        boot=1,
        sequence=board // 25 % 64,
        dropped=0,
        level=0,
        mode=2,
        command_age=units,
        time=board * MILLISECOND // TICK,
        left=left % 65536,
        right=-left % 65536,
        range=0,
        command=command,
        duty=0,
        left_age=0,
        right_age=0,
    )


@pytest.mark.parametrize(
    ("written", "seen", "latency"),
    [
        # Written at 100 ms, in force at 115, shown in the frame that arrives at 130.
        ([100], [(125, 10)], 30),
        # Another host's command with the same number, in force since 65 ms: not counted.
        ([100], [(125, 60)], None),
        # The same, in force for longer than a frame can show.
        ([100], [(125, None)], None),
        # First the other host's, then ours, in force at 130 ms, shown at 155.
        ([100], [(125, 60), (150, 20)], 55),
        # Only the first frame that shows it counts.
        ([100], [(125, 10), (150, 35)], 30),
        # A stop is written at 40 and again at 100 ms. The first is in force at 75, but its time is
        # no longer known; the second is in force at 140 and shown at 155.
        ([40, 100], [(125, 50), (150, 10)], 55),
    ],
)
def test_latency_is_that_of_our_commands(written, seen, latency):
    telemetry = Telemetry(115200)
    for board in (0, 25, 50):
        telemetry.read((board + FRAME_DELAY) * MILLISECOND, state(board, NUMBER, None))
    for time in written:
        telemetry.wrote(NUMBER, SentCommand(time * MILLISECOND, 1.0, 1.0, "wheels"))
    for board, age in seen:
        telemetry.read((board + FRAME_DELAY) * MILLISECOND, state(board, NUMBER, age))
    if latency is None:
        assert isnan(telemetry.latency)
    else:
        assert telemetry.latency == pytest.approx(latency / 1000)


@pytest.mark.parametrize(
    ("shown", "written", "command", "skipped"),
    [
        # (number, ms, rad/s) of the commands; the last frame is at 75 ms, its command of 65 ms.
        (4, [(4, 0, 0.0), (5, 40, 1.0), (6, 50, 2.0)], 6, (55, 1.0)),
        (4, [(4, 0, 0.0), (5, 30, 1.0)], 5, None),  # the frames show each command
        (4, [(4, 0, 0.0), (5, 30, 0.0), (6, 50, 2.0)], 6, None),  # a repetition
        (4, [(5, -300, 1.0), (4, 0, 0.0), (6, 50, 2.0)], 6, None),  # of the round before
        # Of three, the last: the frame before is its earliest time.
        (4, [(4, 0, 0.0), (5, 1, 1.0), (6, 2, 1.5), (7, 50, 2.0)], 7, (50, 1.5)),
        (15, [(15, 0, 0.0), (0, 40, -1.0), (1, 50, 2.0)], 1, (55, -1.0)),
    ],
)
def test_a_command_that_no_frame_shows(shown, written, command, skipped):
    telemetry = Telemetry(115200)
    for number, time, speed in written:
        telemetry.wrote(number, SentCommand(time * MILLISECOND, speed, speed, "wheels"))
    wire_time = 2 * MILLISECOND  # 21 bytes; the clock takes the rest of the delay for an offset
    offset = FRAME_DELAY * MILLISECOND - wire_time
    for board in (25, 50):
        frame = telemetry.read((board + FRAME_DELAY) * MILLISECOND, state(board, shown, 20))
        assert frame.skipped_command_time is None
    frame = telemetry.read((75 + FRAME_DELAY) * MILLISECOND, state(75, command, 10))
    if skipped is None:
        assert frame.skipped_command_time is None
        return
    time, speed = skipped
    assert frame.skipped_left_command == frame.skipped_right_command == speed
    assert frame.skipped_command_time == pytest.approx(time * MILLISECOND + offset, abs=MILLISECOND)


@pytest.mark.parametrize("speed", [80, 20, -80])
@pytest.mark.parametrize(
    ("gap", "driven"), [(25, 25), (500, 500), (850, 850), (850, 300), (5000, 300)]
)
def test_counts_go_on_over_a_gap_of_the_telemetry(speed, gap, driven):
    """Up to 80 counts a ms; in a gap the wheel goes on for as long as it is driven."""
    telemetry = Telemetry(115200)
    count, board, seen = 0, 0, None
    for step, turning in [(25, 25)] * 4 + [(gap, driven)] + [(25, 0)]:
        count, board = count + speed * turning, board + step
        frame = state(board, NUMBER, None, count)._replace(
            time=board * MILLISECOND // TICK % 65536, sequence=board // 25 % 64
        )
        seen = telemetry.read((board + FRAME_DELAY) * MILLISECOND, frame)
    assert (seen.left, seen.right) == (count, -count)


@pytest.mark.parametrize("rate", [0.96, 0.97, 0.995, 1.005, 1.03, 1.04])
def test_the_time_of_frames_follows_the_clock_of_the_board(rate):
    """Without a resonator it runs by some percent too fast or too slow."""
    telemetry, rng, errors = Telemetry(115200), Random(5), []
    for step in range(40 * 20):
        sampled = 1000 + 25 * step  # ms of the host
        board = round(sampled * rate * MILLISECOND / TICK)
        frame = state(0, NUMBER, None)._replace(time=board % 65536, sequence=step % 64)
        arrival = sampled + FRAME_DELAY + rng.expovariate(1 / 3)
        seen = telemetry.read(round(arrival * MILLISECOND), frame)
        if step >= 80:
            errors.append(seen.time / MILLISECOND - sampled - FRAME_DELAY)
    assert max(errors) < 3 and min(errors) > -5


def read_in_stalls(stalls, delays, late_stamp):
    """Times of 100 frames, 25 ms apart, for a host that does not run in `stalls`, (begin, length)
    in ms of its clock: (host time, arrival, board time + FRAME_DELAY) of each, in ms.

    `late_stamp`: the host has taken the time before each stall and reads the frames after it.
    """
    telemetry, seen = Telemetry(115200), []
    for step in range(100):
        arrival = 1000 + 25 * step + FRAME_DELAY + delays[step]
        for begin, length in stalls:
            if begin <= arrival < begin + length:
                arrival = begin + length if late_stamp else begin
        arrival = max(arrival, seen[-1][1] if seen else 0)
        now = round(arrival * MILLISECOND)
        board = 1000 + 25 * step
        frame = state(board, NUMBER, None)._replace(
            time=board * MILLISECOND // TICK % 65536, sequence=step % 64
        )
        seen.append((telemetry.read(now, frame).time / MILLISECOND, arrival, board + FRAME_DELAY))
    return seen


@pytest.mark.parametrize("late_stamp", [True, False])
@pytest.mark.parametrize("seed", range(20))
def test_the_times_of_frames_never_go_back(seed, late_stamp):
    """Not in the burst after a stall, whenever it was: with the first frames of a board, too."""
    rng = Random(seed)
    stalls = [(rng.uniform(900, 3500), rng.choice((50, 200, 500, 900))) for _ in range(3)]
    stalls.append((900 + rng.uniform(0, 100), rng.choice((0, 300, 500))))
    seen = read_in_stalls(stalls, [rng.expovariate(1 / 3) for _ in range(100)], late_stamp)
    times = [time for time, _, _ in seen]
    assert all(before < after for before, after in pairwise(times))
    assert all(time <= arrival for time, arrival, _ in seen)


def test_the_first_burst_of_a_board_does_not_bend_its_clock():
    """The first frames are late by up to 0.5 s: no clock that is slow by that much."""
    for time, _, sent in read_in_stalls([(990, 500)], [0.0] * 100, late_stamp=True)[60:]:
        assert time == pytest.approx(sent, abs=5)


def test_each_flag_is_a_bit_of_its_own():
    flags = [value for name, value in vars(diffbot_frames).items() if name.startswith("FLAG_")]
    assert len(flags) > 10 and len(set(flags)) == len(flags)
    assert all(flag.bit_count() == 1 for flag in flags)
