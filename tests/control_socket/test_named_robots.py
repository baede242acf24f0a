"""Several robots of one pipeline, each with a control socket of its own."""

import json
import signal
import subprocess

import pytest

from tests.support.background import repeating
from tests.support.running import PlainClient, cli, command, moves, running, stands

PAIR = """format: 1
kind: pipeline
include:
  - {path: goal, as: left, set: {world.walls: [], goals: [{x: 30 m}]}}
  - {path: goal, as: right, set: {world.walls: [], goals: [{x: 30 m}]}}
"""


@pytest.fixture
def pair(tmp_path):
    (tmp_path / "pair.yaml").write_text(PAIR)
    words = (str(tmp_path / "pair.yaml"), "--stay", "--record", str(tmp_path / "run.mcap"))
    with running(tmp_path, *words, sets=()) as process:
        clients = [PlainClient(tmp_path, f"test-{name}") for name in ("left", "right")]
        yield clients
        process.send_signal(signal.SIGINT)
        process.wait(60)
    code, out, err = cli(tmp_path, "replay", str(tmp_path / "run.mcap"), "--check")
    assert code == 0 and "bit for bit" in out, err  # with all that the clients did


def moves_again(client):
    """Wait until the robot moves; a busy machine may have stopped it for a reason of its own."""
    for _ in range(20):
        if moves(client.request("status")):
            return
        client.request("resume")
        client.until(lambda status: moves(status) or status["held"])
    raise AssertionError(client.request("status"))


def test_a_stop_of_one_is_not_that_of_the_other_and_stop_without_a_name_stops_all(tmp_path, pair):
    left, right = pair
    for client in pair:
        moves_again(client)
    code, out, err = cli(tmp_path, "stop", "--engine", "test-left", "enough")
    assert code == 0 and out.startswith("test-left: stopped"), err
    assert stands(left.request("status"))
    assert "enough" in left.request("status")["held"]["cause"]
    moves_again(right)
    assert stands(left.request("status"))
    code, out, err = cli(tmp_path, "stop")
    assert code == 0 and "test-left: stopped" in out and "test-right: stopped" in out, err
    assert all(stands(client.request("status")) for client in pair)
    for client, name in zip(pair, ("test-left", "test-right"), strict=True):
        assert cli(tmp_path, "resume", "--engine", name)[0] == 0
        moves_again(client)
    names = ("--engine", "test-left", "--engine", "test-absent", "--engine", "test-right")
    code, out, err = cli(tmp_path, "stop", *names)
    assert code == 1 and "test-absent" in err
    assert "test-left: stopped" in out and "test-right: stopped" in out
    assert all(stands(client.request("status")) for client in pair)
    code, _, err = cli(tmp_path, "resume")
    assert code == 2 and "E-SEVERAL-ENGINES" in err
    assert cli(tmp_path, "resume", "--engine", "test-right")[0] == 0
    moves_again(right)
    assert stands(left.request("status"))


def test_who_is_lost_while_driving_one_stops_this_one(tmp_path, pair):
    left, right = pair
    line, environment = command(
        tmp_path, "drive", "--engine", "test-left", "--speed", "0.1", "--for", "60s"
    )
    for _ in range(10):  # a busy machine may have stopped the robot: then it is resumed
        left.request("resume")
        driver = subprocess.Popen(
            line, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )

        def drives(status, driver=driver):
            withdrawn = status["operator.goal"]["number"] == 0
            return withdrawn or driver.poll() is not None

        left.until(drives)
        is_driving = driver.poll() is None
        driver.send_signal(signal.SIGKILL)
        driver.wait()
        if is_driving:
            break
    left.until(lambda status: status["held"] and status["held"]["code"] == "operator_lost")
    assert right.request("status")["operator.goal"]["number"] == 1
    moves_again(right)
    assert stands(left.request("status"))


def test_names_of_one_robot_are_those_of_its_own_pipeline(tmp_path, pair):
    left, right = pair
    topics = [row["topic"] for row in left.request("list_topics")["topics"]]
    assert {"odometry.odometry", "gate.stop", "robot.encoders", "log"} <= set(topics)
    code, out, err = cli(tmp_path, "engines", "--json")
    rows = [json.loads(row) for row in out.splitlines()]
    assert code == 0, err
    assert [(row["engine"], row["pipeline"]) for row in rows] == [
        ("test-left", "goal"),
        ("test-right", "goal"),
    ]
    reply = left.request("set_parameter", parameter="guard.margin", value=0.07)
    assert reply["ok"]

    def tolerance(client):
        rows = client.request("list_parameters")["parameters"]
        return {row["parameter"]: row["value"] for row in rows}["guard.margin"]

    left.until(lambda status: tolerance(left) == 0.07)
    assert tolerance(right) != 0.07
    left.until(lambda status: left.request("read_log")["lines"])
    for client in pair:
        sources = {line["source"] for line in client.request("read_log", last=500)["lines"]}
        assert "operator" in sources and not any("." in source for source in sources)
    assert left.request("call_action", action="robot.home")["ok"]
    code, _, err = cli(tmp_path, "bag", "save", "--engine", "test-right")
    assert code != 0 and "the first of several robots keeps it" in err


LED = """format: 1
kind: pipeline
include: goal
goals: []
world: {walls: []}
inputs: {lead: {type: Twist, timeout: 0.3 s}}
blocks: {mux: {in: {autonomous: input.lead}}}
"""


def test_inputs_of_the_same_name_belong_to_one_robot_each(tmp_path):
    (tmp_path / "led.yaml").write_text(LED)
    includes = "".join(f"  - {{path: ./led.yaml, as: {name}}}\n" for name in ("left", "right"))
    (tmp_path / "pair.yaml").write_text(f"format: 1\nkind: pipeline\ninclude:\n{includes}")
    recording = tmp_path / "run.mcap"
    words = (str(tmp_path / "pair.yaml"), "--stay", "--record", str(recording))
    with running(tmp_path, *words, sets=()) as process:
        left, right, leader = (
            PlainClient(tmp_path, f"test-{n}") for n in ("left", "right", "left")
        )
        fields = {"topic": "input.lead", "message": {"linear": 0.1, "angular": 0.0}}
        line = json.dumps({"method": "publish", **fields})
        with repeating(lambda: leader.send(line), 0.05):
            left.until(moves)
            assert stands(right.request("status")) and not right.request("status")["held"]
        leader.close()  # a robot whose leader has gone is stopped; the other one is not
        left.until(lambda status: status["held"] and status["held"]["code"] == "input_stale")
        assert right.request("status")["held"] is None
        process.send_signal(signal.SIGINT)
        process.wait(60)
    code, out, err = cli(tmp_path, "replay", str(recording), "--check")
    assert code == 0 and "bit for bit" in out, err


def test_a_robot_is_named_in_front_of_its_goal(tmp_path, pair):
    code, out, err = cli(tmp_path, "goto", "test-right", "0.3", "0", "90deg")
    assert code == 0 and "x 0.3 m" in out, err
    left, right = pair

    def goal(client):
        return client.request("snapshot")["messages"]["operator.goal"]["x"]

    right.until(lambda status: goal(right) == 0.3)
    assert goal(left) == 30.0
    code, _, err = cli(tmp_path, "goto", "middle", "1", "0")
    assert code == 2 and "no engine 'middle'" in " ".join(err.split())
    code, _, err = cli(tmp_path, "goto", "test-left", "1", "0", "--engine", "test-right")
    assert code == 2 and "either" in err
