"""Pipelines of several robots: names, values of each, and where a mistake is reported."""

import pytest

from diffbotctl.config.load import load
from diffbotctl.errors import UserError

HEAD = "format: 1\nkind: pipeline\n"


def pipeline(folder, text, name="pair"):
    path = folder / f"{name}.yaml"
    path.write_text(HEAD + text)
    return str(path)


def test_each_robot_has_its_own_pipeline_and_values(tmp_path):
    text = (
        "include:\n"
        "  - {path: goal, as: left}\n"
        "  - path: square\n"
        "    as: right\n"
        "    robot: turtlebot3_burger\n"
        "    set: {follower.tolerance: 3 cm, vars.side: 30 cm, robot.limits.speed: 0.1 m/s}\n"
    )
    found = load(pipeline(tmp_path, text), sets=["left.follower.tolerance=1 cm", "left.goals=[]"])
    assert found.robot is None and list(found.robots) == ["left", "right"]
    left, right = found.robots.values()
    tolerance = [
        {use.name: use.values for use in each.blocks}["follower"]["tolerance"]
        for each in (left, right)
    ]
    assert tolerance == [0.01, 0.03]
    assert (left.goals, right.goals[0].x) == ((), 0.3)
    assert right.robot.limits.speed == 0.1 and right.robot_file.stem == "turtlebot3_burger"
    assert left.robot.limits.speed == load("goal").robot.limits.speed
    assert {file.stem for file in found.files} >= {"pair", "goal", "square", "book_2wd"}


def test_one_include_may_have_a_name_and_is_looked_for_beside_the_file(tmp_path):
    pipeline(tmp_path, "include: goal\ngoals: [{x: 3 m}]\n", "near")
    found = load(pipeline(tmp_path, "include: {path: near, as: only}\n"))
    assert [goal.x for goal in found.robots["only"].goals] == [3.0]
    found = load(pipeline(tmp_path, "include: {path: ./near.yaml, as: only}\n"))
    assert [goal.x for goal in found.robots["only"].goals] == [3.0]


def test_a_mistake_is_reported_once_in_the_file_in_which_it_is(tmp_path):
    pipeline(tmp_path, "include: goal\nblocks:\n  mux: {block: command_mox}\n", "wrong")
    text = "include:\n  - {path: wrong, as: left}\n  - {path: wrong, as: right}\n"
    with pytest.raises(UserError) as caught:
        load(pipeline(tmp_path, text))
    (problem,) = caught.value.problems
    assert (problem.code, problem.line) == ("E-BLOCK-UNKNOWN", 5)
    assert problem.file.endswith("wrong.yaml")


ONE = "include:\n  - {path: goal, as: left}\n"


@pytest.mark.parametrize(
    ("text", "line", "cause"),
    [
        (f"{ONE}goals: [{{x: 1}}]\n", 5, "has no 'goals' of its own"),
        (f"{ONE}  - goal\n", 4, "either all includes have a name or none"),
        (f"{ONE}  - {{path: goal}}\n", 5, "the include has no 'as'"),
        (f"{ONE}  - {{as: right}}\n", 5, "the include has no 'path'"),
        (f"{ONE}  - {{path: goal, as: left}}\n", 5, "two robots are called 'left'"),
        (f"{ONE}  - {{path: goal, as: Right}}\n", 5, "'Right' is not a valid name"),
        (f"{ONE}  - {{path: goal, as: robot}}\n", 5, "'robot' is not a valid name"),
        (f"{ONE}  - {{path: gaol, as: right}}\n", 5, "there is no pipeline 'gaol'"),
        (f"{ONE}  - {{path: ./none.yaml, as: right}}\n", 5, "there is no file"),
        (f"{ONE}  - {{path: goal, as: right, with: 1}}\n", 5, "an include has no 'with'"),
        (f"{ONE}  - {{path: goal, as: [1]}}\n", 5, "'as' requires a name"),
        (f"{ONE}  - {{path: goal, as: right, set: [1]}}\n", 5, "'set' requires a mapping"),
        (f"{ONE}  - {{path: goal, as: right, set: {{robot: 1}}}}\n", 5, "names no value"),
        (f"{ONE}  - {{path: goal, as: right, set: {{{'a.' * 30}b: 1}}}}\n", 5, "names no value"),
        (f"{ONE}  - {{path: 5, as: right}}\n", 5, "'path' requires a name"),
        ("include: {}\n", 3, "either all includes have a name or none"),
        (f"{ONE}  - {{path: hello, as: right}}\n", 5, "drives no robot"),
        (f"{ONE}  - {{path: nested, as: right}}\n", 5, "itself gives names to its includes"),
        (f"{ONE}  - {{path: guided, as: right}}\n", 5, "has sources"),
        ("include: [{path: ./pair.yaml, as: left}]\n", 3, "itself gives names to its includes"),
        ("include: nested\n", 3, "only in the file that is run"),
    ],
)
def test_what_is_not_possible_is_refused_with_its_place(tmp_path, text, line, cause):
    pipeline(tmp_path, "include: {path: goal, as: inner}\n", "nested")
    sources = "sources: {joystick: {driver: joystick, timeout: 0.3 s}}"
    pipeline(tmp_path, f"include: goal\n{sources}\n", "guided")
    with pytest.raises(UserError) as caught:
        load(pipeline(tmp_path, text))
    (problem,) = caught.value.problems
    assert cause in problem.cause and problem.code == "E-INCLUDE"
    assert problem.line == line and problem.fix


@pytest.mark.parametrize(
    ("sets", "code", "cause"),
    [
        (["lift.follower.tolerance=1"], "E-SET", "no robot 'lift'"),
        (["left.follower=1"], "E-SET", "names no value"),
        (["left.robot=1"], "E-SET", "names no value"),
        (["left.fallower.tolerance=1"], "E-SET", "no block 'fallower'"),
        (["left.follower"], "E-SET", "requires path=value"),
    ],
)
def test_a_wrong_value_of_the_command_line_is_refused(tmp_path, sets, code, cause):
    with pytest.raises(UserError) as caught:
        load(pipeline(tmp_path, ONE), sets=sets)
    (problem,) = caught.value.problems
    assert problem.code == code and cause in problem.cause


def test_a_robot_file_for_all_is_refused(tmp_path):
    with pytest.raises(UserError) as caught:
        load(pipeline(tmp_path, ONE), "turtle")
    assert caught.value.problems[0].code == "E-SEVERAL-ROBOTS"
