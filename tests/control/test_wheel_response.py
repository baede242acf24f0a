"""The ratio of a wheel's speed to its commands, on wheels that follow a first-order equation."""

from math import exp

import pytest

from diffbotctl.control.wheel_response import GAP_MAX, RATIO_FREE, DriveResponse, WheelResponse

LAG, STEP = 0.1, 0.02  # s


def driven(commands, gain=1.0, reach=9.9):
    """The response of a wheel that settles at `gain` times its command, at most at `reach`."""
    response, speed = WheelResponse(), 0.0
    for command in commands:
        settled = min(max(gain * command, -reach), reach)
        speed += (settled - speed) * (1.0 - exp(-STEP / LAG))
        response.update(command, speed, LAG, STEP)
    return response


def test_a_wheel_that_follows_is_commanded_as_it_is():
    response = driven([0.3] * 200)
    assert response.ratio == pytest.approx(1.0, abs=0.02)
    assert response.command_for(0.2) == pytest.approx(0.2, rel=0.02)


@pytest.mark.parametrize("sign", [1, -1])
def test_half_a_motor_is_found_within_a_second(sign):
    response = driven([0.3 * sign] * 50, gain=0.5)
    assert response.ratio == pytest.approx(0.5, abs=0.06)
    assert response.command_for(0.1 * sign) == pytest.approx(RATIO_FREE * 0.2 * sign, rel=0.12)


def test_a_motor_below_its_limit_is_left_to_the_loop_that_sets_its_duty():
    response = WheelResponse()
    for _ in range(100):
        response.update(0.3, 0.15, LAG, STEP, True, is_limited=False)
    assert (response.ratio, response.short_for) == (1.0, 0.0)


def test_a_motor_at_its_limit_is_found_and_forgotten():
    fast = driven([0.3] * 200, reach=0.15)
    assert fast.ratio == pytest.approx(0.5, abs=0.02)
    slow = driven([0.3] * 200 + [0.1] * 200, reach=0.15)
    assert slow.ratio == pytest.approx(1.0, abs=0.02)


def test_a_wheel_that_rises_slowly_is_not_weak():
    assert driven([0.3] * 3).ratio == 1.0  # 60 ms after the command, at 45 % of it


def test_a_wheel_that_stands_counts_the_time_and_keeps_its_ratio():
    response = driven([0.3] * 50, gain=0.0)
    assert response.idle_for == pytest.approx(1.0)
    assert response.ratio == 1.0
    response.update(0.0, 0.0, LAG, STEP)
    response.update(-0.3, 0.0, LAG, STEP)
    assert response.idle_for == pytest.approx(1.0 + STEP), "in whichever direction"
    response.update(-0.3, -0.1, LAG, STEP)
    assert response.idle_for == 0.0


def both(left=0.3, right=0.3):
    """The response of wheels at 0.3 m/s of which the left one turns at `left`, for 3 s."""
    drive = DriveResponse(0.2, 0.001)
    for _ in range(round(3.0 / STEP)):
        for wheel, speed in ((drive.left, left), (drive.right, right)):
            wheel.update(0.3, speed, LAG, STEP, speed * STEP)
    return drive


def test_a_gap_between_two_frames_is_no_time_in_which_a_wheel_stood():
    """The computer stood still for 2.3 s: 0.69 m of the command that was in force before."""
    drive = both()
    for wheel in (drive.left, drive.right):
        wheel.update(0.3, 0.0, LAG, 2.3, 0.0)
    assert drive.fault(creep=0.035, stuck_after=2.0, lag=LAG) == ""
    assert drive.left.idle_for == GAP_MAX
    assert drive.left.uncounted_for == pytest.approx(GAP_MAX + STEP)


def driven_in_bursts(counted, seconds=6.0, command=0.2):
    """Both wheels driven half a second forth and back with pauses, the left one as in `counted`.

    Odometry takes both for turning as commanded.
    """
    drive = DriveResponse(0.2, 0.001)
    for step in range(round(seconds / STEP)):
        phase = int(step * STEP / 0.5) % 4
        sign = {0: 1.0, 2: -1.0}.get(phase, 0.0)
        for wheel, travel in ((drive.left, counted), (drive.right, command * STEP)):
            wheel.update(
                sign * command, sign * command, LAG, STEP, travel and travel * abs(sign), True
            )
        cause = drive.fault(0.035, 2.0, LAG)
        if cause:
            return step * STEP, cause
    return None, ""


