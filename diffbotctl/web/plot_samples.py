"""The numbers that one page plots: every sample of the chosen fields, until the page has got it.

A field is named `block.port.field`, as on the dashboard. Only the top level of a message is
plotted. A flag counts as 0 or 1; what is no finite number is a gap.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Any, NamedTuple

from diffbotctl.control_socket.protocol import Fields
from diffbotctl.time import SECOND

FIELDS_MAX = 8  # lines of a page
SAMPLES_MAX = 2000  # of one field that wait for a page: two minutes of history and 80 s at 10 Hz
TIME_DECIMALS = 4  # of a time in s: samples at up to 10 kHz stay apart
VALUE_DIGITS = 6  # more than a screen has rows
VALUE_MAX = 1e300  # of a greater one the differences may overflow


class PlotSample(NamedTuple):
    """A value at a logical time in s; None is a gap."""

    time: float
    value: float | None


class PlotSamples:
    """The chosen fields of a page, and their samples that it has not got yet."""

    def __init__(self) -> None:
        self.waiting: dict[str, deque[PlotSample]] = {}

    @property
    def topics(self) -> set[str]:
        return {topic_of(name) for name in self.waiting}

    def choose(self, names: Iterable[str]) -> list[str]:
        """Plot these fields and no others. Returns those that were not chosen before."""
        before = self.waiting
        self.waiting = {name: before.get(name, deque(maxlen=SAMPLES_MAX)) for name in names}
        return [name for name in self.waiting if name not in before]

    def add_history(self, name: str, history: Iterable[tuple[float, float]]) -> None:
        """Add what is known of a field from before it was chosen."""
        self.waiting[name].extend(PlotSample(time, _number(value)) for time, value in history)

    def take(self, topic: str, message: Fields) -> None:
        """Take the chosen fields of a message."""
        for name, samples in self.waiting.items():
            if topic_of(name) == topic:
                value = message.get(name.rpartition(".")[2])
                samples.append(PlotSample(message["time"] / SECOND, _number(value)))

    def drain(self) -> dict[str, list[float | None]]:
        """Time and value of one sample after the other, by field; they no longer wait."""
        drained = {name: _flat(samples) for name, samples in self.waiting.items() if samples}
        for samples in self.waiting.values():
            samples.clear()
        return drained


def topic_of(name: str) -> str:
    return name.rpartition(".")[0]


def _number(value: Any) -> float | None:
    is_number = isinstance(value, int | float) and abs(value) <= VALUE_MAX
    return float(value) if is_number else None


def _flat(samples: Iterable[PlotSample]) -> list[float | None]:
    return [number for sample in samples for number in (_time(sample), _value(sample))]


def _time(sample: PlotSample) -> float:
    return round(sample.time, TIME_DECIMALS)


def _value(sample: PlotSample) -> float | None:
    return None if sample.value is None else float(f"{sample.value:.{VALUE_DIGITS}g}")
