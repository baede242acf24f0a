"""What counts and eye say of the wiring: every case worked out by hand."""

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.start.wheels import Turned, judge

# A disc of 20 slots over 0.75 turns gives 15 edges; below a quarter of that, 3.75, it is silent.
CASES = [
    # side, edges of its own encoder, of the other, what was seen, kind, words of cause and fix
    ("left", 15, 0, "forward", "fine", ""),
    ("right", 14, 0, "forward", "fine", ""),
    ("left", 4, 3, "forward", "fine", ""),  # 4 are enough, 3 of the other are a bump
    ("left", 15, 0, "backward", "reversed", ""),
    ("left", 3, 0, "forward", "fault", "encoder counted 3 of 15 slots"),
    ("left", 0, 0, "backward", "fault", "left encoder OUT to Mega 2560 2"),
    ("right", 0, 0, "forward", "fault", "right encoder OUT to Mega 2560 3"),
    ("left", 0, 15, "forward", "fault", "exchange their OUT wires"),
    ("right", 0, 15, "backward", "fault", "left encoder counted when the right wheel turned"),
    ("left", 15, 15, "forward", "fault", "both encoders counted"),
    ("left", 0, 0, "still", "fault", "Mega 2560 5 to L298N ENA"),
    ("right", 0, 0, "still", "fault", "L298N OUT3 to right motor +"),
    ("left", 0, 15, "other wheel", "fault", "exchange the two motors"),
    ("right", 15, 0, "other wheel", "fault", "left wheel turned when the right motor had power"),
]


@pytest.mark.parametrize(("side", "own", "other", "seen", "kind", "words"), CASES)
def test_verdicts(side, own, other, seen, kind, words):
    verdict = judge(load_robot("book_2wd").robot, side, Turned(own, other, 15.0), seen)
    assert verdict.kind == kind
    assert words in f"{verdict.cause}; {verdict.fix}"
    assert bool(verdict.cause) == (kind == "fault")
