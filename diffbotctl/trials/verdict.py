"""Judges a run: what of its expectation is not met, and how it ranks among others."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees
from typing import NamedTuple

from diffbotctl.trials.sections import Expectation, StopExpectation
from diffbotctl.trials.trial_run import StopRecord, TrialResult

MM = 1000.0


class Score(NamedTuple):
    """A run by its importance: less is better in each field, and an earlier one outweighs."""

    unsafe: bool
    unmet: int
    error: float
    sigmas: float
    time: float


class JudgedRun(NamedTuple):
    """A run and what of its expectation is not met; nothing: it passed."""

    result: TrialResult
    unmet: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether all is as expected."""
        return not self.unmet

    @property
    def score(self) -> Score:
        """Safety, then what was expected, the true error, the honesty of the estimate, the time."""
        found = self.result
        return Score(
            found.has_contact or found.outcome == "crashed",
            len(self.unmet),
            found.error or 0.0,
            found.estimate_sigmas or 0.0,
            found.time,
        )


def judge(found: TrialResult, expect: Expectation) -> JudgedRun:
    """Compare a run with its expectation."""
    return JudgedRun(found, tuple(_unmet(found, expect)))


def _unmet(found: TrialResult, expect: Expectation) -> Iterator[str]:
    if found.outcome in ("crashed", "failed"):
        yield f"{found.outcome}: {found.cause}"
        return
    if found.has_contact:
        yield "it touched a wall or an obstacle"
    if expect.reach is not None:
        yield from _not_reached(found, expect.reach)
    yield from _wrong_certainty(found, expect)
    if expect.stop is not None:
        yield from _not_stopped(found, expect.stop)
    limits = (
        ("true error", found.error, expect.error, MM, "mm"),
        ("true error of the heading", found.heading_error, expect.heading_error, 0.0, "deg"),
        ("farther from the goal than at the start by", found.farther, expect.farther, MM, "mm"),
        ("time", found.time, expect.time, 1.0, "s"),
    )
    for what, value, limit, factor, unit in limits:
        if limit is not None and value is None:
            goal = "a goal with a heading" if unit == "deg" else "a goal"
            yield f"{what}: unknown without {goal}"
        elif limit is not None and value is not None and value > limit:
            shown = [degrees(each) if unit == "deg" else each * factor for each in (value, limit)]
            yield f"{what} {shown[0]:.1f} {unit}, more than {shown[1]:g} {unit}"
    if expect.clearance is not None and 0.0 < found.clearance < expect.clearance:
        near, asked = (f"{each * MM:.0f} mm" for each in (found.clearance, expect.clearance))
        yield f"{near} from a wall or obstacle, less than {asked}"


def _not_reached(found: TrialResult, within: float) -> Iterator[str]:
    if not found.is_claimed or found.reached < found.goals:
        yield f"not reached ({found.outcome.replace('_', ' ')}): {found.cause}"
    elif found.time > within:
        yield f"reached after {found.time:.1f} s, not within {within:g} s"


def _wrong_certainty(found: TrialResult, expect: Expectation) -> Iterator[str]:
    is_unsure = found.outcome == "reached_unsure"
    if expect.unsure == "required" and not is_unsure:
        yield f"it does not state that the pose is uncertain ({found.outcome.replace('_', ' ')})"
    elif expect.unsure == "never" and expect.reach is not None and is_unsure:
        yield f"reached, but unsure: {found.cause}"


def _not_stopped(found: TrialResult, expect: StopExpectation) -> Iterator[str]:
    what = f"stop {expect.code}" if expect.code else "stop"
    if expect.cause:
        what += f" with the cause '{expect.cause}'"
    after = [stop for stop in found.stops if stop.time >= found.fault_at]
    fitting = [
        stop for stop in after if expect.code in (None, stop.code) and expect.cause in stop.cause
    ]
    if not fitting:
        yield f"no {what}: {_stops_text(after) or found.outcome.replace('_', ' ')}"
    elif fitting[0].time - found.fault_at > expect.within:
        late = fitting[0].time - found.fault_at
        yield f"{what} {late:.1f} s after the fault, not within {expect.within:g} s"


def _stops_text(stops: list[StopRecord]) -> str:
    return "; ".join(f"{stop.code}: {stop.cause}" for stop in stops[:2])
