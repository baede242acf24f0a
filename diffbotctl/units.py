"""Conversion of quantities with units, such as `65 mm`, `90 deg` or `100 rpm`, to SI numbers."""

from __future__ import annotations

import re
from collections.abc import Callable
from math import ceil, floor, log10, pi
from unicodedata import category, decimal, east_asian_width, name, normalize

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


NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_QUANTITY = re.compile(rf"\s*({NUMBER})\s*([A-Za-z%][A-Za-z0-9/%²]*)?\s*\Z")
_COMMA = re.compile(r"([-+]?[0-9]+),([0-9]+)(\s*[A-Za-z%].*)?\Z")  # decimal comma
_DECIMAL_COMMA = re.compile(r"(?<![0-9.,])[-+]?[0-9]+,[0-9]+(?![0-9.,])")
_UNIT_APART = re.compile(r"(?<=[0-9.])\s+([A-Za-z°µμ%])")  # a unit after a space
_FRACTION = re.compile(r"([-+]?[0-9]+)\s*/\s*([0-9]+)(?![0-9/])\s*(\S*)\Z")
_GROUPED = re.compile(r"(?<![0-9])([0-9]{1,3})((?:[ _'’][0-9]{3})+)(?![0-9])")  # thousands apart
_SIGN_APART = re.compile(r"([-+])\s+(?=[0-9.])")
# Of a quantity. The expressions above need the square of the length, and longer numbers overflow.
QUANTITY_MAX_CHARACTERS = 200
QUOTED_MAX_CHARACTERS = 30
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
# Words that people write for a unit -> the unit; plurals are found by their singular.
_UNIT_WORDS = {
    **dict.fromkeys(("meter", "metre"), "m"),
    **dict.fromkeys(("millimeter", "millimetre"), "mm"),
    **dict.fromkeys(("centimeter", "centimetre"), "cm"),
    **dict.fromkeys(("inch", "inche"), "in"),
    **dict.fromkeys(("degree", "degs"), "deg"),
    **dict.fromkeys(("radian", "rads"), "rad"),
    **dict.fromkeys(("revolution", "rev"), "turn"),
    **dict.fromkeys(("second", "sec"), "s"),
    **dict.fromkeys(("millisecond", "msec"), "ms"),
    **dict.fromkeys(("microsecond", "usec"), "us"),
    "minute": "min",
    "hour": "h",
    "hertz": "Hz",
    "volt": "V",
    **dict.fromkeys(("ampere", "amp"), "A"),
    "gram": "g",
    "kilogram": "kg",
    **dict.fromkeys(("percent", "pct"), "%"),
}


class UnitError(ValueError):
    """A text is not a quantity of the expected kind. The message has the cause and the fix."""


class _WordError(UnitError):
    """The unit of a quantity is unknown."""


def quantity(text: str, unit: str) -> float:
    """The number in SI `unit` that `text` stands for.

    A number without a unit is in SI; an angle other than 0 needs its unit. Raises UnitError if
    `text` is not a number, or if its unit is unknown or of another kind.
    """
    if len(text) > QUANTITY_MAX_CHARACTERS:
        raise UnitError(
            f"'{text[:QUOTED_MAX_CHARACTERS]}...' has {len(text)} characters: write a number with "
            f"a unit, such as {example(unit)}"
        )
    try:
        return _read(text, unit)
    except UnitError:
        corrected, causes = _corrected(text)
        first = corrected.partition(",")[0]  # of two readings
        if not causes or not _QUANTITY.match(first):
            raise
    try:
        _read(first, unit)
    except UnitError as error:  # what would be proposed is not accepted either
        raise UnitError(f"'{text}' {' and '.join(causes)}: {error}") from None
    raise UnitError(f"'{text}' {' and '.join(causes)}: write {corrected}")


def _read(text: str, unit: str) -> float:
    """As `quantity`; the message does not explain characters that look like others."""
    match = _QUANTITY.match(text)
    if match is None:
        such_as = f", such as {example(unit)}"
        raise UnitError(f"'{text}' is not a number with a unit{such_as}{_strange(text)}")
    number, written = float(match[1]), match[2]
    if written is None:
        return plain_number(number, unit, match[1])
    written = written.replace("²", "2")
    if written not in UNITS:
        raise _WordError(f"'{written}' is not a known unit{_nearest(written, unit)}")
    kind, factor = UNITS[written]
    if kind != unit:
        expected = KINDS.get(unit, "a plain number")
        raise UnitError(f"{written} is {KINDS[kind]}, but {expected} is required{_such_as(unit)}")
    return number * factor


def is_number(text: str) -> bool:
    """Whether `text` is a number without a unit."""
    return re.fullmatch(NUMBER, text) is not None


def plain_number(number: float, unit: str, text: str = "") -> float:
    """A number without a unit, in SI `unit`; `text` is the number as it was written.

    Raises UnitError for an angle other than 0: most people mean degrees when they write 90, and
    radians when they write 1.57.
    """
    if unit == "rad" and number != 0.0:
        text = text or f"{number:g}"
        limit = magnitude_max(unit)
        options = [f"{text} deg"] if abs(number) * pi / 180 <= limit else []
        if abs(number) <= limit:
            options.append(f"{text} rad for {number * 180 / pi:g} degrees")
        write = ", or ".join(options) or f"an angle such as {example(unit)}"
        raise UnitError(f"the angle {text} has no unit: write {write}")
    return number


