"""Commands of the command line on running engines."""

import os
import signal
from pathlib import Path

import pytest

from diffbotctl.cli.stop import resume_result
from tests.support.command_process import children_of
from tests.support.running import PlainClient, cli, moves, running, stands

FAR = ("goal", "--stay", "--goal", "30 0")


def hub_of(folder, pid):
    """The child of `pid` that holds the control socket."""
    path = str(folder / "diffbotctl" / "test.socket")
    inodes = {
        line.split()[6] for line in Path("/proc/net/unix").read_text().splitlines() if path in line
    }
    for child in children_of(pid):
        for file in Path(f"/proc/{child}/fd").iterdir():
            if os.readlink(file).removeprefix("socket:[").removesuffix("]") in inodes:
                return child
    raise AssertionError("no child holds the socket")


def test_stop_why_resume_and_goto(tmp_path):
    with running(tmp_path, *FAR):
        client = PlainClient(tmp_path)
        client.until(moves)
        code, _, complaint = cli(tmp_path, "resume")  # of what is not stopped
        assert code == 1 and "nothing is stopped" in complaint
        assert "goal 1: driving, " in complaint and "to go" in complaint
        assert moves(client.request("status"))  # it changes nothing
        assert cli(tmp_path, "drive", "--v", "0.1", "--for", "200ms")[0] == 0
        code, out, _ = cli(tmp_path, "resume")  # nothing held it: a goal waited
        assert code == 0 and "goal 1 continues" in out
        client.until(moves)
        code, out, _ = cli(tmp_path, "stop", "the", "cat")
        assert code == 0 and "stopped" in out
        client.until(stands)
        code, out, _ = cli(tmp_path, "why")
        cause = "`diffbotctl stop` was called in another terminal: the cat."
        assert code == 0 and cause in " ".join(out.split())
        code, out, _ = cli(tmp_path, "resume")
        assert code == 0 and "released from operator_stop" in out
        client.until(moves)
        code, out, _ = cli(tmp_path, "goto", "-20cm", "0", "90deg")
        assert code == 0 and "x -0.2 m" in out and "heading 90 deg" in out
        assert client.until(lambda status: status["operator.goal"]["x"] == -0.2)


GOAL, NO_GOAL = {"number": 1}, {"number": 0}
LATCHED = {"code": "operator_stop", "cause": "the cat", "latched": True}
PASSING = {"code": "obstacle", "cause": "a wall", "latched": False}


def test_resume_before_the_link_is_up_states_when_to_call_it_again():
    status = {"held": LATCHED, "operator.goal": GOAL, "goal_state": None}
    down = {**status, "robot.link": {"state": "negotiating", "cause": ""}}
    is_done, text = resume_result(status, down)
    assert not is_done and "the link to the board is negotiating: call `resume` again" in text


@pytest.mark.parametrize(
    "before, after, done, words",
    [
        ((LATCHED, GOAL), (None, GOAL), True, "released from operator_stop: the cat"),
        ((LATCHED, NO_GOAL), (None, GOAL), True, "the cat; goal 1 continues"),
        ((LATCHED, GOAL), (LATCHED, GOAL), False, "still stopped by operator_stop: the cat"),
        # After the latched stop has ended, another stop is still in force.
        ((LATCHED, GOAL), (PASSING, GOAL), True, "now stopped by obstacle: a wall, which ends by"),
        ((PASSING, GOAL), (PASSING, GOAL), False, "obstacle: a wall; the stop ends by itself when"),
        ((None, GOAL), (None, GOAL), False, "no goal is under way"),  # no block follows goals
        ((None, None), (None, None), False, "nothing is stopped and no goal waits"),
    ],
)
def test_the_reply_to_resume_and_whether_it_did_anything(before, after, done, words):
    names = ("held", "operator.goal", "goal_state")
    statuses = [dict(zip(names, (*status, None), strict=True)) for status in (before, after)]
    assert resume_result(*statuses)[0] == done and words in resume_result(*statuses)[1]


def test_without_an_engine_and_with_several(tmp_path):
    code, _, complaint = cli(tmp_path, "resume")
    assert code == 2 and "E-NO-ENGINE" in complaint
    with running(tmp_path, *FAR, name="first"), running(tmp_path, *FAR, name="second"):
        code, _, complaint = cli(tmp_path, "why")
        assert code == 2 and "E-SEVERAL-ENGINES" in complaint and "first, second" in complaint
        code, _, complaint = cli(tmp_path, "why", "--engine", "secnd")
        assert code == 2 and "did you mean second" in complaint
        assert cli(tmp_path, "stop", "--engine", "second")[0] == 0
        first, second = PlainClient(tmp_path, "first"), PlainClient(tmp_path, "second")
        assert second.request("status")["held"] and not first.request("status")["held"]
        assert cli(tmp_path, "resume", "--engine", "second")[0] == 0
        # A stop is not refused for its options: the one that stops more counts.
        code, out, _ = cli(tmp_path, "stop", "--all", "--engine", "second")
        assert code == 0 and "first: stopped" in out and "second: stopped" in out
        assert first.request("status")["held"] and second.request("status")["held"]
        assert cli(tmp_path, "resume", "--engine", "first")[0] == 0
        code, out, _ = cli(tmp_path, "stop")  # it stops all, without a question
        assert code == 0 and "first: stopped" in out and first.request("status")["held"]
        code, _, complaint = cli(tmp_path, "run", "goal", "--name", "first")
        assert code == 1 and "E-SOCKET" in complaint and "already running" in complaint


@pytest.mark.parametrize("broken", ["hub frozen", "hub killed", "engine frozen"])
def test_stop_works_when_everything_else_is_broken(tmp_path, broken):
    with running(tmp_path, *FAR) as process:
        PlainClient(tmp_path).until(moves)
        hub = hub_of(tmp_path, process.pid)
        if broken == "hub frozen":
            os.kill(hub, signal.SIGSTOP)
        elif broken == "hub killed":
            os.kill(hub, signal.SIGKILL)
        else:
            os.kill(process.pid, signal.SIGSTOP)
        code, out, complaint = cli(tmp_path, "stop")
        assert code == 0, complaint
        assert "ended" in out and process.wait(timeout=60) == 130
        rest = process.stdout.read()
        assert "final stop confirmed" in rest
        # The black box is lost with a server process that was killed, and the run reports that; one
        # that was suspended is resumed at the end.
        assert ("BLACK BOX STOPPED" in rest) == (broken == "hub killed")
    assert not list((tmp_path / "diffbotctl").glob("test.socket"))


def test_a_named_run_without_pace_is_watched_and_stopped_but_not_driven(tmp_path):
    with running(tmp_path, "square", "--fast", "--stay"):
        client = PlainClient(tmp_path)
        before = client.request("status")
        assert before["paced"] is False
        reply = client.request("drive", linear=0.1)
        assert not reply["ok"] and "without --fast" in reply["fix"]
        client.until(lambda status: status["time"] > before["time"])
        code, output, complaint = cli(tmp_path, "stop")
        assert code == 0 and "stopped" in output, complaint


def test_a_killed_engine_leaves_no_name_behind(tmp_path):
    with running(tmp_path, *FAR) as process:
        hub = hub_of(tmp_path, process.pid)
        os.kill(hub, signal.SIGKILL)  # it removes no file
        process.kill()
        process.wait()
    assert (tmp_path / "diffbotctl" / "test.socket").exists()
    assert "E-NO-ENGINE" in cli(tmp_path, "resume")[2]
    with running(tmp_path, *FAR):
        assert PlainClient(tmp_path).request("status")["ok"]
