"""topic, param, call, drive, blocks and graph on a running engine, on the command line."""

import json
import re
from math import radians

import pytest

from tests.support.running import PlainClient, cli, command, moves, release, running, stands
from tests.support.terminal import Terminal


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    runtime_folder = tmp_path_factory.mktemp("tools")
    with running(runtime_folder, "goal", "--stay", "--goal", "0 0"):  # it is there already
        client = PlainClient(runtime_folder)
        client.until(lambda status: status["time"] > 200_000_000)  # ns: rates need some frames
        yield runtime_folder


@pytest.fixture(autouse=True)
def released(folder):
    release(folder)


def test_topics_are_listed_with_types_and_rates(folder):
    code, out, _ = cli(folder, "topic", "list", "--json")
    rows = {row["topic"]: row for row in map(json.loads, out.splitlines())}
    assert code == 0 and rows["odometry.odometry"]["type"] == "Odometry"
    assert 36 < rows["robot.encoders"]["rate"] < 44  # this board sends 40 a second
    assert rows["operator.path"]["age"] is None


@pytest.mark.parametrize(
    "topic, known",
    [("odometry.odometry", set()), ("/odom", {"odometry.odometry is"}), ("/odom.x", None)],
)
def test_echo_once(folder, topic, known):
    code, out, complaint = cli(folder, "topic", "echo", topic, "--once", "--json")
    if known is None:
        assert code == 1 and "no topic" in complaint
        return
    message = json.loads(out)
    assert code == 0 and set(message) >= {"time", "x", "y", "heading"}
    assert not known or "/odom is odometry.odometry here" in complaint


def test_echo_of_a_field_and_for_a_time(folder):
    topic = ("topic", "echo", "odometry.odometry.covariance.0", "--json")
    for seconds in (1, 4, 16):  # on a busy computer few messages come in one second
        code, out, _ = cli(folder, *topic, "--for", f"{seconds}s")
        values = [json.loads(line) for line in out.splitlines()]
        assert code == 0 and all(isinstance(value, float) for value in values)
        if len(values) > 10:
            break
    assert len(values) > 10
    code, _, complaint = cli(folder, "topic", "echo", "odometry.odometry.z", "--once")
    assert code == 2 and "no field 'z'" in complaint


def test_on_a_terminal_a_message_is_one_line(folder):
    line, environment = command(folder, "topic", "echo", "odometry.odometry")
    with Terminal(line, environment) as terminal:
        text = terminal.until(lambda text: text.count(" s  x ") > 20, "20 messages")
    rows = [row.rstrip() for row in text.strip().split("\n")]
    assert all(re.fullmatch(r"[\d.]+ s  x .*m  y .*  \.{3}", row) for row in rows[:-1])
    code, out, _ = cli(folder, "topic", "echo", "odometry.odometry", "--once")
    assert code == 0 and "covariance [" in out and "..." not in out


def test_hz_and_type(folder):
    assert "Hz" in cli(folder, "topic", "hz", "odometry.odometry", "--once")[1]
    out = cli(folder, "topic", "type", "/cmd_vel")[1]
    assert out.startswith("operator.twist  Twist") and "rad/s" in out
    code, _, complaint = cli(folder, "topic", "hz", "odometri.odometry")
    assert code == 1 and "did you mean odometry.odometry" in complaint


@pytest.mark.parametrize(
    "topic, words",
    [
        ("robot.wheels", "driver's input"),
        ("gate.wheels", "driver's input"),
        ("robot.encoders", "only robot publishes"),
        ("odometry.odometry", "only odometry publishes"),
        ("operator.setting", "only operator publishes"),
    ],
)
def test_topics_of_others_cannot_be_published(folder, topic, words):
    message = '{"left": 5, "right": 5}'
    code, _, complaint = cli(folder, "topic", "pub", topic, message)
    assert code == 1 and words in " ".join(complaint.split())
    assert stands(PlainClient(folder).request("status"))


def test_a_goal_can_be_published(folder):
    client = PlainClient(folder)
    before = client.request("status")["operator.goal"]["number"]
    code, _, complaint = cli(folder, "topic", "pub", "/goal", '{"x": 0.0, "y": 0.0}')
    assert code == 0, complaint
    client.until(lambda status: status["operator.goal"]["number"] == before + 1)


def test_one_velocity_moves_the_robot_and_expires(folder):
    client = PlainClient(folder)
    before = client.request("snapshot")["messages"]["odometry.odometry"]["x"]
    code, _, complaint = cli(folder, "topic", "pub", "operator.twist", '{"linear": 0.2}')
    assert code == 0, complaint
    assert client.until(stands)["held"] is None
    assert client.request("snapshot")["messages"]["odometry.odometry"]["x"] != before


