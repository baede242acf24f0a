"""Marks of a picture: what is written, and that any text may stand in it."""

from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as some

from diffbotctl.render.svg import (
    element,
    format_number,
    points_attribute,
    svg_document,
    text_element,
)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.0, "1"),
        (0.125, "0.12"),  # to a hundredth of a pixel
        (-0.001, "0"),
        (10.0, "10"),  # no nought of the number itself is lost
        (7, "7"),
        ("4 3", "4 3"),
    ],
)
def test_numbers_are_as_short_as_they_can_be(value, text):
    assert format_number(value) == text


def test_a_mark_with_its_looks():
    assert element("circle", cx=1.5, r=4, fill="#fff") == '<circle cx="1.5" r="4" fill="#fff"/>'
    assert element("text", "a", class_="pin", text_anchor=None) == '<text class="pin">a</text>'
    assert element("line", stroke_width=2) == '<line stroke-width="2"/>'
    assert points_attribute([(0, 1.5), (2.25, -3)]) == "0,1.5 2.25,-3"


# Characters that XML itself allows.
TEXTS = some.text(
    some.characters(
        min_codepoint=32, exclude_categories=("Cs", "Cn"), exclude_characters="\x7f\ufffe\uffff"
    )
)


@given(TEXTS, TEXTS)
def test_any_text_may_stand_in_it(output, look):
    root = ElementTree.fromstring(
        svg_document(10, 20.4, [text_element(1, 2, output, data_part=look)])
    )
    assert (root.get("width"), root.get("height"), root.get("viewBox")) == ("10", "20", "0 0 10 20")
    _, text = root
    assert (text.text or "") == output and text.get("data-part") == look
