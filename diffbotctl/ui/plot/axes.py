"""Axes: round numbers to write beside a picture, and where a value lies between them."""

from __future__ import annotations

from math import ceil, floor, log10
from typing import NamedTuple

ROUND_STEPS = (1.0, 2.0, 5.0, 10.0)  # times a power of ten
RELATIVE_TOLERANCE = 1e-9  # a curve that varies less, relative to its values, is a constant
CONSTANT_MARGIN = 0.5  # room around a constant: share of its value, or units around zero
VALUE_MAX = 1e300  # greater values are drawn at the edge: their differences may overflow
SPAN_MIN = 1e-300  # a smaller span is a constant: its steps may underflow
LABEL_MAX_VALUE = 1e6  # greater numbers are written with an exponent
DECIMALS_MAX = 9  # finer steps are written with an exponent


class Axis(NamedTuple):
    """From `minimum` to `maximum`, with the values to write beside it."""

    minimum: float
    maximum: float
    ticks: tuple[float, ...]
    decimals: int

    def share(self, value: float) -> float:
        """The position of `value`: 0 at the minimum or below, 1 at the maximum or above."""
        value = min(max(value, self.minimum), self.maximum)
        return (value - self.minimum) / (self.maximum - self.minimum)

    def position(self, value: float, size: int, is_reversed: bool = False) -> int:
        """The position of `value` among `size` dots or characters; reversed: rows, counted down."""
        share = self.share(value)
        return round((1.0 - share if is_reversed else share) * (size - 1))

    def label(self, value: float) -> str:
        """A tick as text; all ticks of an axis have the same number of decimals."""
        if abs(value) >= LABEL_MAX_VALUE or self.decimals > DECIMALS_MAX:
            return f"{value:.3g}"
        text = f"{value:.{self.decimals}f}"
        return text.removeprefix("-") if float(text) == 0.0 else text


def make_axis(minimum: float, maximum: float, ticks: int) -> Axis:
    """An axis from `minimum` to `maximum` with about `ticks` round values, at least two.

    Values that hardly vary get room above and below.
    """
    minimum, maximum = (min(max(end, -VALUE_MAX), VALUE_MAX) for end in (minimum, maximum))
    if maximum - minimum <= max(SPAN_MIN, RELATIVE_TOLERANCE * max(abs(minimum), abs(maximum))):
        margin = CONSTANT_MARGIN * abs(minimum) or CONSTANT_MARGIN
        minimum, maximum = minimum - margin, maximum + margin
    spacing = (maximum - minimum) / max(ticks, 1)
    step = _round_step(spacing)
    while len(multiples := _multiples(step, minimum, maximum)) < 2:
        spacing /= 2
        step = _round_step(spacing)
    decimals = max(0, -floor(log10(step) + RELATIVE_TOLERANCE))
    return Axis(minimum, maximum, tuple(number * step for number in multiples), decimals)


def _multiples(step: float, minimum: float, maximum: float) -> range:
    """The whole multiples of `step` between the bounds, both included."""
    first, last = minimum / step - RELATIVE_TOLERANCE, maximum / step + RELATIVE_TOLERANCE
    return range(ceil(first), floor(last) + 1)


def _round_step(spacing: float) -> float:
    """The smallest round step that is not below `spacing`."""
    power = 10.0 ** floor(log10(spacing))
    limit = spacing * (1 - RELATIVE_TOLERANCE)
    return next((step for step in ROUND_STEPS if step * power >= limit), ROUND_STEPS[-1]) * power