def test_live_parameters_are_set_and_the_others_are_not(folder):
    assert cli(folder, "param", "set", "guard.margin", "8 cm")[0] == 0
    PlainClient(folder).request("status")
    assert json.loads(cli(folder, "param", "get", "guard.margin", "--json")[1])["value"] == 0.08
    for parameter, value, words in (
        ("guard.margin", "0", "at least 0.01 m"),
        ("guard.margin", "-1", "at least 0.01 m"),
        ("guard.margin", "80", "did you mean 80 mm?"),
        ("guard.margin", "8", "8 without a unit is 8 m; did you mean 8 cm? For metres write 8m"),
        ("guard.margin", "none", "must be a number"),
        ("robot.limits.speed", "5", "run again with --set robot.limits.speed="),
        ("limits.speed", "5", "run again with --set robot.limits.speed="),
        ("guard.margin", "2 s", "is a time"),
        ("guard.resume", "never", "one of by_itself, wait"),
        ("guard.debounce", "1.5", "whole number"),
        ("gate.command_timeout", "0.5", "cannot change while running"),
        ("guard.margn", "1", "did you mean guard.margin"),
    ):
        code, _, complaint = cli(folder, "param", "set", parameter, value)
        assert code == 1 and words in " ".join(complaint.split()), complaint


def test_changed_parameters_are_saved_and_load_again(folder, tmp_path):
    from diffbotctl.config.load import load

    assert cli(folder, "param", "set", "guard.resume", "wait")[0] == 0
    code, _, complaint = cli(folder, "param", "save")
    assert code == 2 and "ships with diffbotctl" in complaint
    mine = tmp_path / "mine.yaml"
    code, out, complaint = cli(folder, "param", "save", "guard.resume", "--to", str(mine))
    assert code == 0 and "guard.resume: wait" in out, complaint
    guard = next(use for use in load(str(mine)).blocks if use.name == "guard")
    assert guard.values["resume_by"] == "wait" and guard.values["margin"] == 0.05


def test_saving_into_ones_own_file_keeps_its_comments(tmp_path):
    mine = tmp_path / "mine.yaml"
    before = "format: 1\nkind: pipeline\ninclude: goal\n# my robot brakes late\ngoals: []\n"
    mine.write_text(before)
    with running(tmp_path, str(mine)):
        assert cli(tmp_path, "param", "set", "guard.margin", "7cm")[0] == 0
        assert cli(tmp_path, "param", "save")[0] == 0
    assert mine.read_text() == before + "blocks: {guard: {with: {margin: 0.07 m}}}\n"


def test_actions_are_called_and_wrong_ones_refused(folder):
    assert "odometry.set_pose [x=m] [y=m] [heading=rad]" in cli(folder, "call")[1]
    assert cli(folder, "call", "robot.teleport", "x=0.5")[0] == 0
    code, _, complaint = cli(folder, "call", "odometry.set_pose", "x=0.5", "heading=90deg")
    assert code == 0, complaint
    x = json.loads(cli(folder, "topic", "echo", "odometry.odometry.x", "--once", "--json")[1])
    assert x == pytest.approx(0.5, abs=0.01)
    code, _, complaint = cli(folder, "call", "odometry.set_pose", "z=1")
    assert code == 1 and "no field 'z'" in complaint
    assert "no action 'odometry.explode'" in cli(folder, "call", "odometry.explode")[2]
    complaint = cli(folder, "call", "/clear")[2]
    assert "no action '/clear'" in complaint
    code, done, complaint = cli(folder, "call", "/reset")
    assert code == 0, complaint
    assert done.splitlines() == ["robot.home: done", "odometry.set_pose: done"]


@pytest.mark.parametrize(
    "words, seen",
    [
        (["--v", "0.05", "--distance", "10cm"], lambda d, t: abs(d - 0.1) < 0.04),
        (["--v", "-0.15", "--for", "1s"], lambda d, t: 0.02 < d < 0.25),
        (["--w", "30deg/s", "--angle", "90deg"], lambda d, t: abs(t - 1.571) < 0.25),
    ],
)
def test_drive_for_a_distance_a_time_and_an_angle(folder, words, seen):
    code, out, complaint = cli(folder, "drive", *words)
    assert code == 0, complaint
    _, driven, _, _, turned, _ = out.replace(",", "").split()
    assert seen(float(driven), radians(float(turned)))
    status = PlainClient(folder).until(stands)
    assert status["held"] is None  # letting go in good order holds nothing


def test_drive_beyond_the_limits_is_refused(folder):
    code, _, complaint = cli(folder, "drive", "--v", "3", "--for", "1s")
    assert code == 1 and "limit of 0.3 m/s" in complaint
    assert not moves(PlainClient(folder).request("status"))


def test_blocks_and_graph_show_rates(folder):
    assert "Odometry" in cli(folder, "blocks", "--live")[1]
    out = cli(folder, "graph", "--live")[1]
    assert "robot.encoders" in out and "Hz" in out and "-> robot.wheels" in out
