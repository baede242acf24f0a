"""The state in a black box file: exact, and harmless whatever the file holds."""

import json
import pickle
from collections import deque
from pathlib import Path
from random import Random
from typing import NamedTuple

import pytest
from click.testing import CliRunner

from diffbotctl.cli.main import program
from diffbotctl.config.load import load
from diffbotctl.messages import Twist
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.recording.snapshot import StateError, take_snapshot
from diffbotctl.recording.snapshot_json import BYTES_MAX, DEPTH_MAX, OBJECTS_MAX, from_json, to_json
from diffbotctl.recording.writer import RecordingHeader, RecordingWriter
from diffbotctl.replay.recorded_run import read_run
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND
from tests.sampling import by_day
from tests.support.confined import ConfinedCommands
from tests.support.trials.hostile_yaml import odd_value

MEMORY_MAX_BYTES = 100 << 20
CPU_MAX_S = 10
MIDDLE = 2 * SECOND


class Saved(NamedTuple):
    """A recording, and the state in its middle as it is in a file."""

    path: Path
    state: bytes


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("saved") / "whole.mcap"
    options = RunOptions(fast=True, duration=3.0, record=path, seed=2)
    Run(load("goal"), options).go()
    half = Run(load("goal"), options._replace(duration=MIDDLE / SECOND, record=None))
    half.go()
    return Saved(path, to_json(pickle.loads(take_snapshot(half.engine))))


def write_flight(path, saved, state, **about):
    """A black box file that begins in `state`."""
    run = read_run(saved.path)
    reader = RecordingReader(saved.path)
    items = [item for item in reader.messages() if item.from_driver and item.time > MIDDLE]
    wires = {wire: reader.kinds[wire] for wire in dict.fromkeys(item.wire for item in items)}
    with path.open("wb") as file:
        header = RecordingHeader(wires, len(wires), {**run.about, "flight": "state", **about})
        recording = RecordingWriter(file, header)
        recording.attach_state(MIDDLE, state)
        for item in items:
            messages = (item.message if wire == item.wire else None for wire in wires)
            recording.write((item.time, *messages))
        recording.finish({**run.end, "instants": str(recording.instants)})


@pytest.fixture(scope="module")
def commands(tmp_path_factory):
    with ConfinedCommands(tmp_path_factory.mktemp("hostile")) as commands:
        yield commands


def replayed(commands, path):
    outcome = commands.run("replay", path)
    assert outcome.faults == [], outcome.output[-2000:]
    assert outcome.peak_bytes <= MEMORY_MAX_BYTES and outcome.cpu_s <= CPU_MAX_S
    return outcome


def nothing(module, name):
    raise StateError(f"no {module}.{name}")


def test_values_come_back_exactly_and_what_was_shared_is_shared():
    shared = [0.1, float("inf"), -0.0, 10**30, None, True, "\udc80\n"]
    state = ({1: shared, (2, "b"): {3}}, deque([shared], 5), bytearray(b"\0\xff"), frozenset("a"))
    back = from_json(to_json(state), nothing)
    assert back == state and repr(back) == repr(state)
    assert back[0][1] is back[1][0] and back[1].maxlen == 5
    assert to_json(back) == to_json(state)


def cycle():
    items = []
    items.append(items)
    return items


def nested():
    items = []
    for _ in range(DEPTH_MAX):
        items = [items]
    return items


@pytest.mark.parametrize(
    "value", [print, cycle(), nested(), range(3), [[] for _ in range(OBJECTS_MAX)], "x" * BYTES_MAX]
)
def test_what_could_not_be_restored_is_not_saved(value):
    with pytest.raises(StateError):
        to_json({"value": value})


def test_a_file_without_a_hostile_state_is_replayed_from_it(saved, commands, tmp_path):
    write_flight(tmp_path / "flight.mcap", saved, saved.state)
    outcome = replayed(commands, tmp_path / "flight.mcap")
    assert outcome.code == 0 and "starts 2.00 s after" in outcome.output


def nested_deques():
    """A pickle of 2 MB whose deques hold one another's contents: gigabytes when it is read."""
    value = b"\x80\x02]q\x00(" + b"N" * 1_000_000 + b"e"
    make = b"ccollections\ndeque\nq\x01h\x00\x85R"
    return value + make + b"h\x01h\x00\x85R" * 90_000 + b"0" * 90_000 + b"."


