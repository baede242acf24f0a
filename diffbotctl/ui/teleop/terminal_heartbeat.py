"""Whether the person's terminal is still there: it is asked for its cursor and must answer.

A dead ssh, a frozen window, a laptop asleep send no word; they also answer no question. A terminal
multiplexer answers in place of the terminal behind it, so that inside one this proves nothing.
"""

from __future__ import annotations

from collections.abc import Mapping

QUESTION = "\x1b[6n"  # DSR: report the cursor's position (ECMA-48)
PERIOD = 0.08  # s between two questions
PATIENCE = 0.28  # s; with PERIOD and the way to the wheels it stays below half a second


class TerminalHeartbeat:
    """Times are seconds of any one clock. Questions are answered in the order they were asked."""

    def __init__(self) -> None:
        self.asked: list[float] = []
        self.next = 0.0
        self.round_trip: float | None = None

    def is_due(self, now: float) -> bool:
        """True when a question is to be asked now; it is noted as asked."""
        if now < self.next:
            return False
        self.next = now + PERIOD
        self.asked.append(now)
        return True

    def answered(self, now: float) -> None:
        """The terminal answered the oldest question."""
        if self.asked:
            self.round_trip = now - self.asked.pop(0)

    def is_lost(self, now: float) -> bool:
        """True when a question has waited too long."""
        return bool(self.asked) and now - self.asked[0] > PATIENCE

    def excuse(self, seconds: float) -> None:
        """We ourselves did not look for so long: that is not the terminal's fault."""
        self.asked = [time + seconds for time in self.asked]

    def forget(self) -> None:
        """Begin anew, as after a pause in which nothing was asked."""
        self.asked.clear()
        self.next = 0.0


def multiplexer(environment: Mapping[str, str]) -> str:
    """The name of the multiplexer that this runs inside of; empty when there is none."""
    if environment.get("TMUX"):
        return "tmux"
    return "screen" if environment.get("STY") else ""
