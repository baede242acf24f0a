"""A curve in characters: positions of points, and the numbers of the axes."""

from diffbotctl.ui.plot.plots import CURVE_HEIGHT, CURVE_LABEL_WIDTH, CURVE_WIDTH, render_curve


def cells(text: str) -> list[str]:
    """The rows of the plot without the numbers on the left."""
    return [line[CURVE_LABEL_WIDTH + 2 :] for line in text.split("\n")[:CURVE_HEIGHT]]


def test_minimum_and_maximum_are_in_the_corners():
    text = render_curve({"fit": [(4.0, 2.7), (30.0, 0.4)]}, "cm", "V").plain
    rows = cells(text)
    assert rows[0][0] == "." and rows[-1][CURVE_WIDTH - 1] == "."
    assert text.startswith("    2.7 |")
    assert "4" in text and "30" in text and text.endswith(". fit; across cm, upwards V")


def test_points_are_drawn_over_the_curve():
    rows = cells(render_curve({"fit": [(0, 0), (1, 1), (2, 2)], "rule": [(1, 1)]}, "", "").plain)
    assert sum(row.count("o") for row in rows) == 1
    assert sum(row.count(".") for row in rows) == 2


def test_a_single_value_does_not_divide_by_zero():
    assert "o" not in "".join(cells(render_curve({"fit": [(1.0, 1.0)]}, "", "").plain))
    assert render_curve({}, "", "").plain