def doubled(kind):
    objects = [["tuple"]] + [[kind, [n], [n]] for n in range(12)]
    return json.dumps([*objects, ["set", [len(objects) - 1]]]).encode()


HOSTILE = {
    "a pickle": pickle.dumps(({}, {})),
    "nested deques": nested_deques(),
    "nothing": b"",
    "null": b"null",
    "no object": b"[]",
    "not the parts": b'[["tuple"]]',
    "lists in lists": b"[" * 500_000 + b"]" * 500_000,
    "a deep list": json.dumps([["list"], *(["list", [n]] for n in range(20_000))]).encode(),
    "doubled tuples": doubled("tuple"),
    "doubled messages": doubled("diffbotctl.messages:Wheels"),
    "many lists": b"[" + b",".join([b'["list"]'] * 200_000) + b"]",
    "empty entries": b"[" + b",".join([b"[]"] * 650_000) + b"]",
    "itself": b'[["list", [0]]]',
    "a later object": b'[["list", [1]], ["list"]]',
    "an earlier one from the end": b'[["list"], ["list", [-1]]]',
    "a function": b'[["os:system", "id"]]',
    "a class of a process": b'[["diffbotctl.processes.child_process:ChildSender", "x"]]',
    "another class": b'[["list"], ["diffbotctl.control.coast:Coast", "__class__", [0]]]',
    "too few fields": b'[["diffbotctl.messages:Twist", 1]]',
    "a long number": b'[["list", ' + b"9" * 100_000 + b"]]",
    "3 MB": b'[["list", "' + b"x" * (3 << 20) + b'"]]',
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_state_is_refused(name, saved, commands, tmp_path):
    path = tmp_path / "flight.mcap"
    write_flight(path, saved, HOSTILE[name])
    outcome = replayed(commands, path)
    assert outcome.code == 1 and "E-RECORDING" in outcome.output
    assert "the state at its beginning" in outcome.output
    assert commands.run("bag", "info", path).faults == []


def change(rng, objects):
    """One change of a value, a reference, a class or a number of parts somewhere in the state."""
    entry = rng.choice([entry for entry in objects if len(entry) > 1])
    place = rng.randrange(len(entry))
    other = rng.choice(objects)
    entry[place] = rng.choice(
        (
            [rng.randrange(len(objects))],
            rng.choice(other),
            -(10**18),
            10**18,
            float("nan"),
            None,
            odd_value(rng),
        )
    )
    if rng.random() < 0.1:
        del entry[place]


@pytest.mark.parametrize("seed", by_day(2, range(12)))
def test_a_changed_state_is_used_or_refused(seed, saved, commands, tmp_path):
    rng, objects = Random(seed), json.loads(saved.state)
    for _ in range(rng.choice((1, 1, 10))):
        change(rng, objects)
    path = tmp_path / "flight.mcap"
    write_flight(path, saved, json.dumps(objects, default=str).encode())
    replayed(commands, path)


def test_a_timer_that_is_overdue_by_years_is_refused(saved, commands, tmp_path):
    objects = json.loads(saved.state)
    wires = next(entry for entry in objects if any("deadline_" in str(part) for part in entry))
    place = next(n for n, part in enumerate(wires) if str(part).startswith("deadline_"))
    wires[place + 1] = -(10**18)
    write_flight(tmp_path / "flight.mcap", saved, json.dumps(objects).encode())
    outcome = replayed(commands, tmp_path / "flight.mcap")
    assert outcome.code == 1 and "a timer is due before it" in outcome.output


def test_a_state_of_another_version_is_not_used_and_the_command_states_it(saved, tmp_path):
    path = tmp_path / "flight.mcap"
    write_flight(path, saved, saved.state, version="0.0.9")
    result = CliRunner().invoke(program, ["replay", str(path)])
    assert result.exit_code == 0, result.output
    assert "starts in an unknown state: version 0.0.9 saved it" in result.output


def test_a_message_of_the_pipeline_is_restored_without_a_call():
    twist = Twist(7, 0.1, -0.0)
    assert from_json(to_json([twist]), lambda module, name: Twist) == [twist]
