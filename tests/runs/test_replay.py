"""Replays with something changed, or of a part, and what they are measured by."""

import json
import re
from itertools import groupby

import pytest
from click.testing import CliRunner

from diffbotctl.cli.main import program
from diffbotctl.config.load import load
from diffbotctl.messages import BUILT_IN
from diffbotctl.recording.comparison import recording_differences
from diffbotctl.recording.metrics import recorded_metrics
from diffbotctl.recording.reader import RecordingReader, recording_info
from diffbotctl.recording.writer import RecordingHeader, RecordingWriter
from diffbotctl.replay import recorded_run
from diffbotctl.replay.replay import ReplayOptions, replay_run
from diffbotctl.replay.resimulate import resimulate, why_not_resimulable
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND
from tests.command_result import invoke
from tests.sampling import by_day

WHEELS = "gate.wheels"
SLOWER = ("robot.limits.speed=0.15 m/s",)


@pytest.fixture(scope="module")
def goal(tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "goal.mcap"
    Run(load("goal"), RunOptions(fast=True, record=path, digest=True, seed=3)).go()
    return recorded_run.read_run(path)


def output_of(*words):
    return invoke(program, "replay", *words)


def test_driving_once_more_unchanged_is_the_run_itself(goal):
    assert why_not_resimulable(goal) is None
    again = resimulate(goal, ReplayOptions())
    assert again.digest == goal.end["digest"]
    assert again.metrics == recorded_metrics(goal.path)
    assert again.metrics.true_error is not None


@pytest.mark.parametrize("replayed", [resimulate, replay_run])
def test_the_same_change_twice_is_the_same_run(goal, replayed):
    first, again = (replayed(goal, ReplayOptions(sets=SLOWER)) for _ in range(2))
    assert first.digest == again.digest != goal.end["digest"]
    assert first.metrics == again.metrics


def test_a_slower_robot_arrives_later(goal):
    slow = resimulate(goal, ReplayOptions(sets=SLOWER)).metrics
    assert slow.goals_reached == 1
    # 1.12 m at half the 0.3 m/s takes 3.7 s longer, less what ramps take of it
    assert slow.time_to_goal - recorded_metrics(goal.path).time_to_goal == pytest.approx(
        3.5, abs=1.0
    )


def test_with_the_recorded_motion_only_what_the_blocks_say_changes(goal, tmp_path):
    path = tmp_path / "changed.mcap"
    replay_run(goal, ReplayOptions(sets=SLOWER, record=path))
    topics = {topic.name: topic.place for topic in recording_differences(goal.path, path)}
    assert topics["robot.encoders"] is None and topics["odometry.odometry"] is None
    assert topics["follower.twist"] is not None
    assert json.loads(recorded_run.read_run(path).about["sets"]) == list(SLOWER)


def test_a_replay_written_out_equals_its_recording(goal, tmp_path):
    path = tmp_path / "again.mcap"
    done = replay_run(goal, ReplayOptions(record=path))
    assert done.digest == goal.end["digest"]
    assert all(topic.place is None for topic in recording_differences(goal.path, path))
    assert recording_info(path).complete
    assert replay_run(recorded_run.read_run(path), ReplayOptions(check=True)).difference is None


def rewritten(goal, path, wires, kept=lambda item: True):
    """The recording once more, with these wires alone and of their messages those that `kept`
    takes: as an earlier version, which had no others, would have made it."""
    reader = RecordingReader(goal.path)
    items = [item for item in reader.messages() if item.wire in wires and kept(item)]
    kinds = {wire: BUILT_IN[kind] for wire, (kind, _) in reader.wires.items() if wire in wires}
    sources = sum(reader.wires[wire][1] == "driver" for wire in kinds)
    with path.open("wb") as file:
        recording = RecordingWriter(file, RecordingHeader(kinds, sources, reader.about))
        for _, group in groupby(items, key=lambda item: item.instant):
            instant = list(group)
            output_of = {item.wire: item.message for item in instant}
            recording.write((instant[0].time, *(output_of.get(wire) for wire in kinds)))
        recording.finish(reader.end)
    return recorded_run.read_run(path)


@pytest.mark.parametrize("missing", by_day(1, ["log", "follower.state"]))
def test_a_wire_that_the_recording_lacks_is_reported_and_not_compared(goal, tmp_path, missing):
    whole = replay_run(goal, ReplayOptions(check=True))
    assert missing in goal.wires and not whole.left_out
    old = rewritten(goal, tmp_path / "old.mcap", set(goal.wires) - {missing})
    done = replay_run(old, ReplayOptions(check=True))
    assert done.difference is None and set(done.left_out) == {missing}
    assert done.compared + done.left_out[missing] == whole.compared
    code, text = output_of(old.path, "--check")
    assert code == 0 and f"messages on {missing}, a wire the recording does not have" in text


def test_a_wire_that_the_recording_has_is_compared_to_its_last_message(goal, tmp_path):
    silent = rewritten(goal, tmp_path / "silent.mcap", goal.wires, lambda item: item.wire != "log")
    done = replay_run(silent, ReplayOptions(check=True))
    assert done.difference.wire in ("log", "(time)") and not done.left_out
    assert output_of(silent.path, "--check")[0] == 1


def test_beside_a_wire_that_is_left_out_a_single_lost_message_shows(goal, tmp_path):
    times = [item.time for item in RecordingReader(goal.path).messages() if item.wire == WHEELS]
    lost = times[len(times) // 2]
    wires = set(goal.wires) - {"log"}
    holed = rewritten(
        goal, tmp_path / "holed.mcap", wires, lambda item: (item.wire, item.time) != (WHEELS, lost)
    )
    first = replay_run(holed, ReplayOptions(check=True)).difference
    assert (first.wire, first.time, first.recorded) == (WHEELS, lost, "nothing")


def test_a_recording_that_was_cut_is_replayed_up_to_there(goal, tmp_path):
    path = tmp_path / "cut.mcap"
    path.write_bytes(goal.path.read_bytes()[:90_000])
    last = max(item.time for item in RecordingReader(path).messages())
    code, text = output_of(path)
    assert code == 0 and 0 < last < goal.last
    assert f"the recording is incomplete: it was cut at {last / SECOND:.2f} s" in text
    assert f"replayed {last / SECOND:.2f} s" in text
    assert json.loads(output_of(path, "--json")[1])["cut"] is True


@pytest.mark.parametrize("begin, until", by_day(2, [(0, 3), (2, 4), (2, 100), (6, 6.5)]))
def test_a_part_is_measured_as_in_the_recording(goal, begin, until):
    begin, until = round(begin * SECOND), round(until * SECOND)
    done = replay_run(goal, ReplayOptions(begin=begin, until=until))
    expected = recorded_metrics(goal.path, begin, until)
    assert done.metrics._replace(true_error=None) == expected
    assert done.ending.time <= until


def test_speed_changes_nothing_but_the_time_it_takes(goal):
    def show(pictures):
        assert list(pictures)[-1].messages  # in a child

    fast = replay_run(goal, ReplayOptions(speed=1000.0, begin=SECOND, show=show))
    assert fast.digest == goal.end["digest"]


@pytest.mark.parametrize(
    "change, reason",
    [
        ({"port": "/dev/ttyUSB0"}, "real or emulated"),
        ({"port": "emulated"}, "real or emulated"),
        ({"flight": "state"}, "begin at the start of the run"),
        ({"goals": "[]"}, "a client"),  # the run has one goal more
    ],
)
def test_what_cannot_drive_once_more(goal, change, reason):
    assert reason in why_not_resimulable(goal._replace(about={**goal.about, **change}))


def test_the_command_prints_the_metrics_of_both(goal):
    code, text = output_of(goal.path, "--set", SLOWER[0])
    assert code == 0 and "drives again" in text
    row = re.search(r"time to goal +([\d.]+) s +([\d.]+) s +\+([\d.]+) s", text)
    assert row and float(row[2]) - float(row[1]) == pytest.approx(float(row[3]), abs=0.002)
    for name in ("cross track max", "cross track rms", "stops", "true error", "path"):
        assert name in text
    code, text = output_of(goal.path, "--set", SLOWER[0], "--same-motion")
    assert "with the recorded motion (as requested)" in text
    assert re.search(r"path .* same", text)


def test_the_command_plays_a_part_at_a_speed(goal):
    code, text = output_of(goal.path, "--rate", 1000, "--from", "2s", "--until", "4s")
    assert code == 0 and "replayed 4.00 s" in text and "cross track rms" in text


@pytest.mark.parametrize(
    "words",
    [("--check", "--set", "a.b=1"), ("--check", "--from", "1s"), ("--from", "x"), ("--rate", "0")],
)
def test_what_does_not_fit_together(goal, words):
    result = CliRunner().invoke(program, ["replay", str(goal.path), *words])
    assert result.exit_code == 2


def test_the_recording_is_not_written_over(goal):
    before = goal.path.read_bytes()
    words = ["replay", str(goal.path), "--record", str(goal.path)]
    assert CliRunner().invoke(program, words).exit_code == 2
    assert goal.path.read_bytes() == before
