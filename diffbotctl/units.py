"""Conversion of quantities with units, such as `65 mm`, `90 deg` or `100 rpm`, to SI numbers."""

from __future__ import annotations

import re
from math import isfinite, pi

from diffbotctl.errors import closest_match

# unit -> (its SI unit, factor), for files, the command line and messages
UNITS: dict[str, tuple[str, float]] = {
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "um": ("m", 1e-6),
    "km": ("m", 1e3),
    "in": ("m", 0.0254),
    "rad": ("rad", 1.0),
    "deg": ("rad", pi / 180),
    "mrad": ("rad", 1e-3),
    "turn": ("rad", 2 * pi),
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
    "min": ("s", 60.0),
    "h": ("s", 3600.0),
    "Hz": ("Hz", 1.0),
    "kHz": ("Hz", 1e3),
    "m/s": ("m/s", 1.0),
    "mm/s": ("m/s", 1e-3),
    "cm/s": ("m/s", 1e-2),
    "km/h": ("m/s", 1 / 3.6),
    "rad/s": ("rad/s", 1.0),
    "deg/s": ("rad/s", pi / 180),
    "rpm": ("rad/s", 2 * pi / 60),
    "m/s2": ("m/s2", 1.0),
    "mm/s2": ("m/s2", 1e-3),
    "cm/s2": ("m/s2", 1e-2),
    "rad/s2": ("rad/s2", 1.0),
    "deg/s2": ("rad/s2", pi / 180),
    "V": ("V", 1.0),
    "mV": ("V", 1e-3),
    "kg": ("kg", 1.0),
    "g": ("kg", 1e-3),
    "%": ("1", 1e-2),
}

KINDS = {
    "m": "a length",
    "rad": "an angle",
    "s": "a time",
    "Hz": "a rate",
    "m/s": "a speed",
    "rad/s": "a turning speed",
    "m/s2": "an acceleration",
    "rad/s2": "a turning acceleration",
    "V": "a voltage",
    "kg": "a mass",
    "1": "a ratio",
}

NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_QUANTITY = re.compile(rf"\s*({NUMBER})\s*([A-Za-z%][A-Za-z0-9/%²]*)?\s*\Z")
_COMMA = re.compile(r"\s*[-+]?\d+,\d+\s*[A-Za-z%]?")  # decimal comma


class UnitError(ValueError):
    """A text is not a quantity of the expected kind. The message says why and how to write it."""


def quantity(text: str, unit: str) -> float:
    """The number in SI `unit` that `text` stands for.

    A number without a unit is in SI. Raises UnitError if `text` is not a number, or if its unit is
    unknown or of another kind.
    """
    match = _QUANTITY.match(text)
    if match is None:
        if _COMMA.match(text):
            raise UnitError(
                f"'{text}' has a decimal comma: write a point, {text.strip().replace(',', '.')}"
            )
        raise UnitError(f"'{text}' is not a number with a unit, such as {example(unit)}")
    number, written = float(match[1]), match[2]
    if written is None:
        return number
    written = written.replace("²", "2")
    if written not in UNITS:
        raise UnitError(f"'{written}' is not a known unit{_nearest(written, unit)}")
    kind, factor = UNITS[written]
    if kind != unit:
        expected = KINDS.get(unit, "a plain number")
        raise UnitError(f"{written} is {KINDS[kind]}, but {expected} is required{_such_as(unit)}")
    return number * factor


def parse_pose(text: str) -> tuple[float, float, float | None]:
    """x and y (m) and the heading (rad), None without one, of `X Y [HEADING]`.

    Spaces or commas separate them. Raises UnitError.
    """
    words = text.replace(",", " ").split()
    if not 2 <= len(words) <= 3:
        raise UnitError("give X Y [HEADING], such as '1.0 0.5 90deg'")
    values = [quantity(word, unit) for word, unit in zip(words, ("m", "m", "rad"), strict=False)]
    if not all(map(isfinite, values)):
        raise UnitError(f"{text} is not possible here")
    return values[0], values[1], values[2] if len(values) == 3 else None


def example(unit: str) -> str:
    """An example of a quantity that can be converted to SI `unit`."""
    return {
        "m": "65 mm",
        "rad": "90 deg",
        "s": "300 ms",
        "Hz": "40 Hz",
        "m/s": "0.3 m/s",
        "rad/s": "100 rpm",
        "m/s2": "1 m/s2",
        "rad/s2": "5 rad/s2",
        "V": "10 mV",
        "kg": "2.4 kg",
    }.get(unit, "0.5")


def of_kind(unit: str) -> list[str]:
    """All units that can be converted to SI `unit`."""
    return [name for name, (kind, _) in UNITS.items() if kind == unit]


def _such_as(unit: str) -> str:
    return f", such as {example(unit)}" if unit in KINDS else ""


def _nearest(written: str, unit: str) -> str:
    names = of_kind(unit)
    same = next((name for name in names if name.lower() == written.lower()), None)
    near = same or closest_match(written, names, cutoff=0.5)
    return f"; did you mean {near}?" if near else f"; use one of {', '.join(names)}"
