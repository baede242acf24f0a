"""Lag and dead time of wheels whose board does not tell when it took a command.

Each wheel's angle is followed from when a step of the duty was sent: on at the speed before, until
the dead time has passed; from then on towards the new speed with the lag. Such a board takes each
command for each wheel at another moment, so every step has a lateness of its own beside the dead
time, which scatters about nothing; without these, the mean of what happened to be late would pass
for lag, four times as large. All are found at once by least squares (Gauss and Newton's way).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats
from diffbotctl.calibrate.motor_fit import SLOT_ERROR_SD_PITCHES, LagFit, StepResponse, gather_edges

ITERATIONS_MAX = 12
TIME_TOLERANCE_S = 1e-5  # s; the rounds end when neither time moves further
INITIAL_LAG_S = 0.1  # s, from where the search begins
LAG_MIN_S = 0.01  # s, of a lag
COUNT_SD_PITCHES = (
    0.29  # pitches, sd of a place that is only known to lie somewhere in a slot: 1 / sqrt(12)
)


@dataclass
class LagModel:
    """One wheel's edges, and what is found of it in turn."""

    times: Floats
    places: Floats
    which: Floats
    slot: Floats
    ups: Floats
    start: Floats
    """rad, where it was when each step was sent"""
    late: Floats
    """s, what each step came later than the dead time"""
    speeds: Floats
    """rad/s at the lower and at the higher duty"""
    uneven: Floats
    """rad, by slot"""

    def model(self, lag: float, dead: float) -> tuple[Floats, Floats]:
        """Angles (edges,) in rad, and how they change with lag, dead time, and all of this wheel:
        (edges, 2 + 2 steps + 2 + slots)."""
        rows, steps, slots = len(self.times), len(self.start), len(self.uneven)
        begun = np.where(self.ups, self.speeds[0], self.speeds[1])
        change = np.where(self.ups, 1.0, -1.0) * (self.speeds[1] - self.speeds[0])
        since = np.maximum(self.times - dead - self.late[self.which], 0.0)
        fade = np.exp(-since / lag)
        bend = since - lag * (1.0 - fade)
        angles = self.start[self.which] + begun * self.times + change * bend
        angles += self.uneven[self.slot]
        matrix = np.zeros((rows, 2 + 2 * steps + 2 + slots))
        every = np.arange(rows)
        matrix[:, 0] = change * (fade - 1.0 + since / lag * fade)
        matrix[:, 1] = matrix[every, 2 + steps + self.which] = -change * (1.0 - fade)
        matrix[every, 2 + self.which] = 1.0
        sign = np.where(self.ups, 1.0, -1.0)
        matrix[:, 2 + 2 * steps] = np.where(self.ups, self.times, 0.0) - sign * bend
        matrix[:, 3 + 2 * steps] = np.where(self.ups, 0.0, self.times) + sign * bend
        matrix[every, 4 + 2 * steps + self.slot] = 1.0
        return angles, matrix

    def move(self, by: Floats) -> None:
        """Change what is found of it."""
        steps = len(self.start)
        self.start += by[:steps]
        self.late += by[steps : 2 * steps]
        self.speeds += by[2 * steps : 2 * steps + 2]
        self.uneven += by[2 * steps + 2 :]


def fit_common_lag(steps: Sequence[StepResponse], slots: int, jitter: float) -> LagFit:
    """Lag and dead time of both wheels, whose motors are of one kind, from steps that are timed by
    when they were sent; when each was taken scatters by `jitter` (s, sd).

    Raises ValueError when there are too few edges, or no such motion is in them.
    """
    wheels = [_initial_model(steps, left, slots) for left in (True, False)]
    lag, dead, noise = INITIAL_LAG_S, INITIAL_LAG_S, COUNT_SD_PITCHES * 2 * pi / slots
    for _ in range(ITERATIONS_MAX):
        matrix, wanted = _normalized_system(wheels, lag, dead, noise, jitter)
        by: Floats = np.asarray(np.linalg.lstsq(matrix, wanted, rcond=None)[0], dtype=float)
        lag, before = max(lag + float(by[0]), LAG_MIN_S), lag
        dead = max(dead + float(by[1]), 0.0)
        each = (len(by) - 2) // 2
        for number, wheel in enumerate(wheels):
            wheel.move(by[2 + number * each : 2 + (number + 1) * each])
        if abs(lag - before) + abs(by[1]) < TIME_TOLERANCE_S:
            break
    else:
        raise ValueError("how late they follow could not be told from the steps")
    spread = np.linalg.inv(matrix.T @ matrix)
    seen = sum(len(wheel.times) for wheel in wheels)
    variance = float((wanted[:seen] ** 2).sum()) / (seen - len(by))
    both = spread[0, 0] + spread[1, 1] + 2.0 * spread[0, 1]
    return LagFit(
        lag, dead, float(np.sqrt(both * variance)), float(np.sqrt(spread[0, 0] * variance))
    )


def _initial_model(steps: Sequence[StepResponse], left: bool, slots: int) -> LagModel:
    times, places, which, slot = gather_edges(steps, left, slots)
    ups = np.array([step.up for step in steps])[which]
    late = times > INITIAL_LAG_S * 10.0
    speeds = np.array(
        [
            np.mean(
                [
                    _slope(times[rows], places[rows])
                    for number in range(len(steps))
                    if (rows := late & (which == number) & (ups == up)).any()
                ]
            )
            for up in (False, True)
        ]
    )
    start = np.array(
        [
            np.mean(places[rows] - np.where(ups[rows], speeds[0], speeds[1]) * times[rows])
            for number in range(len(steps))
            if (rows := (times < 0.0) & (which == number)).any()
        ]
    )
    if len(start) < len(steps) or speeds[1] <= speeds[0]:
        raise ValueError("more duty did not turn it faster")
    zeros = np.zeros(len(steps))
    return LagModel(times, places, which, slot, ups, start, zeros, speeds, np.zeros(slots))


def _slope(times: Floats, places: Floats) -> float:
    return float(np.polyfit(times - times[0], places, 1)[0])


def _normalized_system(
    wheels: Sequence[LagModel], lag: float, dead: float, noise: float, jitter: float
) -> tuple[Floats, Floats]:
    """The linear least squares of one round: what was seen, and then what is known beforehand."""
    seen, missing, known, held = [], [], [], []
    each = 2 * len(wheels[0].start) + 2 + len(wheels[0].uneven)
    for number, wheel in enumerate(wheels):
        angles, matrix = wheel.model(lag, dead)
        columns = slice(2 + number * each, 2 + (number + 1) * each)
        wide = np.zeros((len(matrix), 2 + each * len(wheels)))
        wide[:, :2], wide[:, columns] = matrix[:, :2], matrix[:, 2:]
        seen.append(wide / noise)
        missing.append((wheel.places - angles) / noise)
        steps, slots = len(wheel.start), len(wheel.uneven)
        error = SLOT_ERROR_SD_PITCHES * 2 * pi / slots
        prior = np.zeros((steps + slots, wide.shape[1]))
        first = columns.start
        prior[np.arange(steps), first + steps + np.arange(steps)] = 1.0 / jitter
        prior[steps + np.arange(slots), first + 2 * steps + 2 + np.arange(slots)] = 1.0 / error
        known.append(prior)
        held.append(np.concatenate([-wheel.late / jitter, -wheel.uneven / error]))
    return np.concatenate([*seen, *known]), np.concatenate([*missing, *held])