def typed_quantity(text: str, unit: str) -> float:
    """As `quantity`, for what a person types to make a robot move.

    A large number of metres needs its unit: most people who write 500 mean millimetres. Raises
    UnitError.
    """
    number = quantity(text, unit)
    if unit == "m" and abs(number) > BARE_LENGTH_MAX_M and text.strip()[-1:].isdecimal():
        word = text.strip()
        factors = {"mm": 1e-3, "m": 1.0}
        fits = [name for name in factors if abs(number) * factors[name] <= POSE_MAX[unit]]
        write = ", or ".join(f"{word}{name}" for name in fits) or "a smaller number"
        raise UnitError(f"{word} without a unit is in metres: write {write}")
    return number


def _corrected(text: str) -> tuple[str, list[str]]:
    """`text` as it should be written, and what is wrong with it."""
    causes: list[str] = []
    visible = "".join(character for character in text if not _is_invisible(character))
    if visible != text:
        causes.append("contains an invisible character")
    corrected = visible.strip()
    names = [look for character, (look, _) in _LOOKALIKES.items() if character in corrected]
    for character, (_, replacement) in _LOOKALIKES.items():
        corrected = corrected.replace(character, replacement)
    wide = "".join(map(_narrow, corrected))
    if wide != corrected:
        corrected = wide
        names.append("characters of another width")
    plain = ascii_digits(corrected)
    if plain != corrected:
        corrected = plain
        names.append("digits of another script")
    if names:
        causes.append(f"contains {' and '.join(names)}")
    corrected = " ".join(corrected.split())
    for pattern, cause, write in _CORRECTIONS:
        match = pattern.search(corrected)
        written = write(match) if match else ""
        if match and written:
            corrected = corrected[: match.start()] + written + corrected[match.end() :]
            causes.append(cause)
    return corrected, causes


def ascii_digits(text: str) -> str:
    """`text` with the decimal digits of every script as 0 to 9."""
    return "".join(str(decimal(each, each)) for each in text)


def _is_invisible(character: str) -> bool:
    return not character.isascii() and category(character) == "Cf"


def _narrow(character: str) -> str:
    """The ASCII form of a full-width character; any other one as it is."""
    return normalize("NFKC", character) if east_asian_width(character) == "F" else character


def _point(match: re.Match[str]) -> str:
    """`1,5 m` with a point, and `1,000 m`, which may also be a thousand, with both readings."""
    whole, decimals, unit = match[1], match[2], match[3] or ""
    thousand = f", or {whole}{decimals}{unit}" if len(decimals) == 3 and int(whole) else ""
    return f"{whole}.{decimals}{unit}{thousand}"


def _decimal(match: re.Match[str]) -> str:
    if not int(match[2]):
        return ""
    return f"{int(match[1]) / int(match[2]):g} {match[3]}".rstrip()


_CORRECTIONS: tuple[tuple[re.Pattern[str], str, Callable[[re.Match[str]], str]], ...] = (
    (_SIGN_APART, "has a space after its sign", lambda match: match[1]),
    (
        _GROUPED,
        "has its thousands apart",
        lambda match: match[1] + re.sub("[^0-9]", "", match[2]),
    ),
    (_COMMA, "has a decimal comma", _point),
    (_FRACTION, "is a fraction", _decimal),
)


def _strange(text: str) -> str:
    """The name of the first character that no number and no unit has."""
    strange = next((each for each in text if not each.isascii() and each not in "²"), None)
    if strange is None or not strange.isprintable():
        return ""
    return f"; '{strange}' is {name(strange, 'no character of a unit').lower()}"


def parse_pose(text: str) -> tuple[float, float, float | None]:
    """x and y (m) and the heading (rad), None without one, of `X Y [HEADING]`.

    Spaces or commas separate them, and a space may stand before a unit. Raises UnitError, also for
    a comma that may be a decimal one.
    """
    if len(text.split()) > 1 and (number := _DECIMAL_COMMA.search(text)):
        comma = number[0]
        point, space = comma.replace(",", "."), comma.replace(",", " ")
        raise UnitError(f"the comma of {comma} may be a decimal one: write {point}, or {space}")
    apart = text.replace(",", " ")
    try:
        return _pose(_UNIT_APART.sub(r"\1", apart).split())
    except _WordError:
        if 2 <= len(apart.split()) <= 3:  # `1 1 north`: the word is no unit of the number before it
            return _pose(apart.split())
        raise


def _pose(words: list[str]) -> tuple[float, float, float | None]:
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


def rounded_down(value: float) -> float:
    """The positive `value` rounded down to two significant digits, for a limit to propose."""
    step = 10.0 ** (floor(log10(value)) - 1)
    return float(f"{floor(value / step * (1.0 + 1e-9)) * step:.3g}")


def rounded_up(value: float) -> float:
    """As `rounded_down`, upwards."""
    step = 10.0 ** (floor(log10(value)) - 1)
    return float(f"{ceil(value / step * (1.0 - 1e-9)) * step:.3g}")


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
        "A": "1.5 A",
        "kg": "2.4 kg",
    }.get(unit, "0.5")


def of_kind(unit: str) -> list[str]:
    """All units that can be converted to SI `unit`."""
    return [each for each, (kind, _) in UNITS.items() if kind == unit]


def _such_as(unit: str) -> str:
    return f", such as {example(unit)}" if unit in KINDS else ""


def _nearest(written: str, unit: str) -> str:
    names = of_kind(unit)
    if written[:1] == "u" and written[1:] in UNITS:
        return f"; use one of {', '.join(names)}"  # one that is alike is a million times larger
    same = next((name for name in names if name.lower() == written.lower()), None)
    word = written.lower()
    # A word is like another word, or, if it is short, like a unit.
    like = closest_match(word.removesuffix("s"), _UNIT_WORDS, cutoff=0.8)
    named = _UNIT_WORDS.get(word) or _UNIT_WORDS.get(like or "")
    near = same or (named if named in names else closest_match(written, names, cutoff=0.5))
    return f"; did you mean {near}?" if near else f"; use one of {', '.join(names)}"
