"""What `replay --check` accepts: equal messages, and other texts from another version."""

import pytest

from diffbotctl.messages import LogLine, Stop, Twist
from diffbotctl.recording.comparison import ReplayChecker
from diffbotctl.recording.json_codec import message_encoder
from diffbotctl.recording.reader import RecordedMessage

WIRES = {"mux.twist": Twist, "gate.stop": Stop, "log": LogLine}
RECORDED = (
    0,
    Twist(0, 0.1, 0.0),
    Stop(0, "operator_stop", "a cause", True),
    LogLine(0, "info", "a", "b"),
)


def checked(replayed, texts_may_differ):
    items = [
        RecordedMessage(0, wire, False, message, message_encoder(WIRES[wire])(message), 0)
        for wire, message in zip(WIRES, RECORDED[1:], strict=True)
    ]
    checker = ReplayChecker(WIRES, set(WIRES), items, texts_may_differ)
    checker.record(replayed)
    checker.finish()
    return checker


REWORDED = (0, RECORDED[1], RECORDED[2]._replace(cause="other"), RECORDED[3]._replace(text="other"))


def test_texts_of_another_version_are_counted():
    checker = checked(REWORDED, texts_may_differ=True)
    assert checker.difference is None
    assert (checker.compared, checker.text_differences) == (3, 2)


def test_texts_of_the_same_version_are_a_difference():
    assert checked(REWORDED, texts_may_differ=False).difference.wire == "gate.stop"


@pytest.mark.parametrize(
    "place, change",
    [
        (1, {"linear": 0.2}),
        (2, {"code": "obstacle"}),
        (2, {"latched": False}),
        (3, {"level": "error"}),
        (3, {"source": "engine"}),
    ],
)
def test_all_else_is_a_difference_in_any_version(place, change):
    replayed = list(REWORDED)
    replayed[place] = RECORDED[place]._replace(**change)
    assert checked(tuple(replayed), texts_may_differ=True).difference is not None


def test_a_missing_message_is_a_difference_in_any_version():
    assert checked((*REWORDED[:3], None), texts_may_differ=True).difference.wire == "log"
