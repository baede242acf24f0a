"""`run --log FILE`, and the log of a run and of its replay."""

import json
from datetime import datetime

import pytest

from diffbotctl.config.load import load
from diffbotctl.errors import RunError
from diffbotctl.messages import LOG_LEVELS, LogLine
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run

WALL = ["world.walls=[{from: [0.6 m, -1 m], to: [0.6 m, 1 m]}]", "guard.resume=by_itself"]


def written(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_every_event_is_a_line_of_json(tmp_path):
    path = tmp_path / "run.jsonl"
    result = Run(load("goal"), RunOptions(fast=True, log=path)).go()
    lines = written(path)
    assert result.reached == 1
    assert all(set(line) == {"at", *LogLine._fields} for line in lines)
    assert {line["level"] for line in lines} <= set(LOG_LEVELS)
    assert [line["time"] for line in lines] == sorted(line["time"] for line in lines)
    assert lines[0]["text"].startswith("started: ") and "goal.yaml" in lines[0]["text"]
    assert lines[-1]["text"] == "ended: all goals reached; final stop confirmed"
    assert any("goal 1 reached" in line["text"] for line in lines)
    moments = [datetime.fromisoformat(line["at"]).timestamp() * 1e9 for line in lines]
    # The time of day goes as the run's time does; a float of 2026 holds some 200 ns.
    assert moments[-1] - moments[0] == pytest.approx(lines[-1]["time"], abs=2000)


def test_one_line_per_event_not_per_message(tmp_path):
    path = tmp_path / "run.jsonl"
    run = Run(load("goal", None, WALL), RunOptions(fast=True, log=path, duration=20.0))
    run.go()
    output = [line["text"] for line in written(path)]
    assert any("STOP obstacle" in text for text in output)
    assert len(output) < 60  # 20 s are 800 telemetry frames


def test_a_second_run_adds_to_the_file(tmp_path):
    path = tmp_path / "run.jsonl"
    for _ in range(2):
        Run(load("goal"), RunOptions(fast=True, log=path, duration=0.5)).go()
    starts = [line for line in written(path) if line["text"].startswith("started")]
    assert len(starts) == 2


def test_a_full_disk_is_reported_once_and_the_run_continues():
    reported = []
    run = Run(
        load("goal"), RunOptions(fast=False, log="/dev/full", duration=1.5), tell=reported.append
    )
    result = run.go()
    assert result.ending.stopped is True
    assert len(reported) == 1
    assert "LOG STOPPED: /dev/full" in reported[0] and "No space left" in reported[0]


def test_a_file_that_cannot_be_opened_is_refused_before_anything_starts(tmp_path):
    with pytest.raises(RunError, match="E-LOG"):
        Run(load("goal"), RunOptions(fast=True, log=tmp_path / "nowhere" / "run.jsonl"))


@pytest.mark.parametrize("sets", [[], WALL], ids=["open", "wall"])
def test_a_replay_has_the_same_log_line_by_line(tmp_path, sets):
    from diffbotctl.recording.reader import RecordingReader
    from diffbotctl.replay.replay import replay

    path = tmp_path / "run.mcap"
    options = RunOptions(fast=True, record=path, digest=True, duration=20.0, seed=3)
    result = Run(load("goal", None, sets), options).go()
    lines = [item for item in RecordingReader(path).messages() if item.wire == "log"]
    assert len(lines) > 4 and not any(item.from_driver for item in lines)
    again = replay(path, check=True)
    assert again.difference is None and again.digest == result.digest


def test_a_replay_with_another_log_text_is_detected(tmp_path, monkeypatch):
    from diffbotctl.engine import event_log
    from diffbotctl.replay.replay import replay

    path = tmp_path / "run.mcap"
    Run(load("goal"), RunOptions(fast=True, record=path, duration=2.0)).go()
    monkeypatch.setattr(event_log, "_remaining", lambda state: "some way")
    difference = replay(path, check=True).difference
    assert difference is not None and difference.wire == "log" and "some way" in difference.replayed


def test_a_block_that_raises_is_named_in_the_log(tmp_path, monkeypatch):
    from diffbotctl.config import registry
    from tests.runs.test_endings import Breaks

    assert Breaks.__doc__
    monkeypatch.setitem(registry.BLOCKS, "breaks", "tests.runs.test_endings:Breaks")
    file, path = tmp_path / "breaks.yaml", tmp_path / "run.jsonl"
    file.write_text(
        "format: 1\nkind: pipeline\n"
        "robot: {use: book_2wd, in: {wheels: kinematics.wheels}}\n"
        "blocks:\n"
        "  odometry: {block: odometry, in: {encoders: robot.encoders}}\n"
        "  follower: {block: goal_follower,"
        " in: {odometry: odometry.odometry, goal: operator.goal}}\n"
        "  bad: {block: breaks, in: {twist: follower.twist}}\n"
        "  kinematics: {block: diff_drive, in: {twist: bad.twist}}\n"
        "goals: [{x: 2 m, y: 0 m}]\n"
    )
    result = Run(load(str(file)), RunOptions(fast=True, log=path)).go()
    bad = [line for line in written(path) if line["source"] == "bad"]
    assert result.ending.code == 1
    assert [line["level"] for line in bad] == ["error"] and "ZeroDivisionError" in bad[0]["text"]
    assert written(path)[-1]["level"] == "error"
