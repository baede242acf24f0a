"""The dashboard in a real terminal, on a real engine with a simulated robot."""

import os
import re
import signal
import subprocess
import termios

import pytest

from diffbotctl.ui.saved_view import read_view
from tests.sampling import by_day
from tests.support.running import PlainClient, command, moves, running
from tests.support.terminal import Terminal

SIZES = [(60, 20), (80, 24), (120, 40), (200, 60)]


@pytest.fixture
def engine(tmp_path):
    """A run whose robot waits for a command."""
    with running(tmp_path, "goal", "--stay", "--goal", "0.3 0") as process:
        client = PlainClient(tmp_path)
        client.until(lambda status: state(client) == "reached")
        yield client, process


def state(client):
    """The state of the goal."""
    return client.request("snapshot")["messages"].get("follower.state", {}).get("state")


def reached(client):
    """The number of the goal that was reached last."""
    state = client.request("snapshot")["messages"].get("follower.state", {})
    return state["number"] if state.get("state") == "reached" else None


def dash(folder, *words, columns=80, lines=24, **more):
    # pyte draws no more than a few full screens a second on a busy machine.
    line, environment = command(folder, "dash", "--hz", "2", *words)
    terminal = Terminal(line, environment, columns, lines, **more)
    terminal.until(lambda text: "pose" in text and "SIMULATED" in text, "the first picture")
    return terminal


def moment(text):
    """The run's time in the title, in s."""
    return float(re.search(r"goal +([\d.]+) s", text)[1])


def scale(text):
    """The length of the scale bar, in m."""
    found = re.search(r"┤ ([\d.]+) m", text)
    return float(found[1]) if found else None


def bar(text):
    """The scale bar with its length."""
    found = re.search(r"├─+┤ [\d.]+ m", text)
    return found[0] if found else None


def write(terminal, name):
    """Replace the name of a file in the prompt; the end of a long one is seen."""
    terminal.type("\x15")  # ctrl-u empties it
    terminal.until(lambda screen: "view.yaml" not in screen, "the empty prompt")
    terminal.type(name)
    terminal.until(lambda screen: name[-10:] in screen, "what was typed")
    terminal.type("\r")


def answer(terminal, text):
    """Replace the content of the prompt with `text`."""
    terminal.type("\x15")  # ctrl-u empties it
    terminal.until(lambda screen: "(m) = " in screen and "0.0" not in screen.split("(m) =")[1])
    terminal.type(text)
    terminal.until(lambda screen: text in screen, "what was typed")
    terminal.type("\r")


def level_of(client, block):
    """The log level of a block."""
    return {row["block"]: row["level"] for row in client.request("list_blocks")["blocks"]}[block]


def robot_at(terminal, arrows="→↗↑↖←↙↓↘"):
    """Column and row of the robot's arrow on the screen."""
    terminal.until(lambda text: any(sign in text for sign in arrows), "the robot")
    for row, line in enumerate(terminal.screen.display):
        for column, sign in enumerate(line):
            if sign in arrows:
                return column, row
    raise AssertionError("unreachable: it was just seen")


@pytest.mark.parametrize(("columns", "lines"), by_day(1, SIZES))
def test_a_click_sets_a_goal_and_the_robot_arrives(engine, tmp_path, columns, lines):
    client, _ = engine
    with dash(tmp_path, columns=columns, lines=lines) as terminal:
        column, row = robot_at(terminal)
        before = client.request("status")["operator.goal"]["number"]
        terminal.click(column - 6, row - 4)
        status = client.until(lambda status: status["operator.goal"]["number"] > before)
        goal = status["operator.goal"]
        terminal.until(lambda text: "driving" in text or "turning" in text, "the way there")
        assert goal["x"] < 0.3 and goal["y"] > 0.0 and goal["heading"] is None
        client.until(lambda status: reached(client) == goal["number"])
        terminal.until(lambda text: "reached" in text, "the arrival")
        pose = client.request("describe_topic", topic="odometry")["last"]
        assert abs(pose["x"] - goal["x"]) < 0.02 and abs(pose["y"] - goal["y"]) < 0.02


@pytest.mark.nightly
def test_attached_late_it_shows_the_way_and_the_numbers_before(engine, tmp_path):
    """The robot drove 0.3 m, and stands since before this screen."""
    with dash(tmp_path) as terminal:
        column, row = robot_at(terminal)
        behind = terminal.screen.display[row][: column - 6]  # beyond the outline
        assert sum("\u2800" < sign < "\u28ff" for sign in behind) > 5, terminal.text
        terminal.type("2")
        seen = terminal.until(lambda text: "gate.wheels.left 0 rad/s" in text, "the plots")
        terminal.until(lambda text: re.search(r"^ +[2-9](\.0)? │", text, re.M), "the speeds before")
        assert re.search(r"^ +(\d+ +)+\d+ s *$", seen, re.M), "the time axis"


