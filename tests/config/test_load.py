"""From files to a typed configuration."""

from math import pi

import pytest

from diffbotctl.config import lookup
from diffbotctl.config.load import check, load, load_robot
from diffbotctl.errors import ConfigurationError, UserError
from diffbotctl.trials.plan import read_plan


def robot_of(text, tmp_path, **options):
    file = tmp_path / "mine.yaml"
    file.write_text(f"format: 1\nkind: robot\ninclude: book_2wd\n{text}")
    return load_robot(str(file), **options)


def pipeline_of(text, tmp_path, *sets, robot=None):
    file = tmp_path / "mine.yaml"
    file.write_text(f"format: 1\nkind: pipeline\n{text}")
    return load(str(file), robot, sets)


def codes(caught):
    return [problem.code for problem in caught.value.problems]


@pytest.fixture(autouse=True)
def empty_folder(tmp_path_factory, monkeypatch):
    """A working directory without robots and pipelines: the shipped ones are found by name."""
    monkeypatch.chdir(tmp_path_factory.mktemp("here"))


@pytest.mark.parametrize(
    "path, value",
    [
        ("drive.track", 0.125),
        ("drive.left.wheel.diameter", 0.065),  # stated once for both sides
        ("drive.right.wheel.diameter", 0.065),
        ("drive.left.motor.rated", 100 * 2 * pi / 60),
        ("drive.left.motor.reversed", True),  # stated for one side
        ("drive.right.motor.reversed", False),
        ("drive.left.motor.enable", "5"),
        ("drive.right.encoder.pin", "3"),
        ("drive.right.encoder.slots", 20),
        ("drive.left.encoder.glitch", 0.002),
        ("board.deadman", 0.3),
        ("board.stop_button", None),  # the word none
        ("sensors.front.pin", "A0"),
        ("sensors.front.at.x", 0.08),
        ("limits.braking", 1.5),
        ("simulation.slip", 0.0005),
        ("simulation.wiring.left", "reversed"),
        ("simulation.motor.lag", (0.06, 0.15)),
    ],
)
def test_values_of_the_book_s_robot(path, value):
    field = load_robot("book_2wd").robot
    for step in path.split("."):
        field = field[step] if isinstance(field, dict) else getattr(field, step)
    assert field == pytest.approx(value) if isinstance(value, float) else field == value


def test_a_side_overrides_common_values(tmp_path):
    drive = robot_of("drive: {left: {wheel: {diameter: 64 mm}}}", tmp_path).robot.drive
    assert (drive.left.wheel.diameter, drive.right.wheel.diameter) == (0.064, 0.065)


@pytest.mark.parametrize(
    "name, telemetry, edge_times, protocol, speed",
    [
        ("book_2wd", 38.0, True, "diffbot", 0.3),
        ("book_2wd_counts", 48.0, False, "diffbot", 0.3),
        ("book_2wd_stock", 16.5, False, "rosserial", 0.25),
    ],
)
def test_robots_with_three_kinds_of_firmware(name, telemetry, edge_times, protocol, speed):
    robot = load_robot(name).robot
    assert robot.board.telemetry == telemetry
    assert robot.board.edge_times is edge_times
    assert robot.link.protocol == protocol
    assert robot.limits.speed == speed
    assert robot.drive.track == 0.125  # through the include


def test_calibration_overrides_the_fields_but_not_the_simulation(tmp_path):
    text = """calibration:
  drive.left.wheel.diameter: {value: 64.7 mm, sd: 0.1 mm, method: umbmark}
  drive.track: {value: 126.5 mm}
"""
    file = robot_of(text, tmp_path)
    assert file.robot.drive.left.wheel.diameter == pytest.approx(0.0647)
    assert file.robot.drive.right.wheel.diameter == 0.065
    assert file.robot.drive.track == pytest.approx(0.1265)
    assert file.nominal.drive.track == 0.125
    assert file.nominal.drive.left.wheel.diameter == 0.065
    assert file.robot.calibration["drive.left.wheel.diameter"].method == "umbmark"


def test_blocks_and_wires_of_a_pipeline():
    configuration = load("goal")
    use = {block.name: block for block in configuration.blocks}
    assert use["follower"].wires == {"odometry": "odometry.odometry", "goal": "operator.goal"}
    assert use["follower"].values["tolerance"] == pytest.approx(0.010)
    assert use["guard"].values["resume_by"] == "by_itself"  # `resume` in the file
    assert use["guard"].values["braking"] == 1.5  # from the robot file
    assert configuration.robot_wires == {"wheels": "kinematics.wheels"}
    assert configuration.goals[0].heading == pytest.approx(pi / 2)
    assert configuration.world.walls[0].start == (2.5, -1.0)
    assert [file.name for file in configuration.files] == ["goal.yaml", "book_2wd.yaml"]


def test_blocks_of_every_shipped_pipeline_can_be_created():
    for name in lookup.names("pipelines"):
        for block in load(name).blocks:
            assert block.cls(**block.values) is not None


