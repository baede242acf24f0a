"""When frames were really sampled, from arrival times that scatter.

A board that samples at an even pace but whose frames arrive unevenly has its clock followed by an
alpha-beta tracker (Kalata 1984): the scatter of one arrival moves the time by a small share.
"""

from __future__ import annotations

SHARE = 0.1  # of an arrival's lateness that is believed at once; a tenth is scatter of a third
DRIFT = 0.001  # of it that is taken for a change of pace, which the robot file tells nearly
FAR = 4.0  # standard deviations; further off, the board has paused and its pace begins anew


class TimestampFilter:
    """Follows one board's frames; times are integer nanoseconds."""

    def __init__(self, scatter: float, rate: float) -> None:
        """`scatter`: standard deviation of the arrivals (s); `rate`: of the frames (Hz), about."""
        self.scatter = scatter * 1e9
        self.expected = 0.0
        self.period = 1e9 / rate
        self.seen = 0

    def sampled(self, time: int, previous: int) -> int:
        """When the frame dated `time` was sampled; never before `previous`, what was answered for
        the one before."""
        if not self.scatter:
            return time
        self.seen += 1
        if self.seen == 1:
            self.expected = float(time)
            return time
        self.expected += self.period
        late = time - self.expected
        if abs(late) > FAR * self.scatter:
            self.seen, self.expected = 1, float(time)
            return max(time, previous)
        share = max(SHARE, 1.0 / self.seen)  # at first the mean of all tells more
        self.expected += share * late
        self.period += DRIFT * late
        return max(int(self.expected), previous)
