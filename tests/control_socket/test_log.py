"""The log and the processor load of blocks on a running engine."""

import json
import signal
import subprocess
import time

import pytest

from tests.support.forked_command import ForkedCommand
from tests.support.running import (
    REPLY_TIMEOUT_S,
    PlainClient,
    cli,
    command,
    moves,
    running,
    stands,
)

FAR = ["goal", "--goal", "30 0"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    runtime_folder = tmp_path_factory.mktemp("log")
    with running(runtime_folder, "goal", "--stay", "--goal", "0 0"):
        PlainClient(runtime_folder).until(lambda status: status["time"] > 200_000_000)  # ns
        yield runtime_folder


def follow(folder, *words):
    """`diffbotctl log words` as a process whose lines can be read as they come."""
    line, environment = command(folder, "log", "--json", *words)
    return ForkedCommand(line[3:], env=environment, stdout=subprocess.PIPE)


def until(ask, seen):
    """Ask again and again until `seen(answer)`, which it must become in REPLY_TIMEOUT_S."""
    deadline = time.monotonic() + REPLY_TIMEOUT_S
    while not seen(answer := ask()):
        assert time.monotonic() < deadline, answer
    return answer


def read_until(stream, seen):
    """The first line of JSON of which `seen` is true; fails when the stream ends without it."""
    for text in stream:
        line = json.loads(text)
        if seen(line):
            return line
    raise AssertionError("it ended without that line")


def test_earlier_lines_are_printed_and_no_others(folder):
    code, out, _ = cli(folder, "log", "--once", "--json")
    reply = [json.loads(line) for line in out.splitlines()]
    assert code == 0 and set(reply[0]) == {"time", "level", "source", "text"}
    assert "goal 1 accepted: x 0.000 m  y 0.000 m" in {line["text"] for line in reply}
    assert {"operator", "robot", "follower"} <= {line["source"] for line in reply}
    assert len(cli(folder, "log", "--once", "--last", "1")[1].splitlines()) == 1
    assert cli(folder, "log", "--once", "--last", "0")[1] == ""


def test_by_level_and_by_block(folder):
    client = PlainClient(folder)
    assert client.request("stop", reason="someone tests")["ok"]
    client.until(lambda status: status["held"] is not None)
    errors = client.request("read_log", level="error")["lines"]
    assert errors[-1]["source"] == "gate" and "someone tests" in errors[-1]["text"]
    assert {line["level"] for line in errors} == {"error"}
    robot = client.request("read_log", block="robot")["lines"]
    assert {line["source"] for line in robot} == {"robot"}
    assert client.request("resume")["ok"]
    client.until(lambda status: status["held"] is None)
    row = next(row for row in client.request("list_blocks")["blocks"] if row["block"] == "gate")
    assert row["last_error"] == errors[-1]


def test_following_shows_an_event_as_it_happens(folder):
    process = follow(folder, "--block", "operator")
    try:
        read_until(process.stdout, lambda line: "goal 1 accepted" in line["text"])
        # Earlier lines are printed once the stream has begun, so the next line comes by the stream.
        assert PlainClient(folder).request("set_parameter", parameter="guard.margin", value="6 cm")[
            "ok"
        ]
        line = read_until(process.stdout, lambda line: "guard.margin" in line["text"])
        assert line["text"] == "guard.margin = 0.06" and line["source"] == "operator"
    finally:
        process.kill()
        process.communicate()


def test_the_log_names_the_client_that_begins_and_ends_driving(folder):
    client = PlainClient(folder)
    assert client.request("drive", linear=0.05, angular=0.0)["ok"]
    assert client.request("release")["ok"]
    client.until(stands)
    reply = until(
        lambda: [line["text"] for line in client.request("read_log", block="operator")["lines"]],
        lambda reply: reply[-1].endswith("released control"),  # it may come after the reply
    )
    assert reply[-2].startswith("plain (process ") and reply[-2].endswith("is driving")


def test_echo_and_the_ros_name_show_the_same_wire(folder):
    code, out, _ = cli(folder, "topic", "echo", "log", "--once", "--json")
    assert code == 0 and json.loads(out)["level"] in ("info", "warning", "error")
    assert cli(folder, "topic", "echo", "log.text", "--once", "--json")[1].startswith('"')
    assert "/rosout is log here" in cli(folder, "topic", "echo", "/rosout", "--once")[2]
    assert "LogLine" in cli(folder, "topic", "type", "log")[1]


@pytest.mark.parametrize(
    "words, complaint",
    [
        (["level", "gard", "debug"], "did you mean guard"),
        (["level", "guard", "loud"], "is not one of"),
        (["--once", "--block", "gard"], "did you mean guard"),
    ],
)
def test_unknown_blocks_and_levels_are_reported(folder, words, complaint):
    code, _, reply = cli(folder, "log", *words)
    assert code in (1, 2) and complaint in " ".join(reply.split())


@pytest.mark.parametrize(
    "asked, complaint",
    [
        ({"method": "read_log", "last": -1}, "0 to 500"),
        ({"method": "read_log", "last": 1e9}, "0 to 500"),
        ({"method": "read_log", "last": "all"}, "finite number"),
        ({"method": "read_log", "level": "loud"}, "no level 'loud'"),
        ({"method": "set_log_level", "block": "guard", "level": "Debug"}, "no level 'Debug'"),
        ({"method": "set_log_level", "block": "absent", "level": "debug"}, "no block 'absent'"),
        ({"method": "set_log_level", "level": "debug"}, "field 'block'"),
    ],
)
def test_invalid_requests_are_refused(folder, asked, complaint):
    reply = PlainClient(folder).request(**asked)
    assert reply["ok"] is False and complaint in reply["cause"]


def test_a_level_changes_while_running_and_in_the_replay_too(tmp_path):
    path = tmp_path / "levels.mcap"
    with running(tmp_path, *FAR, "--record", str(path)) as process:
        client = PlainClient(tmp_path)
        client.until(moves)
        levels = {row["block"]: row["level"] for row in client.request("list_blocks")["blocks"]}
        assert set(levels.values()) == {"info"}
        assert cli(tmp_path, "log", "level", "mux", "debug")[1].startswith("mux logs from")
        assert client.request("drive", linear=0.05, angular=0.0)["ok"]
        assert client.request("release")["ok"]
        client.until(stands)
        lines = until(lambda: client.request("read_log", block="mux")["lines"], len)
        assert (lines[0]["level"], lines[0]["text"]) == ("debug", "manual driving")
        levels = {row["block"]: row["level"] for row in client.request("list_blocks")["blocks"]}
        assert levels.pop("mux") == "debug" and set(levels.values()) == {"info"}
        assert client.request("set_log_level", block="*", level="error")["ok"]
        until(
            lambda: {row["level"] for row in client.request("list_blocks")["blocks"]},
            lambda levels: levels == {"error"},
        )
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    code, out, complaint = cli(tmp_path, "replay", str(path), "--check")
    assert code == 0, out + complaint


def test_blocks_are_measured_while_someone_asks(folder):
    client = PlainClient(folder)
    rows = until(
        lambda: {row["block"]: row for row in client.request("list_blocks")["blocks"]},
        lambda rows: rows["odometry"]["busy"] is not None,
    )
    assert 0 < rows["odometry"]["reactions"] < 50  # a board sends 40 frames a second, at most
    assert 0 < rows["odometry"]["busy"] < 1
    assert rows["odometry"]["overruns"] == 0
    code, out, _ = cli(folder, "blocks", "--running", "--json")
    row = json.loads(out.splitlines()[0])
    assert code == 0 and 0 < row["busy"] < 1


def test_timers_that_a_standstill_made_late_are_counted(tmp_path):
    """The talker speaks each 10 ms; the engine is frozen for longer, so some come too late."""
    quick = ["hello", "--set", "talker.period=10 ms", "--for", "60s"]
    line, environment = command(tmp_path, "run", *quick, "--name", "test")
    process = ForkedCommand(line[3:], env=environment, stdout=subprocess.PIPE)
    try:
        process.stdout.readline(), process.stdout.readline()
        client = PlainClient(tmp_path)

        def overruns():
            return client.request("list_blocks")["blocks"][0]["overruns"]

        before = until(overruns, lambda count: count is not None)
        process.send_signal(signal.SIGSTOP)
        time.sleep(0.3)  # the freeze itself, 30 periods of the timer
        process.send_signal(signal.SIGCONT)
        # A firing that is up to a period late is no overrun; some may go by on the way.
        until(overruns, lambda count: count >= before + 20)
    finally:
        process.kill()
        process.communicate()


def test_a_follower_of_the_log_gets_the_end_of_the_run(tmp_path):
    with running(tmp_path, *FAR) as engine:
        process = follow(tmp_path)
        try:
            read_until(process.stdout, lambda line: "goal 1 accepted" in line["text"])
            engine.send_signal(signal.SIGINT)
            line = read_until(process.stdout, lambda line: line["source"] == "engine")
            assert line["level"] == "warning" and "final stop confirmed" in line["text"]
            assert process.wait(timeout=REPLY_TIMEOUT_S) == 0
        finally:
            process.kill()
            process.communicate()


@pytest.mark.parametrize(
    "option, source", [("debug", {"mux", "range"}), ("mux=debug", {"mux"})], ids=["all", "one"]
)
def test_levels_from_the_start(tmp_path, option, source):
    with running(tmp_path, *FAR, "--log-level", option):
        client = PlainClient(tmp_path)
        client.until(moves)
        assert client.request("drive", linear=0.05, angular=0.0)["ok"]
        lines = until(
            lambda: [row for row in client.request("read_log")["lines"] if row["level"] == "debug"],
            lambda rows: "mux" in {row["source"] for row in rows},
        )
        assert {row["source"] for row in lines} >= source
        assert option == "debug" or {row["source"] for row in lines} == source


@pytest.mark.parametrize(
    "option, complaint",
    [("loud", "levels are debug, info"), ("gard=debug", "did you mean guard")],
)
def test_a_level_that_does_not_exist_starts_nothing(tmp_path, option, complaint):
    code, _, reply = cli(tmp_path, "run", "goal", "--log-level", option)
    assert code == 2 and complaint in " ".join(reply.split())
