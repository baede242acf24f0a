"""Messages of another package: run, watched, recorded, replayed, and read where it is missing."""

import json
import os
import pickle
import signal
import subprocess
from math import inf, isnan, nan
from pathlib import Path
from shutil import copytree
from typing import Annotated, Literal, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.control_socket.command_driver import sendable_value
from diffbotctl.message_types import full_name, type_name, type_problem
from diffbotctl.messages import BUILT_IN, Field, Goal, Range, fields
from diffbotctl.recording.json_codec import message_decoder, message_encoder
from diffbotctl.recording.message_schema import json_schema, message_class
from diffbotctl.recording.reader import RecordingReader
from tests.support import own_package
from tests.support.running import PlainClient, cli, command, running

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """(folder of sockets, pipeline, recording) with the package on PYTHONPATH."""
    folder = tmp_path_factory.mktemp("own")
    pipeline = own_package.install(folder / "site")
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = f"{ROOT}{os.pathsep}{folder / 'site'}"
    os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
    recording = folder / "noses.mcap"
    code, out, complaint = cli(
        folder, "run", str(pipeline), "--fast", "--quiet", "--record", str(recording)
    )
    assert code == 0 and "INCOMPLETE" not in out, out + complaint
    yield folder, pipeline, recording
    os.environ.pop("PYTHONPATH")
    os.environ.pop("XDG_CACHE_HOME")
    if before is not None:
        os.environ["PYTHONPATH"] = before


