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
    "A": ("A", 1.0),
    "mA": ("A", 1e-3),
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
    "A": "a current",
    "kg": "a mass",
    "1": "a ratio",
}

# Largest coordinate and heading of a goal: a larger one is a typing error.
POSE_MAX = {"m": 1000.0, "rad": 20 * pi}

# The longest way that is typed without a unit; the odometry of such robots is useless before.
BARE_LENGTH_MAX_M = 100.0

# Largest magnitude that a setting of a kind may have where its declaration gives no tighter bound.
# A larger one is a typing error, and would overflow in calculations.
MAGNITUDE_MAX = {
    "m": 10e3,
    "rad": POSE_MAX["rad"],
    "s": 1e6,
    "Hz": 1e6,
    "m/s": 100.0,
    "rad/s": 10e3,
    "m/s2": 1e3,
    "rad/s2": 1e6,
    "V": 1e3,
    "A": 1e3,
    "kg": 1e4,
    "1": 1e6,
    "": 1e9,
}


def magnitude_max(unit: str) -> float:
    """The largest magnitude of a quantity in SI `unit`."""
    return MAGNITUDE_MAX.get(unit, MAGNITUDE_MAX[""])


NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_QUANTITY = re.compile(rf"\s*({NUMBER})\s*([A-Za-z%][A-Za-z0-9/%²]*)?\s*\Z")
_COMMA = re.compile(r"\s*[-+]?\d+,\d+\s*[A-Za-z%]?")  # decimal comma
_DECIMAL_COMMA = re.compile(r"(?<![\d.,])[-+]?\d+,\d+(?![\d.,])")
_UNIT_APART = re.compile(r"(?<=[\d.])\s+([A-Za-z°µ%])")  # a unit after a space
_FRACTION = re.compile(r"\s*([-+]?\d+)\s*/\s*(\d+)\s*(\S*)\s*\Z")
# Characters that look right and are not accepted -> their name, and what to write.
_LOOKALIKES = {
    "\N{MINUS SIGN}": ("the minus sign U+2212", "-"),
    "\N{EN DASH}": ("an en dash", "-"),
    "\N{EM DASH}": ("an em dash", "-"),
    "\N{DEGREE SIGN}": ("the degree sign", " deg"),
    "\N{MICRO SIGN}": ("the micro sign", "u"),
    "\N{GREEK SMALL LETTER MU}": ("the Greek letter mu", "u"),
    "^": ("a caret", ""),
}


class UnitError(ValueError):
    """A text is not a quantity of the expected kind. The message has the cause and the fix."""


def quantity(text: str, unit: str) -> float:
    """The number in SI `unit` that `text` stands for.

    A number without a unit is in SI; an angle other than 0 needs its unit. Raises UnitError if
    `text` is not a number, or if its unit is unknown or of another kind.
    """
    match = _QUANTITY.match(text)
    if match is None:
        raise UnitError(_not_a_quantity(text, unit))
    number, written = float(match[1]), match[2]
    if written is None:
        return plain_number(number, unit)
    written = written.replace("²", "2")
    if written not in UNITS:
        raise UnitError(f"'{written}' is not a known unit{_nearest(written, unit)}")
    kind, factor = UNITS[written]
    if kind != unit:
        expected = KINDS.get(unit, "a plain number")
        raise UnitError(f"{written} is {KINDS[kind]}, but {expected} is required{_such_as(unit)}")
    return number * factor


def plain_number(number: float, unit: str) -> float:
    """A number without a unit, in SI `unit`. Raises UnitError for an angle other than 0.

    Most people mean degrees when they write 90, and radians when they write 1.57.
    """
    if unit == "rad" and number != 0.0:
        other = f", or {number:g} rad for {number * 180 / pi:g} degrees" if isfinite(number) else ""
        raise UnitError(f"the angle {number:g} has no unit: write {number:g} deg{other}")
    return number


def typed_quantity(text: str, unit: str) -> float:
    """As `quantity`, for what a person types to make a robot move.

    A large number of metres needs its unit: most people who write 500 mean millimetres. Raises
    UnitError.
    """
    number = quantity(text, unit)
    if unit == "m" and abs(number) > BARE_LENGTH_MAX_M and text.strip()[-1:].isdecimal():
        word = text.strip()
        raise UnitError(f"{word} without a unit is in metres: write {word}mm, or {word}m")
    return number


def _not_a_quantity(text: str, unit: str) -> str:
    """Why `text` is not a number with a unit, and how to write it."""
    if _COMMA.match(text):
        return f"'{text}' has a decimal comma: write a point, {text.strip().replace(',', '.')}"
    if (fraction := _FRACTION.match(text)) and int(fraction[2]):
        number = f"{int(fraction[1]) / int(fraction[2]):g}"
        return f"'{text}' is a fraction: write {f'{number} {fraction[3]}'.rstrip()}"
    names = [name for character, (name, _) in _LOOKALIKES.items() if character in text]
    corrected = text
    for character, (_, replacement) in _LOOKALIKES.items():
        corrected = corrected.replace(character, replacement)
    corrected = " ".join(corrected.split())
    if names and _QUANTITY.match(corrected):
        return f"'{text}' contains {' and '.join(names)}: write {corrected}"
    return f"'{text}' is not a number with a unit, such as {example(unit)}"


def parse_pose(text: str) -> tuple[float, float, float | None]:
    """x and y (m) and the heading (rad), None without one, of `X Y [HEADING]`.

    Spaces or commas separate them, and a space may stand before a unit. Raises UnitError, also for
    a comma that may be a decimal one.
    """
    if len(text.split()) > 1 and (number := _DECIMAL_COMMA.search(text)):
        comma = number[0]
        point, space = comma.replace(",", "."), comma.replace(",", " ")
        raise UnitError(f"the comma of {comma} may be a decimal one: write {point}, or {space}")
    words = _UNIT_APART.sub(r"\1", text.replace(",", " ")).split()
    if not 2 <= len(words) <= 3:
        raise UnitError("give X Y [HEADING], such as '1.0 0.5 90deg'")
    values = [
        typed_quantity(word, unit) for word, unit in zip(words, ("m", "m", "rad"), strict=False)
    ]
    for word, value, unit in zip(words, values, ("m", "m", "rad"), strict=False):
        if not abs(value) <= POSE_MAX[unit]:
            limit = "1000 m" if unit == "m" else "10 turns"
            raise UnitError(f"{word} is too far: at most {limit} is possible")
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