def test_a_pipeline_without_robot():
    configuration = load("hello")
    assert (configuration.robot, configuration.robot_file, configuration.robot_wires) == (
        None,
        None,
        {},
    )


def test_a_variable_is_replaced_by_its_value(tmp_path):
    text = "include: goal\nvars: {side: 50 cm, far: 2}\ngoals: [{x: $side, y: $far}]\n"
    goal = pipeline_of(text, tmp_path).goals[0]
    assert (goal.x, goal.y) == (0.5, 2.0)


def test_variables_within_text(tmp_path):
    text = """vars: {who: world, number: 3}
blocks: {talker: {block: talker, with: {greeting: "hello $who, $number of $$5"}}}
"""
    assert pipeline_of(text, tmp_path).blocks[0].values["greeting"] == "hello world, 3 of $5"


@pytest.mark.parametrize(
    "words, block, parameter, value",
    [
        ("follower.tolerance=20 mm", "follower", "tolerance", 0.02),
        ("follower.tolerance = 0.03", "follower", "tolerance", 0.03),
        ("guard.resume=wait", "guard", "resume_by", "wait"),
        ("follower.reverse=true", "follower", "reverse", True),
        ("robot.limits.braking=1 m/s2", "guard", "braking", 1.0),
        ("follower.with.tolerance=20 mm", "follower", "tolerance", 0.02),  # as messages name it
        ("blocks.follower.with.tolerance=20 mm", "follower", "tolerance", 0.02),
    ],
)
def test_set_changes_one_value(words, block, parameter, value):
    use = {use.name: use for use in load("goal", sets=[words]).blocks}[block]
    assert use.values[parameter] == value


def test_set_changes_goals_and_items_of_lists():
    settings = ["goals=[{x: 1 m}, {x: 2 m}]", "goals.1.y=30 cm", "world.walls.0.to=[3 m, 2 m]"]
    configuration = load("goal", sets=settings)
    assert [(goal.x, goal.y) for goal in configuration.goals] == [(1.0, 0.0), (2.0, 0.3)]
    assert configuration.world.walls[0].end == (3.0, 2.0)
    assert load("goal", sets=["goals=[]"]).goals == ()


@pytest.mark.parametrize(
    ("words", "cause", "fix"),
    [
        ("robot=turtle", "robot cannot be changed by --set", "--robot"),
        ("robot.include=/dev/zero", "robot.include cannot be changed by --set", "--robot"),
        ("robot.kind=pipeline", "robot.kind cannot be changed by --set", "--robot"),
        ("drive.track=13 cm", "the pipeline has no block 'drive'", "write robot.drive.track"),
        ("follower=5", "--set requires block.parameter=value", "follower.tolerance"),
        ("vars=5", "--set requires block.parameter=value", "follower.tolerance"),
        ("follower.tolerance", "--set requires path=value", "follower.tolerance"),
        ("=5", "--set requires path=value", "follower.tolerance"),
        (
            "goals.5.x=1 m",
            "goals has one item, and none is called 5",
            "items count from 0: goals.0",
        ),
        ("goals.x=1 m", "goals has one item, and none is called x", "--set goals='[...]'"),
        ("goals.-1.x=1 m", "goals has one item, and none is called -1", "goals.0"),
        ("world.walls.1.to=[1 m, 2 m]", "world.walls has one item, and none is called 1", ".0"),
    ],
)
def test_set_that_is_refused(words, cause, fix):
    (problem,) = check("goal", "book_2wd", [words])
    assert problem.code == "E-SET" and problem.cause == cause and fix in problem.fix


def test_an_item_of_an_empty_list_is_refused():
    (problem,) = check("standby", "book_2wd", ["goals.0.x=1 m"])
    assert (problem.code, problem.cause) == ("E-SET", "goals is an empty list")


def test_set_changes_a_variable():
    assert load("distance", sets=["vars.distance=50 cm"]).goals[0].x == 0.5


def test_lists_are_replaced_and_mappings_merged(tmp_path):
    text = "include: square\ngoals: [{x: 1 m}]\nvars: {side: 1 m}\nworld: {obstacles: []}\n"
    with pytest.raises(ConfigurationError) as caught:
        pipeline_of(text + "blocks: {follower: {with: {tolerance: 1 um}}}\n", tmp_path)
    # The four goals of the square are replaced, so its variable is unused; its walls remain.
    assert "W-VAR-UNUSED" in codes(caught)
    configuration = pipeline_of(text.replace("vars: {side: 1 m}\n", ""), tmp_path)
    assert [goal.x for goal in configuration.goals] == [1.0]
    assert len(configuration.world.walls) == 1


def test_the_last_of_several_includes_has_priority(tmp_path):
    (tmp_path / "slow.yaml").write_text("limits: {speed: 0.1 m/s}\n")
    (tmp_path / "slower.yaml").write_text("limits: {speed: 0.05 m/s}\n")
    file = tmp_path / "mine.yaml"
    file.write_text("format: 1\nkind: robot\ninclude: [book_2wd, slow, slower]\n")
    assert load_robot(str(file)).robot.limits.speed == 0.05


