"""The panels of the dashboard at every size: nothing is cut that matters, values have units."""

import io
import re
from typing import get_args

import pytest
from rich.console import Console

from diffbotctl.messages import Battery, Goal, GoalState, Link, Odometry, Range, Wheels
from diffbotctl.recording.json_codec import plain
from diffbotctl.ui.dash import key_help, panels
from diffbotctl.ui.dash.facts import facts_panel
from diffbotctl.ui.dash.state import HISTORY_MAX_VALUES, RunView
from diffbotctl.ui.plot.chart import ChartCurve, render_chart
from diffbotctl.ui.text import shorten_text

SIZES = [(60, 20), (80, 24), (120, 40), (200, 60)]
BODY_ROWS = 4  # title, status, keys and help are above and below the body
NOW = 12_000_000_000
CAUSE = "the left wheel lags behind its command by more than the right one does"
MESSAGES = {
    "odometry.odometry": Odometry(NOW, -10.002, -10.3, 3.1, 0.21, -0.19, (0.0,) * 6),
    "operator.goal": Goal(NOW, 3, -11.0, -10.3, 1.57),
    "follower.state": GoalState(NOW, 3, "stuck", 12.345, -3.1, CAUSE),
    "gate.wheels": Wheels(NOW, -4.25, 9.2),
    "front.range": Range(NOW, 0.213, "measured"),
    "back.range": Range(NOW, 1.213, "too_close"),
    "left.range": Range(NOW, 0.0, "fault"),
    "right.range": Range(NOW, 3.0, "clear"),
    "robot.battery": Battery(NOW, 7.4, True),
    "robot.link": Link(NOW, "stale", 412, 3, 2),
}
OUTLINE = {
    "front": 0.08,
    "back": 0.15,
    "width": 0.14,
    "track": 0.125,
    "left_diameter": 0.065,
    "right_diameter": 0.065,
    "speed": 0.3,
    "turn_rate": 4.0,
}
LOG = [
    f"goal {number}: turning, {100 + number} mm, 97.6 deg to go, and a wheel that is slower"
    for number in range(40)
]
MEANING = "Distance between the front of the robot and the obstacle at standstill, measured there."


@pytest.fixture
def view():
    """A run with four distance sensors, a battery, a stop and a goal that failed."""
    view = RunView("test")
    scene = {"title": "goal", "simulated": "SIMULATED", "walls": [], "rounds": [], "sensors": []}
    view.take_reply("scene", {**scene, "robot": OUTLINE})
    rows = [{"topic": wire, "type": type(message).__name__} for wire, message in MESSAGES.items()]
    view.take_reply("list_topics", {"topics": rows})
    held = {"code": "wheel_fault", "cause": CAUSE, "latched": True}
    messages = {wire: plain(message) for wire, message in MESSAGES.items()}
    view.take_reply("snapshot", {"time": NOW, "held": held, "messages": messages})
    lines = [{"time": NOW, "level": "info", "source": "follower", "text": text} for text in LOG]
    view.take_reply("read_log", {"lines": lines})
    row = {"parameter": "guard.margin", "value": 0.05, "unit": "m", "help": MEANING}
    view.take_reply("list_parameters", {"parameters": [{**row, "live": True, "changed": False}]})
    error = {"time": NOW, "text": "the message of an error that is longer than a narrow column is"}
    block = {"block": "odometry", "rate": 40.0, "age": 0.01, "busy": 0.012, "overruns": 3}
    view.take_reply("list_blocks", {"blocks": [{**block, "last_error": error}]})
    return view


def rendered(content, width):
    """The lines of a panel; none may be longer than the panel."""
    console = Console(file=io.StringIO(), width=width, color_system=None, legacy_windows=False)
    console.print(content)
    lines = [line.rstrip() for line in console.file.getvalue().rstrip("\n").split("\n")]
    assert max(map(len, lines)) <= width, lines
    return lines


