"""Quantities as people write them, and the error for those that are not accepted."""

from contextlib import suppress
from math import pi

import pytest

from diffbotctl.units import UnitError, of_kind, parse_pose, quantity


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("65 mm", "m", 0.065),
        ("90 deg", "rad", pi / 2),
        ("0", "rad", 0.0),
        ("-0", "rad", 0.0),
        ("1 m/s²", "m/s2", 1.0),
        ("300 us", "s", 300e-6),
        ("0.3", "m/s", 0.3),
    ],
)
def test_values(text, unit, value):
    assert quantity(text, unit) == pytest.approx(value)


@pytest.mark.parametrize(
    ("text", "unit", "message"),
    [
        ("90", "rad", "the angle 90 has no unit: write 90 deg"),
        ("-1.5", "rad", "the angle -1.5 has no unit: write -1.5 deg, or -1.5 rad for -85.9437"),
        ("90°", "rad", "'90°' contains the degree sign: write 90 deg"),
        ("\N{MINUS SIGN}1 m", "m", "contains the minus sign U+2212: write -1 m"),
        ("300 µs", "s", "contains the micro sign: write 300 us"),
        ("300 \N{GREEK SMALL LETTER MU}s", "s", "contains the Greek letter mu: write 300 us"),
        ("1 m/s^2", "m/s2", "contains a caret: write 1 m/s2"),
        ("1/8 m", "m", "'1/8 m' is a fraction: write 0.125 m"),
        ("1/0", "m", "'1/0' is not a number with a unit, such as 65 mm"),
        ("−5 °", "rad", "the minus sign U+2212 and the degree sign: write -5 deg"),
        ("5^", "1", "contains a caret: write 5"),
        ("9" * 400 + "/1 m", "m", "9...' has 404 characters: write a number with a unit, such as"),
        ("9" * 5000 + ",000 m", "m", "9...' has 5006 characters: write a number with a unit"),
        ("1" * 30_000 + "!", "m", "1...' has 30001 characters: write a number with a unit"),
        ("1" + " " * 90_000 + "mm x", "m", "...' has 90005 characters: write a number with a unit"),
        ("^°", "rad", "'^°' is not a number with a unit, such as 90 deg"),
        ("1,5 m", "m", "'1,5 m' has a decimal comma: write 1.5 m"),
        ("1,500 m", "m", "has a decimal comma: write 1.500 m, or 1500 m"),
        ("0,125 m", "m", "has a decimal comma: write 0.125 m"),
        ("1,5 parsec", "m", "has a decimal comma: 'parsec' is not a known unit"),
        ("1 250 mm", "m", "'1 250 mm' has its thousands apart: write 1250 mm"),
        ("1_000", "m", "'1_000' has its thousands apart: write 1000"),
        ("- 5 mm", "m", "'- 5 mm' has a space after its sign: write -5 mm"),
        ("1/2", "rad", "'1/2' is a fraction: the angle 0.5 has no unit: write 0.5 deg"),
        ("90°", "Hz", "contains the degree sign: deg is an angle, but a rate is required"),
        ("65 µA", "A", "contains the micro sign: 'uA' is not a known unit; use one of A, mA"),
        ("6\N{ZERO WIDTH SPACE}5 mm", "m", "contains an invisible character: write 65 mm"),
        ("６５ｍｍ", "m", "contains characters of another width: write 65mm"),
        ("5 c\N{CYRILLIC SMALL LETTER EM}", "m", "is cyrillic small letter em"),
        ("½ m", "m", "'½' is vulgar fraction one half"),
        ("−5,5 °", "rad", "the degree sign and has a decimal comma: write -5.5 deg"),
        ("1e308", "rad", "the angle 1e308 has no unit: write an angle such as 90 deg"),
        ("1e-320", "rad", "the angle 1e-320 has no unit: write 1e-320 deg"),
        ("5 secs", "s", "'secs' is not a known unit; did you mean s?"),
        ("5 milimetres", "m", "'milimetres' is not a known unit; did you mean mm?"),
        ("5 percent", "1", "'percent' is not a known unit; did you mean %?"),
    ],
)
def test_messages(text, unit, message):
    with pytest.raises(UnitError) as caught:
        quantity(text, unit)
    assert message in str(caught.value)


WRONG = (
    "5",
    "5,5",
    "-5,25",
    "1 250",
    "1_250",
    "1/8",
    "- 5",
    "\N{MINUS SIGN}5",
    "6\N{SOFT HYPHEN}5",
)
MARKS = ("^", "°", "µ", "\N{GREEK SMALL LETTER MU}", "\N{ZERO WIDTH SPACE}", "")


@pytest.mark.parametrize("number", WRONG)
@pytest.mark.parametrize("mark", MARKS)
@pytest.mark.parametrize("unit", ["m", "rad", "s", "Hz", "m/s", "m/s2", "V", "A", "kg", "1"])
def test_what_is_proposed_is_accepted(number, mark, unit):
    for symbol in ("", *of_kind(unit)):
        with suppress(UnitError):
            assert quantity(f"{number} {mark}{symbol}", unit) is not None
            continue
        with pytest.raises(UnitError) as caught:
            quantity(f"{number} {mark}{symbol}", unit)
        _, has_proposal, proposed = str(caught.value).partition(": write ")
        if has_proposal and not proposed.startswith("an angle"):
            quantity(proposed.partition(",")[0], unit)


def test_a_pose():
    assert parse_pose("1 0.5 90deg") == (1.0, 0.5, pytest.approx(pi / 2))
    assert parse_pose("1, 0.5") == (1.0, 0.5, None)
    assert parse_pose("1,2") == (1.0, 2.0, None)
    assert parse_pose("0.5,1 0") == (0.5, 1.0, 0.0)
    assert parse_pose("500m -300mm") == (500.0, pytest.approx(-0.3), None)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 0.5 90", "the angle 90 has no unit"),
        ("1 0.5 1e308deg", "1e308deg is too far: at most 10 turns is possible"),
        ("1e9m 0", "1e9m is too far: at most 1000 m is possible"),
        ("1e999m 0", "1e999m is too far"),
        ("1", "give X Y [HEADING]"),
        ("1 1 nan", "'nan' is not a number with a unit, such as 90 deg"),
        ("1 1 north", "'north' is not a number with a unit, such as 90 deg"),
        ("1 1 90 degrees", "'degrees' is not a known unit; did you mean deg?"),
        ("2000 0", "2000 without a unit is in metres: write 2000mm"),
        ("1e308 0", "1e308 without a unit is in metres: write a smaller number"),
        ("1,5 0", "the comma of 1,5 may be a decimal one: write 1.5, or 1 5"),
        ("0 -1,5 90deg", "the comma of -1,5 may be a decimal one: write -1.5, or -1 5"),
        ("0 -300", "-300 without a unit is in metres: write -300mm, or -300m"),
        ("500 300", "500 without a unit is in metres: write 500mm, or 500m"),
    ],
)
def test_poses_that_are_refused(text, message):
    with pytest.raises(UnitError) as caught:
        parse_pose(text)
    assert message in str(caught.value)
