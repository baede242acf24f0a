"""`--at HOST`: commands through a real ssh to an engine; the link frozen, cut and refused."""

import re
import signal
import subprocess
import time

import pytest

from diffbotctl.control_socket.command_driver import DRIVE_TIMEOUT, is_late
from diffbotctl.control_socket.far_engine import EngineTime
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.time import SECOND as S
from tests.support.far_host import far_host
from tests.support.lost_terminal import drive, last_command_and_motion
from tests.support.running import PlainClient, cli, command, moves, running, stands
from tests.support.terminal import Terminal


@pytest.fixture
def far(tmp_path, monkeypatch):
    """The server of the other computer; this one's own folder has no engine."""
    (tmp_path / "there").mkdir()
    (tmp_path / "here").mkdir()
    with far_host(tmp_path / "ssh", tmp_path / "there") as (server, path):
        monkeypatch.setenv("PATH", path)
        yield server
        server.send_signal(signal.SIGCONT)


def here(tmp_path, *words, **options):
    return cli(tmp_path / "here", *words, "--at", "robot", **options)


def stopped(tmp_path, *words):
    """What `stop` prints; on a busy machine ssh may take longer than it waits for an answer."""
    for _ in range(10):
        code, out, err = here(tmp_path, "stop", *words)
        if code == 0:
            return out
        assert "NOT KNOWN whether the robot has stopped" in err, err
    raise AssertionError(err)


def driven(tmp_path):
    """What `drive` prints; a busy machine may have delayed a command by more than its lease."""
    for _ in range(10):
        code, out, err = here(tmp_path, "drive", "--speed", "0.1", "--for", "1s")
        if code == 0:
            return out
        assert "E-HELD" in err or "E-LATE" in err, err
        here(tmp_path, "resume")
    raise AssertionError(err)


def test_every_command_reaches_the_far_engine_and_the_person_is_named(tmp_path, far):
    there = tmp_path / "there"
    with running(there, "goal", "--stay", "--goal", "0 0"):
        watcher = PlainClient(there)
        assert "odometry.odometry" in here(tmp_path, "topic", "list")[1]
        code, out, _ = here(tmp_path, "topic", "echo", "odometry.odometry", "--once")
        assert code == 0 and "heading" in out
        assert float(re.search(r"driven (\S+) m", driven(tmp_path))[1]) > 0.0
        assert here(tmp_path, "goto", "5", "0")[0] == 0
        watcher.until(moves)
        output = "robot: test: stopped; `diffbotctl resume` allows motion again\n"
        assert stopped(tmp_path, "that is", "enough") == output
        assert stands(watcher.request("status"))
        code, out, _ = here(tmp_path, "why")
        assert code == 0 and re.search(r"diffbotctl stop of \S+@\S+", " ".join(out.split()))
        lines = [line["text"] for line in watcher.request("read_log")["lines"]]
        assert any(re.search(r"drive of \S+@\S+ .*is driving", text) for text in lines)
        assert here(tmp_path, "resume")[0] == 0
        file = tmp_path / "far.mcap"
        code, out, err = here(tmp_path, "bag", "record", "gate.*", "--for", "1s", "--output", file)
        assert code == 0, err
        assert any(m.wire == "gate.wheels" for m in RecordingReader(file).messages())
        assert here(tmp_path, "bag", "save")[0] == 0
        code, out, _ = here(tmp_path, "dash", "--once")
        assert code == 0 and "pose" in out


@pytest.mark.parametrize("screen", ["dash", "teleop"])
def test_a_screen_drives_a_far_robot(tmp_path, far, screen):
    with running(tmp_path / "there", "goal", "--stay", "--goal", "30 0"):
        watcher = PlainClient(tmp_path / "there")
        line, environment = command(tmp_path / "here", screen, "--at", "robot", "--mode", "hold")
        with Terminal(line, environment) as terminal:
            terminal.until(lambda text: "pose" in text, "the first picture")
            drive(terminal, watcher, "hold")
            far.send_signal(signal.SIGSTOP)  # nothing passes any more, as through a cut link
            held = watcher.until(lambda status: status["held"] and stands(status))["held"]
            assert held["code"] == "operator_lost" and re.search(
                screen + r" of \S+@", held["cause"]
            )


