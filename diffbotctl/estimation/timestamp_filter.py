"""Sampling times of telemetry frames from jittered arrival times.

The board samples at a constant rate, but its frames arrive with jitter. An alpha-beta filter
(Kalata 1984) tracks the sampling times.
"""

from __future__ import annotations

ALPHA = 0.1  # gain of the time; 0.1 reduces the jitter to about a third
BETA = 0.001  # gain of the period, which the robot file states approximately
INNOVATION_MAX_SDS = 4.0  # a larger innovation means that the board has paused; the filter restarts


class TimestampFilter:
    """Alpha-beta filter of the sampling times of one board. Times are integer nanoseconds."""

    def __init__(self, jitter: float, rate: float) -> None:
        """`jitter`: standard deviation of the arrival times (s); `rate`: nominal rate (Hz)."""
        self.jitter = jitter * 1e9
        self.expected = 0.0
        self.period = 1e9 / rate
        self.frames = 0

    def sampled(self, time: int, previous: int) -> int:
        """Sampling time of the frame that arrived at `time`; never before `previous`, the sampling
        time of the frame before it."""
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
        gain = max(
            ALPHA, 1.0 / self.frames
        )  # at first the mean of all frames is the better estimate
        self.expected += gain * innovation
        self.period += BETA * innovation
        return max(int(self.expected), previous)
