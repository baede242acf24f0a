"""Recordings made with version 0.1 are read and replayed bit for bit by this version.

How each was made, and what it covers, is in data/recordings_v0_1/README.md. They are never made
again: files written by version 0.1 stay as they are. Texts that a later version words differently
are listed in data/recordings_v0_1/changed_texts.yaml and translated before the comparison. Wires on
which a later version intends to behave differently are listed in changed_behaviour.yaml, by
recording; nothing else may differ.
"""

import json
import re
from collections.abc import Iterable, Iterator
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

import pytest
import yaml

# All that this test needs of the program; after a rename only these lines change.
from diffbotctl.block import Block, Every, FromRobot, In, Out, action
from diffbotctl.messages import Encoders, GoalState, LogLine, Message, Odometry, Stop, Text, Twist
from diffbotctl.params import Param
from diffbotctl.recording.json_codec import message_encoder
from diffbotctl.recording.reader import RecordedMessage, RecordingReader
from diffbotctl.replay.recorded_run import read_run
from diffbotctl.replay.replay import ReplayOptions, replay, replay_run
from diffbotctl.time import SECOND

BLOCKS = "diffbotctl.blocks"  # the entry point by which packages offer their blocks

FOLDER = Path(__file__).parent / "data" / "recordings_v0_1"


class Frozen(NamedTuple):
    """Result of the replay of a recording in version 0.1."""

    compared: int
    """messages that `--check` compares with the recorded ones; 0 where it refuses"""
    digest: str


CHECKED = {
    "edges.mcap": Frozen(1302, "527517cd8eac56d304340b30aa0474d509db9a45d82be51462898deaa5a2688f"),
    "counts.mcap": Frozen(1687, "f6c9a65112b3a6786d87ad4110868ebd453f4bbef7c37d93bc8526e2d33dc037"),
    "stock.mcap": Frozen(859, "9651f42017fe45bd3dcc6bd3d0abcb9c92563239dc626576fde227c8014bf483"),
    "emulated.mcap": Frozen(
        900, "778c87b6b3ea3b67efb212814848b6d4b9bd1e1347e504a7aeae94da2f642e92"
    ),
    "path.mcap": Frozen(1141, "d66a2a0b89b0447af82a9293035d10ad67018c96bbe17dfc0fd2b568dc907e17"),
    "wander.mcap": Frozen(610, "1858fffab89600439617c3b2f28aa54b84922fd9293e21e8d993fe7d841f1ca8"),
    "turtle.mcap": Frozen(522, "ef43c1165626b687026b5c4b4b347b54e82341304e96f952432dd85f961b055d"),
    "obstacle.mcap": Frozen(
        1117, "1a3d0b1108c593020350c3f3a2e3dd55f82fd169fdff5260227188ccf7875fb2"
    ),
    "operator.mcap": Frozen(
        1162, "34a78d4659d3622aca93f1ac0f394a9fe069108de2ad48a679e0dbe60bd8c340"
    ),
    "ease.mcap": Frozen(1089, "771f4be3b568ff5eca266d9b5209bf4ba736451133f1716ad3551ad1d281c85e"),
}

# A recovered recording has no end, and a black box file no messages of blocks: `--check` refuses
# both.
UNCHECKED = {
    "hello.mcap": Frozen(0, "d9d4da6b2dd7ca1855881bbfe5c2424e75e7f9e968341cc0fae624feaa24ae39"),
    "flight.mcap": Frozen(0, "d57896ab4e686117a02f69baac09694fcc36aac9025273b119c3d5c7902cdfb0"),
}


class Unchecked(NamedTuple):
    """What version 0.1 made of a recording that cannot be checked."""

    numbers: str
    """digest of its replay with all texts empty, without what changed_behaviour.yaml covers"""
    texts: tuple[tuple[int, dict[str, str]], ...]
    """the texts of one message by field, with how many messages in a row have the same"""


PUSHED = (
    "the right wheel turns although it was at rest and nothing is commanded: the robot is pushed "
    "or rolls, or its encoder counts noise"
)
HALT = "diffbotctl stop (process 14678, uid 0) asked to stop: end of the flight"
REPLAYED = {
    "hello.mcap": Unchecked(
        "d9d4da6b2dd7ca1855881bbfe5c2424e75e7f9e968341cc0fae624feaa24ae39",
        (),
    ),
    "flight.mcap": Unchecked(
        "25e65dd2194247e0c701fe2417d1ae70e4b2b7b3cefac39785dc01dab0320ed9",
        (
            (16, {"cause": "", "state": "driving"}),
            (1, {"cause": "", "state": "aligning"}),
            (1, {"text": "goal 7: aligning, 4 mm, 0.0 deg to go"}),
            (1, {"cause": "", "state": "aligning"}),
            (1, {"cause": "", "state": "reached"}),
            (1, {"text": "goal 7 reached, 4 mm, 0.0 deg off"}),
            (1, {"text": "goal 8 taken: x 0.800 m  y 0.800 m"}),
            (1, {"cause": "", "state": "turning"}),
            (1, {"text": "goal 8: turning, 701 mm, 88.2 deg to go"}),
            # The recorded robot turns on the spot; this follower turns about the right wheel, which
            # nothing commands then, and drives on without a rest.
            (2, {"cause": "", "state": "turning"}),
            (1, {"text": PUSHED}),
            (2, {"cause": "", "state": "turning"}),
            (1, {"cause": "", "state": "driving"}),
            (1, {"text": "goal 8: driving, 699 mm, 0.0 deg to go"}),
            (16, {"cause": "", "state": "driving"}),
            (2, {"cause": HALT}),
            (1, {"text": f"STOP operator_stop: {HALT}; waits for `resume`"}),
            (1, {"cause": HALT}),
        ),
    ),
}

