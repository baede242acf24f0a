"""The Sharp sensor: distances, objects that are too close, and faults."""

from math import radians
from random import Random

import pytest

from diffbotctl.blocks.range_sensor import REACH, RangeSensor, distance_at, volts_at
from diffbotctl.config.load import load
from diffbotctl.config.robot import SensorSection
from diffbotctl.geometry.distance_sensors import RESIDUAL_VOLTS
from diffbotctl.messages import Goal, Odometry, Resume, Volts
from diffbotctl.plant.range_sensors import volts
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import MILLISECOND as MS

SHARP = {"front": SensorSection(type="sharp_gp2y0a41sk0f", pin="A0")}


def sensor(speed=0.3, **values):
    return RangeSensor(sensor="front", sensors=SHARP, speed=speed, **values)


def drive(block, places, period=25 * MS, noise=0.0, seed=1):
    """The states and distances for true distances in metres, one each period."""
    rng = Random(seed)
    readings = []
    for number, place in enumerate(places, 1):
        now = number * period
        reading = Volts(now, max(0.005, volts(place) + rng.gauss(0.0, noise)))
        readings.append(block.react(now, reading, None, None))
    return readings


def sweep(begin, end, step):
    """Places from `begin` to `end` in metres, `step` apart, without the end."""
    count = int(abs(end - begin) / step)
    return [begin + (end - begin) * i / count for i in range(count)]


# The datasheet's typical points, read by eye; the fit's error there is 1.9 mm at most.
@pytest.mark.parametrize(
    "read, distance",
    [
        (2.34, 0.05),
        (2.02, 0.06),
        (1.56, 0.08),
        (1.265, 0.10),
        (0.928, 0.14),
        (0.656, 0.20),
        (0.525, 0.25),
    ],
)
def test_the_curve_fits_the_datasheet(read, distance):
    reading = sensor().react(MS, Volts(MS, read), None, None)
    assert reading.state == "measured"
    assert reading.distance == pytest.approx(distance, abs=0.002)


@pytest.mark.parametrize("distance", [0.05, 0.1, 0.2, 0.3])
def test_distance_is_the_inverse_of_volts(distance):
    curve = (0.1498, 0.0134, -0.047)
    assert distance_at(volts_at(distance, *curve), *curve) == pytest.approx(distance)


def test_beyond_its_range_it_reports_clear():
    reading = sensor().react(MS, Volts(MS, 0.30), None, None)  # 0.312 V is 40 cm
    assert (reading.state, reading.distance) == ("clear", REACH)


@pytest.mark.parametrize("speed, period", [(0.3, 25), (0.1, 25), (0.3, 20), (0.25, 61), (0.05, 61)])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_folded_back_voltages_never_give_a_distance(speed, period, noise):
    """60 cm to contact and back at the maximum speed, for the telemetry of each board."""
    step = speed * period / 1000
    places = [*sweep(0.6, 0.0, step), *sweep(0.0, 0.6, step)]
    readings = drive(sensor(speed), places, period * MS, noise)
    for place, seen in zip(places, readings, strict=True):
        if place < 0.04:
            assert seen.state == "too_close", f"{place * 100:.1f} cm is called {seen}"
        if seen.state == "measured":
            # 4 to 40 cm: the fit's 1.9 mm, and 10 mV of noise is 7 mm at 30 cm (twice that allowed)
            assert seen.distance == pytest.approx(place, abs=0.004 + 4 * noise * place)
    assert readings[0].state == "clear"


@pytest.mark.parametrize("speed, period", [(0.3, 25), (0.1, 25), (0.05, 61)])
def test_it_is_released_when_the_voltage_has_passed_its_peak_again(speed, period):
    step = speed * period / 1000
    there, back = sweep(0.6, 0.01, step), sweep(0.01, 0.6, step)
    readings = drive(sensor(speed), [*there, *back], period * MS)
    for place, seen in zip(back, readings[len(there) :], strict=True):
        if place > 0.05:
            assert seen.state in ("measured", "clear")


def test_retreat_before_the_peak_is_not_folded_back():
    """To 3.8 cm, where the voltage still rises, and back."""
    step = 0.3 * 0.025
    places = [*sweep(0.2, 0.038, step), *sweep(0.038, 0.2, step)]
    readings = drive(sensor(), places)
    assert min(seen.distance for seen in readings) == 0.0  # it was too close in between
    assert readings[-1].state == "measured"


def test_an_object_that_enters_and_leaves_sideways_is_released():
    """A hand at 3.2 cm for half a second: the robot cannot move 2 cm in 25 ms."""
    readings = drive(sensor(), [*[0.5] * 5, *[0.032] * 20, *[0.5] * 5], noise=0.01)
    assert [seen.state for seen in readings[5:25]] == ["too_close"] * 20
    assert [seen.state for seen in readings[25:]] == ["clear"] * 5


