"""The ends of squares as they were measured, and mistakes of reading that their errors show.

To first order three mistakes look alike: directions taken for each other, and the wrong sign of all
answers to the left, or in front. Each turns the signs of the same sums (umbmark.py).
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any, NamedTuple

from diffbotctl.calibrate.dead_reckoning import EndError, wrap_angle
from diffbotctl.calibrate.step import Event, Message
from diffbotctl.calibrate.umbmark import SquareErrors
from diffbotctl.errors import Problem, RunError
from diffbotctl.prompts.question import Question

SWAPPED = (
    "The ends of both directions contradict each other. Clockwise and counter-clockwise ends seem "
    "to be swapped, or the sign of all answers to the left or in front is wrong: the two UMBmark "
    "rules agree with any one of these mistakes, so the ends do not show which. On the last square "
    "you can see it: it was driven counter-clockwise, with the square on the left of the robot."
)
MISTAKES = ("directions", "left", "forward", "none")
MISTAKE_QUESTION = Question(
    "geometry.swapped",
    "Which mistake was it: directions swapped, the sign of left, the sign of forward, or none?",
    choices=MISTAKES,
)


class SquareEnd(NamedTuple):
    """Where one square ended, in the frame of its start; nan where nobody read it."""

    measured: EndError
    odometry: EndError

    @property
    def error(self) -> EndError:
        """The measured end minus that of odometry."""
        measured, odometry = self
        heading = wrap_angle(measured.heading - odometry.heading)
        return EndError(measured.x - odometry.x, measured.y - odometry.y, heading)


def square_errors(
    side: float,
    clockwise: Sequence[SquareEnd],
    counter: Sequence[SquareEnd],
    mistake: str = "",
) -> SquareErrors:
    """The end errors, without a mistake of reading: one of MISTAKES, or none."""
    factors = {"left": (1.0, -1.0), "forward": (-1.0, 1.0)}
    forward, left = factors.get(mistake, (1.0, 1.0))

    def errors(ends: Sequence[SquareEnd]) -> list[EndError]:
        return [
            end._replace(
                measured=end.measured._replace(x=forward * end.measured.x, y=left * end.measured.y)
            ).error
            for end in ends
        ]

    squares = SquareErrors(side, errors(clockwise), errors(counter))
    return squares.exchanged() if mistake == "directions" else squares


def ask_mistake() -> Generator[Event, Any, str]:
    """Which mistake the person has made. Raises RunError if it is none of these."""
    yield Message(SWAPPED)
    mistake = str((yield MISTAKE_QUESTION))
    if mistake == "none":
        raise contradicting_ends("the ends of both directions contradict each other")
    return mistake


def contradicting_ends(cause: str) -> RunError:
    fix = (
        "was each end measured from its own start mark, in front and to the left with its sign, "
        "and first those of the clockwise squares? Then run this step again"
    )
    return RunError(Problem("E-CALIBRATE-ROBOT", "geometry", cause, fix))