@pytest.fixture
def missing(installed, monkeypatch):
    """As `installed`, where the package is not."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    return installed


def ok(folder, *words):
    code, out, complaint = cli(folder, *map(str, words))
    assert code == 0, out + complaint
    return out


def test_the_graph_names_the_package(installed):
    folder, pipeline, _ = installed
    rows = [json.loads(line) for line in ok(folder, "graph", pipeline, "--json").splitlines()]
    types = {(row["source"], row["output"]): row["type"] for row in rows}
    assert types["nose", "own"] == "odd_noses/Range"
    assert types["range", "range"] == "Range"
    assert "odd_noses/Gas" in ok(folder, "graph", pipeline)
    assert "odd_noses/Face" in ok(folder, "blocks", "show", "smell")


@pytest.mark.parametrize(
    ("options", "output"),
    [
        ((), "replayed 1."),
        (("--check",), "DIFFERENT at 1."),
        (("--json",), '"failure": {"severity": "error", "code": "E-BLOCK-RAISED"'),
        (("--rate", "1000"), "replayed 1."),
        (("--set", "nose.gain=2"), "the simulated robot drives again"),
        (("--set", "nose.gain=2", "--same-motion"), "replayed 1."),
        (("--set", "nose.gain=2", "--json"), '"failure": {"severity": "error"'),
    ],
)
def test_a_replay_whose_block_raises_ends_as_a_run_does(options, output, installed, tmp_path):
    folder, _, recording = installed
    copytree(folder / "site", tmp_path / "site")
    blocks = tmp_path / "site" / own_package.NAME / "blocks.py"
    counting = "        self.count += 1\n"
    raising = "        if now > 1_000_000_000:\n            raise ValueError('no nose')\n"
    blocks.write_text(blocks.read_text().replace(counting, counting + raising))
    line, environment = command(folder, "replay", recording, *options)
    environment["PYTHONPATH"] = f"{ROOT}{os.pathsep}{tmp_path / 'site'}"
    done = subprocess.run(line, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1 and output in done.stdout, done.stdout
    assert "odd_noses/blocks.py:46:13  E-BLOCK-RAISED" in done.stderr
    assert "block nose: it raised ValueError: no nose" in done.stderr
    drives_again = "--set" in options and "--same-motion" not in options
    assert ("the robot was stopped" in done.stderr) == drives_again


def test_a_recorded_run_is_replayed_bit_for_bit(installed):
    folder, _, recording = installed
    assert "same" in ok(folder, "replay", recording, "--check")
    again = folder / "again.mcap"
    ok(folder, "replay", recording, "--set", "nose.gain=2", "--record", again)
    code, out, _ = cli(folder, "bag", "diff", str(recording), str(again))
    assert code == 1 and "nose.gas" in out
    ppm = [
        [item.message.ppm for item in RecordingReader(path).messages() if item.wire == "nose.gas"]
        for path in (recording, again)
    ]
    assert ppm[0] and [2 * value for value in ppm[0]] == ppm[1]


def test_the_recording_is_read_without_the_package(missing):
    folder, _, recording = missing
    info = ok(folder, "bag", "info", recording)
    assert "odd_noses/Range" in info and "odd_noses/Face" in info
    lines = ok(folder, "bag", "export", recording, "nose.face", "nose.face.boxes.1.x").splitlines()
    names = ["x", "name", "corners.0", "corners.1", "mood", "seen", "level", "boxes.1.x"]
    assert lines[0].split(",")[1:] == [f"nose.face.{name}" for name in names]
    assert lines[2].split(",")[2:] == ["nan", "nan", "1", "sad", "True", "-inf", "2.0"]
    assert "same" in ok(folder, "bag", "diff", recording, recording)
    picture = folder / "ppm.svg"
    ok(folder, "bag", "plot", "nose.own.near", recording, "--output", picture)
    assert "nose.own.near" in picture.read_text()
    code, _, complaint = cli(folder, "replay", str(recording))
    assert code == 2 and "E-BLOCK-UNKNOWN" in complaint


def test_units_travel_with_the_recording(installed):
    recording = installed[2]
    reader = RecordingReader(recording)
    assert len(list(reader.messages())) > 1000
    own, built_in = reader.kinds["nose.own"], reader.kinds["range.range"]
    assert built_in is Range and type_name(own) == "odd_noses/Range"
    assert fields(own)["near"] == (float, Field("cm", "Not the built-in Range."))


def test_a_running_engine_shows_and_takes_them(installed):
    folder, pipeline, _ = installed
    words = (str(pipeline), "--stay", "--goal", "0 0")
    with running(folder, *words):
        client = PlainClient(folder)
        client.until(lambda status: status["time"] > 200_000_000)  # ns: rates need some frames
        rows = map(json.loads, ok(folder, "topic", "list", "--json").splitlines())
        assert {row["topic"]: row["type"] for row in rows}["nose.own"] == "odd_noses/Range"
        message = json.loads(ok(folder, "topic", "echo", "nose.face", "--once", "--json"))
        assert message["corners"] == ["nan", 1] and message["boxes"][1]["label"] == "none"
        assert "Hz" in ok(folder, "topic", "hz", "nose.gas", "--once")
        assert "cm" in ok(folder, "topic", "type", "nose.own")
        before = client.request("describe_topic", topic="nose.gas")["last"]["ppm"]
        ok(folder, "call", "nose.raise_count", "by=1000")
        ok(folder, "param", "set", "nose.gain", "3")
        assert "3" in ok(folder, "param", "get", "nose.gain")
        client.request("subscribe", topic="nose.gas")
        while (line := client.read()).get("message", {}).get("ppm", 0) < 3000:
            assert line.get("message", {"ppm": before})["ppm"] >= before
        ok(folder, "dash", "--once")
        client.close()


def test_actions_take_texts_and_return_values(installed):
    folder, pipeline, _ = installed
    recording = folder / "calls.mcap"
    words = (str(pipeline), "--stay", "--goal", "0 0", "--record", str(recording))
    with running(folder, *words) as process:
        assert "[name=TEXT] [near=m] [mood=TEXT]" in ok(folder, "call")
        out = ok(folder, "call", "nose.describe", "name=Ada L. = x", "near=20 cm")
        assert out == 'nose.describe: ["Ada L. = x is glad", 0.2, "nan"]\n'
        out = ok(folder, "call", "nose.describe", "mood=sad", "name=7", "--json")
        assert json.loads(out)["value"] == ["7 is sad", 1.0, "nan"]
        assert float(ok(folder, "call", "nose.raise_count", "by=1000").split()[1]) >= 1000
        assert ok(folder, "call", "odometry.set_pose").endswith("done\n")
        for words, complaint in {
            ("nose.describe",): "the field 'name' must be a printable text",
            ("nose.describe", "name=\n"): "printable text",
            ("nose.describe", "name=none"): "there is no face",
            ("nose.itself",): "it is a Smell",
        }.items():
            code, _, error = cli(folder, "call", *words)
            assert code == 1 and complaint in error
        process.send_signal(signal.SIGTERM)
        process.wait()
    assert "same" in ok(folder, "replay", recording, "--check")


@pytest.mark.parametrize("value", [{"a": 1}, object(), "x" * 10_001, (0,) * 1001, [[[[0]]]], {1}])
def test_what_an_action_cannot_return(value):
    with pytest.raises(ValueError):
        sendable_value(value)


def test_what_an_action_returns_is_json():
    value = [nan, (Range(1, inf, "clear"), True), None, "text", 10**30]
    assert json.loads(json.dumps(sendable_value(value), allow_nan=False)) == [
        "nan",
        [{"time": 1, "state": "clear", "distance": "inf"}, True],
        None,
        "text",
        10**30,
    ]


def test_a_black_box_that_begins_in_the_middle_holds_them(installed, monkeypatch):
    """The state of wires with own messages is saved and restored."""
    from diffbotctl.config.load import load
    from diffbotctl.recording.snapshot import take_snapshot
    from diffbotctl.recording.snapshot_json import to_json
    from diffbotctl.recording.snapshot_restore import restore_snapshot
    from diffbotctl.runs.options import RunOptions
    from diffbotctl.runs.run import Run

    folder, pipeline, _ = installed
    monkeypatch.syspath_prepend(str(folder / "site"))
    one = Run(load(str(pipeline)), RunOptions(fast=True, duration=1.0))
    one.go()
    other = Run(load(str(pipeline)), RunOptions(fast=True))
    state = to_json(pickle.loads(take_snapshot(one.engine)))
    restore_snapshot(state, one.engine.last_instant, other.engine)
    held = [value for value in other.engine.compiled.state().values() if value is not None]
    assert any(type_name(type(value)) == "odd_noses/Range" for value in held)


def test_a_wire_between_two_classes_of_one_name_names_both(installed, monkeypatch):
    from diffbotctl.config.load import check

    folder, _, _ = installed
    monkeypatch.syspath_prepend(str(folder / "site"))
    wrong = folder / "wrong.yaml"
    wrong.write_text(own_package.PIPELINE.replace("distance: range.range", "distance: nose.own"))
    (problem,) = [each for each in check(str(wrong)) if each.severity == "error"]
    assert problem.code == "E-WIRE-TYPE"
    assert "odd_noses/Range (cm)" in problem.cause and "diffbotctl/Range (m)" in problem.cause


class Nested(NamedTuple):
    x: float
    label: str | None


class NotATuple:
    time: int


def case(**hints):
    return NamedTuple("Case", [("time", int), *hints.items()])


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (NotATuple, "not a NamedTuple"),
        (NamedTuple("NoTime", [("x", float)]), "first field"),
        (NamedTuple("Late", [("x", float), ("time", int)]), "first field"),
        (NamedTuple("Real", [("time", float)]), "first field"),
        (case(x=list[float]), "cannot be recorded"),
        (case(x=dict), "cannot be recorded"),
        (case(x=bytes), "cannot be recorded"),
        (case(x=object), "cannot be recorded"),
        (case(x=float | str), "several meanings"),
        (case(x=tuple[int, ...] | float), "several meanings"),
        (case(x=tuple[list[int], ...]), "cannot be recorded"),
        (case(x=Literal[1, 2]), "choice"),
        (case(x="Nowhere"), "cannot be read"),
        (case(x=tuple[tuple[tuple[tuple[tuple[tuple[int]]]]]]), "deep"),
    ],
)
def test_what_cannot_be_recorded_is_refused(kind, words):
    cause, fix = type_problem(kind)
    assert words in cause and fix


def test_built_in_classes_can_be_recorded():
    assert not any(map(type_problem, BUILT_IN.values()))
    assert (type_name(Goal), full_name(Goal)) == ("Goal", "diffbotctl/Goal")


SCALARS = {
    int: st.integers(-(2**63), 2**63 - 1),
    float: st.floats(),
    bool: st.booleans(),
    str: st.text(st.characters()),
    Literal["a", "nan"]: st.sampled_from(["a", "nan"]),
    float | None: st.none() | st.floats(),
    int | None: st.none() | st.integers(-9, 9),
    str | None: st.none() | st.sampled_from(["nan", ""]),
    Nested: st.builds(Nested, st.floats(), st.none() | st.text()),
    Nested | None: st.none() | st.builds(Nested, st.floats(), st.none()),
    Annotated[float, Field("m", "Some 100 %.")]: st.floats(),
}


@st.composite
def hint_and_value(draw, depth=0):
    hint = draw(st.sampled_from(list(SCALARS)))
    strategy = SCALARS[hint]
    for _ in range(draw(st.integers(0, 2))):
        if draw(st.booleans()):
            hint, strategy = tuple[hint, ...], st.lists(strategy, max_size=3).map(tuple)
        else:
            hint, strategy = tuple[hint, int], st.tuples(strategy, SCALARS[int])
    return hint, draw(strategy)


@given(st.lists(hint_and_value(), max_size=6))
def test_any_message_reads_back_from_its_schema_as_it_was(drawn):
    names = [f"field_{place}n" for place in range(len(drawn))]
    hints = [(name, hint) for name, (hint, _) in zip(names, drawn, strict=True)]
    kind = NamedTuple("Drawn", [("time", int), *hints])
    message = kind(5, *(value for _, value in drawn))
    data = message_encoder(kind)(message)
    recorded = message_class(type_name(kind), json.dumps(json_schema(kind)).encode())
    assert type_name(recorded) == type_name(kind) and type_problem(recorded) is None
    for reader in (kind, recorded):
        again = message_decoder(reader)(data)
        assert message_encoder(reader)(again) == data
        assert all(map(same, again, message))


def same(one, other):
    if isinstance(other, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(other, float) and isnan(other):
        return isinstance(one, float) and isnan(one)
    return one == other


@pytest.mark.parametrize("number", [0.5, nan, inf])
def test_numbers_of_numpy_are_numbers(number):
    import numpy

    kind = case(x=float, n=int)
    message = kind(numpy.int64(3), numpy.float32(number), numpy.int8(7))
    data = json.loads(message_encoder(kind)(message))
    assert data == {"time": 3, "x": number if number == 0.5 else str(number), "n": 7}


@pytest.mark.parametrize(
    "schema",
    [
        b"",
        b"[]",
        b"{}",
        b'{"properties": {"time": {"type": "integer"}, "a b": {"type": "integer"}}}',
        b'{"properties": {"time": {"type": "integer"}, "_x": {"type": "integer"}}}',
        b'{"properties": {"time": {"type": "integer"}, "class": {"type": "integer"}}}',
        b'{"properties": {"time": {"type": "integer"}, "x": {"type": "code"}}}',
        b'{"properties": {"time": {"type": "integer"}, "x": {"type": []}}}',
        b'{"properties": {"time": {"type": "number"}}}',
        b'{"properties": {"x": {"type": "integer"}}}',
        b"[" * 100_000,
        json.dumps({"properties": {f"x{n}": {"type": "integer"} for n in range(9999)}}).encode(),
    ],
)
def test_a_schema_made_to_harm_is_refused(schema):
    with pytest.raises(ValueError):
        message_class("my_package/Face", schema)
