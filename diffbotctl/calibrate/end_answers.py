"""Questions for where a robot stopped, and refusals with figures of answers that cannot be true.

The person may be right: a wheel may have slipped. So an answer that is repeated is accepted,
except for offsets of exactly zero again and again, which no measurement gives.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field, replace
from math import degrees, hypot, pi
from statistics import median
from typing import Any, Literal

from diffbotctl.calibrate.contradiction import ATTEMPTS_MAX
from diffbotctl.calibrate.dead_reckoning import EndError, wrap_angle
from diffbotctl.calibrate.step import Event, Message
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Odometry
from diffbotctl.prompts.question import Question

MM = 1000.0
# Of the side: the end errors of a track that is wrong by 5 % and of tyres that differ by 1.5 %,
# three standard deviations of what a ruler and a kit leave.
FIRST_ERROR_RATIO_MAX = 0.30
DIFFERENCE_RATIO_MAX = 0.05  # of the side, between equal squares: usual ones scatter by a tenth
DIFFERENCE_MIN_M = 0.03
SCATTER_FACTOR = 4.0  # of robots that slip more
# Ends that are exactly 0 to the millimetre, or headings to the degree, occur once in ten or in two.
ZEROS_MAX = {"place": 3, "heading": 4}
SAME_PLACE_M = 0.005  # between two readings of one end
Place = tuple[float, float]  # forward and left, m

FACING = Question(
    "geometry.facing",
    "By how much is its heading turned from the start? Clockwise is negative.",
    unit="rad",
    default_unit="deg",
    minimum=-pi,
    maximum=pi,
    limit_reason="give an angle of at most half a turn",
    quantity="facing",
)
POSITION_TEXTS = {
    "forward": "How far in front of the start mark did it stop? Behind is negative.",
    "left": "How far to the left of the start mark did it stop? Right is negative.",
}


def position_question(direction: Literal["forward", "left"], side: float) -> Question:
    """How far in one direction the robot stopped from the start of a square with `side` (m)."""
    return Question(
        f"geometry.{direction}",
        POSITION_TEXTS[direction],
        unit="m",
        default_unit="mm",
        minimum=-side,
        maximum=side,
        limit_reason="the error cannot be larger than the square",
        quantity=direction,
    )


@dataclass(slots=True)
class ZeroReadings:
    """Counts readings in a row that are exactly 0.

    `planned`: how many there will be; `what` they are, in words.
    """

    planned: int
    what: str
    kind: Literal["place", "heading"] = "place"
    count: int = field(default=0, init=False)

    def add(self, *values: float) -> None:
        """Note the values of one reading. Raises RunError if too many were 0."""
        self.count = 0 if any(values) else self.count + 1
        if self.count < max(min(ZEROS_MAX[self.kind], self.planned), 2):
            return
        cause = f"{self.what} was given as exactly 0, {self.count} times in a row"
        fix = (
            "the slip of the wheels alone moves every end by some millimetres and tenths of a "
            "degree: measure each from the mark, then run this step again"
        )
        raise RunError(Problem("E-CALIBRATE-ANSWER", "geometry", cause, fix))


def place_contradiction(
    place: Place, odometry: Odometry, before: Sequence[EndError], side: float
) -> str | None:
    """Why a measured end does not go with what the wheels counted.

    `before`: the end errors of the squares before in this direction; `side` of the square, m.
    """
    if place == (0.0, 0.0):
        return (
            "Exactly on the start mark, 0 mm in front and 0 mm to the left? By its wheels it "
            f"stands at {place_text((odometry.x, odometry.y))}, not counting their slip."
        )
    expected, limit = (odometry.x, odometry.y), FIRST_ERROR_RATIO_MAX * side
    basis = "By its wheels"
    if before:
        error = median(end.x for end in before), median(end.y for end in before)
        expected = expected[0] + error[0], expected[1] + error[1]
        scatter = median(hypot(end.x - error[0], end.y - error[1]) for end in before)
        limit = max(DIFFERENCE_RATIO_MAX * side, DIFFERENCE_MIN_M, SCATTER_FACTOR * scatter)
        basis = "By its wheels and the squares before"
    if hypot(place[0] - expected[0], place[1] - expected[1]) <= limit:
        return None
    return f"{basis} it stands at {place_text(expected)}, and not at {place_text(place)}."


def place_text(place: Place) -> str:
    """A place as a person reads it from the tape."""
    forward, left = (round(value * MM) for value in place)
    ahead = f"{abs(forward)} mm {'behind' if forward < 0 else 'in front'}"
    return f"{ahead}, {abs(left)} mm to the {'right' if left < 0 else 'left'}"


def ask_place(
    side: float, contradiction: Callable[[Place], str | None]
) -> Generator[Event, Any, Place]:
    """Where the robot stopped; a contradicted answer is asked again.

    Raises RunError if all answers differ from each other and are contradicted.
    """
    place = yield from _ask_place(side, is_repeated=False)
    for _ in range(ATTEMPTS_MAX - 1):
        reason = contradiction(place)
        if reason is None:
            break
        yield Message(f"{reason} Measure again; the same answer is accepted.")
        previous, place = place, (yield from _ask_place(side, is_repeated=True))
        if hypot(place[0] - previous[0], place[1] - previous[1]) <= SAME_PLACE_M:
            return place
    reason = contradiction(place)
    if reason is None:
        return place
    cause = f"{ATTEMPTS_MAX} different answers for one end. {reason}"
    fix = "measure from the start mark of this square to where the same point of the robot is now"
    raise RunError(Problem("E-CALIBRATE-ANSWER", "geometry", cause, fix))


def _ask_place(side: float, is_repeated: bool) -> Generator[Event, Any, Place]:
    forward = yield replace(position_question("forward", side), is_repeated=is_repeated)
    left = yield replace(position_question("left", side), is_repeated=is_repeated)
    return float(forward), float(left)


def angle_contradiction(
    angle: float, expected: float, before: Sequence[float], first_max: float, other_max: float
) -> str | None:
    """Why a measured angle does not go with the `expected` one (rad).

    `before`: differences of earlier readings from what was expected of them.
    """
    usual = median(before) if before else 0.0
    error = wrap_angle(angle - expected - usual)
    if abs(error) <= (other_max if before else first_max):
        return None
    basis = "the readings before" if before else "its wheels"
    return (
        f"By {basis} it is turned by {degrees(wrap_angle(expected + usual)):.0f} deg, not by "
        f"{degrees(angle):.0f} deg; clockwise is negative."
    )
