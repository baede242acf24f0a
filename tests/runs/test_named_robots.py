"""Several simulated robots in one engine: each drives, stops and is recorded by itself."""

import pytest

from diffbotctl.config.load import load
from diffbotctl.drivers.named_robots import RobotGroup
from diffbotctl.engine.clock import VirtualClock
from diffbotctl.engine.instant_monitor import instant_limits
from diffbotctl.engine.loop import Engine
from diffbotctl.errors import Problem, RunError, UserError
from diffbotctl.messages import Stop
from diffbotctl.recording.reader import RecordingReader, recording_info
from diffbotctl.replay.recorded_run import read_run
from diffbotctl.replay.replay import ReplayOptions, replay, replay_run
from diffbotctl.replay.resimulate import why_not_resimulable
from diffbotctl.ros2.bag_export import export_bag
from diffbotctl.runs.build_graph import assemble
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run

PAIR = """format: 1
kind: pipeline
include:
  - {path: goal, as: left, set: {world.walls: []}}
  - path: goal
    as: right
    set: {world.walls: [], goals: [{x: 0.3 m, y: 0.1 m}]}
"""


@pytest.fixture
def pair(tmp_path):
    path = tmp_path / "pair.yaml"
    path.write_text(PAIR)
    return str(path)


def recorded(path, prefix=""):
    """(time, wire without `prefix`, message as text) of 3 s, without the log."""
    return [
        (item.time, item.wire.removeprefix(prefix), str(item.message))
        for item in RecordingReader(path).messages()
        if item.wire.startswith(prefix) and item.wire != "log" and item.time < 3_000_000_000
    ]


def test_both_reach_their_goals_and_the_recording_replays(tmp_path, pair):
    path = tmp_path / "run.mcap"
    result = Run(load(pair), RunOptions(fast=True, record=path, digest=True)).go()
    assert (result.ending.code, result.reached, result.goals) == (0, 2, 2)
    assert result.ending.cause == "left: all goals reached; right: all goals reached"
    assert result.ending.stopped and not result.stops
    wires = {item.wire for item in RecordingReader(path).messages()}
    assert {"left.odometry.odometry", "right.gate.wheels", "log"} <= wires
    lines = [item.message for item in RecordingReader(path).messages() if item.wire == "log"]
    assert {"left.follower", "right.follower"} <= {line.source for line in lines}
    again = replay(path, check=True)
    assert again.difference is None and again.compared > 1000
    assert again.digest == result.digest and again.metrics.goals_reached == 2
    assert again.metrics.path is None  # two paths have no sum that means anything
    assert why_not_resimulable(read_run(path)) is None
    topics = {topic.name for topic in recording_info(path).topics if topic.origin == "viewer"}
    assert topics == {"left.odometry.odometry.pose", "right.odometry.odometry.pose", "log.lines"}
    with pytest.raises(UserError) as caught:
        replay_run(read_run(path), ReplayOptions(dash=True))
    assert caught.value.problems[0].code == "E-SEVERAL-ROBOTS"
    with pytest.raises(UserError) as caught:
        export_bag(path, tmp_path / "bag", None, False)
    assert caught.value.problems[0].code == "E-SEVERAL-ROBOTS"


def test_a_robot_drives_as_it_does_alone(tmp_path, pair):
    """The first of several has the seed of the run: bit for bit the same, until it is alone."""
    several, alone = tmp_path / "several.mcap", tmp_path / "alone.mcap"
    options = RunOptions(fast=True, duration=3.0, seed=5)
    Run(load(pair), options._replace(record=several)).go()
    Run(load("goal", sets=["world.walls=[]"]), options._replace(record=alone)).go()
    assert recorded(several, "left.") == recorded(alone)
    other = [message for _, wire, message in recorded(several, "right.") if "encoders" in wire]
    assert other != [message for _, wire, message in recorded(alone) if "encoders" in wire]


