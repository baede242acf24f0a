"""Curves in a terminal, as SVG and as PNG."""

import io
import sys
from math import isfinite, isnan, nan
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner
from hypothesis import assume, given
from hypothesis import strategies as st

from diffbotctl.cli import bag
from diffbotctl.cli.main import program
from diffbotctl.errors import UsageError, UserError
from diffbotctl.recording.fields import Series, read_series
from diffbotctl.ui.plot import image as image_module
from diffbotctl.ui.plot import plots
from diffbotctl.ui.plot.axes import make_axis
from diffbotctl.ui.plot.canvas import ASCII, BRAILLE, CharacterCanvas
from diffbotctl.ui.plot.image import COLOURS, encode_svg, make_figure
from tests.command_result import invoke

NUMBERS = st.floats(-1e9, 1e9, allow_nan=False)


@pytest.mark.parametrize(
    "least, most, ticks, labels",
    [
        (0.0, 10.0, 5, ["0", "2", "4", "6", "8", "10"]),  # 10 / 5 is a round step itself
        (0.0, 9.0, 5, ["0", "2", "4", "6", "8"]),  # 1.8 is rounded up to 2
        (-0.04, 0.11, 3, ["0.00", "0.05", "0.10"]),  # 0.05
        (3.0, 3.0, 2, ["2", "4"]),  # a constant gets half its value on both sides: 3 / 2
        (0.0, 0.0, 2, ["-0.5", "0.0", "0.5"]),
        (1.1, 1.3, 1, ["1.1", "1.2", "1.3"]),  # 0.2 would give one tick: the next step down
        (0.0, 5e-324, 2, ["-0.5", "0.0", "0.5"]),  # the smallest float has no smaller step
        (0.0, 1e-11, 2, ["0", "5e-12", "1e-11"]),
    ],
)
def test_axes(least, most, ticks, labels):
    made = make_axis(least, most, ticks)
    assert [made.label(tick) for tick in made.ticks] == labels


@given(st.floats(allow_nan=False), st.floats(allow_nan=False), st.floats(), st.integers(1, 12))
def test_an_axis_of_any_numbers_has_ticks_and_places_every_value(one, other, value, ticks):
    axis = make_axis(min(one, other), max(one, other), ticks)
    assert isfinite(axis.minimum) and isfinite(axis.maximum) and len(axis.ticks) >= 2
    assert all(len(axis.label(tick)) <= 20 for tick in axis.ticks)
    assert isnan(value) or 0.0 <= axis.share(value) <= 1.0


@given(NUMBERS, NUMBERS, st.integers(1, 12))
def test_an_axis_holds_its_values_and_two_ticks_or_more(one, other, ticks):
    least, most = sorted((one, other))
    assume(most == least or most - least > 1e-6 * max(abs(least), abs(most)))
    made = make_axis(least, most, ticks)
    slack = 1e-6 * (made.maximum - made.minimum)
    assert made.minimum <= least and most <= made.maximum
    assert 2 <= len(made.ticks) <= 3 * ticks + 2
    assert all(made.minimum - slack <= tick <= made.maximum + slack for tick in made.ticks)


@pytest.mark.parametrize(
    "font, dots, rows",
    [
        # A braille cell is 2 wide and 4 high; dot 1 is its upper left, dot 8 its lower right.
        (BRAILLE, [(0, 0)], ["\u2801"]),
        (BRAILLE, [(1, 3)], ["\u2880"]),
        (BRAILLE, [(x, y) for x in (0, 1) for y in range(4)], ["\u28ff"]),
        (ASCII, [(0, 0)], ["'"]),
        (ASCII, [(0, 1)], ["."]),
        (ASCII, [(0, 0), (0, 1)], [":"]),
        (ASCII, [(-1, 0), (9, 9)], [" "]),  # outside
    ],
)
def test_dots(font, dots, rows):
    canvas = CharacterCanvas(1, 1, font)
    for x, y in dots:
        canvas.dot(x, y)
    assert canvas.text().plain.split("\n") == rows


def test_a_line_leaves_no_column_out():
    canvas = CharacterCanvas(8, 4, ASCII)
    canvas.polyline([(0, 7), (7, 0)])
    assert canvas.text().plain.split("\n") == ["      .'", "    .'  ", "  .'    ", ".'      "]


RAMP = Series("a.b.x", "m", [0.0, 1.0, 2.0], [0.0, 1.0, 2.0])


@pytest.mark.parametrize("panels", [1, 2, 3])
@pytest.mark.parametrize("font", [BRAILLE, ASCII])
def test_a_picture_fits_the_terminal(panels, font):
    lines = list(plots.render_plots([RAMP] * panels, 80, 24, font))
    assert len(lines) <= 24 and max(map(len, lines)) <= 80
    assert lines[0] == "a.b.x [m]"
    if font is ASCII:
        assert "".join(lines).isascii()


def test_a_ramp_rises_from_the_lower_left_to_the_upper_right():
    lines = list(plots.render_plots([RAMP], 30, 9, ASCII))
    curve = [line[10:] for line in lines[1:-2]]
    firsts = [len(row) - len(row.lstrip()) for row in curve]
    assert firsts == sorted(firsts, reverse=True) and firsts[-1] == 0
    assert len(curve[0]) == 20  # its end is in the last of 30 - 10 columns


