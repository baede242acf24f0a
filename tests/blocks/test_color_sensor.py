"""Colour sensor of the turtle: background, lines of a width, the pen, clearing, killing."""

from math import dist

import pytest

from diffbotctl.blocks.color_sensor import CELL_M, PENS_MAX, ColorSensor
from diffbotctl.messages import Canvas, Odometry

BLUE, RED = (0, 0, 255), (255, 0, 0)


def canvas(pen="#ff0000", is_down=True, sheet=0, pen_width=0.1, has_first=True):
    return Canvas(0, sheet, "#0000ff", pen, is_down, (), pen_width, has_first)


@pytest.fixture
def sensor():
    """A sensor below a turtle that has drawn a line from (1, 5) to (3, 5), 10 cm wide."""
    block = ColorSensor()
    walk(block, [(1.0 + 0.02 * step, 5.0) for step in range(101)])
    return block


def walk(sensor, places, **state):
    """The colour at the last of these places."""
    seen = None
    for x, y in places:
        seen = sensor.react(1, canvas(**state), Odometry(1, x, y, 0.0, 0.0, 0.0, (0.0,) * 6))
    return None if seen is None else seen[1:]


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        (2.01, 5.01, RED),
        (2.01, 4.99, RED),
        (2.01, 5.12, BLUE),
        (2.01, 4.85, BLUE),
        (0.8, 5.0, BLUE),
        (3.2, 5.0, BLUE),
        (-1.0, 99.0, BLUE),
    ],
)
def test_what_is_seen_beside_a_line(sensor, x, y, expected):
    assert walk(sensor, [(x, y)], is_down=False) == expected


def test_the_pen_draws_only_while_it_is_down(sensor):
    walk(sensor, [(2.0, 7.0), (2.2, 7.0)], is_down=False)
    assert walk(sensor, [(2.1, 7.0)], is_down=False) == BLUE
    walk(sensor, [(2.0, 7.0), (2.2, 7.0)], pen="#00ff00")
    assert walk(sensor, [(2.1, 7.0)], is_down=False) == (0, 255, 0)


def test_a_turtle_that_was_put_elsewhere_draws_no_line(sensor):
    walk(sensor, [(3.0, 5.0), (3.0, 8.0)])
    assert walk(sensor, [(3.0, 6.5)], is_down=False) == BLUE


def test_a_cleared_canvas_has_no_line(sensor):
    assert walk(sensor, [(2.0, 5.0)], is_down=False, sheet=1) == BLUE


def test_a_killed_turtle_sees_and_draws_nothing(sensor):
    assert walk(sensor, [(2.0, 6.0), (2.2, 6.0)], has_first=False) is None
    assert walk(sensor, [(2.1, 6.0)], is_down=False) == BLUE


def test_pens_beyond_the_most_replace_those_that_are_not_seen(sensor):
    for number in range(PENS_MAX + 5):
        walk(sensor, [(2.0, 5.0), (2.1, 5.0)], pen=f"#0000{number % 256:02x}")
        walk(sensor, [(2.0, 5.0), (2.1, 5.0)], pen=f"#00ff{number % 256:02x}")
    assert walk(sensor, [(2.05, 5.0)], is_down=False) == (0, 255, (PENS_MAX + 4) % 256)
    assert walk(sensor, [(1.2, 5.0)], is_down=False) == RED


@pytest.mark.parametrize("radius", [0.01, 0.035, 0.2, 2.5])
@pytest.mark.parametrize("place", [(5.513, 5.021), (0.02, 0.0), (11.09, 7.777)])
def test_a_dot_has_the_cells_whose_middle_is_within_the_radius(place, radius):
    sensor = ColorSensor()
    sensor._dot(*place, radius, 7)
    own = sensor._cell(*place)
    for cell, pen in enumerate(sensor.cells):
        row, column = divmod(cell, sensor.columns)
        distance = dist(place, ((column + 0.5) * CELL_M, (row + 0.5) * CELL_M))
        if abs(distance - radius) > 1e-9:
            assert (pen == 7) == (distance < radius or cell == own)
