"""Inputs of a pipeline: declared, published by clients, stale after their timeout, replayed."""

import json
from pathlib import Path

import pytest

from diffbotctl.config.load import check, load
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.drivers.input_leases import InputLeases
from diffbotctl.messages import Range, Twist
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.time import MILLISECOND as MS
from tests.support.background import repeating
from tests.support.running import PlainClient, cli, moves, running, stands

PIPELINE = """
format: 1
kind: pipeline
include: goal
goals: []
inputs:
  twist: {type: Twist, timeout: 0.3 s}
  gap: {type: Range, timeout: 0.2 s, neutral: {distance: 200 cm, state: clear}}
  words: {type: String, timeout: 0.2 s}
  count: {type: Int8}
blocks:
  mux: {in: {autonomous: input.twist}}
  listener: {block: listener, in: {text: input.words}}
"""


@pytest.fixture
def pipeline(tmp_path):
    path = tmp_path / "led.yaml"
    path.write_text(PIPELINE)
    return path


def publishing(client, topic, message, sent=None):
    """`client` publishes the message 20 times a second, from a thread, until the end.

    `sent`: a list that receives each line.
    """
    line = json.dumps({"method": "publish", "topic": topic, "message": message})

    def publish():
        client.send(line)
        if sent is not None:
            sent.append(line)

    return repeating(publish, 0.05)


def refusal(client, topic, **message):
    reply = client.request("publish", topic=topic, message=message)
    assert reply["ok"] is False
    return reply["cause"]


def test_a_client_drives_by_an_input_and_its_end_stops_and_latches(tmp_path, pipeline):
    recording = tmp_path / "led.mcap"
    with running(tmp_path, str(pipeline), "--stay", "--record", str(recording)) as process:
        watcher = PlainClient(tmp_path)
        publisher = PlainClient(tmp_path, hello='{"hello": 2, "name": "leader"}')
        with publishing(publisher, "input.twist", {"linear": 0.1, "angular": 0.0}):
            watcher.until(moves)
            cause = refusal(watcher, "input.twist", linear=0.1, angular=0.0)
            assert "leader" in cause and "publishes on this input" in cause
        publisher.close()
        held = watcher.until(lambda status: status["held"] and stands(status))["held"]
        assert (held["code"], held["latched"]) == ("input_stale", True)
        assert "leader" in held["cause"] and "disconnected" in held["cause"]
        again = PlainClient(tmp_path, hello='{"hello": 2, "name": "second"}')
        sent = []
        with publishing(again, "input.twist", {"linear": 0.1, "angular": 0.0}, sent):
            begin = watcher.request("status")["time"]
            watcher.until(lambda status: status["time"] > begin + 500 * MS)
            # A busy machine sends fewer in that time than the recording is asked for below.
            watcher.until(lambda status: len(sent) > 20)
            status = watcher.request("status")
            assert stands(status) and status["held"]["code"] == "input_stale"
            assert watcher.request("resume")["ok"]
            watcher.until(moves)
        held = watcher.until(lambda status: status["held"] and stands(status))["held"]
        assert "nothing on input.twist for 0.3 s" in held["cause"]
        lines = [line["text"] for line in watcher.request("read_log")["lines"]]
        assert any("leader" in text and "disconnected" in text for text in lines)
        assert "second" in cli(tmp_path, "why")[1]
        process.terminate()
        process.wait(timeout=60)
    code, out, _ = cli(tmp_path, "replay", str(recording), "--check")
    assert code == 0 and "same" in out
    origins = RecordingReader(recording)
    twists = [item for item in origins.messages() if item.wire == "input.twist"]
    assert len(twists) > 10 and all(item.from_driver for item in twists)
    # Of two messages that come at the same time, the engine takes the second 1 ns later.
    assert all(0 <= item.time - item.message.time < 1000 for item in twists)


def test_an_input_that_feeds_no_motion_only_expires(tmp_path, pipeline):
    with running(tmp_path, str(pipeline), "--stay"):
        client = PlainClient(tmp_path)
        assert client.request("publish", topic="input.words", message={"text": "hi"})["ok"]
        client.request("subscribe", topic="log")
        while "expired" not in (line := client.read()).get("message", {}).get("text", ""):
            assert line is not None
        assert client.request("status")["held"] is None
        described = client.request("describe_topic", topic="listener.heard")
        assert described["last"]["text"] == "heard: hi"


@pytest.mark.parametrize(
    ("topic", "message", "words"),
    [
        ("input.twist", {"linear": 0.1}, "angular is missing"),
        ("input.twist", {"linear": "fast", "angular": 0}, "linear must be a number"),
        ("input.twist", {"linear": "inf", "angular": 0}, "not a finite number"),
        ("input.twist", {"linear": "nan", "angular": 0}, "must be a number"),
        ("input.twist", {"linear": True, "angular": 0}, "must be a number"),
        ("input.twist", {"linear": 0, "angular": 0, "z": 0}, "no field 'z'"),
        ("input.gap", {"distance": 1, "state": "open"}, "one of clear"),
        ("input.count", {"data": 128}, "data must be -128 to 127; it is 128"),
        ("input.count", {"data": 1.5}, "data must be a whole number"),
        ("input.words", {"text": 5}, "must be a text"),
        ("input.words", {"text": "x" * 20_000}, "characters"),
        ("input.nose", {}, "no topic"),
    ],
)
def test_what_is_no_message_of_the_type_is_refused(tmp_path_factory, topic, message, words):
    folder = shared_run(tmp_path_factory)
    assert words in refusal(PlainClient(folder), topic, **message)


