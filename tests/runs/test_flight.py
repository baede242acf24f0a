"""The flight recorder: what led to a stop is written down, and can be replayed exactly."""

import json
import os
import pickle
import re
import signal

import pytest
from click.testing import CliRunner

from diffbotctl.cli.main import program
from diffbotctl.config.load import load
from diffbotctl.engine.clock import VirtualClock
from diffbotctl.engine.loop import Engine
from diffbotctl.errors import RunError
from diffbotctl.messages import Goal
from diffbotctl.recording.black_box_store import FILES_MAX, black_box_folder, delete_oldest
from diffbotctl.recording.digest import RunDigest
from diffbotctl.recording.reader import RecordingReader, recording_info
from diffbotctl.recording.snapshot import take_snapshot
from diffbotctl.recording.snapshot_json import to_json
from diffbotctl.recording.snapshot_restore import restore_snapshot
from diffbotctl.replay import recorded_run
from diffbotctl.replay.recorded_run import ReplayDriver
from diffbotctl.replay.replay import ReplayOptions, replay_run
from diffbotctl.runs.build_graph import assemble
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from tests.runs.test_endings import FAR, read_until, start
from tests.support.running import cli

WALL = ("world.walls=[{from: [0.6 m, -1 m], to: [0.6 m, 1 m]}]", "follower.patience=2 s")
CORNERS = ((0.6, 0), (0.6, 0.6), (0, 0.6), (0, 0))
ROUND = tuple(Goal(0, 0, x, y) for _ in range(30) for x, y in CORNERS)
ONE = (Goal(0, 0, 1.0, 0.0),)
LAST = Goal(0, 0, 50.0, 0.0)  # beyond the wall


def fly(where, sets=WALL, goals=ONE, **options):
    """Run with a flight recorder; the lines that were printed, and the flights."""
    notices = []
    run = Run(
        load("goal", None, sets),
        RunOptions(fast=True, flights=where, goals=goals, **options),
        tell=notices.append,
    )
    result = run.go()
    return result, notices, sorted(where.glob("*.mcap"), key=lambda path: path.stat().st_mtime_ns)


def texts_of_blocks(path, after=-1):
    return [
        (item.time, item.wire, item.data)
        for item in RecordingReader(path).messages()
        if not item.from_driver and item.time > after
    ]


def test_a_stop_is_announced_with_a_command_for_the_file(tmp_path):
    result, notices, flights = fly(tmp_path)
    assert result.stops and result.ending.code == 1
    assert len(flights) > 1 and notices == [  # once, at the end
        "The whole run so far is kept: `diffbotctl why` explains it, or",
        f"    diffbotctl replay {flights[-1]}",
    ]
    seen = recording_info(flights[0])
    assert "obstacle" in seen.end["cause"] and seen.complete
    # Nothing that a replay makes anew: messages of drivers, and their pictures for viewers.
    assert {topic.origin for topic in seen.topics if topic.messages} == {"driver", "viewer"}
    assert "blocked" in recording_info(flights[-1]).end["cause"]


def test_why_explains_the_newest_run_when_none_is_active(tmp_path):
    state = {"XDG_STATE_HOME": str(tmp_path), "XDG_RUNTIME_DIR": str(tmp_path / "none")}

    def why(*words):
        done = CliRunner().invoke(program, ["why", *words], env=state)
        return done.exit_code, " ".join(f"{done.output}{done.exception or ''}".split())

    assert "E-NO-ENGINE" in why()[1]
    fly(tmp_path / "diffbotctl" / "flights")
    code, shown = why()
    assert code == 0 and shown.startswith("The run of goal, ")
    assert ": an obstacle is ahead: something stands " in shown
    assert shown.endswith("for 2 s.") and "The run has ended: goal 1 was not reached" in shown
    assert "encoders" not in shown and "range.range" not in shown
    code, whole = why("--all")
    assert code == 0 and "Before it, robot." in whole and "range.range: measured, 0." in whole
    code, record = why("--json")
    assert json.loads(record)["summary"] == shown and json.loads(record)["held"] is None
    assert "E-NO-ENGINE" in why("--engine", "goal")[1]  # this one is not running