def test_noise_at_the_nearest_distance_does_not_latch():
    """At 4.2 cm noise moves the voltage across the limit."""
    block = sensor()
    drive(block, [0.042] * 200, noise=0.01)
    readings = drive(block, [0.045, 0.05, 0.06], noise=0.0)
    assert readings[-1].state == "measured"


def test_resume_releases_too_close():
    block = sensor()
    readings = drive(block, sweep(0.2, 0.015, 0.005))
    assert readings[-1].state == "too_close"
    now = 10_000 * MS
    again = block.react(now, Volts(now, 1.0), Resume(now), None)
    assert again.state == "measured"
    later = block.react(now + MS, Volts(now + MS, 1.01), Resume(now), None)
    assert later.state == "measured"


@pytest.mark.parametrize("read", [float("nan"), float("inf"), -float("inf")])
def test_no_voltage_is_a_fault(read):
    readings = sensor().react(MS, Volts(MS, read), None, None)
    assert (readings.state, readings.distance) == ("fault", 0.0)


def test_three_readings_of_zero_volts_are_a_fault():
    block = sensor()
    states = [block.react(n * MS, Volts(n * MS, 0.0), None, None).state for n in range(1, 5)]
    assert states == ["clear", "clear", "fault", "fault"]
    assert block.react(5 * MS, Volts(5 * MS, 0.5), None, None).state == "measured"


def test_a_constant_voltage_is_a_fault():
    block = sensor(frozen_for=1.0)
    states = [
        block.react(n * 25 * MS, Volts(n * 25 * MS, 0.8), None, None).state for n in range(1, 60)
    ]
    # from 25 ms on the same; a second later is the 41st reading
    assert states[:40] == ["measured"] * 40
    assert states[40:] == ["fault"] * 19
    now = 60 * 25 * MS
    assert block.react(now, Volts(now, 0.805), None, None).state == "measured"


def test_the_check_of_a_constant_voltage_can_be_disabled():
    block = sensor(frozen_for=None)
    states = {
        block.react(n * 100 * MS, Volts(n * 100 * MS, 0.8), None, None).state for n in range(1, 90)
    }
    assert states == {"measured"}


def test_no_output_before_the_first_voltage():
    assert sensor().react(MS, None, None, None) is None


@pytest.mark.parametrize(
    ("heading", "x", "state"),
    [
        (0.0, 0.0, "too_close"),  # it stands where it was: the voltage may be that of a contact
        (radians(30.0), 0.0, "too_close"),
        (radians(90.0), 0.0, "clear"),
        (radians(-180.0), 0.0, "clear"),
        (0.0, -0.4, "clear"),
    ],
)
def test_what_was_too_close_is_forgotten_where_the_robot_has_left_it(heading, x, state):
    """A wall touches the sensor; then the robot turns, or drives back, and nothing is in view."""
    block = sensor()
    at_wall = Odometry(0, 0.0, 0.0, 0.0, 0.0, 0.0, (0.0,) * 6)
    for number, place in enumerate(sweep(0.2, 0.0, 0.0075), 1):
        block.react(number * 25 * MS, Volts(number * 25 * MS, volts(place)), None, at_wall)
    now = 3000 * MS
    assert block.react(now, Volts(now, volts(0.002)), None, at_wall).state == "too_close"
    elsewhere = at_wall._replace(heading=heading, x=x)
    now += 1000 * MS
    assert block.react(now, Volts(now, RESIDUAL_VOLTS), None, elsewhere).state == state
    if state == "clear":  # and the next wall is seen, beyond the fold and in it
        places = sweep(0.2, 0.01, 0.0075)
        readings = [
            block.react(now + n * 25 * MS, Volts(now + n * 25 * MS, volts(place)), None, elsewhere)
            for n, place in enumerate(places, 1)
        ]
        assert [reading.state for reading in readings[-3:]] == ["too_close"] * 3


def test_the_robot_drives_on_from_a_wall_that_it_has_turned_away_from():
    sets = ["goals=[]", "world.walls=[{from: [0.35, -1], to: [0.35, 1]}]"]
    goals = (Goal(0, 0, 0.24, 0.0), Goal(0, 0, -0.4, 0.0))
    run = Run(
        load("goal", "book_2wd", [*sets, "follower.tolerance=60mm"]),
        RunOptions(goals=goals, fast=True),
    )
    result = run.go()
    assert result.reached + result.unsure == 2, result.ending.cause
