"""Sentences are folded between words and keep their indentation."""

import pytest

from diffbotctl.ui.text import fold_text

CASES = (
    # text, hang, width, what comes of it
    ("short", 0, 10, "short"),
    ("one two three", 0, 7, "one two\nthree"),  # "one two" has just 7
    ("  one two three", 0, 9, "  one two\n  three"),  # the indentation stays
    ("one two three", 2, 7, "one two\n  three"),
    ("/a/path/longer/than/that x", 0, 10, "/a/path/longer/than/that\nx"),  # whole, to be copied
    ("a-hyphen-stays whole", 0, 10, "a-hyphen-stays\nwhole"),
    ("one\n\ntwo three", 0, 5, "one\n\ntwo\nthree"),  # lines of its own stay its own
    ("now run `diffbotctl run goal` or", 0, 20, "now run\n`diffbotctl run goal`\nor"),
    ("a    column", 0, 20, "a    column"),  # what fits is left alone
)


@pytest.mark.parametrize(("text", "hang", "width", "expected"), CASES)
def test_folding(text, hang, width, expected):
    assert fold_text(text, hang, width) == expected
