"""Canvas: colours, pen and spawned turtles."""

import pytest

from diffbotctl.blocks.canvas import TURTLES_MAX, TurtleCanvas, colour
from diffbotctl.config.load import load
from diffbotctl.log import Logbook
from diffbotctl.messages import Odometry, TurtlePlacement

HERE = Odometry(5, 5.544, 5.544, 0.0, 0.0, 0.0, (0.0,) * 6)


@pytest.fixture
def canvas():
    """A canvas that has sent its state once."""
    block = TurtleCanvas()
    block.react(0, HERE)
    return block


@pytest.mark.parametrize(
    ("parts", "expected"),
    [((0, 0, 0), "#000000"), ((255, 255, 255), "#ffffff"), ((69, 86, 255), "#4556ff")],
)
def test_colours(parts, expected):
    assert colour(*parts) == expected


def test_the_state_is_sent_first_and_then_on_changes(canvas):
    state, placement = TurtleCanvas().react(0, HERE)
    assert state == (0, 0, "#4556ff", "#b3b8ff", True, ()) and placement is None
    assert canvas.react(1, HERE) == (None, None)
    canvas.background_red = 255
    assert canvas.react(2, HERE)[0].background == "#ff56ff"
    assert canvas.react(3, HERE) == (None, None)


def test_pen_up_and_down(canvas):
    canvas.pen, canvas.pen_green = "up", 0
    state, _ = canvas.react(1, HERE)
    assert (state.is_down, state.pen) == (False, "#b300ff")


def test_clear_starts_a_new_line(canvas):
    canvas.clear(1)
    assert canvas.react(1, HERE)[0].sheet == 1


def test_starting_over_erases_the_line_and_removes_all_further_turtles(canvas):
    assert [canvas.spawn(1), canvas.spawn(1, number=7)] == [2, 7]
    canvas.start_over(2)
    state, *sent = *canvas.react(3, HERE), *(canvas.react(now, HERE)[1] for now in (4, 5, 6))
    assert (state.sheet, state.turtles) == (1, ())
    assert [(one.number, one.is_present) for one in sent] == [
        (2, True),
        (7, True),
        (2, False),
        (7, False),
    ]


def test_turtles_are_spawned_moved_and_killed(canvas):
    canvas.spawn(1, 2.0, 3.0, 0.5)
    canvas.spawn(1)
    assert canvas.react(1, HERE)[0].turtles == (2, 2.0, 3.0, 0.5, 3, 0.0, 0.0, 0.0)
    canvas.teleport(2, 3, 9.0, 8.0, 1.0)
    canvas.kill(2, 2)
    assert canvas.react(2, HERE)[0].turtles == (3, 9.0, 8.0, 1.0)
    canvas.spawn(3, 1.0)  # numbers are not reused
    assert canvas.react(3, HERE)[0].turtles[4] == 4


def test_a_number_can_be_asked_for_unless_it_is_taken(canvas):
    canvas.spawn(1, 2.0, number=7)
    canvas.spawn(1, 3.0)
    assert canvas.react(1, HERE)[0].turtles[::4] == (7, 8)
    for number in (7, 1, 2.5):
        with pytest.raises(ValueError, match="turtle"):
            canvas.spawn(2, number=number)
    canvas.kill(2, 7)
    canvas.spawn(2, 4.0, number=7)
    assert canvas.react(3, HERE)[0].turtles[4:6] == (7, 4.0)


def test_numbers_that_can_be_driven_are_used_again_when_there_is_no_other():
    canvas = TurtleCanvas(driven=4)
    for number in (1, 2, 3):
        canvas.spawn(number)
    canvas.kill(4, 3)
    canvas.spawn(5)
    canvas.spawn(6)
    assert canvas.react(7, HERE)[0].turtles[::4] == (2, 4, 3, 5)


@pytest.mark.parametrize(("driven", "warned"), [(1, 2), (2, 1), (3, 0)])
def test_a_turtle_that_no_block_moves_is_reported(driven, warned):
    canvas, book = TurtleCanvas(driven=driven), Logbook()
    canvas.log = book.source_log("canvas")
    canvas.spawn(1)
    canvas.spawn(1)
    lines = book.take_lines(1)
    assert len(lines) == warned
    assert all("stands still" in line.text and line.level == "warning" for line in lines)


def test_the_pipeline_turtles_drives_as_many_as_its_canvas_says():
    blocks = {use.name: use.values for use in load("turtles").blocks}
    numbers = [values["number"] for name, values in blocks.items() if name.startswith("turtle")]
    assert sorted(numbers) == list(range(2, blocks["canvas"]["driven"] + 1))


def test_every_placement_is_sent_one_an_instant(canvas):
    canvas.spawn(1, 2.0, 3.0, 0.5)
    canvas.teleport(1, 2, 9.0, 8.0, 1.0)
    canvas.kill(1, 2)
    sent = [canvas.react(time, HERE)[1] for time in (10, 20, 30, 40)]
    assert sent == [
        TurtlePlacement(10, 2, 2.0, 3.0, 0.5, True),
        TurtlePlacement(20, 2, 9.0, 8.0, 1.0, True),
        TurtlePlacement(30, 2, 0.0, 0.0, 0.0, False),
        None,
    ]


@pytest.mark.parametrize("number", [1, 7, 2.5])
def test_an_unknown_turtle_cannot_be_killed_or_moved(canvas, number):
    canvas.spawn(1)
    with pytest.raises(ValueError, match="turtle"):
        canvas.kill(2, number)
    with pytest.raises(ValueError, match="turtle"):
        canvas.teleport(2, number)
    assert len(canvas.react(3, HERE)[0].turtles) == 4


def test_the_number_of_turtles_is_limited(canvas):
    for _ in range(TURTLES_MAX):
        canvas.spawn(1)
    with pytest.raises(ValueError, match="kill some"):
        canvas.spawn(2)
