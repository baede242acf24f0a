"""Declarations of settings: bounds, and the names that packages of release 0.1 use."""

import pytest

from diffbotctl.params import Count, Number, Param, Section, declared, with_unit


class Bounded(Section):
    """One setting between two bounds."""

    share = Param(float, unit="1", minimum=0.1, maximum=0.5, help="A share.")


def test_bounds_are_included():
    share = declared(Bounded)["share"]
    assert share.bounds == {"minimum": 0.1, "maximum": 0.5}
    assert share.complaint(0.1) is None and share.complaint(0.5) is None
    assert share.complaint(0.09) == "must be at least 0.1"
    assert share.complaint(0.51) == "must be at most 0.5"


def test_least_and_most_still_work_and_warn():
    with pytest.warns(DeprecationWarning, match="minimum= and maximum=") as warned:

        class Former(Section):
            share = Param(float, unit="1", least=0.1, most=0.5, help="A share.")

    assert warned[0].filename == __file__, "the warning names the line of the declaration"
    assert declared(Former)["share"].bounds == declared(Bounded)["share"].bounds


def test_a_declaration_is_frozen():
    with pytest.raises(AttributeError):
        declared(Bounded)["share"].unit = "m"


@pytest.mark.parametrize(
    ("interval", "bounds"),
    [
        ("[0, 0.5)", {"below": 0.5, "minimum": 0.0}),
        ("(0, inf)", {"above": 0.0}),
        ("(-inf, 2]", {"maximum": 2.0}),
        ("[-2, 1e3]", {"minimum": -2.0, "maximum": 1000.0}),
        ("", {}),
    ],
)
def test_an_interval_gives_the_bounds_of_a_number(interval, bounds):
    declared = Number("m", interval, None, "A length.")
    assert declared.bounds == bounds and declared.none and declared.default is None
    assert Number("m", interval, 1.0, "A length.").none is False


def test_the_bounds_of_a_count_are_whole_numbers():
    declared = Count("[1, 40)", 5, "How many.")
    assert declared.bounds == {"minimum": 1, "below": 40} and declared.kind is int
    assert all(type(bound) is int for bound in declared.bounds.values())


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0349066, "rad", "2 deg"),
        (0.5, "rad", "0.5 rad"),
        (0.0, "rad", "0 deg"),
        (4.0, "rad/s", "4 rad/s"),
        (5.0, "1", "5"),
    ],
)
def test_a_number_is_shown_with_its_unit(value, unit, text):
    assert with_unit(value, unit) == text
