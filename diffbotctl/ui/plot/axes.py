"""Axes: round numbers to write beside a picture, and where a value stands between them."""

from __future__ import annotations

from math import ceil, floor, log10
from typing import NamedTuple

ROUND = (1.0, 2.0, 5.0, 10.0)  # steps that a person reads easily, times a power of ten
FLAT = 1e-9  # of the value: a curve that varies less is drawn as a constant
HALF = 0.5  # of the unit, or of the value: room around a constant


class Axis(NamedTuple):
    """From `least` to `most`, with the values to write beside it."""

    least: float
    most: float
    ticks: tuple[float, ...]
    decimals: int

    def share(self, value: float) -> float:
        """Where `value` stands: 0 at the beginning, 1 at the end."""
        return (value - self.least) / (self.most - self.least)

    def label(self, value: float) -> str:
        """A tick in words, all of an axis with the same number of decimals."""
        if abs(value) >= WIDEST:
            return f"{value:.3g}"
        text = f"{value:.{self.decimals}f}"
        return text.removeprefix("-") if float(text) == 0.0 else text


WIDEST = 1e6  # numbers of more digits are written with an exponent


def make_axis(least: float, most: float, ticks: int) -> Axis:
    """An axis from `least` to `most` with about `ticks` round values in it, two at the least.

    What hardly varies gets room above and below.
    """
    if most - least <= FLAT * max(abs(least), abs(most)):
        room = HALF * abs(least) or HALF
        least, most = least - room, most + room
    wanted = (most - least) / max(ticks, 1)
    step = _step(wanted)
    while len(inside := _multiples(step, least, most)) < 2:
        wanted /= 2
        step = _step(wanted)
    decimals = max(0, -floor(log10(step) + FLAT))
    return Axis(least, most, tuple(number * step for number in inside), decimals)


def _multiples(step: float, least: float, most: float) -> range:
    """The whole multiples of `step` between the bounds, both included."""
    return range(ceil(least / step - FLAT), floor(most / step + FLAT) + 1)


def _step(wanted: float) -> float:
    """The smallest round step that is not below `wanted`."""
    power = 10.0 ** floor(log10(wanted))
    return next((each for each in ROUND if each * power >= wanted * (1 - FLAT)), ROUND[-1]) * power