_shared = {}


@pytest.fixture(scope="module", autouse=True)
def ended():
    yield
    for context in _shared.pop("context", ()):
        context.__exit__(None, None, None)


def shared_run(factory):
    """The folder of one run for all tests that disturb nothing."""
    if not _shared:
        folder = factory.mktemp("inputs")
        path = folder / "led.yaml"
        path.write_text(PIPELINE)
        context = running(folder, str(path), "--stay")
        context.__enter__()
        _shared.update(folder=folder, context=(context,))
    return _shared["folder"]


def test_the_neutral_message_comes_at_the_start(tmp_path_factory):
    client = PlainClient(shared_run(tmp_path_factory))
    last = client.request("describe_topic", topic="input.gap")["last"]
    assert (last["distance"], last["state"]) == (2.0, "clear")


def test_a_number_of_ros_is_published(tmp_path_factory):
    client = PlainClient(shared_run(tmp_path_factory))
    client.request("subscribe", topic="input.count")
    client.send('{"method": "publish", "topic": "input.count", "message": {"data": -128}}')
    while (line := client.read()) is not None and "message" not in line:
        pass
    assert line["message"]["data"] == -128
    assert client.request("describe_topic", topic="input.count")["type"] == "Int8"


def test_what_is_published_to_no_block_is_reported(tmp_path_factory):
    folder = shared_run(tmp_path_factory)
    code, _, complaint = cli(folder, "topic", "pub", "input.count", '{"data": 1}')
    assert code == 0 and "no block and no program of this pipeline reads input.count" in complaint
    assert cli(folder, "topic", "pub", "input.words", '{"text": "hi"}')[2] == ""


def leases(pipeline):
    uses = load(str(pipeline)).inputs
    return InputLeases(uses, Operator([], lambda code, cause: None, stay=True))


def test_leases_in_logical_time(pipeline):
    ours = leases(pipeline)
    (gap,) = ours.deliver(0)
    assert gap == ("input.gap", Range(0, 2.0, "clear"))
    assert ours.due() > 10**15
    assert ours.renew(1000 * MS, "input.twist", 1, "ann") is None
    assert ours.renew(1100 * MS, "input.twist", 2, "bob") == "ann"
    assert ours.due() == 1300 * MS and ours.deliver(1300 * MS - 1) == []
    (halt,) = ours.deliver(1300 * MS)
    assert halt.wire == "operator.halt" and halt.message.latched
    assert "ann has published nothing" in halt.message.cause
    assert ours.renew(1400 * MS, "input.twist", 2, "bob") is None
    ours.end(1450 * MS, 2, "bob has disconnected")
    assert ours.due() == 1450 * MS + 1
    (halt,) = ours.deliver(ours.due())
    assert halt.message.cause == "bob has disconnected"
    assert ours.renew(1500 * MS, "input.gap", 3, "eve") is None
    (gap,) = ours.deliver(1700 * MS)
    assert gap == ("input.gap", Range(1700 * MS, 2.0, "clear"))


def test_only_what_motion_depends_on_stops_it(pipeline):
    feeds = {use.wire: use.feeds_motion for use in load(str(pipeline)).inputs}
    assert feeds == {
        "input.twist": True,
        "input.gap": False,
        "input.words": False,
        "input.count": False,
    }


def test_blocks_get_no_message_that_has_expired(pipeline):
    from diffbotctl.runs.build_graph import assemble

    seen = []
    graph = assemble(load(str(pipeline)), False).graph
    mux = graph.block("mux")
    mux.react = lambda now, teleop, autonomous: seen.append((now, autonomous))
    compiled = graph.compile({}, None)
    place = graph.sources.index("input.twist")
    messages = [None] * len(graph.sources)
    messages[place] = Twist(5, 0.1, 0.0)
    compiled.instant(5, *messages)
    assert compiled.due() <= 5 + 300 * MS
    compiled.instant(5 + 300 * MS, *([None] * len(graph.sources)))
    assert seen == [(5, Twist(5, 0.1, 0.0)), (5 + 300 * MS, None)]


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("twist: {type: Twyst}", "E-MESSAGE-TYPE"),
        ("twist: {type: os/system}", "E-MESSAGE-TYPE"),
        ("twist: {type: Resume}", "E-INPUT"),
        ("twist: {type: Call}", "E-INPUT"),
        ("twist: {type: Twist, timeout: 2 s}", "E-INPUT"),
        ("twist: {type: Twist, timeout: 0 s}", "E-BOUNDS"),
        ("twist: {type: Twist, neutral: {linear: 0}}", "E-INPUT"),
        ("twist: {type: Twist, neutral: {linear: 0.1 m, angular: 0}}", "E-INPUT"),
        ("twist: {type: Range}", "E-WIRE-TYPE"),
        ("twyst: {type: Twist}", "E-WIRE-OUTPUT"),
        ("Twist: {type: Twist}", "E-NAME"),
        ("twist: {timeout: 1 s}", "E-KEY-MISSING"),
    ],
)
def test_wrong_declarations_are_errors(pipeline, line, code):
    text = pipeline.read_text().replace("twist: {type: Twist, timeout: 0.3 s}", line)
    Path(pipeline).write_text(text)
    assert code in [problem.code for problem in check(str(pipeline))]
