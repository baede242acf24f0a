"""What an eye sees of a robot's wheels: which turn, and which way."""

from __future__ import annotations

from collections.abc import Sequence

from diffbotctl.config.drive_sides import SIDES

TURNS = 0.3  # rad/s, an eighth of what the slowest motion asks; slower, a wheel seems to stand
BOTH = {
    "stands": "stand",
    "turns forward": "turn forward",
    "turns backward": "turn backward",
}
LASTS = 60_000_000  # ns; what is over sooner is not seen


class WheelReport:
    """Tells when what is seen has changed."""

    def __init__(self) -> None:
        self.seen = self.coming = ("stands", "stands")
        self.since = 0

    def look(self, now: int, speeds: Sequence[float]) -> str | None:
        """At `now` (ns) the left and the right wheel turn at `speeds` (rad/s): words for what is
        new since they were last told, if anything is."""
        left, right = (_way(speed) for speed in speeds)
        if (left, right) != self.coming:
            self.coming, self.since = (left, right), now
        if self.coming == self.seen or now - self.since < LASTS:
            return None
        self.seen = self.coming
        if left == right:
            return f"both wheels {BOTH[left]}"
        ways = zip(SIDES, self.seen, strict=True)
        return ", ".join(f"the {side} wheel {way}" for side, way in ways)


def _way(speed: float) -> str:
    if abs(speed) < TURNS:
        return "stands"
    return "turns forward" if speed > 0.0 else "turns backward"