def words(lines):
    """The text of the lines without its folding."""
    return " ".join(" ".join(lines).split())


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_facts_have_units_and_are_complete(view, width, height):
    facts_width = 32 if width < 110 else 43
    banner = rendered(panels.stop_banner(view), width)
    assert len(banner) <= 3 and words(banner).startswith("STOPPED (r: resume) wheel_fault:")
    rows = height - BODY_ROWS - len(banner)
    lines = rendered(facts_panel(view, facts_width, rows), facts_width)
    assert len(lines) <= rows or width == 60, lines  # there four sensors and a stop are too much
    text = words(lines)
    for value in (
        "-10.002 -10.300 m +177.6°",
        "+0.210 m/s -0.19 rad/s",
        "stuck 12.345 m -178°",
        CAUSE,
        "-4.25",
        "+9.20",
        "rad/s",
        "0.213 m",
        "too close",
        "FAULT",
        "clear",
        "7.4 V",
        "wheel_fault",
    ):
        assert value in text, (value, lines)


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_help_shows_every_key(view, width, height):
    letters = "u i o  j k l  m , .  drive, k stops"
    met = set(get_args(key_help.Need))
    lines = rendered(key_help.help_panel(letters, met), width - 2)
    assert len(lines) <= height - BODY_ROWS
    for keys, effect, _ in key_help.HELP:
        assert any(keys in line and effect in line for line in lines), keys
    line = key_help.help_line(width, met)
    assert len(line) <= width and line.endswith("? help")
    assert set(line[:-6].split("  ")) <= {*(key for key, _ in key_help.KEYS), ""}


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_log_folds_between_words_and_shows_the_newest(view, width, height):
    for columns in (width - 2, max(width // 3, 36)):
        lines = rendered(panels.log_panel(view, columns, height), columns)
        assert len(lines) <= height
        text = words(lines)
        assert LOG[-1] in text and "…" not in text
        entries = re.findall(r"goal (\d+):", text)
        assert [int(entry) for entry in entries] == list(range(40 - len(entries), 40))


@pytest.mark.parametrize("width", [44, 58, 78, 118])
def test_blocks_leave_out_columns_rather_than_cut_them(view, width):
    head, row = rendered(panels.blocks_panel(view, width, 10), width)
    assert "40 Hz" in row and "odometry" in row
    assert ("0.0 s" in row) == ("age" in head) and ("1.20 %" in row) == ("busy" in head)
    assert "12.0 s: the message" in row  # an error comes before the other columns
    assert ("overruns" in head) == (width >= 58)


@pytest.mark.parametrize("width", [58, 78, 118])
def test_the_meaning_of_the_chosen_parameter_is_complete(view, width):
    lines = rendered(panels.parameters_panel(view, 0, width, 16), width)
    assert words(lines).endswith(MEANING)
    assert "0.05" in lines[1] and " m " in lines[1]
    shortened = lines[1].split(" m ")[1].strip()
    assert MEANING.startswith(shortened.removesuffix("…"))
    assert shortened.removesuffix("…").split()[-1] in MEANING.split()


@pytest.mark.parametrize(
    ("text", "width", "expected"),
    [
        ("one two", 7, "one two"),
        ("one two three", 8, "one two…"),
        ("one two three", 7, "one…"),
        ("one", 2, "…"),
        ("one", 0, ""),
    ],
)
def test_a_shortened_text_ends_between_words(text, width, expected):
    assert shorten_text(text, width) == expected


@pytest.mark.parametrize(("width", "height"), [(36, 11), (58, 16), (78, 20), (198, 50)])
@pytest.mark.parametrize("plain_letters", [False, True])
def test_a_chart_has_a_scale_for_each_unit_and_a_time_axis(width, height, plain_letters):
    curves = [
        ChartCurve("gate.wheels.left", "rad/s", [(t / 5, t / 10) for t in range(100)]),
        ChartCurve("odometry.odometry.x", "m", [(t / 5, 200.0 + t) for t in range(100)]),
        ChartCurve("gate.wheels.right", "rad/s", [(t / 5, -t / 10) for t in range(100)]),
    ]
    text = render_chart(curves, 30.0, width, height, plain_letters).plain
    lines = text.split("\n")
    assert len(lines) <= height and max(map(len, lines)) <= width
    assert re.fullmatch(r" +(\d+ +)+\d+ s", lines[-1]), lines[-1]  # times, with the unit
    for part in ("gate.wheels.left 9.9 rad/s", "gate.wheels.right -9.9 rad/s", "x 299 m"):
        assert part in text
    scales = [float(line.split()[0]) for line in lines if re.match(r" *-?[\d.]+ [│|]", line)]
    assert any(scale >= 200 for scale in scales) and any(abs(scale) < 10 for scale in scales)


def test_a_chart_without_data_states_it():
    assert "no data" in render_chart([ChartCurve("a.b.c", "", [])], 30.0, 40, 8).plain


def test_the_past_comes_before_what_was_seen(view):
    name = "gate.wheels.left"
    assert list(view.numbers[name]) == [(12.0, -4.25)]
    reply = {"times": [11.0, 11.5, 12.0], "fields": {"left": [1.0, 2.0, -4.25]}, "trail": []}
    view.take_history("gate.wheels", reply)
    assert list(view.numbers[name]) == [(11.0, 1.0), (11.5, 2.0), (12.0, -4.25)]
    many = [0.001 * step for step in range(2 * HISTORY_MAX_VALUES)]
    view.take_history("gate.wheels", {"times": many, "fields": {"left": many}, "trail": []})
    assert len(view.numbers[name]) == HISTORY_MAX_VALUES
    assert view.numbers[name][-1] == (12.0, -4.25)
    view.take_trail({"trail": [[-9.7, -10.3], [-9.9, -10.3]]})
    assert list(view.trail.points) == [(-9.7, -10.3), (-9.9, -10.3), (-10.002, -10.3)]


def test_units_come_from_the_declarations(view):
    assert view.unit("gate.wheels.left") == "rad/s" and view.unit("odometry.odometry.x") == "m"
    assert view.unit("operator.goal.number") == "" and view.unit("no.such.field") == ""
