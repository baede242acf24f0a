"""Canvas: colours, pen and spawned turtles."""

import pytest

from diffbotctl.blocks.canvas import TURTLES_MAX, TurtleCanvas, colour
from diffbotctl.config.load import load
from diffbotctl.log import Logbook
from diffbotctl.messages import Odometry, TurtlePlacement, Twist

HERE = Odometry(5, 5.544, 5.544, 0.0, 0.0, 0.0, (0.0,) * 6)


@pytest.fixture
def canvas():
    """A canvas that has sent its state once."""
    block = TurtleCanvas()
    frame(block, 0)
    return block


def frame(canvas, now, twist=None):
    """The state and the placement that are sent at a pose of the robot."""
    state, _, _, placement = canvas.react(now, HERE, twist)
    return state, placement


@pytest.mark.parametrize(
    ("parts", "expected"),
    [((0, 0, 0), "#000000"), ((255, 255, 255), "#ffffff"), ((69, 86, 255), "#4556ff")],
)
def test_colours(parts, expected):
    assert colour(*parts) == expected


def test_the_state_is_sent_first_and_then_on_changes(canvas):
    state, placement = frame(TurtleCanvas(), 0)
    assert state == (0, 0, "#4556ff", "#b3b8ff", True, (), 0.07, True, (), ()) and placement is None
    assert frame(canvas, 1) == (None, None)
    canvas.background_red = 255
    assert frame(canvas, 2)[0].background == "#ff56ff"
    assert frame(canvas, 3) == (None, None)


def test_pen_up_and_down(canvas):
    canvas.pen, canvas.pen_green = "up", 0
    state, _ = frame(canvas, 1)
    assert (state.is_down, state.pen) == (False, "#b300ff")


def test_clear_starts_a_new_line(canvas):
    canvas.clear(1)
    assert frame(canvas, 1)[0].sheet == 1


def test_starting_over_erases_the_line_and_removes_all_further_turtles(canvas):
    assert [canvas.spawn(1), canvas.spawn(1, name="turtle7")] == ["turtle2", "turtle7"]
    canvas.start_over(2)
    state, *sent = *frame(canvas, 3), *(frame(canvas, now)[1] for now in (4, 5, 6))
    assert (state.sheet, state.turtles) == (1, ())
    assert [(one.number, one.is_present) for one in sent] == [
        (2, True),
        (7, True),
        (2, False),
        (7, False),
    ]
    assert canvas.spawn(3) == "turtle2"  # as turtlesim counts after its reset


def test_turtles_are_spawned_moved_and_killed(canvas):
    canvas.spawn(1, 2.0, 3.0, 0.5)
    canvas.spawn(1)
    assert frame(canvas, 1)[0].turtles == (2, 2.0, 3.0, 0.5, 3, 0.0, 0.0, 0.0)
    canvas.teleport(2, "turtle3", 9.0, 8.0, 1.0)
    canvas.kill(2, "turtle2")
    assert frame(canvas, 2)[0].turtles == (3, 9.0, 8.0, 1.0)
    canvas.spawn(3, 1.0)  # numbers are not reused
    assert frame(canvas, 3)[0].turtles[4] == 4


def test_a_name_can_be_given_unless_there_is_one(canvas):
    canvas.spawn(1, 2.0, name="turtle3")
    assert [canvas.spawn(1), canvas.spawn(1)] == ["turtle2", "turtle4"]
    assert canvas.spawn(1, name="ada") == "ada"
    state, _ = frame(canvas, 1)
    assert (state.turtles[::4], state.names[2:]) == ((3, 2, 4, 5), ("turtle4", "ada"))
    for name, words in [
        ("ada", "a turtle called ada already"),
        ("turtle3", "a turtle called turtle3 already"),
        ("turtle1", "a turtle called turtle1 already"),
        ("turtle5", "the block turtle5 moves ada"),
        ("a b", "is no name"),
        ("x" * 33, "is no name"),
    ]:
        with pytest.raises(ValueError, match=words):
            canvas.spawn(2, name=name)
    canvas.kill(2, "turtle3")
    canvas.spawn(2, 4.0, name="turtle3")
    assert frame(canvas, 3)[0].turtles[-4:-2] == (3, 4.0)


def test_a_name_of_its_own_takes_the_highest_block_so_that_turtle2_stays_free():
    canvas = TurtleCanvas(driven=4)
    assert [canvas.spawn(1, name=name) for name in ("ada", "", "bob", "", "eve")] == [
        "ada",
        "turtle2",
        "bob",
        "turtle5",
        "eve",
    ]
    assert frame(canvas, 1)[0].turtles[::4] == (4, 2, 3, 5, 6)


@pytest.mark.parametrize(("x", "y"), [(20.0, 5.0), (-0.1, 5.0), (5.0, 11.1)])
def test_a_place_outside_of_the_canvas_is_refused(canvas, x, y):
    with pytest.raises(ValueError, match=r"is 0 to 11.09 m on the canvas"):
        canvas.spawn(1, x, y)
    canvas.spawn(1)
    with pytest.raises(ValueError, match=r"is 0 to 11.09 m on the canvas"):
        canvas.teleport(1, "turtle2", x, y)
    assert frame(canvas, 2)[0].turtles == (2, 0.0, 0.0, 0.0)


