"""A wheel that is faster than commanded: what is noticed, when, and what is healthy."""

from math import exp, inf, pi

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.engine.overspeed import OverspeedDetector

MOTOR = load_robot("book_2wd").robot.drive.left.motor
MS = 1_000_000
SLOTS = 20
FRAME = 25 * MS


def detected_at(command, speed, seconds=12.0, slots=SLOTS, host_loop=False, carrying=0.0):
    """Seconds until the detector reports, inf if never.

    `command` and `speed` are functions of the time in s, in rad/s.
    """
    detector = OverspeedDetector(MOTOR, slots, 0.1, 0.05, host_loop)
    angle, now = 0.35 * 2 * pi / slots, 0
    while now < seconds * 1e9:
        now += FRAME
        angle += speed(now / 1e9) * FRAME / 1e9
        if detector.counts(now, int(angle * slots / (2 * pi)), 0) is not None:
            return now / 1e9
        detector.command(now, command(now / 1e9), carrying)
    return inf


def constant(value):
    return lambda time: value


@pytest.mark.parametrize("slots", [8, 20, 360, 4096])
@pytest.mark.parametrize("target", [0.5, 2.0, 4.0])
def test_a_motor_at_full_speed_is_noticed(target, slots):
    # The limit is 1.5 times the target, or the speed of an edge each 0.3 s. The strongest motor
    # turns at 15.7 rad/s; what it exceeds the limit by in 1 s, and 4 counts, is allowed.
    limit = 1.5 * max(target, 2 * pi / slots / 0.3)
    rest, surplus = 15.7 - limit, 0.9 * 10.5 - limit
    bound = (rest + 4 * 2 * pi / slots) / surplus
    assert detected_at(constant(target), constant(10.5), slots=slots) < bound + 0.2


@pytest.mark.parametrize("speed", [3.0, 10.5])
def test_a_motor_that_keeps_turning_after_the_stop_is_noticed(speed):
    at = detected_at(lambda time: 3.0 if time < 2.0 else 0.0, lambda time: min(speed, 3.0 + time))
    assert 2.0 < at < 4.0


def test_a_wheel_that_is_carried_along_in_a_curve_is_no_fault():
    """A heavy robot on an open bridge, whose other wheel reaches 2.9 rad/s of 4."""
    assert detected_at(constant(0.4), constant(2.5), 40.0, carrying=4.0) == inf
    assert detected_at(constant(0.4), constant(2.5), 40.0) < 40.0
    # Faster than both commands it is not carried.
    assert detected_at(constant(0.4), constant(10.5), carrying=4.0) < 3.0


def test_more_than_the_strongest_motor_is_noticed_within_half_a_second():
    noise = 100 * 2 * pi / SLOTS  # rad/s, of an encoder wire that picks up the mains
    assert detected_at(constant(6.0), constant(noise)) < 0.5


@pytest.mark.parametrize("lag", [0.03, 0.1, 0.4])
@pytest.mark.parametrize("gain", [0.6, 1.0, 1.4])
def test_healthy_motors_are_never_reported(gain, lag):
    """Drive at 3 rad/s for 4 s with a wrong gain, coast, and drive again slowly."""

    def command(time):
        return 3.0 if time < 4.0 else 0.0 if time < 6.0 else 0.8

    def speed(time):
        if time < 4.0:
            return 3.0 * gain * (1 - exp(-time / lag))
        if time < 6.0:
            return 3.0 * gain * exp(-(time - 4.0) / lag)
        return 0.8 * gain * (1 - exp(-(time - 6.0) / lag))

    assert detected_at(command, speed) == inf


def test_a_wheel_that_is_pushed_at_rest_is_no_fault():
    detector = OverspeedDetector(MOTOR, SLOTS, 0.1, 0.05, False)
    for frame in range(400):
        count = max(0, frame - 100) // 2  # 63 rad/s
        assert detector.counts(frame * FRAME, count, 0) is None
        assert detector.is_pushed == (count >= 2)
        detector.command(frame * FRAME, 0.0)