ALL = {**CHECKED, **UNCHECKED}


class Ease(Block):
    """A user's own block, which ease.mcap was recorded with: let through a share of a velocity."""

    share = Param(float, default=1.0, unit="1", above=0.0, most=1.0, live=True, help="Of both.")
    rounds = Param(int, default=2, least=1, most=9, live=True, help="Ticks from word to word.")
    mode = Param(
        str, default="both", choices=("both", "turns"), live=True, help="What is made smaller."
    )
    speed = FromRobot("limits.speed")

    tick = Every(0.2)
    wanted = In(Twist, fresh_for=0.5)
    odometry = In(Odometry, trigger=False, optional=True)
    twist = Out(Twist)
    text = Out(Text)

    def reset(self):
        self.ticks = 0
        self.extra = 1.0

    def changed(self, name):
        self.log.info(f"{name} is {getattr(self, name)}")

    @action
    def press(self, now, factor=0.5):
        """Make everything smaller by one more factor."""
        if not 0.0 < factor <= 1.0:
            raise ValueError("the factor must be above 0 and at most 1")
        self.extra *= factor

    def react(self, now, tick, wanted, odometry):
        text = None
        if tick is not None:
            self.ticks += 1
            if self.ticks % self.rounds == 0 and odometry is not None:
                text = Text(tick, f"{self.mode}: {odometry.linear / self.speed:.3f} of the limit")
        if wanted is None:
            return None, text
        turning = wanted.angular * self.share * self.extra
        moving = wanted.linear * (self.share * self.extra if self.mode == "both" else 1.0)
        return Twist(now, moving, turning), text


@pytest.fixture(autouse=True)
def package(tmp_path, monkeypatch):
    """An installed package of a user, which offers the block `ease`."""
    info = tmp_path / "easy-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: easy\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{BLOCKS}]\nease = {__name__}:Ease\n")
    monkeypatch.syspath_prepend(str(tmp_path))


def test_all_twelve_are_there():
    assert len(ALL) == 12
    assert {path.name for path in FOLDER.glob("*.mcap")} == set(ALL)


class ChangedText(NamedTuple):
    """One row of changed_texts.yaml."""

    old: str
    new: str
    field: str = "text"
    """`state` for GoalState.state, `text` for all others"""


CHANGED_TEXTS = [
    ChangedText(**row) for row in yaml.safe_load((FOLDER / "changed_texts.yaml").read_text())
]
TEXT_FIELDS = {LogLine: ("text",), Stop: ("cause",), GoalState: ("cause", "state")}


def translated_text(field: str, text: str, rows: Iterable[ChangedText] = CHANGED_TEXTS) -> str:
    """A text of version 0.1 in the words of this version."""
    for row in rows:
        if (row.field == "state") == (field == "state"):
            text = re.sub(row.old, row.new, text)
    return text


def texts_of(message: Message) -> dict[str, str]:
    return {field: getattr(message, field) for field in TEXT_FIELDS.get(type(message), ())}


def translated_texts(texts: dict[str, str]) -> dict[str, str]:
    return {field: translated_text(field, text) for field, text in texts.items()}


def translated(message: Message) -> Message:
    """A message of version 0.1 in the words of this version."""
    return message._replace(**translated_texts(texts_of(message)))


RECORDED = RecordingReader.messages


def translated_messages(reader: RecordingReader) -> Iterator[RecordedMessage]:
    for item in RECORDED(reader):
        message = translated(item.message)
        yield item._replace(message=message, data=message_encoder(type(message))(message))


@pytest.fixture
def in_present_words(monkeypatch):
    """Both the inputs and the recorded outputs of a replay are translated."""
    monkeypatch.setattr(RecordingReader, "messages", translated_messages)


def digest(items: Iterable[RecordedMessage]) -> str:
    """What diffbotctl.recording.comparison makes of these messages."""
    result = sha256()
    for item in items:
        result.update(item.wire.encode() + b" %d " % item.time + item.data)
    return result.hexdigest()


LATER_FIELDS = {
    Odometry: ("warning", "geometry_sd"),
    Encoders: (
        "turn",
        "turn_fault",
        "skipped_left_command",
        "skipped_right_command",
        "skipped_command_time",
        "left_level",
        "right_level",
    ),
}  # added after version 0.1