RESTS = """\
format: 1
kind: pipeline
include: goal
blocks: {broken: {block: ./rests.py:Rests, in: {odometry: odometry.odometry}}}
"""
RESTS_CODE = """\
from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Odometry, Text


class Rests(Block):
    odometry = In(Odometry)
    text = Out(Text)

    def react(self, now, odometry):
        return nowhere
"""
ENDS = [  # words of `run`, and what `why` states of that run; an older one has hit a wall
    (("goal", "--fast", "--for", "1s"), "The run has ended: time limit of 1 s", ""),
    (
        ("goal", "--fast", "--goal", "1,0", *(f"--set={each}" for each in WALL)),
        "an obstacle is ahead",
        "kept no black box file",
    ),
    (("hello", "--quiet", "--for", "0.2s"), "The run has ended: time limit", ""),
    (("rests.yaml", "--robot", "book_2wd", "--allow-programs", "--for", "9s"), "NameError", ""),
]


@pytest.mark.parametrize(("words", "told", "reason"), ENDS, ids=lambda words: str(words)[:30])
def test_why_explains_the_last_run_also_one_without_a_black_box_file(
    tmp_path, monkeypatch, words, told, reason
):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rests.yaml").write_text(RESTS)
    (tmp_path / "rests.py").write_text(RESTS_CODE)
    fly(black_box_folder())
    cli(tmp_path, "run", *words)
    for more in ((), ("--all",)):
        code, shown, complaint = cli(tmp_path, "why", *more)
        shown = " ".join(shown.split())
        assert code == 0, complaint
        assert shown.startswith(f"The run of {words[0].removesuffix('.yaml')}, ") and told in shown
        assert "Nothing has stopped" not in shown and "E-CODE" not in shown
        assert "goal 1 was not reached" not in shown or "--goal" in words
    assert reason in shown
    fly(black_box_folder())  # of a later run
    assert "an obstacle is ahead" in cli(tmp_path, "why")[1]


def test_a_run_without_a_stop_leaves_nothing(tmp_path):
    result, notices, flights = fly(
        tmp_path, sets=("world.walls=[]",), goals=(Goal(0, 0, 0.2, 0.0),)
    )
    assert result.ending.code == 0
    assert (notices, flights) == ([], [])


def test_a_replay_reproduces_all_messages(tmp_path):
    _, _, flights = fly(tmp_path / "flights")
    full, again = tmp_path / "full.mcap", tmp_path / "again.mcap"
    sets = load("goal", None, WALL)
    Run(sets, RunOptions(fast=True, record=full, goals=ONE)).go()
    done = replay_run(recorded_run.read_run(flights[-1]), ReplayOptions(record=again))
    assert done.begins == "run"
    assert texts_of_blocks(again) == texts_of_blocks(full)


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    """A flight of a run of five minutes and more, and a recording of the same run."""
    where = tmp_path_factory.mktemp("long")
    sets = ("world.walls=[{from: [3 m, -9 m], to: [3 m, 9 m]}]", "follower.patience=2 s")
    _, notices, flights = fly(where / "flights", sets, (*ROUND, LAST), seed=5)
    full = where / "full.mcap"
    Run(
        load("goal", None, sets), RunOptions(fast=True, record=full, goals=(*ROUND, LAST), seed=5)
    ).go()
    return notices, flights, full


@pytest.mark.nightly
def test_of_a_long_run_the_last_minutes_are_kept_and_replayed_bit_for_bit(long, tmp_path):
    notices, flights, full = long
    assert "The last 3 minutes are kept" in notices[-2]
    run = recorded_run.read_run(flights[-1])
    assert run.begins == "state"
    begin = run.state[0]
    assert 180e9 <= run.last - begin <= 245e9  # the span, and up to a state or two before it
    again = tmp_path / "again.mcap"
    replay_run(run, ReplayOptions(record=again))
    assert texts_of_blocks(again) == texts_of_blocks(full, after=begin)
    assert len(texts_of_blocks(again)) > 10_000


@pytest.mark.nightly
def test_only_live_parameters_can_be_changed_in_a_replay_from_a_state(long):
    run = recorded_run.read_run(long[1][-1])
    plain = replay_run(run, ReplayOptions())
    live, fixed = ("guard.margin=0.2 m", "guard.resume=wait"), ("follower.tolerance=25 mm",)
    changed = replay_run(run, ReplayOptions(sets=live))
    assert changed.digest != plain.digest
    assert replay_run(run, ReplayOptions(sets=live)).digest == changed.digest
    with pytest.raises(RunError, match="cannot change after the start"):
        replay_run(run, ReplayOptions(sets=fixed))


