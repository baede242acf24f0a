"""Options that contradict each other, or need another one, are refused with both names."""

import os

import pytest

from tests.support.running import cli

# command; the options that exclude each other; the words between
EXCLUSIVE = [
    ("run goal", "--dash", "--web", ""),
    ("run goal", "--json", "--dash", ""),
    ("run goal", "--json", "--web", ""),
    ("run goal", "--json", "--view", "v.yaml"),
    ("run goal", "--quiet", "--dash", ""),
    ("run goal", "--quiet", "--web", ""),
    ("run goal", "--quiet", "--view", "v.yaml"),
    ("run goal", "--no-socket", "--dash", ""),
    ("run goal", "--no-socket", "--web", ""),
    ("run goal", "--no-socket", "--view", "v.yaml"),
    ("run goal", "--no-socket", "--name", "x"),
    ("run goal", "--no-socket", "--group", "users"),
    ("run goal", "--fast", "--dash", ""),
    ("run goal", "--fast", "--web", ""),
    ("run goal", "--fast", "--view", "v.yaml"),
    ("run goal", "--fast", "--group", "users"),
    ("run goal", "--fast", "--port", "TERMINAL"),
    ("run goal --seed 0", "--seed", "--port", "TERMINAL"),
    ("replay a.mcap", "--check", "--set", "a.b=1"),
    ("replay a.mcap", "--check", "--from", "0s"),
    ("replay a.mcap", "--check", "--until", "1s"),
    ("replay a.mcap", "--json", "--dash", ""),
    ("replay a.mcap", "--json", "--rate", "2"),
    ("drive --speed 0.1 --for 2s", "--for", "--distance", "1m"),
    ("drive --turn 1 --for 2s", "--for", "--angle", "90deg"),
    ("drive --speed 0.1 --turn 1 --distance 1m", "--distance", "--angle", "90deg"),
    ("dash", "--once", "--keys", "twist"),
    ("dash", "--once", "--mode", "hold"),
    ("dash", "--once", "--hz", "5"),
    ("dash", "--once", "--speed", "0.1"),
    ("dash", "--once", "--turn", "1"),
    ("topic hz /odom", "--once", "--for", "2s"),
    ("log", "--once", "--for", "2s"),
    ("graph goal", "PIPELINE", "--running", ""),
    ("graph goal", "PIPELINE", "--engine", "x"),
    ("graph goal", "PIPELINE", "--at", "pi@robot"),
    ("graph", "--running", "--robot", "book_2wd"),
    ("graph", "--running", "--set", "a.b=1"),
    ("graph", "--running", "--mermaid", ""),
    ("graph", "--running", "--output", "a.svg"),
    ("graph goal", "--json", "--mermaid", ""),
    ("graph goal", "--json", "--output", "a.svg"),
    ("graph goal", "--mermaid", "--output", "a.svg"),
    ("ros2 --socket x.socket", "--socket", "--engine", "x"),
    ("ros2", "--check", "--drive", ""),
    ("ros2", "--check", "--namespace", "x"),
    ("ros2", "--check", "--frame-prefix", "x"),
    ("ros2", "--check", "--peer", "x"),
    ("bag export a.mcap odometry", "FIELD", "--attachment", "robot.urdf"),
    ("bag export a.mcap", "--format=csv", "--attachment", "robot.urdf"),
    ("bag export a.mcap", "--robot=turtle", "--attachment", "robot.urdf"),
    ("bag plot x a.mcap", "--ascii", "--output", "a.svg"),
    ("ports", "--ask", "--json", ""),
    ("ports", "--ask", "--root", "/"),
    ("doctor", "--fix", "--bundle", "a.zip"),
    ("doctor", "--fix", "--json", ""),
    ("doctor", "--json", "--bundle", "a.zip"),
    ("start", "--status", "--again", ""),
    ("start", "--status", "--answers", "a.yaml"),
    ("emulate", "--blank", "--hex", "a.hex"),
    ("wiring book_2wd", "--json", "--table", ""),
    ("wiring book_2wd", "--json", "--output", "a.svg"),
    ("wiring book_2wd", "--table", "--output", "a.svg"),
]
# command, the option without effect, the one that it needs
NEEDS = [
    ("run goal", "--lan", "--web"),
    ("run goal", "--tcp-port=8000", "--web"),
    ("run goal --fast", "--force", "--record"),
    ("replay a.mcap", "--force", "--record"),
    ("replay a.mcap", "--same-motion", "--set"),
    ("drive --distance 1m", "--distance", "--speed"),
    ("drive --angle 90deg --speed 1", "--angle", "--turn"),
    ("graph goal", "--force", "--output"),
    ("wiring book_2wd", "--force", "--output"),
    ("show book_2wd", "--force", "--output"),
    ("export urdf book_2wd", "--force", "--output"),
    ("bag export a.mcap", "--force", "--output"),
    ("bag export a.mcap", "--robot=book_2wd", "--format"),
    ("bag plot x a.mcap", "--force", "--output"),
    ("param save", "--force", "--output"),
    ("ports", "--robot=book_2wd", "--ask"),
    ("doctor", "--with=a.yaml", "--bundle"),
    ("doctor", "--force", "--bundle"),
]