def without_later_fields(item: RecordedMessage) -> RecordedMessage:
    """The message as version 0.1 would have written it; later fields have their defaults."""
    fields = json.loads(item.data)
    for later in LATER_FIELDS.get(type(item.message), ()):
        assert fields.pop(later) == type(item.message)._field_defaults[later]
    return item._replace(data=json.dumps(fields).encode())


def without_texts(item: RecordedMessage) -> RecordedMessage:
    message = item.message._replace(**dict.fromkeys(texts_of(item.message), ""))
    item = item._replace(message=message, data=message_encoder(type(message))(message))
    return without_later_fields(item)


class ChangedBehaviour(NamedTuple):
    """One row of changed_behaviour.yaml."""

    reason: str
    wires: str
    """regular expression for whole names of wires"""
    recordings: list[str]

    def covers(self, name: str, item: RecordedMessage) -> bool:
        return name in self.recordings and re.fullmatch(self.wires, item.wire) is not None


CHANGED_BEHAVIOUR = [
    ChangedBehaviour(**row)
    for row in yaml.safe_load((FOLDER / "changed_behaviour.yaml").read_text())
]
CHANGED = {name for row in CHANGED_BEHAVIOUR for name in row.recordings}


def unchanged(name: str, items: Iterable[RecordedMessage]) -> list[tuple[str, int, bytes]]:
    """What no row of changed_behaviour.yaml covers: (wire, time, data)."""
    return [
        (item.wire, item.time, item.data)
        for item in items
        if not any(row.covers(name, item) for row in CHANGED_BEHAVIOUR)
    ]


def replayed(name: str, folder: Path) -> list[RecordedMessage]:
    """All messages of a replay."""
    replay_run(read_run(FOLDER / name), ReplayOptions(record=folder / name))
    return list(RECORDED(RecordingReader(folder / name)))


@pytest.mark.parametrize("name", sorted(CHANGED & CHECKED.keys()))
def test_only_the_listed_behaviour_has_changed(name, in_present_words, tmp_path):
    before = list(RecordingReader(FOLDER / name).messages())
    wires = {item.wire for item in before}  # on others, this version alone has messages
    after = [item for item in replayed(name, tmp_path) if item.wire in wires]
    assert unchanged(name, after) == unchanged(name, before)
    assert digest(RECORDED(RecordingReader(FOLDER / name))) == CHECKED[name].digest
    for row in CHANGED_BEHAVIOUR:
        if name not in row.recordings:
            continue
        old, new = (
            [(item.wire, item.time, item.data) for item in items if row.covers(name, item)]
            for items in (before, after)
        )
        assert old and new and old != new, f"nothing has changed: {row.reason}"


@pytest.mark.parametrize("name", sorted(CHECKED.keys() - CHANGED))
def test_every_message_is_computed_again_bit_for_bit(name, in_present_words):
    done = replay(FOLDER / name, check=True)
    assert done.difference is None and done.text_differences == 0
    assert done.compared == CHECKED[name].compared > 0
    reader = RecordingReader(FOLDER / name)
    assert digest(RECORDED(reader)) == CHECKED[name].digest
    assert done.digest == digest(reader.messages())


@pytest.mark.parametrize("name", UNCHECKED)
def test_a_recording_that_cannot_be_checked_is_replayed_to_its_end(
    name, in_present_words, tmp_path
):
    run = read_run(FOLDER / name)
    done = replay_run(run, ReplayOptions(record=tmp_path / name))
    assert done.ending.code == 0 and done.ending.time > run.last
    items = list(RECORDED(RecordingReader(tmp_path / name)))
    assert digest(items) == done.digest
    numbers = [
        item
        for item in map(without_texts, items)
        if not any(row.covers(name, item) for row in CHANGED_BEHAVIOUR)
    ]
    assert digest(numbers) == REPLAYED[name].numbers
    texts = [texts for item in items if (texts := texts_of(item.message))]
    old = [texts for count, texts in REPLAYED[name].texts for _ in range(count)]
    assert texts == [translated_texts(each) for each in old]
    if texts == old:
        assert digest(map(without_later_fields, items)) == UNCHECKED[name].digest


@cache
def recorded_texts() -> set[tuple[str, str]]:
    """All texts that version 0.1 recorded, or computed in the replay of a black box file."""
    recorded = (
        texts_of(item.message) for name in ALL for item in RECORDED(RecordingReader(FOLDER / name))
    )
    replayed = (texts for made in REPLAYED.values() for _, texts in made.texts)
    return {text for texts in (*recorded, *replayed) for text in texts.items()}


@pytest.mark.parametrize("row", CHANGED_TEXTS, ids=lambda row: row.old)
def test_each_changed_text_is_in_a_recording(row):
    before = CHANGED_TEXTS[: CHANGED_TEXTS.index(row)]
    assert any(
        translated_text(field, text, before) != translated_text(field, text, [*before, row])
        for field, text in recorded_texts()
    )


def test_a_black_box_file_begins_in_the_state_that_was_saved():
    run = read_run(FOLDER / "flight.mcap")
    assert run.is_black_box and run.begins == "state"
    assert run.state is not None and run.state[0] > 30 * SECOND