@pytest.mark.nightly
def test_a_drag_sets_the_heading_and_the_wheel_zooms(engine, tmp_path):
    client, _ = engine
    with dash(tmp_path) as terminal:
        column, row = robot_at(terminal)
        bar = scale(terminal.text)
        terminal.type(f"\x1b[<64;{column + 1};{row + 1}M" * 4)  # four steps of the wheel
        terminal.until(lambda text: scale(text) not in (None, bar), "another scale")
        column, row = robot_at(terminal)
        terminal.click(column, row, to=(column, row - 5))  # upwards: y, 90 degrees
        goal = client.until(lambda status: status["operator.goal"]["heading"])["operator.goal"]
        assert goal["heading"] == pytest.approx(1.5708, abs=0.2)


def words(text):
    """The words on a screen, without the ends of its lines."""
    return " ".join(text.split())


def test_keys_drive_stop_resume_and_choose(engine, tmp_path):
    client, _ = engine
    with dash(tmp_path) as terminal:
        terminal.type("g")
        terminal.until(lambda text: "goal: X Y" in text, "the question")
        began = moment(terminal.text)
        terminal.until(lambda text: moment(text) > began + 1.0, "what goes on meanwhile")
        terminal.type("5 0\r")
        client.until(lambda status: moves(status) and status["operator.goal"]["x"] == 5.0)
        terminal.type(" ")
        terminal.until(lambda text: "STOPPED" in text and "space was pressed" in words(text))
        terminal.type("r")
        client.until(moves)
        terminal.type("\x1b[B")  # arrow down: backwards, and the goal is withdrawn
        client.until(lambda status: status["operator.goal"]["number"] == 0 and moves(status))
        terminal.until(lambda text: "DRIVING" in text, "driving")
        terminal.until(lambda text: "DRIVING" not in text, "the end of the press")
        assert client.request("status")["held"] is None  # let go in good order
        for key, sign in (
            ("2", "━ "),
            ("3", "guard.margin"),
            ("4", "follower"),
            ("5", "robot: link up"),
        ):
            terminal.type(key)
            terminal.until(lambda text, sign=sign: sign in text, f"the view of {key}")
        terminal.type("t")
        terminal.type("?")
        terminal.until(lambda text: "w x  a d  drive" in text, "the other letters")
        terminal.type("\x1b")
        terminal.until(lambda text: "├" in text, "the map again")


def test_a_parameter_is_changed_and_a_wrong_value_refused(engine, tmp_path):
    client, _ = engine
    with dash(tmp_path) as terminal:
        terminal.type("3")
        terminal.until(lambda text: "guard.margin" in text, "the parameters")
        terminal.type("\r")
        terminal.until(lambda text: "guard.margin (m) =" in text, "the question")
        answer(terminal, "8 cm")
        terminal.until(lambda text: "0.08" in text, "the new value")
        values = {
            row["parameter"]: row["value"]
            for row in client.request("list_parameters")["parameters"]
        }
        assert values["guard.margin"] == 0.08
        terminal.type("\r")
        terminal.until(lambda text: "guard.margin (m) =" in text, "the question again")
        answer(terminal, "-1")
        terminal.until(lambda text: "must be" in text, "the refusal")


@pytest.mark.nightly
def test_a_view_is_saved_and_opened_again(engine, tmp_path):
    path, other = tmp_path / "mine.yaml", tmp_path / "notes.txt"
    other.write_text("nothing of ours")
    with dash(tmp_path, "--plot", "odometry.odometry.x") as terminal:
        terminal.until(bar, "the map")
        before = bar(terminal.text)
        terminal.type("[")
        terminal.until(lambda text: bar(text) not in (None, before), "another scale")
        zoomed = bar(terminal.text)
        terminal.type("2<")
        terminal.until(lambda text: "odometry.odometry.x 0.3" in text, "the plots")
        for file, seen in ((other, "is no view"), (path, "saved:")):
            terminal.type("v")
            terminal.until(lambda text: "save this view as:" in text, "the question")
            write(terminal, str(file))
            terminal.until(
                lambda text, seen=seen: seen in text and "save this view as:" not in text,
                "what was done",
            )
    assert other.read_text() == "nothing of ours"
    view = read_view(str(path))
    assert (view.panel, view.fields, view.span) == ("plots", ("odometry.odometry.x",), 15.0)
    assert view.place is not None and not view.follows
    line, environment = command(tmp_path, "dash", "--hz", "2", "--view", str(path))
    with Terminal(line, environment) as terminal:
        terminal.until(lambda text: "odometry.odometry.x 0.3" in text, "the plots again")
        terminal.type("1")
        terminal.until(lambda text: bar(text) == zoomed, "the same zoom")


