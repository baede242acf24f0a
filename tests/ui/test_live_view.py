"""The picture of `run`: its progress, and the last one, which stays on the terminal."""

import io
import os

import pytest
from rich.console import Console

from diffbotctl.messages import Duty, GoalState, LogLine, Odometry, Text, Wheels
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.render.map_scene import Scene
from diffbotctl.ui.live_view import LiveView, duration_text, progress_text
from diffbotctl.ui.run_text import commanded_wheels, log_lines, pose_text, wheel_speeds_text
from tests.support.running import command
from tests.support.terminal import Terminal

MESSAGES = {
    "odometry.odometry": Odometry(0, 0.5, 0.2, 0.0, 0.1, 0.0, (0.0,) * 6),
    "follower.state": GoalState(0, 1, "reached", 0.002, 0.0),
}


@pytest.mark.parametrize(
    ("messages", "text"),
    [
        ({"straight.wheels": Wheels(9, 5.0, 5.0)}, "commanded +5.00 +5.00 rad/s"),
        # After a stop the blocks before the gate go on.
        (
            {"straight.wheels": Wheels(9, 5.0, 5.0), "gate.wheels": Wheels(9, 0.0, 0.0)},
            "commanded +0.00 +0.00 rad/s",
        ),
        ({"gate.wheels": Duty(9, 0.4, -0.25)}, "commanded +40 -25 %"),
    ],
)
def test_the_wheels_are_what_the_gate_commands(messages, text):
    wheels = commanded_wheels(RunSnapshot(9, messages, 0, 0))
    assert wheel_speeds_text(wheels, None) == text


def test_a_number_that_rounds_to_zero_has_no_minus():
    pose = Odometry(0, -0.0001, -0.0, -0.0001, -0.0001, -0.001, (0.0,) * 6)
    assert pose_text(pose) == "x 0.000 m  y 0.000 m  heading 0.0 deg"
    assert wheel_speeds_text(Wheels(0, -0.001, 0.0), pose) == (
        "commanded +0.00 +0.00 rad/s  body +0.000 m/s +0.00 rad/s"
    )


@pytest.mark.parametrize(
    ("time", "elapsed", "duration", "text"),
    [
        (30.0, 30.0, None, None),  # paced, and its end is not known
        (300.0, 10.0, None, "30 times real time"),
        (15.0, 15.0, 60.0, "25 % of 60 s, 45 s left"),
        (150.0, 5.0, 1000.0, "15 % of 1000 s, 28 s left, 30 times real time"),
        (0.2, 0.5, 1000.0, "0 % of 1000 s"),  # too early for an estimate
        (60.0, 60.0, 60.0, None),
        (0.0, 9.0, 60.0, "0 % of 60 s"),
    ],
)
def test_progress(time, elapsed, duration, text):
    assert progress_text(time, elapsed, duration) == text


def test_the_lines_of_a_log_are_in_the_order_of_time():
    messages = {"talker.text": Text(100_000_000, "hello")}
    ended = LogLine(150_000_000, "info", "engine", "ended")
    assert list(log_lines(iter([RunSnapshot(150_000_000, messages, 0, 0, (ended,))]))) == [
        "    0.10 s  talker.text: hello",
        "    0.15 s  engine: ended",
    ]


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (59.4, "59 s"), (200.0, "3 min 20 s"), (7500.0, "2 h 5 min")],
)
def test_durations(seconds, text):
    assert duration_text(seconds) == text


def test_brackets_in_what_programs_send_are_text_and_those_of_the_title_style():
    view = LiveView(Scene("goal [x]", "SIMULATED"))
    console = Console(file=io.StringIO(), width=80, color_system=None)
    snapshot = RunSnapshot(9, {"nose.report": Text(9, "a [/] [red]b")}, 0, 1, (), "", False)
    for markup in (True, False):  # a line of the log above is printed without
        console.print(view.render(snapshot, 80, 24), markup=markup)
    shown = console.file.getvalue()
    assert shown.count("a [/] [red]b") == shown.count("goal [x]   SIMULATED") == 2


@pytest.mark.parametrize(("width", "height"), [(60, 20), (80, 24), (120, 40)])
@pytest.mark.parametrize(
    ("messages", "rows_below"), [(MESSAGES, 13), ({}, 22)], ids=["pose", "no pose"]
)
def test_the_last_picture_has_the_cause_and_leaves_room_for_the_summary(
    width, height, messages, rows_below
):
    view = LiveView(Scene("goal", "SIMULATED"))
    console = Console(file=io.StringIO(), width=width, color_system=None)
    ending = "obstacle: [something] stands 5 cm ahead"
    console.print(view.render(RunSnapshot(9, messages, 0, 1, (), ending, True), width, height))
    lines = console.file.getvalue().rstrip("\n").split("\n")
    shown = ending if width > 60 else "obstacle: [something] stands 5 cm…"
    assert shown in lines[0] and "goal" in lines[0]
    assert len(lines) <= max(height - rows_below, 8) and max(map(len, lines)) <= width


@pytest.mark.parametrize(("columns", "lines"), [(60, 20), (80, 24)])
def test_the_picture_of_a_run_stays_above_its_summary(tmp_path, columns, lines):
    line, environment = command(tmp_path, "run", "goal", "--fast", "--goal", "0.5 0")
    with Terminal(line, environment, columns, lines) as terminal:
        assert terminal.ended() == 0
        title, *_ = (row for row in terminal.screen.display if row.startswith("╭"))
        assert "all goals reached" in title
        assert "├" in terminal.text and "goals 1 of 1 reached" in terminal.text
        assert terminal.text.index(title) < terminal.text.index("goals 1 of 1 reached")


def test_an_unpaced_run_shows_its_progress_also_with_one_processor(tmp_path):
    line, environment = command(tmp_path, "run", "wander", "--fast", "--for", "100000s")
    one = str(min(os.sched_getaffinity(0)))
    with Terminal(["taskset", "--cpu-list", one, *line], environment) as terminal:
        terminal.until(lambda text: "times real time" in text, "the progress")
        assert " % of 100000 s" in terminal.text
