"""`bag record` and `bag save` on a running engine."""

import os
import signal
import socket
import subprocess
from pathlib import Path

import pytest

from diffbotctl.recording.black_box_store import BlackBoxStore, RunMetadata
from diffbotctl.recording.reader import RecordingReader, recording_info
from diffbotctl.time import SECOND as S
from tests.support import own_package
from tests.support.running import PlainClient, cli, command, moves, running, stands

ROOT = Path(__file__).parents[2]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path


def record(folder, *words):
    """`bag record` in the background, once it records."""
    line, environment = command(folder, "bag", "record", *words)
    process = subprocess.Popen(
        line, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert "recording" in process.stderr.readline()
    return process


def test_chosen_topics_are_recorded_until_the_interrupt(folder):
    file = folder / "part.mcap"
    with running(folder, "goal", "--stay"):
        client = PlainClient(folder)
        words = ["odometry.*", "/cmd_vel", "gate.*", "--exclude", "gate.stop"]
        process = record(folder, *words, "--output", str(file))
        begin = client.request("status")["time"]
        client.until(lambda status: status["time"] > begin + S)
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=60)
        assert process.returncode == 0 and f"{file}: " in out
    info = recording_info(file)
    assert info.complete and info.end["cause"] == "the recording was ended"
    counts = {topic.name: topic.messages for topic in info.topics}
    imu = {"odometry.imu"}  # without messages: this robot has none
    assert set(counts) - imu == {"odometry.odometry", "operator.twist", "gate.wheels"}
    origins = {topic.name: topic.origin for topic in info.topics}
    assert origins["odometry.odometry"] == "block" and origins["operator.twist"] == "driver"
    assert counts["odometry.odometry"] > 20 and counts["gate.wheels"] > 20
    messages = [m for m in RecordingReader(file).messages() if m.wire == "odometry.odometry"]
    times = [item.message.time for item in messages]
    assert times == sorted(times) and times[-1] - times[0] > S // 2
    code, out, _ = cli(folder, "bag", "export", str(file), "odometry.odometry.x")
    assert code == 0 and len(out.splitlines()) > 20
    code, out, err = cli(folder, "replay", str(file))
    assert code == 1 and "E-RECORDING" in err and "bag save" in err


def test_it_ends_with_the_run_and_is_equal_to_the_run_s_own_recording(folder):
    part, whole = folder / "part.mcap", folder / "whole.mcap"
    with running(folder, "goal", "--record", str(whole)) as run:
        process = record(folder, "--output", str(part))
        process.communicate(timeout=120)
        run.wait(timeout=60)
    assert process.returncode == 0
    info = recording_info(part)
    assert info.end["cause"] == "the run has ended"
    recorded = {
        (m.wire, m.message.time, repr(m.message))
        for m in RecordingReader(whole).messages()
        if m.wire != "log"
    }
    live = [m for m in RecordingReader(part).messages() if m.wire != "log"]
    assert len(live) > 100  # a busy machine attaches late
    assert all((m.wire, m.message.time, repr(m.message)) in recorded for m in live)
    wires = ("odometry.odometry", "follower.state", "robot.encoders")
    for wire in wires:
        times = sorted(m.message.time for m in live if m.wire == wire)
        expected = sorted(time for name, time, _ in recorded if name == wire and time >= times[0])
        assert times == expected  # none is missing between the first one and the end


def test_own_message_types_are_recorded_without_their_package(folder, monkeypatch):
    site, file = folder / "site", folder / "gas.mcap"
    pipeline = own_package.install(site)
    with monkeypatch.context() as patch:
        patch.syspath_prepend(site)
        patch.setenv("PYTHONPATH", f"{site}{os.pathsep}{ROOT}")
        with running(folder, str(pipeline), "--stay"):
            patch.undo()
            process = record(folder, "nose.*", "--for", "1s", "--output", str(file))
            assert process.wait(timeout=60) == 0
    code, out, _ = cli(folder, "bag", "export", str(file), "nose.gas.ppm")
    assert code == 0 and len(out.splitlines()) > 10


def test_a_topic_that_is_not_there_is_answered_with_the_nearest(folder):
    with running(folder, "goal", "--stay"):
        code, _, err = cli(folder, "bag", "record", "odometry.odometri")
        assert code == 1 and "did you mean odometry.odometry?" in err
        code, _, err = cli(folder, "bag", "record", "gate.*", "--exclude", "*")
        assert code == 2 and "no topic is left" in err
        (folder / "mine.mcap").write_text("mine")
        words = ["bag", "record", "--for", "1s", "--output"]
        code, _, err = cli(folder, *words, str(folder / "mine.mcap"))
        assert code == 2 and "E-OUTPUT" in err
        code, _, err = cli(folder, *words, "/nowhere/x.mcap")
        assert code == 1 and "E-RECORD" in err


def test_the_last_minutes_are_saved_and_replayed_without_a_stop(folder):
    with running(folder, "goal", "--stay", "--goal", "9 0"):
        client = PlainClient(folder)
        client.until(moves)
        code, out, err = cli(folder, "bag", "save")
        assert code == 0, err
        assert not stands(client.request("status"))
        file = out.removeprefix("saved: ").strip()
    info = recording_info(Path(file))
    assert info.complete and "saved by `diffbotctl bag save`" in info.end["cause"]
    code, out, _ = cli(folder, "replay", str(file), "--record", str(folder / "again.mcap"))
    assert code == 0 and "replayed" in out
    wires = {topic.name for topic in recording_info(folder / "again.mcap").topics}
    assert "odometry.odometry" in wires


def test_a_recorded_run_has_nothing_to_save(folder):
    with running(folder, "goal", "--stay", "--record", str(folder / "whole.mcap")):
        code, _, err = cli(folder, "bag", "save")
        assert code == 1 and "recorded from its start" in err


def test_many_requests_write_one_file_a_second_and_no_stop_is_forgotten(tmp_path):
    ours, theirs = socket.socketpair()
    store = BlackBoxStore(theirs, RunMetadata(tmp_path, "x", {}, {"epoch": "0"}))
    assert store.save("a person") is None  # nothing has come yet
    store.ring.add_batch(5 * S, b"")
    store.stop = "a stop whose file is due later"
    assert [store.save("a person") for _ in range(3)] == [1, 1, 1]
    assert store.stop == "a stop whose file is due later"
    store.ring.add_batch(6 * S, b"")
    assert store.save("a person") == 2
    ours.close()