def test_a_problem_has_its_place_in_the_included_file(tmp_path):
    (tmp_path / "narrow.yaml").write_text("drive: {track: 125 deg}\n")
    file = tmp_path / "mine.yaml"
    file.write_text("format: 1\nkind: robot\ninclude: [book_2wd, narrow]\n")
    with pytest.raises(ConfigurationError) as caught:
        load_robot(str(file))
    assert [problem.file.endswith("narrow.yaml") for problem in caught.value.problems] == [True]


# Files in ./robots, `use` of the pipeline, --robot; the robot that is used.
@pytest.mark.parametrize(
    "own, use, option, taken",
    [
        ([], None, None, "book_2wd"),  # the default
        (["mine"], None, None, "mine"),  # the only one in ./robots
        (["mine", "book_2wd"], None, None, "book_2wd"),
        (["mine"], "book_2wd", None, "book_2wd"),  # `use` has priority over the only one
        (["mine"], "book_2wd", "mine", "mine"),  # --robot has priority
        (
            ["book_2wd_counts"],
            None,
            "book_2wd_counts",
            "book_2wd_counts",
        ),  # ./robots has priority over shipped
    ],
)
def test_which_robot_is_used(tmp_path, monkeypatch, own, use, option, taken):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robots").mkdir()
    for name in own:
        include = "book_2wd_stock" if name == "book_2wd" else "book_2wd"
        text = f"format: 1\nkind: robot\ninclude: {include}\n"
        (tmp_path / "robots" / f"{name}.yaml").write_text(text)
    line = f"robot: {{use: {use}}}\n" if use else ""
    (tmp_path / "p.yaml").write_text(f"format: 1\nkind: pipeline\ninclude: goal\n{line}")
    configuration = load("p.yaml", option)
    assert configuration.robot_file.stem == taken
    is_own = taken in own
    assert (configuration.robot_file.parent.resolve() == (tmp_path / "robots").resolve()) is is_own


def test_several_robots_and_none_selected(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robots").mkdir()
    for name in ("one", "two"):
        (tmp_path / "robots" / f"{name}.yaml").write_text("format: 1\n")
    with pytest.raises(UserError) as caught:
        load("goal")
    assert codes(caught) == ["E-ROBOT-WHICH"]
    assert load("goal", default_robot="turtlebot3_burger").robot_file.stem == "turtlebot3_burger"
    trials = tmp_path / "trials.yaml"
    trials.write_text("format: 1\nkind: trials\npipeline: goal\ncases: {healthy: {}}\n")
    with pytest.raises(UserError) as caught:
        read_plan(str(trials))
    assert codes(caught) == ["E-ROBOT-WHICH"]
    assert caught.value.problems[0].fix == "choose some in trials.yaml: `robots: [NAME]`"


def test_a_kit_is_written_before_it_is_a_robot():
    with pytest.raises(UserError) as caught:
        load("goal", "four_wheels")
    assert "`diffbotctl new robot --kit four_wheels`" in caught.value.problems[0].fix


def test_a_pipeline_in_the_folder_has_priority_over_a_shipped_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pipelines").mkdir()
    (tmp_path / "pipelines" / "hello.yaml").write_text(
        "format: 1\nkind: pipeline\nblocks: {mine: {block: talker}}\n"
    )
    assert [block.name for block in load("hello").blocks] == ["mine"]


def test_problems_of_both_files_are_reported_together(tmp_path):
    (tmp_path / "robot.yaml").write_text(
        "format: 1\nkind: robot\ninclude: book_2wd\ndrive: {track: 9 deg}\n"
    )
    with pytest.raises(ConfigurationError) as caught:
        pipeline_of(
            "include: goal\nrobot: {use: ./robot.yaml}\nblocks: {mux: {block: command_mox}}\n",
            tmp_path,
        )
    assert sorted(codes(caught)) == ["E-BLOCK-UNKNOWN", "E-UNIT"]


def test_loading_imports_no_heavy_library():
    """A fresh interpreter: jsonschema alone would add a quarter to the start-up time."""
    import subprocess
    import sys

    script = (
        "import sys; from diffbotctl.config.load import load; load('goal'); "
        "print(*sorted({'jsonschema', 'numpy', 'rich'} & set(sys.modules)))"
    )
    environment = {"PYTHONPATH": str(lookup.folder("robots").parent), "HOME": "/nonexistent"}
    command = [sys.executable, "-c", script]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert result.stdout.split() == []


def test_only_the_blocks_of_the_pipeline_are_imported():
    import subprocess
    import sys

    script = (
        "import sys; from diffbotctl.config.load import load; load('hello'); "
        "print(*[name for name in sys.modules if name.startswith('diffbotctl.blocks.')])"
    )
    environment = {"PYTHONPATH": str(lookup.folder("robots").parent), "HOME": "/nonexistent"}
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
    )
    imported = {name.rsplit(".", 1)[1] for name in done.stdout.split()}
    # The check of the stopping distance uses these two.
    assert imported == {"talker", "listener", "obstacle_stop", "range_sensor"}