@pytest.mark.nightly
def test_the_command_prints_where_a_replay_begins(long, tmp_path):
    path = long[1][-1]
    result = CliRunner().invoke(program, ["replay", str(path), "--set", "guard.margin=0.2 m"])
    assert re.search(r"^starts \d+\.\d\d s after the run.s start, in a saved state", result.output)
    assert "begin at the start of the run" in result.output  # why it is not simulated again
    assert "cross track rms" in result.output
    info = CliRunner().invoke(program, ["bag", "info", str(path)]).output
    assert "from a known state" in info and "blocked" in info


@pytest.mark.nightly
def test_a_check_of_a_flight_is_refused(long):
    with pytest.raises(RunError, match="no messages of blocks"):
        replay_run(recorded_run.read_run(long[1][-1]), ReplayOptions(check=True))


def test_a_killed_engine_leaves_its_flight(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    process = start(*FAR)
    read_until(process, "driving")
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    rest = process.stdout.read()  # the children hold the pipe: when it ends they have written all
    (path,) = black_box_folder().glob("*.mcap")
    assert path.parent == tmp_path / "diffbotctl" / "flights"
    assert recording_info(path).end["cause"] == "the engine was killed"
    assert f"diffbotctl replay {path}" in rest
    assert replay_run(recorded_run.read_run(path), ReplayOptions()).ending.code == 0


def test_a_black_box_file_that_was_cut_is_replayed_up_to_there(tmp_path):
    _, _, flights = fly(tmp_path)
    path = tmp_path / "cut.mcap"
    path.write_bytes(flights[-1].read_bytes()[:8000])  # its end record is before that
    run = recorded_run.read_run(path)
    assert run.is_cut and run.end is not None
    assert run.last == max((item.time for item in RecordingReader(path).messages()), default=0)
    assert not recorded_run.read_run(flights[-1]).is_cut


def test_a_folder_that_cannot_be_made_is_reported_and_the_run_goes_on(tmp_path):
    (tmp_path / "file").write_text("")
    result, notices, _ = fly(tmp_path / "file" / "flights")
    assert result.ending.stopped is True
    assert notices and all("could not be kept" in line for line in notices)


def test_only_the_newest_flights_are_kept(tmp_path):
    for number in range(FILES_MAX + 5):
        path = tmp_path / f"{99 - number}.mcap"
        path.write_text("")
        os.utime(path, ns=(number, number))
    (tmp_path / "notes.txt").write_text("mine")
    delete_oldest(tmp_path)
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {f"{99 - number}.mcap" for number in range(5, FILES_MAX + 5)} | {"notes.txt"}


@pytest.mark.parametrize(
    "state, home",
    [
        ("/x", "/x"),
        ("", "/h/.local/state"),
        (None, "/h/.local/state"),
        ("relative", "/h/.local/state"),  # the XDG specification wants it ignored
    ],
)
def test_where_flights_lie(monkeypatch, state, home):
    monkeypatch.setenv("HOME", "/h")
    monkeypatch.delenv("XDG_STATE_HOME")
    if state is not None:
        monkeypatch.setenv("XDG_STATE_HOME", state)
    assert str(black_box_folder()) == f"{home}/diffbotctl/flights"


@pytest.mark.parametrize(
    "pipeline, robot",
    [
        ("goal", "book_2wd"),
        pytest.param("goal", "book_2wd_counts", marks=pytest.mark.nightly),
        ("goal", "book_2wd_stock"),
        ("square", None),
        pytest.param("distance", None, marks=pytest.mark.nightly),
        pytest.param("hello", None, marks=pytest.mark.nightly),
    ],
)
def test_every_shipped_pipeline_goes_on_from_its_state(tmp_path, pipeline, robot):
    full = tmp_path / "full.mcap"
    setup = load(pipeline, robot)
    Run(setup, RunOptions(fast=True, duration=4.0, record=full, seed=2)).go()
    half = 2_000_000_000

    def engine(after, printed):
        inputs = (each for each in RecordingReader(full).messages() if each.time > after)
        graph = assemble(setup, real=False).graph
        return Engine(graph, [ReplayDriver(inputs)], VirtualClock(), record=printed.append)

    first, rest = [], []
    before, behind = engine(-1, first), engine(half, rest)
    before.run(half + 1)
    state = to_json(pickle.loads(take_snapshot(before)))
    restore_snapshot(state, half, behind)
    behind.last = half
    behind.run(4_000_000_000)
    digest = RunDigest(before.graph.kinds)
    for instant in first + rest:
        digest.record(instant)
    assert (
        digest.text()
        == replay_run(recorded_run.read_run(full), ReplayOptions(until=4_000_000_000)).digest
    )
    assert len(first) > 10 < len(rest)