@pytest.mark.nightly
def test_ten_turtles_drive_at_once(tmp_path):
    places = [(1.0 + number, 9.0 - number) for number in range(10)]
    (tmp_path / "ten.yaml").write_text(
        "format: 1\nkind: pipeline\ninclude:\n"
        + "".join(
            f"  - {{path: turtle, as: turtle{number}, set: {{goals: [{{x: {x}, y: {y}}}]}}}}\n"
            for number, (x, y) in enumerate(places, 1)
        )
    )
    run = Run(load(str(tmp_path / "ten.yaml")), RunOptions(fast=True, duration=60.0))
    result = run.go()
    assert (result.ending.code, result.reached) == (0, 10)
    for robot, (x, y) in zip(run.robots, places, strict=True):
        pose = robot.truth().pose
        assert (pose.x, pose.y) == pytest.approx((x, y), abs=0.15)


def test_one_that_fails_its_goal_does_not_stop_the_other(pair):
    blocked = ["left.world.walls=[{from: [0.3, -1], to: [0.3, 1]}]"]
    result = Run(load(pair, sets=blocked), RunOptions(fast=True, duration=120.0)).go()
    assert result.reached == 1 and result.ending.code == 1
    assert any(stop.cause.startswith("left: ") for stop in result.stops)
    assert not any(stop.cause.startswith("right: ") for stop in result.stops)


def test_a_goal_of_a_client_keeps_the_run_from_ending(pair):
    run = Run(load(pair), RunOptions(fast=True, duration=40.0))
    left, right = run.robots
    left.operator.replace_goals(0, left.goals[0])
    result = run.go()
    assert result.ending.cause.startswith("time limit") and right.ending == (0, "all goals reached")
    assert left.operator.reached == 1


def test_a_stop_of_one_holds_this_one_and_a_pause_of_the_engine_all(pair):
    """As the clients' driver stops one; and as the monitor of the instants stops all."""
    setup = load(pair)
    graph = assemble(setup, False).graph
    instants = []
    limits = instant_limits(0.3, 50.0, True)
    engine = Engine(graph, [], VirtualClock(), record=instants.append, limits=limits)
    places = {wire: place for place, wire in enumerate(graph.wires, 1)}

    def stopped(name):
        stops = [instant[places[f"{name}.gate.stop"]] for instant in instants]
        return [stop.code for stop in stops if stop is not None]

    own = Stop(1, "operator_stop", "a person", True)
    engine.deliver(1, [("left.operator.halt", own)])
    assert (stopped("left"), stopped("right")) == (["operator_stop"], [])
    assert engine.monitor is not None
    engine.monitor.check_wake_up(1_000_000_000)
    engine.step(10)
    assert (stopped("left"), stopped("right")) == (["operator_stop"], ["host_frozen"])
    halts = [instant for instant in instants if instant[places["left.operator.halt"]] is not None]
    assert [instant[0] for instant in halts] == [1, 2]


class FakeRobot:
    """A robot driver that is out of reach, or confirms its stop."""

    def __init__(self, reachable):
        self.reachable, self.stopped, self.commands = reachable, False, []

    def due(self):
        return 7

    def files(self):
        return []

    def deliver(self, now):
        return []

    def close(self):
        pass

    def command(self, now, command):
        self.commands.append(command)

    def stop(self, now):
        if not self.reachable:
            raise RunError(Problem("E-DEVICE", "port", "gone", "plug it in"))
        self.stopped = True


def test_one_out_of_reach_keeps_no_other_from_being_stopped():
    robots = [FakeRobot(True), FakeRobot(False), FakeRobot(True)]
    group = RobotGroup([(str(number), robot) for number, robot in enumerate(robots)])
    with pytest.raises(RunError):
        group.stop(1)
    assert [robot.stopped for robot in robots] == [True, False, True]
    assert not group.stopped and group.due() == 7


@pytest.mark.parametrize(
    "options", [RunOptions(port="/dev/ttyUSB0"), RunOptions(port="emulated", fast=True)]
)
def test_real_robots_have_an_engine_each(pair, options):
    with pytest.raises(UserError) as caught:
        Run(load(pair), options)
    assert caught.value.problems[0].code == "E-SEVERAL-ROBOTS"
