"""Files of format 1 have the results that the conformance folder states: docs/compatibility.md."""

import json
from itertools import pairwise
from pathlib import Path

import pytest
import yaml

from diffbotctl.config.load import load, load_robot
from diffbotctl.errors import UserError
from diffbotctl.recording.reader import RecordingReader
from tests.support.running import PlainClient, running

FOLDER = Path(__file__).parent.parent / "conformance"


def has(actual, stated):
    """Whether a value is as stated; what is not stated of an object may be anything."""
    if isinstance(stated, dict):
        return isinstance(actual, dict) and all(
            key in actual and has(actual[key], value) for key, value in stated.items()
        )
    if isinstance(stated, float):
        return actual == pytest.approx(stated, rel=1e-9)
    return actual == stated


def result_of(read):
    """What `read` returns, or the errors for which the files are refused."""
    try:
        return read()
    except UserError as error:
        errors = [each for each in error.problems if each.severity == "error"]
        return {"errors": [[each.code, each.line, each.column] for each in errors]}


def robot_values(file, paths):
    robot, values = load_robot(str(file)).robot, {}
    for path in paths:
        value = robot
        for name in path.split("."):
            value = value[name] if isinstance(value, dict) else getattr(value, name)
        values[path] = value
    return {"values": values}


def pipeline_graph(file):
    loaded = load(str(file), str(FOLDER / "robots" / "units.yaml"), ())
    return {
        "goals": [[goal.x, goal.y, goal.heading] for goal in loaded.goals],
        "robot": loaded.robot_wires,
        "blocks": {block.name: [block.kind, block.wires] for block in loaded.blocks},
        "parameters": {
            f"{block.name}.{name}": value
            for block in loaded.blocks
            for name, value in block.values.items()
        },
    }


def recorded_topics(file):
    found = {}
    reader = RecordingReader(file)
    messages = list(reader.messages())
    assert all(a.time <= b.time for a, b in pairwise(messages))
    for item in messages:
        topic = found.setdefault(
            item.wire, {"type": type(item.message).__name__, "messages": 0, "first": None}
        )
        topic["messages"] += 1
        topic["last"] = json.loads(item.data)
        topic["first"] = topic["first"] or topic["last"]
    return {"topics": found}


@pytest.mark.parametrize(
    "file", sorted(FOLDER.glob("*/*.json")), ids=lambda file: f"{file.parent.name}-{file.stem}"
)
def test_a_file_has_its_result(file):
    stated = json.loads(file.read_text())
    match file.parent.name:
        case "robots":
            given = file.with_suffix(".yaml")
            found = result_of(lambda: robot_values(given, stated.get("values", ())))
        case "pipelines":
            found = result_of(lambda: pipeline_graph(file.with_suffix(".yaml")))
        case "recordings":
            found = recorded_topics(file.with_suffix(".mcap"))
    assert has(found, stated), json.dumps(found, indent=1)


def test_every_file_of_the_folder_has_a_result():
    given = {file for file in FOLDER.glob("*/*") if file.suffix in (".yaml", ".mcap")}
    given.discard(FOLDER / "socket" / "requests.yaml")
    assert given and all(file.with_suffix(".json").exists() for file in given)


def test_the_socket_replies_as_stated(tmp_path):
    about = yaml.safe_load((FOLDER / "socket" / "requests.yaml").read_text())
    with running(tmp_path, "goal", "--stay", "--goal", "0 0", name="conformance"):
        client = PlainClient(tmp_path, "conformance", hello="")
        assert has(client.greeting, about["hello"])
        for exchange in about["exchanges"]:
            line = exchange["send"]
            client.send(line if isinstance(line, str) else json.dumps(line))
            if "reply" in exchange:
                reply = client.read()
                assert has(reply, exchange["reply"]), (line, reply)
        client.close()
