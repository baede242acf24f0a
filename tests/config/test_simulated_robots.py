"""Robots that exist only in the simulator, and pipelines on robots without a sensor."""

import pytest

from diffbotctl.config import lookup
from diffbotctl.config.load import load, load_robot
from diffbotctl.errors import ConfigurationError


def codes(caught):
    """The errors among the problems."""
    return [problem.code for problem in caught.value.problems if problem.severity == "error"]


@pytest.mark.parametrize("name", ["turtle", "turtlebot3_burger"])
def test_a_simulated_robot_is_refused_on_a_real_port(name):
    assert load_robot(name).warnings == ()
    with pytest.raises(ConfigurationError) as caught:
        load_robot(name, real=True)
    assert codes(caught) == ["E-BOARD-SIMULATED"]


@pytest.mark.parametrize(
    ("changes", "code", "words"),
    [
        ("drive: {left: {motor: {enable: none}}}", "E-DRIVER", "enable of the left motor"),
        ("drive: {left: {motor: {in1: none}}}", "E-BOARD-PIN", "can omit this pin"),
        ("drive: {right: {motor: {in2: none}}}", "E-BOARD-PIN", "can omit this pin"),
        ("drive: {left: {encoder: {pin: none}}}", "E-BOARD-PIN", "can omit this pin"),
    ],
)
def test_a_robot_with_a_board_needs_its_pins(tmp_path, changes, code, words):
    file = tmp_path / "mine.yaml"
    file.write_text(f"format: 1\nkind: robot\ninclude: book_2wd\n{changes}\n")
    with pytest.raises(ConfigurationError) as caught:
        load_robot(str(file))
    assert codes(caught) == [code]
    (problem,) = [problem for problem in caught.value.problems if problem.code == code]
    assert words in problem.cause
    assert problem.line == 4


def wires(configuration):
    return {use.name: use.wires for use in configuration.blocks}


def test_only_guards_with_a_sensor_are_kept():
    two_wheels, burger, turtle = (
        load("goal", robot) for robot in ("book_2wd", "turtlebot3_burger", "turtle")
    )
    assert "scan_guard" not in wires(two_wheels)
    assert wires(two_wheels)["kinematics"] == {"twist": "guard.twist"}
    assert "guard" not in wires(burger) and "range" not in wires(burger)
    assert wires(burger)["scan_guard"]["twist"] == "limiter.twist"
    assert wires(burger)["kinematics"] == {"twist": "scan_guard.twist"}
    assert wires(turtle)["kinematics"] == {"twist": "limiter.twist"}


@pytest.mark.parametrize("robot", lookup.names("robots"))
@pytest.mark.parametrize("pipeline", ["goal", "distance", "square", "teleop"])
def test_general_pipelines_accept_every_robot(pipeline, robot):
    last = load(pipeline, robot).blocks[-1]
    assert (last.name, list(last.wires)) == ("kinematics", ["twist"])


@pytest.mark.parametrize(
    ("robot", "warned"),
    [("book_2wd", []), ("turtlebot3_burger", []), ("turtle", ["W-UNGUARDED"])],
)
def test_a_pipeline_without_guards_gives_a_warning(robot, warned):
    codes_found = [problem.code for problem in load("goal", robot).warnings]
    assert [code for code in codes_found if code == "W-UNGUARDED"] == warned


def test_a_renamed_sensor_is_a_wrong_wire_not_a_missing_sensor(tmp_path):
    # A guard must not be dropped because of a name: its wire is reported as wrong.
    file = tmp_path / "mine.yaml"
    shipped = load_robot("book_2wd").file.read_text()
    file.write_text(
        shipped.replace("  front: {type", "  nose: {type").replace("{front: {n", "{nose: {n")
    )
    with pytest.raises(ConfigurationError) as caught:
        load("goal", str(file))
    assert "E-WIRE-OUTPUT" in codes(caught)
    assert "W-UNGUARDED" not in codes(caught)


def test_parameters_of_a_dropped_block_can_be_set():
    changed = load("goal", "turtle", ["guard.margin=7 cm"])
    assert "guard" not in wires(changed)


def test_a_wire_from_a_dropped_block_without_replacement_is_an_error(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "format: 1\nkind: pipeline\ninclude: goal\n"
        "blocks: {again: {block: obstacle_stop, in: {twist: mux.twist, range: range.range}}}\n"
    )
    with pytest.raises(ConfigurationError) as caught:
        load(str(file), "turtle")
    assert "E-WIRE-NODE" in codes(caught)