def test_a_run_begins_with_a_saved_view(tmp_path):
    (tmp_path / "mine.yaml").write_text(
        "format: 1\nkind: view\npanel: plots\n"
        "plots: {fields: [odometry.odometry.heading], span: 15 s}\n"
    )
    words = ("run", "standby", "--view", str(tmp_path / "mine.yaml"))
    line, environment = command(tmp_path, *words)
    with Terminal(line, environment) as terminal:
        terminal.until(lambda text: "odometry.odometry.heading 0" in text, "the plot of the view")
        terminal.type("\x03")
        assert terminal.ended() == 130


@pytest.mark.nightly
def test_the_log_level_of_a_block_is_set(engine, tmp_path):
    client, _ = engine
    with dash(tmp_path) as terminal:
        terminal.type("5")
        terminal.until(lambda text: "robot: link up" in text, "the log")
        for typed, seen in (
            ("guard loud", "no level 'loud'"),
            ("gard debug", "did you mean guard"),
            ("debug", "give a block"),
        ):
            terminal.type("\r")
            terminal.until(lambda text: "log: BLOCK LEVEL" in text, "the question")
            terminal.type(f"{typed}\r")
            terminal.until(lambda text, seen=seen: seen in text, "the refusal")
        terminal.type("\r")
        terminal.until(lambda text: "log: BLOCK LEVEL" in text, "the question again")
        terminal.type("guard debug\r")
        client.until(lambda status: level_of(client, "guard") == "debug")


@pytest.mark.nightly
def test_it_follows_the_windows_size(engine, tmp_path):
    with dash(tmp_path) as terminal:
        terminal.resize(112, 36)
        terminal.until(lambda text: "follower" in text and "kinematics" in text, "the blocks below")
        terminal.resize(80, 24)
        terminal.until(lambda text: "follower" not in text, "the small layout")


def test_without_colour_or_utf_8_it_is_still_usable(engine, tmp_path):
    with dash(tmp_path, NO_COLOR="1") as terminal:
        cells = [cell for line in terminal.screen.buffer.values() for cell in line.values()]
        colours = {cell.fg for cell in cells} | {cell.bg for cell in cells}
        assert all(c == "default" or len({c[0:2], c[2:4], c[4:6]}) == 1 for c in colours), colours
    for words, more in ((["--ascii"], {}), ([], {"PYTHONIOENCODING": "ascii"})):
        with dash(tmp_path, *words, **more) as terminal:
            terminal.until(lambda text: "|--" in text, "the scale in letters")
            assert terminal.text.replace("°", "").isascii(), terminal.text
            robot_at(terminal, ">/^\\<v")


@pytest.mark.parametrize("exit_path", by_day(1, ["ctrl-c", "SIGTERM", "engine killed"]))
def test_every_exit_path_restores_the_terminal(engine, tmp_path, exit_path):
    _, process = engine
    with dash(tmp_path) as terminal:
        before = termios.tcgetattr(terminal.slave)
        assert not before[3] & termios.ICANON
        if exit_path == "ctrl-c":
            terminal.type("\x03")
        elif exit_path == "SIGTERM":
            terminal.process.send_signal(signal.SIGTERM)
        else:
            process.kill()
        code = terminal.ended()
        assert code == {"ctrl-c": 0, "SIGTERM": 128 + 15, "engine killed": 0}[exit_path]
        after = termios.tcgetattr(terminal.slave)
        assert after[3] & termios.ICANON and after[3] & termios.ECHO and after[3] & termios.ISIG
        on = {mode >> 5 for mode in terminal.screen.modes}
        assert not on & {1000, 1003, 1004, 1006, 1049}, on


@pytest.mark.nightly
def test_a_dashboard_that_never_drove_may_be_killed(engine, tmp_path):
    client, _ = engine
    with dash(tmp_path) as terminal:
        client.request("goto", x=-30.0, y=0.0)
        client.until(lambda status: state(client) == "driving" and moves(status))
        began = client.request("status")["time"]
        terminal.process.kill()
        later = client.until(lambda status: status["time"] > began + 1_000_000_000)
        assert later["held"] is None and moves(later)