def test_a_wheel_that_never_counts_in_short_drives_is_named():
    # Half of the time it is driven, and each time 0.2 m/s * (0.5 s - lag) are expected of it.
    seconds, cause = driven_in_bursts(counted=0.0)
    assert 1.0 < seconds < 4.0 and "the left wheel has given no count for" in cause


@pytest.mark.parametrize("counted", [0.2 * STEP, None])
def test_a_wheel_that_counts_or_has_no_encoder_is_not(counted):
    assert driven_in_bursts(counted) == (None, "")


def test_a_wheel_that_lags_behind_the_other_one_explains_a_failure():
    drive = DriveResponse(0.2, 0.001)
    for _ in range(200):
        drive.left.update(0.1, 0.1, LAG, STEP, 0.1 * STEP)
        drive.right.update(0.1, 0.1, LAG, STEP, 0.03 * STEP)
    (text,) = drive.weaknesses()
    assert text.startswith("the right wheel has made 30% of its commanded travel")
    drive.begin()
    assert drive.weaknesses() == []


def both_driven(counts, seconds_before=1.0, speed=0.3, pitch=0.01):
    """Both wheels at `speed`; from `seconds_before` on, each counts if its `counts` is true."""
    response = DriveResponse(0.15, pitch)
    for step in range(round((seconds_before + 0.5) / STEP)):
        for wheel, is_counting in zip((response.left, response.right), counts, strict=True):
            counted = speed * STEP if is_counting or step * STEP < seconds_before else 0.0
            wheel.update(speed, speed, LAG, STEP, counted)
    return response


@pytest.mark.parametrize(
    ("counts", "seconds_before", "speed", "found"),
    [
        ((True, False), 1.0, 0.3, "the right wheel has given no count for 0.1"),
        ((False, True), 1.0, 0.3, "the left wheel has given no count for 0.1"),
        ((False, False), 1.0, 0.3, ""),  # the link may be silent, or the floor ice
        ((True, False), 0.0, 0.3, ""),  # a start may be late
        ((True, False), 1.0, 0.1, ""),  # 5 cm: less than 8 pitches
        ((True, True), 1.0, 0.3, ""),
    ],
)
def test_a_wheel_that_stops_under_way_is_found_in_half_a_second(
    counts, seconds_before, speed, found
):
    response = both_driven(counts, seconds_before, speed)
    assert response.fault(0.035, 2.0, LAG).startswith(found)
    assert bool(response.fault(0.035, 2.0, LAG)) == bool(found)


def test_a_wheel_whose_counts_only_go_up_and_down_is_found_in_half_a_second():
    """An encoder of two channels whose channel B is dead: the motor turns, the count does not."""
    drive, pitch, speed = DriveResponse(0.15, 0.01), 0.01, 0.3
    for step in range(round(1.5 / STEP)):
        counted = speed * STEP if step * STEP < 1.0 else (pitch, 0.0, -pitch, 0.0)[step % 4]
        drive.left.update(speed, 0.0 if step * STEP > 1.1 else speed, LAG, STEP, counted)
        drive.right.update(speed, speed, LAG, STEP, speed * STEP)
    cause = drive.fault(0.035, 2.0, LAG)
    assert "the left wheel counts up and down in turn" in cause and "channel B" in cause


def test_a_wheel_that_reverses_counts_on():
    wheel = WheelResponse()
    wheel.update(0.3, 0.3, LAG, STEP, 0.006)
    wheel.update(-0.3, 0.1, LAG, STEP, 0.002)  # rolls on
    wheel.update(-0.3, -0.1, LAG, STEP, -0.002)
    assert wheel.uncounted_for == pytest.approx(2 * STEP)
    wheel.update(-0.3, -0.3, LAG, STEP, -0.006)
    assert wheel.uncounted_for == pytest.approx(STEP)
