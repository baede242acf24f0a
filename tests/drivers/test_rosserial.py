"""Arduino sketches over rosserial: types, what differs, commands that are never sent late."""

import struct
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.config.load import check
from diffbotctl.links.rosserial_scalars import CODECS
from diffbotctl.links.rosserial_sketch import SketchBoard, port_name
from diffbotctl.messages import STD_MSGS, Bool, Empty, Float32, Int16, Int32, Text, UInt64, fields
from diffbotctl.time import SECOND
from tests.support.arduino_sketch import MD5, ArduinoSketch
from tests.support.book_board import BookBoardPort, text
from tests.support.running import PlainClient, cli, running

WALL = 1_700_000_000 * SECOND + 5


def test_the_sums_of_the_definitions_are_those_of_ros():
    sums = {codec.ros_type[0]: codec.ros_type[1] for codec in CODECS.values()}
    assert len(sums) == 13
    assert {name: sums[f"std_msgs/{name}"] for name in MD5} == MD5


@pytest.mark.parametrize(
    ("message", "payload"),
    [
        (Int16(7, -2), "feff"),
        (Int32(7, 258), "02010000"),
        (Float32(7, 0.5), "0000003f"),
        (Bool(7, True), "01"),
        (Empty(7), ""),
        (Text(7, "hi"), "020000006869"),
        (UInt64(7, 1), "0100000000000000"),
    ],
)
def test_payloads_byte_by_byte(message, payload):
    codec = CODECS[type(message)]
    assert codec.encode(message).hex() == payload
    assert codec.decode(7, bytes.fromhex(payload)) == message
    assert codec.decode(7, bytes.fromhex(payload) + b"x") is None


def test_what_does_not_fit_is_refused():
    for message in (Int16(0, 40_000), Float32(0, 1e39)):
        with pytest.raises(ValueError, match=r"does not fit into std_msgs/"):
            CODECS[type(message)].encode(message)
    assert CODECS[UInt64].decode(0, b"\xff" * 8) is None
    assert CODECS[Float32].decode(0, struct.pack("<f", inf)) == (0, inf)


@given(st.sampled_from(sorted(STD_MSGS)), st.binary(max_size=12))
def test_any_payload_is_a_message_of_the_type_or_none(name, payload):
    kind = STD_MSGS[name]
    message = CODECS[kind].decode(5, payload)
    assert message is None or type(message) is kind
    if message is not None and "data" in fields(kind):
        hint, field = fields(kind)["data"]
        assert type(message.data) is hint
        assert hint is float or field.minimum <= message.data <= field.maximum


def test_topics_have_names_that_a_pipeline_can_write():
    names = ["/chatter", "front/led", "toggleLed", "ADC", "pushed"]
    assert list(map(port_name, names)) == ["chatter", "front_led", "toggle_led", "adc", "pushed"]


class Link:
    """Host and sketch in virtual time, joined by a line that can be cut."""

    def __init__(self, sketch, publishers, subscribers):
        self.sketch = sketch
        self.host = SketchBoard(publishers, subscribers, 57600)
        self.now = 0
        self.is_cut = False
        self.messages = []

    def run(self, seconds):
        """Until then, or the failure."""
        until = self.now + round(seconds * SECOND)
        while self.now < until:
            self.now += SECOND // 100
            self.sketch.run(self.now / SECOND)
            sent = b"".join(data for _, data, _ in self.sketch.arrived(self.now / SECOND))
            data = b"" if self.is_cut else sent
            self.messages += self.host.receive(self.now, data, WALL)
            while frame := self.host.send(self.now):
                if not self.is_cut:
                    self.sketch.take(frame)
            if (failure := self.host.failure(self.now)) is not None:
                return failure
        return None


def hello(**changed):
    """A sketch with a text, a count, a servo and a light."""
    published = {"chatter": "String", "count": "Int32"} | changed.pop("published", {})
    subscribed = {"servo": "UInt16", "/toggleLed": "Empty"} | changed.pop("subscribed", {})
    return ArduinoSketch(published, subscribed, **changed)


