"""Pipelines under names in another one: wires, remapping, errors, and the names everywhere."""

import json

import pytest

from diffbotctl.config.load import check, load
from diffbotctl.recording.reader import RecordingReader
from tests.support.running import PlainClient, cli, running

HEAD = "format: 1\nkind: pipeline\n"
TWO = f"""{HEAD}include:
  - {{path: hello, as: one}}
  - {{path: hello, as: two, in: {{listener.text: one.talker.text}}}}
"""
OPEN = f"""{HEAD}inputs: {{words: {{type: String, timeout: 0.3 s}}}}
blocks: {{listener: {{block: listener, in: {{text: input.words}}}}}}
"""


@pytest.fixture
def pipeline(tmp_path):
    """Returns a function that writes a pipeline, and `open.yaml` beside it."""
    (tmp_path / "open.yaml").write_text(OPEN)

    def write(text):
        path = tmp_path / "whole.yaml"
        path.write_text(text)
        return str(path)

    return write


def wires(configuration):
    return {
        f"{use.name}.{port}": w for use in configuration.blocks for port, w in use.wires.items()
    }


def test_one_pipeline_is_there_twice_with_a_wire_between(pipeline):
    loaded = load(pipeline(TWO), sets=["two.talker.greeting=hi"])
    assert wires(loaded) == {
        "one.listener.text": "one.talker.text",
        "two.listener.text": "one.talker.text",
    }
    greetings = {use.name: use.values.get("greeting") for use in loaded.blocks}
    assert (greetings["one.talker"], greetings["two.talker"]) == ("hello world", "hi")
    assert [path.name for path in loaded.files] == ["whole.yaml", "hello.yaml"]


def test_blocks_of_the_file_and_declared_inputs_are_wired_to_them(pipeline):
    own = """  - {path: open, as: ear, in: {input.words: one.talker.text}}
  - {path: open, as: other}
  - goal
blocks:
  both: {block: listener, in: {text: one.talker.text}}
"""
    loaded = load(pipeline(TWO + own))
    found = wires(loaded)
    assert found["ear.listener.text"] == found["both.text"] == "one.talker.text"
    assert found["other.listener.text"] == "other.input.words"
    assert [use.wire for use in loaded.inputs] == ["other.input.words"]
    assert loaded.robot is not None and found["kinematics.twist"] == "guard.twist"


def test_motion_that_depends_on_a_part_depends_on_its_inputs(pipeline):
    part = f"""{HEAD}inputs: {{twist: {{type: Twist, timeout: 0.3 s}}}}
blocks: {{limiter: {{block: command_mux, in: {{teleop: input.twist}}}}}}
"""
    whole = f"""{HEAD}include: [goal, {{path: ./part.yaml, as: hand}}, {{path: open, as: ear}}]
blocks: {{mux: {{in: {{teleop: hand.limiter.twist}}}}}}
"""
    path = pipeline(whole)
    path_of_part = path.replace("whole", "part")
    with open(path_of_part, "w") as file:
        file.write(part)
    feeds = {use.wire: use.feeds_motion for use in load(path).inputs}
    assert feeds == {"hand.input.twist": True, "ear.input.words": False}
    with open(path_of_part, "w") as file:
        file.write(part.replace("0.3 s", "2 s"))
    (problem,) = check(path)
    assert problem.code == "E-INPUT" and "2 s is too long for hand.input.twist" in problem.cause


@pytest.mark.parametrize(
    ("text", "line", "code", "words"),
    [
        (TWO.replace("one.talker.text", "one.talker.txt"), 5, "E-WIRE-OUTPUT", "talker.txt"),
        (TWO.replace("one.talker.text", "won.talker.text"), 5, "E-WIRE-NODE", "no block 'won'"),
        (
            TWO.replace("listener.text", "listener.txt"),
            5,
            "E-WIRE-INPUT",
            "listener.txt",
        ),
        (TWO.replace("one.talker.text", "operator.twist"), 5, "E-WIRE-TYPE", "'listener.text' of"),
        (TWO.replace("as: two", "as: one"), 5, "E-INCLUDE", "two includes are called 'one'"),
        (TWO.replace("as: two", "as: Two"), 5, "E-INCLUDE", "not a valid name"),
        (TWO.replace("path: hello, as: two", "path: hallo, as: two"), 5, "E-INCLUDE", "'hallo'"),
        (f"{TWO}  - {{path: goal, as: base}}\n  - open\n", 6, "E-INCLUDE", "drives a robot: goal"),
        (f"{TWO}blocks: {{one: {{block: talker}}}}\n", 6, "E-NAME", "an include is called 'one'"),
        (
            f"{TWO}blocks: {{a: {{block: listener, in: {{text: two.talker.words}}}}}}\n",
            6,
            "E-WIRE-OUTPUT",
            "'two' has no output 'talker.words'",
        ),
        (
            f"{HEAD}include:\n  - {{path: open, as: a, in: {{listener.text: b.listener.heard}}}}\n"
            "  - {path: open, as: b, in: {listener.text: a.listener.heard}}\n",
            4,
            "E-WIRE-LOOP",
            "b.listener -> a.listener -> b.listener",
        ),
    ],
)
def test_mistakes_are_shown_where_they_are(pipeline, text, line, code, words):
    problems = check(pipeline(text))
    assert [(problem.code, problem.line) for problem in problems] == [(code, line)], problems
    assert words in f"{problems[0].cause} {problems[0].fix}"


def test_a_mistake_in_a_part_is_shown_in_its_file(pipeline, tmp_path):
    (tmp_path / "open.yaml").write_text(OPEN.replace("block: listener", "block: listenr"))
    problems = check(pipeline(f"{HEAD}include: {{path: open, as: ear}}\n"))
    assert [problem.code for problem in problems] == ["E-BLOCK-UNKNOWN"]
    assert problems[0].place.source.name.endswith("open.yaml")


def test_a_part_that_names_includes_itself_is_refused(pipeline, tmp_path):
    (tmp_path / "open.yaml").write_text(TWO)
    problems = check(pipeline(f"{HEAD}include: {{path: open, as: ear}}\n"))
    assert "itself gives names" in problems[0].cause and problems[0].line == 3


def test_a_running_engine_its_recording_and_its_replay_have_the_names(pipeline, tmp_path):
    recording = tmp_path / "two.mcap"
    path = pipeline(f"{TWO}  - {{path: open, as: ear}}\n")
    with running(tmp_path, path, "--record", str(recording), sets=()) as process:
        client = PlainClient(tmp_path)
        topics = [row["topic"] for row in client.request("list_topics")["topics"]]
        assert {"one.talker.text", "two.listener.heard", "ear.input.words"} <= set(topics)
        code, _, complaint = cli(tmp_path, "param", "set", "two.talker.period", "50ms")
        assert code == 1 and "two.talker.period cannot change while running" in complaint
        code, output, complaint = cli(
            tmp_path, "topic", "echo", "/one/talker/text", "--once", "--json"
        )
        assert code == 0 and json.loads(output)["text"].startswith("hello world"), complaint
        assert client.request("publish", topic="ear.input.words", message={"text": "hi"})["ok"]
        blocks = [row["block"] for row in client.request("list_blocks")["blocks"]]
        assert "two.listener" in blocks
        process.terminate()
        process.wait(60)
    wires = {item.wire for item in RecordingReader(recording).messages()}
    assert {"one.talker.text", "two.talker.text", "ear.listener.heard"} <= wires
    code, output, complaint = cli(tmp_path, "replay", str(recording), "--check")
    assert code == 0 and "same" in output, complaint
