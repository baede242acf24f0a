"""Plants behind one interface: the shipped ones, and the one that the page shows."""

import re
from math import inf, nan, pi
from pathlib import Path

import pytest

from diffbotctl.config import consents
from diffbotctl.config.code_files import CodeConsentError
from diffbotctl.config.load import check, load
from diffbotctl.messages import Goal
from diffbotctl.physics_model import Edge, MotorInput, Plant, PlantStep
from diffbotctl.plant.own_plant import OwnDrive, plant_robot
from diffbotctl.plant.simulated_robot import draw_robot
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND

PAGE = Path(__file__).parents[2] / "docs" / "plants.md"
OPEN, SHORTED = MotorInput(0.0, "open"), MotorInput(0.0, "shorted")


def driven(duty):
    return MotorInput(duty, "driven")


class ShippedPlant(Plant):
    """A shipped plant behind the interface."""

    def __init__(self, drive, chassis):
        self._drive, self._chassis = drive, chassis
        for wheel in drive.wheels:
            wheel.watch(True)

    def step(self, until, left, right):
        """Let time pass; see `Plant`."""
        self._drive.set_shorted(*(float(each.state == "shorted") for each in (left, right)))
        self._drive.advance(until, (left.duty, right.duty))
        a, b = self._drive.wheels
        self._chassis.roll(a.angle, b.angle)
        return PlantStep(
            [Edge(*change) for change in a.changes(until)],
            [Edge(*change) for change in b.changes(until)],
            *self._chassis.pose,
            (a.angle, b.angle),
        )


def shown_code():
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S)
    return code


def shipped(equations):
    sets = [f"robot.simulation.equations={equations}", "robot.simulation.slip=0 mm"]
    robot = load("goal", "book_2wd", sets)
    made = draw_robot(robot.robot, robot.nominal, 1)
    return ShippedPlant(made.drive, made.chassis)


def own():
    names = {}
    exec(shown_code(), names)
    robot = load("goal", "book_2wd")
    return names["MyPlant"](plant_robot(draw_robot(robot.robot, robot.nominal, 1).parameters), 1)


@pytest.mark.parametrize(
    "make", [lambda: shipped("exponential"), lambda: shipped("torque"), own], ids=["1", "2", "own"]
)
def test_every_plant_behaves_like_a_robot(make):
    plant = make()
    rest = plant.step(SECOND // 2, OPEN, OPEN)
    assert not rest.left and not rest.right and (rest.x, rest.y, rest.heading) == (0, 0, 0)
    ahead = plant.step(2 * SECOND, driven(0.6), driven(0.6))
    assert ahead.x > 0.2 and abs(ahead.heading) < 0.6 and min(ahead.angles) > 2 * pi
    times = [edge.time for edge in ahead.left]
    assert times == sorted(times) and times[0] > SECOND // 2 and times[-1] <= 2 * SECOND
    rising = sum(edge.level for edge in ahead.left)
    assert rising == pytest.approx(ahead.angles[0] / (2 * pi) * 20, abs=2)  # slots of the disc
    halted = plant.step(5 * SECOND, SHORTED, SHORTED)
    still = plant.step(6 * SECOND, SHORTED, SHORTED)
    assert (halted.x, halted.angles) == (still.x, still.angles)
    turned = plant.step(7 * SECOND, driven(-0.6), driven(0.6))
    assert turned.heading > still.heading + 1.0


class Wrong(Plant):
    """Returns numbers that no robot can have."""

    def __init__(self, numbers):
        self.numbers = numbers

    def step(self, until, left, right):
        x, y, heading, *angles = self.numbers
        return PlantStep((), (), x, y, heading, tuple(angles))


@pytest.mark.parametrize("place", range(5))
@pytest.mark.parametrize("number", [nan, inf, -inf, 1e308, -1e10])
def test_a_number_that_no_robot_can_have_is_refused_where_it_comes_from(place, number):
    numbers = [0.0] * 5
    OwnDrive(Wrong(numbers), False).advance(1, (0.0, 0.0))
    numbers[place] = number
    with pytest.raises(ValueError, match=r"Wrong\.step returned a number that is not finite"):
        OwnDrive(Wrong(numbers), False).advance(1, (0.0, 0.0))


@pytest.fixture
def robot(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(consents, "_allowed_here", set())
    (tmp_path / "my_plant.py").write_text(shown_code())
    file = tmp_path / "mine.yaml"
    file.write_text(
        "format: 1\nkind: robot\ninclude: book_2wd\ndrive: {polarity: checked_by_hand}\n"
        "simulation: {plant: ./my_plant.py:MyPlant}\n"
    )
    return file


def test_a_goal_is_reached_with_the_plant_of_the_page_once_it_is_allowed(robot):
    with pytest.raises(CodeConsentError) as refused:
        load("goal", str(robot))
    (code,) = refused.value.files
    consents.allow_here(code.consent_key)
    configuration = load("goal", str(robot))
    truths = []
    for _ in range(2):
        options = RunOptions(goals=(Goal(0, 1, 0.4, 0.2),), seed=3, fast=True, duration=30.0)
        run = Run(configuration, options, tell=lambda text: None)
        result = run.go()
        assert result.ending.code in (0, 3), result.ending.cause
        truths.append(result.truth)
    assert truths[0] == truths[1]
    assert truths[0].pose.x == pytest.approx(0.4, abs=0.05)
    assert not run.plant.has_contact
    faulty = robot.with_name("faulty.yaml")
    faulty.write_text(
        robot.read_text().replace(
            "simulation: {", "simulation: {faults: [{fault: wheel_blocked}], "
        )
    )
    assert "E-FAULT" in {problem.code for problem in check(str(faulty))}