PUBLISHERS = {"chatter": Text, "count": Int32}
SUBSCRIBERS = {"servo": STD_MSGS["UInt16"], "toggle_led": Empty}


def test_a_sketch_is_asked_once_and_exchanges_messages():
    link = Link(hello(), PUBLISHERS, SUBSCRIBERS)
    link.sketch.values = {"chatter": text("hello"), "count": struct.pack("<i", -3)}
    assert link.run(1.0) is None and link.host.is_ready
    assert {name: message[1] for name, message in link.messages} == {
        "chatter": "hello",
        "count": -3,
    }
    link.host.publish("servo", STD_MSGS["UInt16"](0, 90))
    link.host.publish("servo", STD_MSGS["UInt16"](0, 91))  # replaces the one before
    link.host.publish("toggle_led", Empty(0))
    link.sketch.say("moved", level=2)
    assert link.run(12.0) is None  # longer than a board waits for the time
    assert link.sketch.configured and link.sketch.requests == 1
    assert sorted(link.sketch.received) == [("/toggleLed", b""), ("servo", b"\x5b\x00")]
    assert link.host.log == [("warning", "moved")]


def test_a_board_that_restarts_or_is_plugged_in_again_gets_no_old_command():
    link = Link(hello(), PUBLISHERS, SUBSCRIBERS)
    link.host.publish("servo", STD_MSGS["UInt16"](0, 10))  # before the board is known
    assert link.run(1.0) is None
    link.is_cut = True
    link.host.publish("servo", STD_MSGS["UInt16"](0, 20))  # lost on the line
    assert link.run(3.0) is None
    link.host.publish("servo", STD_MSGS["UInt16"](0, 30))  # waits when the port is lost
    link.host.opened(link.now)
    link.is_cut = False
    assert link.run(2.0) is None and link.host.is_ready
    assert link.sketch.received == []
    link.sketch.restart()  # it is silent until it is asked again
    assert link.run(6.0) is None
    assert link.sketch.configured and link.sketch.received == []


def test_a_text_beyond_the_memory_of_the_board_is_not_sent():
    link = Link(ArduinoSketch({}, {"say": "String"}, space=16), {}, {"say": Text})
    assert link.run(1.0) is None
    link.host.publish("say", Text(0, "x" * 12))
    with pytest.raises(ValueError, match="17 bytes are too many: the board takes 16"):
        link.host.publish("say", Text(0, "x" * 13))
    link.run(0.1)
    assert link.sketch.received == [("say", text("x" * 12))]


@pytest.mark.parametrize(
    ("sketch", "words"),
    [
        (
            hello(published={"chatter": "Int32"}),
            "the sketch declares chatter as std_msgs/Int32, this driver expects std_msgs/String",
        ),
        (
            hello(subscribed={"servo": f"UInt16 {'0' * 32}"}),
            f"declares servo as std_msgs/UInt16, of another definition (MD5 {'0' * 32})",
        ),
        (
            ArduinoSketch({"chatter": "String"}, {"servo": "UInt16", "led": "Empty"}),
            "count is missing: the sketch publishes chatter (std_msgs/String); toggle_led is "
            "missing: the sketch subscribes to servo (std_msgs/UInt16), led (std_msgs/Empty)",
        ),
    ],
)
def test_what_differs_is_named(sketch, words):
    failure = Link(sketch, PUBLISHERS, SUBSCRIBERS).run(6.0)
    assert failure.is_final and words in failure.cause


def test_silence_is_named():
    link = Link(hello(), PUBLISHERS, SUBSCRIBERS)
    link.is_cut = True
    failure = link.run(11.0)
    assert "no answer of rosserial comes at 57600 baud" in failure.cause and not failure.is_final
    link = Link(hello(), PUBLISHERS, SUBSCRIBERS)
    assert link.run(1.0) is None
    link.is_cut = True
    assert link.run(8.0) is None and link.run(4.0).cause == "nothing comes from it"


