"""RobotClient: what the page shows, the commands, and what stops the robot when a program ends."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from diffbotctl.client import RobotClient
from diffbotctl.errors import RunError
from tests.support.running import PlainClient, command, moves, release, running, stands

PAGE = Path(__file__).parents[2] / "docs" / "python.md"
PROGRAM = re.compile(r"^```python\n(# (\S+)\n.*?)^```", re.M | re.S)
DRIVING = """
from diffbotctl.client import RobotClient
with RobotClient(name="mine") as robot:
    robot.drive(linear=0.1, seconds=60.0)
"""


@pytest.fixture(scope="module")
def engine(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run", numbered=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(folder))
        with running(folder, "goal", "--stay", "--set", "goals=[]"):
            yield folder


@pytest.fixture
def plain(engine):
    release(engine)
    client = PlainClient(engine)
    yield client
    client.close()


def test_topics_parameters_and_actions(engine):
    with RobotClient() as robot:
        assert robot.topics()["odometry.odometry"] == "Odometry"
        assert robot.read("odometry.odometry")["x"] == pytest.approx(0.0, abs=0.5)
        times = [message["time"] for message in robot.messages("odometry.odometry", 0.5)]
        assert len(times) > 2 and times == sorted(set(times))
        robot.set_parameter("guard.margin", "8 cm")
        assert robot.call("odometry.set_pose", x=0.0, y=0.0, heading=0.0) is None
        while robot.parameters()["guard.margin"] != 0.08:
            time.sleep(0.01)
        for refused in (
            lambda: robot.read("odometry.nothing"),
            lambda: robot.publish("robot.wheels", left=1.0),
            lambda: robot.set_parameter("guard.margin", "8 kg"),
            lambda: robot.call("odometry.fly"),
            lambda: robot.drive(linear=9.0),
        ):
            with pytest.raises(RunError, match="E-REQUEST"):
                refused()


def test_drive_and_goto_end_at_rest_and_leave_no_stop(engine, plain):
    with RobotClient() as robot:
        before = robot.read("odometry.odometry")
        robot.drive(linear=0.1, seconds=1.0)
        plain.until(stands)
        assert robot.read("odometry.odometry")["x"] - before["x"] > 0.02
        robot.goto(before["x"] + 0.25, before["y"])
        assert robot.read("odometry.odometry")["x"] - before["x"] == pytest.approx(0.25, abs=0.05)
    assert plain.request("status")["held"] is None


def test_leaving_with_a_goal_under_way_stops_the_robot(engine, plain):
    with pytest.raises(ZeroDivisionError), RobotClient(name="mine") as robot:
        signal.signal(signal.SIGALRM, lambda number, frame: 1 // 0)
        signal.setitimer(signal.ITIMER_REAL, 1.0)
        robot.goto(3.0, 0.0)
    held = plain.until(lambda status: status["held"])["held"]
    assert held["code"] == "operator_stop"
    assert "mine" in held["cause"] and "ended with ZeroDivisionError" in held["cause"]
    plain.until(stands)


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGSTOP])
def test_a_dead_program_stops_the_robot(engine, plain, end):
    _, environment = command(engine)
    with subprocess.Popen([sys.executable, "-c", DRIVING], env=environment) as program:
        plain.until(
            lambda status: any(
                line["text"].endswith("is driving")
                for line in plain.request("read_log", block="operator", last=1)["lines"]
            )
        )
        program.send_signal(end)
        held = plain.until(lambda status: status["held"])["held"]
        assert held["code"] == "operator_lost" and "mine" in held["cause"]
        plain.until(stands)
        program.kill()


def test_a_program_of_the_pipeline_opens_the_engine_that_started_it(tmp_path):
    pipeline = tmp_path / "tour.yaml"
    pipeline.write_text(
        "format: 1\nkind: pipeline\ninclude: goal\ngoals: []\n"
        f"programs:\n  tour: {{run: {sys.executable} tour.py}}\n"
    )
    (tmp_path / "tour.py").write_text(DRIVING)
    # Another engine runs, whose name comes first: the program does not take that one.
    with (
        running(tmp_path, "goal", "--stay", "--set", "goals=[]", name="a"),
        running(tmp_path, str(pipeline), "--stay", "--allow-programs"),
    ):
        client = PlainClient(tmp_path)

        def moves_in_the_end(status):
            """A busy computer may let the program wait for 0.3 s; it is started again."""
            if status["held"] and status["held"]["code"] == "operator_lost":
                client.request("resume")
            return moves(status)

        client.until(moves_in_the_end)
        assert stands(PlainClient(tmp_path, "a").request("status"))


def test_the_program_on_the_page(tmp_path):
    (match,) = PROGRAM.finditer(PAGE.read_text())
    (tmp_path / match[2]).write_text(match[1])
    with running(tmp_path, "turtle", sets=()):
        _, environment = command(tmp_path)
        done = subprocess.run(
            [sys.executable, match[2]],
            env={**environment, "PYTHONPATH": os.getcwd()},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert done.returncode == 0, done.stderr
        x, y = map(float, re.findall(r"[xy] (\d+\.\d+) m", done.stdout))
        client = PlainClient(tmp_path)
        pose = client.request("describe_topic", topic="robot.pose")["last"]
        assert (x - pose["x"]) ** 2 + (y - pose["y"]) ** 2 > 0.3  # it drove, and went home
        assert client.request("status")["held"] is None
