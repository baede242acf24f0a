"""A value that a message proposes is accepted when it is typed, and the message is gone then."""

import re
from random import Random

import pytest

from diffbotctl.config.load import check
from diffbotctl.units import rounded_down, rounded_up

# Key -> its values, drawn between two limits on a logarithmic scale, and their unit.
DRAWN = {
    "robot.board.telemetry": (1, 100, " Hz"),
    "robot.board.deadman": (100, 500, " ms"),
    "robot.drive.track": (25, 1900, " mm"),
    "robot.drive.wheel.diameter": (11, 480, " mm"),
    "robot.drive.motor.rated": (1, 500, " rpm"),
    "robot.drive.motor.lag": (1, 1900, " ms"),
    "robot.drive.encoder.slots": (1, 4096, ""),
    "robot.drive.encoder.glitch": (0.01, 50, " ms"),
    "robot.drive.wheelbase": (11, 1900, " mm"),
    "robot.limits.speed": (0.01, 10, " m/s"),
    "robot.limits.turn_rate": (0.1, 100, " rad/s"),
    "robot.limits.braking": (0.01, 10, " m/s2"),
    "robot.body.width": (10, 2900, " mm"),
    "robot.sensors.front.at.x": (1, 130, " mm"),
    "follower.tolerance": (1, 200, " mm"),
    "guard.margin": (10, 300, " mm"),
}
PROPOSED = re.compile(
    r"(?:set|lower|raise) ([a-z_.]+)(?: to(?: at most| at least)?|:) (-?[\d.e+-]+)( [A-Za-z/]+\d?)?"
)
SECTIONS = {"telemetry": "board", "glitch": "drive.encoder", "track": "drive"}


def drawn_settings(rng):
    """Some keys with values, as `--set` takes them."""
    settings = {}
    for key in rng.sample(sorted(DRAWN), rng.randint(1, 4)):
        low, high, unit = DRAWN[key]
        value = low * (high / low) ** rng.random()
        settings[key] = f"{round(value)}" if not unit else f"{value:.4g}{unit}"
    return settings


def problems_of(settings):
    return check("goal", "book_2wd", [f"{key}={value}" for key, value in settings.items()])


def proposals(problem):
    """Key and value of each proposal of a fix, as `--set` takes them."""
    if tolerance := re.fullmatch(r"use ([\d.]+ mm) or more", problem.fix):
        yield "follower.tolerance", tolerance[1]
    for key, number, unit in PROPOSED.findall(problem.fix):
        is_unit = unit in (" Hz", " us", " mm", " m/s", " rad/s")
        section = f"{SECTIONS[key]}." if key in SECTIONS else ""
        yield f"robot.{section}{key}", number + (unit if is_unit else "")


@pytest.mark.parametrize("seed", range(60))
def test_what_a_fix_proposes_is_accepted(seed):
    settings = drawn_settings(Random(seed))
    for problem in problems_of(settings):
        for key, value in proposals(problem):
            after = problems_of({**settings, key: value})
            assert problem.cause not in {other.cause for other in after}, (problem, value)
            refused = [other for other in after if other.code in ("E-BOUNDS", "E-UNIT", "E-TYPE")]
            assert refused == [], (problem.fix, value)


def test_proposals_are_found_in_the_fixes():
    settings = ["robot.limits.speed=2 m/s", "robot.board.telemetry=90 Hz", "follower.tolerance=1mm"]
    fixes = [found for each in check("goal", "book_2wd", settings) for found in proposals(each)]
    assert ("robot.limits.speed", "0.34 m/s") in fixes
    assert ("robot.board.telemetry", "39 Hz") in fixes
    assert ("robot.link.baud", "38400") in fixes
    assert ("follower.tolerance", "3 mm") in fixes


@pytest.mark.parametrize(
    ("value", "down", "up"),
    [
        (0.3403, 0.34, 0.35),
        (0.00204, 0.002, 0.0021),
        (0.34, 0.34, 0.34),
        (5.4454, 5.4, 5.5),
        (0.099, 0.099, 0.099),
        (123.4, 120.0, 130.0),
        (1e-9, 1e-9, 1e-9),
    ],
)
def test_proposals_have_two_digits_and_are_never_zero(value, down, up):
    assert rounded_down(value) == down
    assert rounded_up(value) == up


@pytest.mark.parametrize(
    ("settings", "is_proposed"),
    [
        ({"robot.board.telemetry": "42 Hz"}, True),
        ({"robot.board.telemetry": "90 Hz"}, False),  # counts alone are too many too
    ],
)
def test_to_leave_out_edge_times_is_advised_where_it_is_enough(settings, is_proposed):
    fixes = [problem.fix for problem in problems_of(settings) if "LINK-BUDGET" in problem.code]
    assert len(fixes) == 1 and ("edge_times: false" in fixes[0]) == is_proposed
    if is_proposed:
        after = problems_of({**settings, "robot.board.edge_times": "false"})
        assert not [problem for problem in after if "LINK-BUDGET" in problem.code]


@pytest.mark.parametrize(
    ("settings", "code"),
    [
        ({"robot.drive.motor.rated": "0.5 rpm"}, "E-LIMIT-SPEED"),
        ({"robot.drive.wheelbase": "1.1 m"}, "W-SKID-STEER"),
        ({"robot.sensors.front.at.x": "-250 mm"}, "E-STOP-REACH"),
    ],
)
def test_what_is_not_possible_is_not_proposed(settings, code):
    fixes = [problem.fix for problem in problems_of(settings) if problem.code == code]
    assert len(fixes) == 1 and fixes[0]
    assert "set " not in fixes[0]


def test_a_speed_beyond_the_wheels_has_one_message():
    codes = [problem.code for problem in problems_of({"robot.limits.speed": "3 m/s"})]
    assert "E-LIMIT-SPEED" in codes and "W-EDGES" not in codes


@pytest.mark.parametrize(
    ("robot", "is_advised"),
    [("drive: {encoder: {slots: 200}}", False), ("drive: {encoder: {glitch: 40 ms}}", True)],
)
def test_to_leave_a_key_out_is_advised_where_the_file_has_it(robot, is_advised, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(f"format: 1\nkind: robot\ninclude: book_2wd\n{robot}\n")
    (problem,) = [each for each in check(str(path)) if each.code == "E-GLITCH"]
    assert ("leave it out" in problem.fix) == is_advised