def test_a_gap_stays_a_gap():
    gap = Series("a.b.x", "m", [0.0, 1.0, 2.0, 3.0, 4.0], [1.0, 1.0, nan, 1.0, 1.0])
    (row,) = [line[10:] for line in plots.render_plots([gap], 31, 9, ASCII) if "'" in line[9:]]
    assert "     " in row.strip()
    lines = [each for each in make_figure([gap], "t").shapes if getattr(each, "width", 0) == 1.5]
    assert [len(each.points) for each in lines] == [2, 2]


def test_fields_of_one_unit_share_a_panel(goal):
    picture = make_figure(read_series(goal, ["gate.wheels", "robot.front"]), "goal & <run>")
    root = ElementTree.fromstring(encode_svg(picture))
    name = "{http://www.w3.org/2000/svg}"
    texts = [each.text for each in root.iter(f"{name}text")]
    assert {"goal & <run>", "gate.wheels.left", "gate.wheels.right", "rad/s", "V"} <= set(texts)
    lines = list(root.iter(f"{name}polyline"))
    curves = [each for each in lines if each.get("stroke-width") == "1.5"]
    assert [each.get("stroke") for each in curves] == [COLOURS[0], COLOURS[1], COLOURS[0]]
    frames = [each for each in lines if each.get("points").count(" ") == 4]
    assert len(frames) == 2
    for each in curves:
        for point in each.get("points").split():
            x, y = map(float, point.split(","))
            assert 0 <= x <= picture.width and 0 <= y <= picture.height


def test_a_png_has_the_curve_where_the_picture_has_it():
    from PIL import Image

    picture = make_figure([RAMP], "ramp")
    image = Image.open(io.BytesIO(image_module.encode_png(picture))).convert("RGB")
    assert image.size == (
        picture.width * image_module.PNG_SCALE,
        picture.height * image_module.PNG_SCALE,
    )
    (curve,) = [each for each in picture.shapes if getattr(each, "width", 0) == 1.5]
    x, y = (round(each * image_module.PNG_SCALE) for each in curve.points[1])
    assert image.getpixel((x, y)) == tuple(bytes.fromhex(COLOURS[0][1:]))
    assert image.getpixel((x + 9, y + 20 * image_module.PNG_SCALE)) == (
        255,
        255,
        255,
    )  # beside the grid


@pytest.mark.parametrize(
    "name, cause",
    [("x.pdf", ".svg or .png"), ("x", ".svg or .png"), ("nowhere/x.svg", "No such file")],
)
def test_a_picture_that_cannot_be_written(goal, tmp_path, name, cause):
    with pytest.raises(UserError, match=cause):
        invoke(bag.bag, "plot", "odometry.odometry.x", goal, "--output", tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_without_pillow_a_png_states_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "PIL", None)  # as Python has it for what is not installed
    with pytest.raises(UsageError, match="pip install pillow"):
        image_module.encode_png(make_figure([RAMP], "t"))


def test_text_fields_cannot_be_plotted(goal):
    with pytest.raises(UsageError, match="texts or lists"):
        read_series(goal, ["range.range.state"])
    assert [each.name for each in read_series(goal, ["range.range"])] == ["range.range.distance"]


def test_a_period_of_time(goal):
    (part,) = read_series(goal, ["odometry.odometry.x"], 1_000_000_000, 2_000_000_000)
    (whole,) = read_series(goal, ["odometry.odometry.x"])
    inside = [(t, v) for t, v in zip(whole.times, whole.values, strict=True) if 1.0 <= t < 2.0]
    assert list(zip(part.times, part.values, strict=True)) == inside
    with pytest.raises(UsageError, match="has a number in that time"):
        read_series(goal, ["odometry.odometry.x"], 10**15)


def plotted(*words, charset="utf-8"):
    runner = CliRunner(charset=charset, env={"COLUMNS": "80", "LINES": "24"})
    result = runner.invoke(program, ["bag", "plot", *map(str, words)], standalone_mode=False)
    assert result.exception is None, result.exception
    return result.output.splitlines()


def test_the_command_draws_on_a_terminal_of_80_by_24(goal):
    lines = plotted("odometry.odometry.x", "gate.wheels.left", goal)
    assert 20 <= len(lines) <= 23 and max(map(len, lines)) <= 80  # one row is the prompt's
    assert any("\u2801" <= character <= "\u28ff" for character in "".join(lines))
    assert lines[0] == "odometry.odometry.x [m]" and lines[-1].endswith("s")


def test_the_recording_may_be_named_before_the_fields(goal):
    assert plotted(goal, "gate.wheels") == plotted("gate.wheels", goal)


@pytest.mark.parametrize("words, charset", [(["--ascii"], "utf-8"), ([], "ascii"), ([], "latin-1")])
def test_where_there_is_no_braille_plain_characters_draw(goal, words, charset):
    lines = plotted(*words, "odometry.odometry.x", goal, charset=charset)
    assert "".join(lines).isascii() and any("'" in line for line in lines)


@pytest.mark.parametrize("name, begins", [("x.svg", b"<svg "), ("x.png", b"\x89PNG")])
def test_the_command_writes_pictures(goal, tmp_path, name, begins):
    path = tmp_path / name
    words = ("gate.wheels", goal, "--from", "1s", "--until", "3s", "--output", path)
    assert plotted(*words) == [f"written: {path}"]
    assert path.read_bytes().startswith(begins)
