"""Robots drawn at random, the controller that knows the true pose, and runs of the matrix."""

from math import pi

import pytest

from diffbotctl.config.load import check, load
from diffbotctl.messages import Goal
from diffbotctl.plant.simulated_robot import draw_robot
from diffbotctl.time import SECOND
from diffbotctl.trials.random_robots import draw_design, yaml_text
from tests.sampling import by_day, each_once
from tests.support.matrix_case import Case, run_case, set_up
from tests.support.random_robots import PERTURBATIONS
from tests.support.true_pose_controller import TruePoseController


@pytest.mark.parametrize("number", by_day(12, range(60)))
def test_a_drawn_robot_is_within_the_bounds(number):
    design = draw_design(7, number)
    assert 0.07 <= design.track <= 0.4 and 0.03 <= design.diameter <= 0.2
    assert design.diameter <= 1.2 * design.track + 1e-4
    assert 8 <= design.slots <= 4096 and design.pitch <= 0.2 * design.track + 1e-4
    rpm = design.rated * 60 / (2 * pi)
    assert 29.9 <= rpm <= 400.1 and rpm / 60 * design.slots <= 20_010


@each_once(name=list(PERTURBATIONS), plant=[1, 2])
def test_each_perturbation_gives_a_robot_that_is_accepted(name, plant, tmp_path):
    setting = set_up(Case(3, len(name), name, plant, 0), tmp_path)
    simulation = setting.trial.configuration.nominal.simulation
    assert simulation.equations == ("exponential", "torque")[plant - 1]
    assert setting.robot.drive.left.motor.rated != setting.robot.drive.right.motor.rated


def test_a_case_is_the_same_run_from_its_text():
    case = Case.parse("2:4:jitter:1:0")
    assert run_case(case) == run_case(case)
    assert str(case) == "2:4:jitter:1:0"
    with pytest.raises(ValueError):
        Case.parse("2:4:nothing:1:0")


@pytest.mark.parametrize("equations", ["exponential", "torque"])
def test_a_controller_that_knows_the_pose_reaches_goals_in_any_direction(equations, tmp_path):
    file = tmp_path / "robot.yaml"
    tree = {"format": 1, "kind": "robot", "include": "book_2wd"}
    file.write_text(yaml_text(tree | {"simulation": {"equations": equations}}))
    setup = load("goal", str(file), ["world.walls=[]"])
    for seed, (x, y, heading) in enumerate(((1.0, 0.5, 1.0), (-0.6, 0.1, -2.0), (0.05, 0.0, 3.0))):
        plant = draw_robot(setup.robot, setup.nominal, seed)
        controller = TruePoseController(setup.robot, Goal(0, 1, x, y, heading), (0.01, 0.035))
        assert controller.run(plant, 60 * SECOND) is not None
        pose = plant.truth().pose
        assert abs(pose.x - x) < 0.01 and abs(pose.y - y) < 0.01
        assert abs((pose.heading - heading + pi) % (2 * pi) - pi) < 0.035


@pytest.mark.parametrize(
    "change, code",
    [
        ("{wheel: {diameter: 149 mm}, encoder: {slots: 100}}", None),
        ("{wheel: {diameter: 151 mm}, encoder: {slots: 100}}", "E-WHEEL-SIZE"),
        ("{encoder: {slots: 9}}", None),
        ("{encoder: {slots: 8}}", "E-ENCODER-COARSE"),
        ("{motor: {rated: 300 rpm}, encoder: {slots: 3999, glitch: 10 us}}", None),
        ("{motor: {rated: 300 rpm}, encoder: {slots: 4050, glitch: 10 us}}", "E-ENCODER-FAST"),
    ],
)
def test_check_refuses_what_the_matrix_does_not_draw(change, code, tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text(
        "format: 1\nkind: robot\ninclude: book_2wd\nboard: {edge_times: false}\n"
        f"body: {{width: 160 mm}}\ndrive: {change}\n"
    )
    errors = [problem.code for problem in check(str(file)) if problem.code.startswith("E-")]
    assert errors == ([code] if code else [])


def fine_robot(number):
    """Robot `number` of those of seed 11 whose encoders are fine."""
    return [each for each in range(100) if draw_design(11, each).slots > 64][number]


@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_goal_is_not_claimed_when_an_encoder_loses_every_second_slot(number):
    result = run_case(Case(11, fine_robot(number), "halved", 1, 0))
    assert result.trial.outcome in ("reached_unsure", "given_up")
    assert f"{result.wheel} wheel: counts half the edges" in result.cause


@each_once(number=[0, 1, 2], plant=[1, 2])
def test_the_cost_of_moments_without_edges_is_reported(number, plant):
    result = run_case(Case(11, fine_robot(number), "silent_for_moments", plant, 0))
    assert result.trial.outcome != "reached" or result.true_error < 0.05


@pytest.mark.parametrize("number", [0, 1, 3])
def test_a_goal_is_not_claimed_when_both_encoders_lose_every_second_slot(number):
    """A robot that is heavy for its motors looks nearly the same, and does reach its goals."""
    result = run_case(Case(11, fine_robot(number), "both_halved", 1, 0))
    assert result.trial.outcome in ("reached_unsure", "given_up")
    assert "every second one is missing" in result.cause
