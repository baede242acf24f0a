"""When frames were really sampled, from arrival times that scatter.

A board that samples at an even pace but whose frames arrive unevenly has its clock followed by an
alpha-beta tracker (Kalata 1984): the scatter of one arrival moves the time by a small share.
"""

from __future__ import annotations

ALPHA = 0.1  # share of the innovation that corrects the time: a tenth is a scatter of a third
BETA = 0.001  # share of it that corrects the period, which the robot file tells nearly
INNOVATION_MAX_SDS = 4.0  # further off, the board has paused and its pace begins anew


class TimestampFilter:
    """Follows one board's frames; times are integer nanoseconds."""

    def __init__(self, jitter: float, rate: float) -> None:
        """`jitter`: standard deviation of the arrivals (s); `rate`: of the frames (Hz), about."""
        self.jitter = jitter * 1e9
        self.expected = 0.0
        self.period = 1e9 / rate
        self.frames = 0

    def sampled(self, time: int, previous: int) -> int:
        """When the frame dated `time` was sampled; never before `previous`, what was answered for
        the one before."""
        if not self.jitter:
            return time
        self.frames += 1
        if self.frames == 1:
            self.expected = float(time)
            return time
        self.expected += self.period
        innovation = time - self.expected
        if abs(innovation) > INNOVATION_MAX_SDS * self.jitter:
            self.frames, self.expected = 1, float(time)
            return max(time, previous)
        gain = max(ALPHA, 1.0 / self.frames)  # at first the mean of all tells more
        self.expected += gain * innovation
        self.period += BETA * innovation
        return max(int(self.expected), previous)