def test_once_and_a_pipe_print_the_panels(engine, tmp_path):

    line, environment = command(tmp_path, "dash")
    done = subprocess.run(line, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and "\x1b" not in done.stdout
    for word in ("SIMULATED", "map", "pose", "blocks", "guard.margin", "goal 1 reached"):
        assert word in done.stdout


# Pipeline, environment, what the screen shows, then what it has and what it does not offer.
OFFERS = [
    ("hello", [], "listener", ["p plot"], ["g goal", "m/s", "resume", "latch", "zoom", "stop"]),
    ("teleop", [], "pose", ["m/s", "r resume", "b latch"], ["g goal"]),
    ("goal", ["TMUX=inside"], "pose", ["g goal", "m/s"], ["b latch"]),
]


@pytest.mark.parametrize(("pipeline", "variables", "first", "offered", "hidden"), OFFERS)
def test_only_keys_that_work_are_offered(tmp_path, pipeline, variables, first, offered, hidden):
    line, environment = command(tmp_path, "run", pipeline, "--dash")
    with Terminal(["env", *variables, *line], environment, 120, 24) as terminal:
        text = terminal.until(lambda text: first in text and "? help" in text, "the first picture")
        assert all(word in text for word in offered), text
        assert not any(word in text for word in hidden), text
        if pipeline != "goal":
            terminal.type("g")
            terminal.until(lambda text: "no block of this pipeline follows goals" in text)


@pytest.mark.nightly
def test_run_with_its_own_dashboard_ends_with_it(tmp_path):
    line, environment = command(tmp_path, "run", "teleop", "--dash")
    with Terminal(line, environment) as terminal:
        terminal.until(lambda text: "pose" in text, "the first picture")
        before = PlainClient(tmp_path, "teleop").request("describe_topic", topic="odometry")[
            "last"
        ]["x"]
        terminal.type("i")
        terminal.until(lambda text: "DRIVING" in text, "driving")
        terminal.until(lambda text: "DRIVING" not in text, "standing")
        assert (
            PlainClient(tmp_path, "teleop").request("describe_topic", topic="odometry")["last"]["x"]
            > before
        )
        terminal.type("\x03")
        assert terminal.ended() == 130
        assert "interrupted" in terminal.text


def test_a_run_whose_own_dashboard_is_killed_continues_and_restores_the_terminal(tmp_path):
    line, environment = command(tmp_path, "run", "goal", "--dash", "--goal", "30 0")
    with Terminal(line, environment) as terminal:
        terminal.until(lambda text: "driving" in text, "the way")
        children = os.popen(f"ps --ppid {terminal.process.pid} -o pid=,args=").read()
        client = PlainClient(tmp_path, "goal")
        client.until(moves)
        os.kill(child_with_terminal(terminal.process.pid), signal.SIGKILL)
        terminal.until(lambda text: "the run goes on" in text, f"the word of {children}")
        assert termios.tcgetattr(terminal.slave)[3] & termios.ISIG
        client.until(moves)
        terminal.type("\x03")  # the kernel makes SIGINT of it again
        assert terminal.ended() == 130


def child_with_terminal(parent):
    """The child that dash runs in: the one with threads of its own (textual reads and writes)."""
    for name in os.listdir("/proc"):
        if name.isdigit():
            try:
                with open(f"/proc/{name}/stat") as file:
                    fields = file.read().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[1]) == parent and int(fields[17]) > 1:
                return int(name)
    raise AssertionError("no dashboard")


def test_a_replay_is_watched_and_cannot_be_commanded(tmp_path):
    path = tmp_path / "drive.mcap"
    line, environment = command(
        tmp_path,
        "run",
        "goal",
        "--fast",
        "--quiet",
        "--record",
        str(path),
        "--goal",
        "2 0",
        "--set",
        "world.walls=[]",
    )
    subprocess.run(line, env=environment, check=True, capture_output=True, timeout=60)
    line, environment = command(tmp_path, "replay", str(path), "--dash", "--from", "3s")
    with Terminal(line, environment) as terminal:
        terminal.until(lambda text: "REPLAY" in text and "driving" in text, "the replay")
        terminal.type(" ")
        terminal.until(lambda text: "this is a replay" in text, "the refusal")
        terminal.type("4")
        terminal.until(lambda text: "kinematics" in text, "the blocks")
        terminal.type("\x03")
        assert terminal.ended() == 130