@pytest.mark.parametrize("how", ["frozen", "killed"])
def test_a_lost_link_stops_the_robot_and_nothing_late_drives(tmp_path, far, how):
    there, file = tmp_path / "there", tmp_path / "lost.mcap"
    with running(there, "goal", "--stay", "--goal", "0 0", "--record", str(file)) as run:
        watcher = PlainClient(there)
        words = ["drive", "--speed", "0.1", "--for", "60s", "--at", "robot"]
        line, environment = command(tmp_path / "here", *words)
        driver = subprocess.Popen(line, env=environment, stderr=subprocess.PIPE, text=True)
        watcher.until(moves)
        lost_at = watcher.request("status")["time"]
        far.send_signal(signal.SIGSTOP if how == "frozen" else signal.SIGKILL)
        held = watcher.until(lambda status: status["held"] and stands(status))["held"]
        assert held["code"] == "operator_lost" and "drive of" in held["cause"]
        # What waits on the way is now older than its lease.
        watcher.until(lambda status: status["time"] > lost_at + S)
        assert watcher.request("resume")["ok"]
        healed_at = watcher.request("status")["time"]
        far.send_signal(signal.SIGCONT) if how == "frozen" else None
        _, err = driver.communicate(timeout=60)
        assert driver.returncode and any(code in err for code in ("E-SSH", "E-LATE", "E-HELD")), err
        watcher.until(lambda status: status["time"] > healed_at + S)
        run.terminate()
        run.wait(timeout=60)
    command_at, motion_at = last_command_and_motion(file)
    assert 0 < command_at < healed_at  # also after the link works again
    assert motion_at <= command_at + DRIVE_TIMEOUT


def test_stop_over_a_dead_link_reports_it_within_three_seconds(tmp_path, far):
    with running(tmp_path / "there", "goal", "--stay", "--goal", "9 0"):
        PlainClient(tmp_path / "there").until(moves)
        far.send_signal(signal.SIGSTOP)
        line, environment = command(tmp_path / "here", "stop", "--at", "robot")
        begin = time.monotonic()
        done = subprocess.run(line, env=environment, capture_output=True, text=True, timeout=60)
        took = time.monotonic() - begin
        assert done.returncode == 1 and "NOT KNOWN whether the robot has stopped" in done.stderr
        assert "switch it off" in done.stderr
        assert took < 30  # it ends by itself, on an idle machine within 3 s


def test_stop_without_a_name_stops_all_engines_there(tmp_path, far):
    there = tmp_path / "there"
    words = ["goal", "--stay", "--goal", "9 0"]
    with running(there, *words, name="left"), running(there, *words, name="right"):
        clients = [PlainClient(there, name) for name in ("left", "right")]
        for client in clients:
            client.until(moves)
        out = stopped(tmp_path)
        assert "left: stopped" in out and "right: stopped" in out
        assert all(stands(client.request("status")) for client in clients)
        code, _, err = here(tmp_path, "goto", "1", "0")
        assert code == 2 and "E-SEVERAL-ENGINES" in err and "--engine left" in err
        assert here(tmp_path, "resume", "--engine", "left")[0] == 0


@pytest.mark.nightly
def test_stop_at_several_computers_prints_each_answer(tmp_path, far):
    there = tmp_path / "there"
    with running(there, "goal", "--stay", "--goal", "9 0"):
        client = PlainClient(there)
        client.until(moves)
        words = ("--at", "robot", "--at", "ann@nowhere.invalid")
        code, out, err = cli(tmp_path / "here", "stop", *words)
        assert code == 1 and "robot: test: stopped" in out, err
        assert "ann@nowhere.invalid  E-SSH" in err and "NOT KNOWN" in err
        client.until(stands)
        words = ("--at", "robot", "--at", "tester@robot")  # two names of one computer
        code, out, err = cli(tmp_path / "here", "stop", *words)
        assert code == 0, err
        assert sorted(line.partition(";")[0] for line in out.splitlines()) == [
            "robot: test: stopped",
            "tester@robot: test: stopped",
        ]
    code, _, err = cli(tmp_path / "here", "stop", "--at", "robot", "--at", "-oProxyCommand=x")
    assert code == 1 and "is no host" in err and "no engine runs there" in err


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (["--at", "ann@nowhere.invalid"], 1, "E-SSH"),
        (["--at", "-oProxyCommand=touch x"], 2, "is no host"),
        (["--at", "robot"], 2, "no engine runs there"),
        (["--at", "robot", "--engine", "mower"], 2, "no engine called 'mower'"),
    ],
)
def test_what_cannot_be_reached_is_explained(tmp_path, far, words, code, text):
    result, _, err = cli(tmp_path / "here", "topic", "list", *words)
    assert (result, text in err) == (code, True), err
    assert "Traceback" not in err and not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("now", "stamp", "lease", "late"),
    [
        (5 * S, None, None, False),  # a client that does not say when
        (5 * S, 4.8 * S, None, False),
        (5 * S, 4.6 * S, None, True),
        (5 * S, 4.6 * S, 0.5, False),
        (5 * S, 9.0 * S, 0.3, False),
    ],
)
def test_a_command_is_late_after_its_lease(now, stamp, lease, late):
    assert is_late(now, stamp, lease) is late


def test_the_engine_s_time_is_never_reported_too_late():
    clock = EngineTime()
    assert clock.lease() == {}
    clock.note({"time": 10 * S})
    clock.note({"message": {"time": 5 * S}})  # one that waited on the way
    clock.note({"ok": True})
    fields = clock.lease()
    assert 10 * S <= fields["time"] < 20 * S and fields["lease"] == 0.3
