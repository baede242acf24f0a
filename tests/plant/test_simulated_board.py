"""Boards: when a command takes hold, the dead-man's stop, counts and their frames."""

from random import Random

import pytest

from diffbotctl.control.speed_loop import SpeedGains
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.messages import Duty, Wheels
from diffbotctl.plant.simulated_board import BOARD_MODELS, SimulatedBoard
from diffbotctl.time import MILLISECOND as MS

# Half duty for 5 rad/s by the feed-forward alone.
GAINS = SpeedGains(static=0.1, slope=0.08, proportional=0.0, integral=0.0)
HELD = 14_900_000  # ns; 10.4 ms on the wire and 4.5 ms by radio


def board(kind="edges", glitch=2 * MS, deadman=300 * MS, seed=1):
    return SimulatedBoard(
        BOARD_MODELS[kind], (GAINS, GAINS), (20, 20), 0.1, glitch, deadman, Random(seed)
    )


def serve_until(made, until):
    """Serve the board until `until`; returns [(time, (left, right duty))] of the changes."""
    changes, before = [], None
    while made.due <= until:
        now = made.due
        made.serve(now)
        duties = tuple(side.duty for side in made.sides)
        if duties != before:
            changes.append((now, duties))
            before = duties
    return changes


def test_a_command_takes_hold_after_its_delay():
    made = board()
    made.command(0, Wheels(0, 5.0, -5.0))
    serve_until(made, HELD - 1)
    assert [side.duty for side in made.sides] == [0.0, 0.0]
    serve_until(made, HELD)
    assert [side.duty for side in made.sides] == pytest.approx([0.5, -0.5])
    assert [side.direction for side in made.sides] == [1, -1]


@pytest.mark.parametrize("speed, duty", [(1e-16, 0.0), (0.0019, 0.0), (0.002, 0.1 + 0.08 / 256)])
def test_speeds_are_rounded_as_in_a_frame(speed, duty):
    made = board()
    made.command(0, Wheels(0, speed, -speed))
    serve_until(made, HELD)
    assert [side.duty for side in made.sides] == pytest.approx([duty, -duty])


def test_the_dead_man_stops_it_300_ms_after_the_last_command():
    made = board()
    made.command(0, Wheels(0, 5.0, 5.0))
    made.command(100 * MS, Wheels(100 * MS, 5.0, 5.0))  # the same: it only keeps alive
    stops = HELD + 400 * MS
    serve_until(made, stops - 1)
    assert min(side.duty for side in made.sides) >= 0.5
    serve_until(made, stops)
    assert [side.duty for side in made.sides] == [0.0, 0.0]
    assert made.sample(stops)[5:7] == (0.0, 0.0)  # the frame states it


def test_after_a_dead_mans_stop_a_command_counts_again():
    made = board()
    made.command(0, Wheels(0, 5.0, 5.0))
    serve_until(made, 1000 * MS)
    made.command(1000 * MS, Wheels(1000 * MS, 5.0, 5.0))
    serve_until(made, 1000 * MS + HELD)
    assert made.sides[0].duty == pytest.approx(0.5)


def test_the_published_firmware_has_no_dead_man():
    made = board("stock")
    made.command(0, Duty(0, 0.5, 0.5))
    serve_until(made, 60_000 * MS)
    assert [side.duty for side in made.sides] == [0.5, 0.5]


def test_stock_commands_are_delayed_differently_per_wheel():
    # 100 ms, and each wheel by up to 25 ms off that.
    made, apart = board("stock"), []
    for k in range(200):
        now = k * 200 * MS
        made.command(now, Duty(now, 0.5 + k / 1000, 0.5 + k / 1000))
        times = [time - now for time, _ in serve_until(made, now + 150 * MS)]
        assert all(75 * MS <= time <= 125 * MS for time in times)
        assert made.sides[0].duty == made.sides[1].duty == 0.5 + k / 1000
        apart.append(times[-1] - times[0])
    # The distance of two uniform times within 50 ms: a third of it in the mean.
    assert sum(apart) / len(apart) == pytest.approx(50 * MS / 3, rel=0.25)


def test_a_board_without_a_speed_loop_refuses_speeds():
    with pytest.raises(TypeError, match="Wheels"):
        board("stock").command(0, Wheels(0, 1, 1))


def test_raw_duty_holds_until_the_dead_man_stop_and_is_reported():
    made = board()
    made.command(0, Duty(0, 0.5, -0.25))
    changes = serve_until(made, 500 * MS)
    assert changes[1] == (HELD, (0.5, -0.25)) and changes[-1] == (HELD + 300 * MS, (0.0, 0.0))
    assert made.sample(500 * MS).command_kind == "duty"