def test_each_turtle_has_its_pen(canvas):
    canvas.pen_red = 0  # of turtle 1 alone
    canvas.spawn(1)
    canvas.spawn(1)
    canvas.set_pen(2, "turtle3", red=255, green=0, blue=16, width=0.2, pen="up")
    assert frame(canvas, 3)[0].pens == (("#b3b8ff", 0.07, True), ("#ff0010", 0.2, False))
    for wrong in ({"red": 256}, {"width": 0.0}, {"pen": "left"}):
        with pytest.raises(ValueError, match=r"pen|red"):
            canvas.set_pen(4, "turtle3", **wrong)
    with pytest.raises(ValueError, match=r"param set canvas\.pen_red"):
        canvas.set_pen(4, "turtle1", red=255)


def test_numbers_that_can_be_driven_are_used_again_when_there_is_no_other():
    canvas = TurtleCanvas(driven=4)
    for now in (1, 2, 3):
        canvas.spawn(now)
    canvas.kill(4, "turtle3")
    canvas.spawn(5)
    canvas.spawn(6)
    assert frame(canvas, 7)[0].turtles[::4] == (2, 4, 3, 5)


@pytest.mark.parametrize(("driven", "warned"), [(1, 2), (2, 1), (3, 0)])
def test_a_turtle_that_no_block_moves_is_reported(driven, warned):
    canvas, book = TurtleCanvas(driven=driven), Logbook()
    canvas.log = book.source_log("canvas")
    canvas.spawn(1)
    canvas.spawn(1)
    lines = book.take_lines(1)
    assert len(lines) == warned
    assert all("stands still" in line.text and line.level == "warning" for line in lines)


def test_the_pipeline_turtles_drives_as_many_as_its_canvas_states():
    blocks = {use.name: use.values for use in load("turtles").blocks}
    numbers = [values["number"] for name, values in blocks.items() if name.startswith("turtle")]
    assert sorted(numbers) == list(range(2, blocks["canvas"]["driven"] + 1))


def test_every_placement_is_sent_one_an_instant(canvas):
    canvas.spawn(1, 2.0, 3.0, 0.5)
    canvas.teleport(1, "turtle2", 9.0, 8.0, 1.0)
    canvas.kill(1, "turtle2")
    sent = [frame(canvas, time)[1] for time in (10, 20, 30, 40)]
    assert sent == [
        TurtlePlacement(10, 2, 2.0, 3.0, 0.5, True),
        TurtlePlacement(20, 2, 9.0, 8.0, 1.0, True),
        TurtlePlacement(30, 2, 0.0, 0.0, 0.0, False),
        None,
    ]


def test_turtle_1_stands_after_it_was_killed_and_moves_when_it_is_back(canvas):
    canvas.connected = frozenset({"odometry", "twist"})
    fast = [Twist(now, 1.0, 0.5) for now in range(6)]
    assert canvas.react(1, HERE, fast[1]) == (None, fast[1], None, None)
    assert canvas.react(2, HERE, fast[1])[1] is None  # once
    canvas.kill(3, "turtle1")
    state, passed, stop, placement = canvas.react(3, HERE, fast[3])
    assert (state.has_first, passed, placement) == (False, Twist(3, 0.0, 0.0), None)
    assert (stop.code, stop.latched) == ("turtle_killed", False)
    with pytest.raises(ValueError, match="already"):
        canvas.kill(4, "turtle1")
    with pytest.raises(ValueError, match=r"robot\.teleport"):
        canvas.spawn(4, 1.0, name="turtle1")
    assert canvas.spawn(4, name="turtle1") == "turtle1"
    state, passed, stop, _ = canvas.react(4, HERE, fast[4])
    assert (state.has_first, passed, stop.code) == (True, fast[4], "")
    canvas.kill(5, "turtle1")
    canvas.start_over(5)
    assert canvas.react(5, HERE, fast[5])[1:3] == (fast[5], None)


def test_the_width_of_the_pen(canvas):
    canvas.pen_width = 0.2
    assert frame(canvas, 1)[0].pen_width == 0.2


@pytest.mark.parametrize("name", ["turtle1", "turtle7", ""])
def test_an_unknown_turtle_cannot_be_killed_or_moved(canvas, name):
    canvas.spawn(1)
    with pytest.raises(ValueError, match="turtle"):
        canvas.kill(2, name)
    with pytest.raises(ValueError, match="turtle"):
        canvas.teleport(2, name)
    assert len(frame(canvas, 3)[0].turtles) == 4


def test_the_number_of_turtles_is_limited(canvas):
    for _ in range(TURTLES_MAX):
        canvas.spawn(1)
    with pytest.raises(ValueError, match="kill some"):
        canvas.spawn(2)
