"""The summary at the end of a run."""

from __future__ import annotations

from math import degrees, hypot
from textwrap import wrap

from diffbotctl.messages import Goal
from diffbotctl.runs.run import RunResult
from diffbotctl.ui import message_text

WIDTH, MARGIN = 80, 12  # columns of the narrowest terminal in use, and of the names


def lines(result: RunResult, last_goal: Goal | None) -> list[str]:
    """The summary as lines: a name, and what there is to say; long ones are folded."""
    made = []
    for name, text in rows(result, last_goal):
        first, *more = wrap(text, WIDTH - MARGIN) or [""]
        made.append(f"{name:>{MARGIN - 1}} {first}")
        made += [" " * MARGIN + part for part in more]
    return made


def rows(result: RunResult, last_goal: Goal | None) -> list[tuple[str, str]]:
    """The summary as (name, text)."""
    ending = result.ending
    found = [("ended", f"{ending.cause}, after {ending.time / 1e9:.1f} s")]
    if result.goals:
        found.append(("goals", f"{result.reached} of {result.goals} reached"))
    if result.odometry is not None:
        found.append(("pose", message_text.pose(result.odometry)))
    if last_goal is not None and result.odometry is not None:
        found.append(("error", _error(last_goal, result.odometry)))
    if last_goal is not None and result.truth is not None:
        found.append(("true error", _error(last_goal, result.truth.pose)))
    if result.odometry is not None:
        found.append(("path", f"{result.path:.2f} m"))
    found += [
        ("stop", f"at {stop.time / 1e9:.1f} s, {message_text.stop(stop)}") for stop in result.stops
    ]
    if result.link is not None:
        found.append(("link", message_text.link(result.link)))
    if ending.stopped is not None:
        confirmed = "confirmed" if ending.stopped else "NOT CONFIRMED: watch the wheels"
        found.append(("final stop", confirmed))
    if result.recording is not None:
        found.append(("recording", f"INCOMPLETE: {result.recording}"))
    if result.digest is not None:
        found.append(("digest", result.digest))
    return found


def _error(goal: Goal, pose: object) -> str:
    x, y, heading = pose.x, pose.y, pose.heading  # type: ignore[attr-defined]
    text = f"{hypot(goal.x - x, goal.y - y) * 1000:.1f} mm"
    if goal.heading is None:
        return text
    turn = (degrees(heading - goal.heading) + 180) % 360 - 180
    return f"{text}, {abs(turn):.1f} deg"