def refused(folder, words):
    """The error of a command line that is refused, in one line."""
    code, out, message = cli(folder, *words, cwd=folder)
    assert code == 2 and out == "", message
    assert "Usage:" in message and message.count("error:") == 1
    return " ".join(message.partition("error:")[2].split())


@pytest.mark.parametrize(("command", "one", "other", "value"), EXCLUSIVE)
def test_options_that_contradict_each_other(command, one, other, value, tmp_path):
    words = command.split()
    words += [one] if one.startswith("--") and one not in words else []
    words += [other] if other not in words else []
    terminal, slave = os.openpty()
    words += [os.ttyname(slave) if value == "TERMINAL" else value] if value else []
    message = refused(tmp_path, words)
    os.close(terminal)
    os.close(slave)
    assert one.partition("=")[0] in message and other in message and "exclude each other" in message
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("command", "option", "needed"), NEEDS)
def test_an_option_that_has_no_effect_alone(command, option, needed, tmp_path):
    words = command.split()
    words += [option] if option not in words else []
    message = refused(tmp_path, words)
    assert option.partition("=")[0] in message and needed in message
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "cause"),
    [
        (("log", "--engine", "x", "level", "guard", "debug"), "--engine has no effect before"),
        (("log", "--at", "pi@robot", "level", "guard", "debug"), "--at has no effect before"),
        (("blocks", "--json", "show", "odometry"), "--json has no effect before 'show'"),
        (("replay", "a.mcap", "--from", "3s", "--until", "2s"), "--from 3 s is not before --until"),
        (("bag", "plot", "x", "a.mcap", "--until", "0s"), "--until 0 s is not after the start"),
        (("bag", "plot", "x", "a.mcap", "--from", "-1s"), "--from -1 s is before the start"),
        (("ros2", "--at", "pi@robot"), "name it with --socket"),
        (
            ("check", "book_2wd", "--robot", "turtle"),
            "--robot has no effect: book_2wd is no pipeline, whose robot it replaces; leave it "
            "out, or check that robot: diffbotctl check turtle",
        ),
        (
            ("check", "book_2wd", "book_2wd_stock", "--set", "limits.speed=9"),
            "is set with --set robot.limits.speed",
        ),
    ],
)
def test_what_else_has_no_effect(words, cause, tmp_path):
    assert cause in refused(tmp_path, words)


@pytest.mark.parametrize(
    ("words", "cause"),
    [
        (("standby",), "this pipeline has no goals, so that a --fast run of it would never end"),
        (("wander",), "this pipeline has no goals"),
        (("turtles",), "this pipeline has no goals"),
        (
            ("goal", "--stay"),
            "--stay waits for goals, and a --fast run without --name",
        ),
    ],
)
def test_a_run_as_fast_as_possible_that_would_never_end(words, cause, tmp_path):
    code, out, message = cli(tmp_path, "run", *words, "--fast")
    assert (code, out) == (2, "")
    assert "E-ENDLESS" in message and cause in " ".join(message.split()) and "--for 60s" in message
    code, out, _ = cli(tmp_path, "run", *words, "--fast", "--quiet", "--for", "0.2s")
    assert "time limit" in out
