"""Plain lines for a pipe or a log: one line an event, never one a message."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from diffbotctl.hub.latest import Snapshot
from diffbotctl.messages import Goal, GoalState, Link, Odometry, Text
from diffbotctl.ui import words


class News:
    """Remembers what was said, and says what is new."""

    def __init__(self) -> None:
        self.last: tuple[object, ...] = (None, None, None)
        self.heard: dict[str, int] = {}

    def lines(self, picture: Snapshot) -> Iterator[str]:
        """A line if the goal's state, the stop in force or the link's state has changed."""
        yield from _texts(picture, self.heard)
        state, link = words.newest(picture, GoalState), words.newest(picture, Link)
        stop = words.holding(picture)
        now = (
            (state.number, state.state) if isinstance(state, GoalState) else None,
            stop.code if stop else None,
            link.state if isinstance(link, Link) else None,
        )
        if now != self.last:
            self.last = now
            yield line(picture)


def lines(pictures: Iterator[Snapshot]) -> Iterator[str]:
    """All that is new, picture after picture."""
    news = News()
    for picture in pictures:
        yield from news.lines(picture)


def _texts(picture: Snapshot, heard: dict[str, int]) -> Iterator[str]:
    """A line for each text that is newer than the one `heard` on its wire."""
    for wire, message in picture.messages.items():
        if isinstance(message, Text) and heard.get(wire, -1) < message.time:
            heard[wire] = message.time
            yield f"{message.time / 1e9:8.2f} s | {wire}: {message.text}"


def line(picture: Snapshot) -> str:
    """One line for one picture."""
    parts = [f"{picture.time / 1e9:8.2f} s"]
    odometry, state = words.newest(picture, Odometry), words.newest(picture, GoalState)
    goal, link = words.newest(picture, Goal), words.newest(picture, Link)
    stop = words.holding(picture)
    if isinstance(odometry, Odometry):
        parts.append(words.pose(odometry))
    if isinstance(goal, Goal) and goal.number and isinstance(state, GoalState):
        parts.append(f"goal {goal.number} {words.goal_state(state)}")
    if isinstance(link, Link) and link.state != "up":
        parts.append(f"link {words.link(link)}")
    if stop is not None:
        parts.append(f"STOP {words.stop(stop)}")
    return " | ".join(parts)


def show(pictures: Iterator[Snapshot]) -> None:
    """Print lines to standard output as they come."""
    for text in lines(pictures):
        print(text, file=sys.stdout, flush=True)