@pytest.mark.parametrize("blocked", [0, 1])
def test_raw_duty_without_edges_is_a_stall(blocked):
    made = board(deadman=2000 * MS)
    made.command(0, Duty(0, 0.4, 0.4))
    turning = made.sides[1 - blocked]
    for k in range(1, 60):
        made.edge(turning, k * 20 * MS)
        serve_until(made, k * 20 * MS)
    # no edge for 0.95 s at a duty that gives 3.75 rad/s: a pitch takes 84 ms
    assert made.fault_flags == (frames.FLAG_LEFT_STALL, frames.FLAG_RIGHT_STALL)[blocked]
    assert [side.duty for side in made.sides] == [0.0, 0.0]
    made.command(1300 * MS, Duty(1300 * MS, 0.4, 0.4))
    serve_until(made, 1400 * MS)
    assert [side.duty for side in made.sides] == [0.0, 0.0]
    made.clear_fault()
    made.command(1400 * MS, Duty(1400 * MS, 0.4, 0.4))
    serve_until(made, 1500 * MS)
    assert [side.duty for side in made.sides] == [0.4, 0.4]


def test_a_low_raw_duty_is_no_stall():
    made = board(deadman=2000 * MS)
    made.command(0, Duty(0, 0.3, 0.2))
    serve_until(made, 1900 * MS)
    assert made.fault_flags == 0
    assert [side.duty for side in made.sides] == [0.3, 0.2]


@pytest.mark.parametrize(
    "edges, count",  # times in ms of one wheel's edges
    [
        ([10, 20, 30], 3),
        ([10, 11.9, 30], 2),  # within 2 ms: bounce
        ([10, 12.0, 30], 3),
        ([10, 11.5, 13], 2),  # 3 ms after the last that counted, not after the bounce
    ],
)
def test_the_glitch_filter(edges, count):
    made = board()
    for time in edges:
        made.edge(made.sides[0], int(time * MS))
    assert (made.sides[0].count, made.sides[1].count) == (count, 0)


def test_counts_take_the_sign_of_the_command():
    made = board()
    left, right = made.sides
    made.command(0, Wheels(0, 5.0, -5.0))
    serve_until(made, HELD)
    for k in range(1, 4):
        made.edge(left, HELD + k * 10 * MS)
        made.edge(right, HELD + k * 10 * MS)
    made.command(50 * MS, Wheels(50 * MS, 0.0, 0.0))
    serve_until(made, 50 * MS + HELD)
    made.edge(right, 80 * MS)  # coasting keeps the last direction
    frame = made.sample(90 * MS)
    assert (frame.left, frame.right) == (3, -4)
    assert (frame.left_edge, frame.right_edge) == (HELD + 30 * MS, 80 * MS)


def test_only_boards_with_edge_times_report_them():
    for kind, reported in (("counts", False), ("edges", True)):
        made = board(kind)
        made.command(0, Wheels(0, 5.0, 5.0))
        serve_until(made, 20 * MS)
        made.edge(made.sides[0], 25 * MS)
        frame = made.sample(30 * MS)
        assert (frame.left_edge == 25 * MS) is reported
        assert (frame.command_time == HELD) is reported
        assert frame.left_command == 5.0


def test_a_resting_board_has_nothing_due():
    made = board()
    made.command(0, Wheels(0, 5.0, 5.0))
    serve_until(made, 1000 * MS)
    assert made.due > 10**15  # a million seconds: no tick of the loop
    made.command(1007 * MS, Wheels(1007 * MS, 5.0, 5.0))
    serve_until(made, 1007 * MS + HELD)
    assert made.due == 1030 * MS  # the timer's next turn of 10 ms after 1021.9


def test_a_pressed_button_stops_and_commands_count_again_when_it_is_released():
    made = board()
    made.command(0, Wheels(0, 5.0, 5.0))
    serve_until(made, 100 * MS)
    made.press(100 * MS, True)
    assert [side.duty for side in made.sides] == [0.0, 0.0]
    made.command(150 * MS, Wheels(150 * MS, 5.0, 5.0))
    serve_until(made, 200 * MS)
    assert [side.duty for side in made.sides] == [0.0, 0.0]
    made.press(200 * MS, False)
    made.command(200 * MS, Wheels(200 * MS, 5.0, 5.0))
    serve_until(made, 200 * MS + HELD)
    assert min(side.duty for side in made.sides) == pytest.approx(0.5)