def test_a_wheel_that_turns_after_a_short_command_is_not_pushed():
    """It stood for 2 s; a command of 0.1 s moves it by three counts, 0.1 to 0.3 s after its end."""
    detector = OverspeedDetector(MOTOR, SLOTS, 0.1, 0.1, True)
    for frame in range(120):
        now = frame * FRAME
        count = 0 if frame < 88 else min(1 + (frame - 88) // 4, 3)
        assert detector.counts(now, count, 0) is None
        assert not detector.is_pushed
        detector.command(now, 2.0 if 80 <= frame < 84 else 0.0)
    assert detector.is_at_rest


def test_a_restart_of_the_board_counts_anew():
    detector = OverspeedDetector(MOTOR, SLOTS, 0.1, 0.05, False)
    detector.command(0, 3.0)
    assert detector.counts(FRAME, 5000, 0) is None
    assert detector.counts(2 * FRAME, 0, 1) is None
    assert detector.counts(3 * FRAME, 1, 1) is None


def after_a_gap(speed, gap=2.3):
    """Seconds after a gap at which the detector reports a wheel at `speed` (rad/s), inf if never.

    It is commanded 3 rad/s. The host stands still for `gap` s; all frames of that time arrive at
    its end, one each 1 ms, and the engine stops the robot at the first of them. The wheel goes on.
    """
    detector = OverspeedDetector(MOTOR, SLOTS, 0.1, 0.05, False)
    frames, pitch = round(gap * 1e9 / FRAME), 2 * pi / SLOTS
    begin = 2_000 * MS
    for now in range(0, begin, FRAME):
        detector.command(now, 3.0)
        assert detector.counts(now, int(3.0 * now / 1e9 / pitch), 0) is None
    for frame in range(frames + 400):
        sampled = begin + frame * FRAME
        arrived = max(sampled, begin + round(gap * 1e9) + frame * MS)
        angle = 3.0 * begin / 1e9 + speed * (sampled - begin) / 1e9
        if detector.counts(arrived, int(angle / pitch), 0) is not None:
            return (arrived - begin) / 1e9 - gap
        detector.command(arrived, 0.0)
    return inf


@pytest.mark.parametrize("gap", [0.25, 0.6, 2.3])
def test_frames_that_queued_up_are_no_fast_wheel(gap):
    # The wheel goes on after the stop too, as on a board that has missed it: that is noticed later.
    assert 0.3 < after_a_gap(3.0, gap) < 4.0


@pytest.mark.parametrize("gap", [0.25, 0.6, 2.3])
def test_a_wheel_that_runs_away_in_a_gap_is_noticed_after_it(gap):
    assert after_a_gap(30.0, gap) < 0.35


@pytest.mark.parametrize("delay", [0.06, 0.13, 0.19, 0.29])
@pytest.mark.parametrize("speed", [3.0, 10.4])
def test_frames_that_a_busy_host_reads_late_are_no_fast_wheel(delay, speed):
    """Again and again, the host reads nothing for `delay` s, and then all that has arrived."""
    detector = OverspeedDetector(MOTOR, SLOTS, 0.1, 0.05, False)
    read_at = 0
    for sampled in range(0, 10_000 * MS, FRAME):
        begin = sampled // (500 * MS) * 500 * MS  # of a delay, each half second
        late = max(sampled, begin + round(delay * 1e9)) if sampled > begin else sampled
        read_at = max(late, read_at + MS)
        detector.command(read_at, speed)
        assert detector.counts(read_at, int(speed * sampled / 1e9 * SLOTS / (2 * pi)), 0) is None


@pytest.mark.parametrize("jumps", [(40, 80), (-40, 0, -40, 0), (500,)])
def test_the_reported_speed_is_above_the_reported_limit(jumps):
    detector = OverspeedDetector(MOTOR, SLOTS, 0.1, 0.05, False)
    detector.command(FRAME, 3.0)
    detector.counts(FRAME, 0, 0)
    excesses = [
        detector.counts((number + 2) * FRAME, count, 0) for number, count in enumerate(jumps)
    ]
    excess = next(filter(None, excesses))
    assert excess.speed > excess.limit