PIPELINE = """
format: 1
kind: pipeline
sources:
  board:
    driver: rosserial
    timeout: 2 s
    with: {device: $device}
    out: {chatter: String}
    in: {say: talker.text}
blocks:
  talker: {block: talker}
  listener: {block: listener, in: {text: board.chatter}}
"""


@pytest.mark.parametrize(
    ("old", "new", "code", "words"),
    [
        ("chatter: String", "chatter: Twist", "E-SOURCE", "the driver rosserial has no Twist"),
        ("chatter: String", "chatter: Strin", "E-MESSAGE-TYPE", "no message type 'Strin'"),
        ("chatter: String", "Chatter: String", "E-NAME", "not a valid output name"),
        ("talker.text", "talker.words", "E-WIRE-OUTPUT", "no output 'words'"),
        ("talker.text", "operator.twist", "E-WIRE-TYPE", "which 'board' cannot be sent"),
        ("board.chatter", "board.chat", "E-WIRE-OUTPUT", "no output 'chat'"),
        ("rosserial", "joystick", "E-SOURCE", "has outputs of its own: twist"),
        ("device: $device", "device: /dev/x, baud: 1200", "E-CHOICE", "baud cannot be"),
    ],
)
def test_wrong_declarations_are_errors(tmp_path, old, new, code, words):
    path = tmp_path / "board.yaml"
    path.write_text(PIPELINE.replace(old, new).replace("$device", "/dev/x"))
    found = [(problem.code, problem.cause) for problem in check(str(path))]
    assert any(code == each and words in cause for each, cause in found), found


def test_the_graph_shows_what_is_sent_to_it(pipeline, tmp_path):
    code, output, _ = cli(tmp_path, "graph", str(pipeline), "--mermaid")
    assert code == 0
    assert "board -->|chatter to text| listener" in output
    assert "talker -->|text to say| board" in output


@pytest.fixture
def pipeline(tmp_path):
    path = tmp_path / "board.yaml"
    path.write_text(PIPELINE.replace("$device", str(tmp_path / "tty")))
    return path


def plugged(tmp_path, sketch):
    port = BookBoardPort(sketch)
    (tmp_path / "tty").unlink(missing_ok=True)
    (tmp_path / "tty").symlink_to(port.name)
    return port


def sketch():
    made = ArduinoSketch({"chatter": "String"}, {"say": "String"})
    made.values = {"chatter": text("I am an Arduino")}
    return made


def count(payload):
    """The number of a text of the talker."""
    return int(payload.split()[-1])


def test_a_board_talks_is_unplugged_and_plugged_in_again(tmp_path, pipeline):
    first = plugged(tmp_path, sketch())
    with running(tmp_path, str(pipeline), sets=()):
        first.wait_for(lambda board: len(board.received) > 3, 10.0)
        before = count(first.board.received[-1][1])
        _, output, _ = cli(tmp_path, "topic", "echo", "board.chatter", "--once", "--json")
        assert '"text": "I am an Arduino"' in output
        client = PlainClient(tmp_path)
        client.request("subscribe", topic="log")
        first.close()
        while "it has disconnected" not in (line := client.read()).get("message", {}).get(
            "text", ""
        ):
            assert line is not None
        assert "source board" in line["message"]["text"]
        with plugged(tmp_path, sketch()) as second:
            second.wait_for(lambda board: len(board.received) > 3, 20.0)
            numbers = [count(payload) for _, payload in second.board.received]
            # Those that the talker sent meanwhile, ten a second, are not sent late.
            assert numbers[0] > before + 4 and numbers[3] - numbers[0] <= 6


def test_a_board_with_other_topics_ends_the_run_at_its_start(tmp_path, pipeline):
    with plugged(tmp_path, ArduinoSketch({"chatter": "Int32"}, {"say": "String"})):
        code, _, complaint = cli(tmp_path, "run", str(pipeline), "--for", "20s")
    assert code != 0 and "E-DEVICE" in complaint and "  board:" in complaint
    assert "declares chatter as std_msgs/Int32" in " ".join(complaint.split())
