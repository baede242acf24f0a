"""What all commands have in common: help, options, errors, exit codes, interrupts."""

import os
import random
import signal
import subprocess
import sys
import time
from collections import defaultdict
from importlib import import_module
from pathlib import Path

import click
import pytest

from diffbotctl.cli import main
from diffbotctl.cli.main import GROUPS, help_rows, program
from tests.support.confined import run_command

HELP_ROWS_MAX = 24
# Options that mean the same in every command that has them, so that their text is the same.
SHARED = ("--engine", "--force", "--json", "--robot", "--seed", "--set", "--yes")
DIFFERENT = {  # command, option: why its text differs
    ("show", "--robot"), ("frames", "--robot"), ("urdf", "--robot"),  # also the argument
    ("wiring", "--robot"), ("emulate", "--robot"),
    ("start", "--robot"),  # a new file is made without it
    ("export", "--robot"),  # the recorded robot without it
    ("stop", "--engine"),  # all engines without it
}  # fmt: skip


run = run_command


def commands(group=program, path=()):
    """Every command with its path, below the groups too."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        yield (*path, name), command
        if isinstance(command, click.Group):
            yield from commands(command, (*path, name))


def test_every_command_has_its_place_in_the_help_and_the_help_fits():
    rows = [row for group in GROUPS for row in help_rows(group)]
    reached = {id(command) for _, command in commands()}
    for path in sorted(Path(main.__file__).parent.glob("[a-z]*.py")):
        for name, value in vars(import_module(f"diffbotctl.cli.{path.stem}")).items():
            if isinstance(value, click.Command) and value is not program:
                assert id(value) in reached, (
                    f"{path.name}: declare {name} with @command or @group of cli.command"
                )
    lines = run("--help").printed.splitlines()
    assert len(rows) <= HELP_ROWS_MAX
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize("words", [["run"], ["topic", "echo"], ["calibrate", "motors"]])
def test_help_shows_the_help_of_a_command(words):
    assert run("help", *words).printed == run(*words, "--help").printed != ""


def test_the_version_has_a_short_option():
    assert run("-V").printed == run("--version").printed != ""


@pytest.mark.parametrize("option", SHARED)
def test_an_option_means_the_same_everywhere(option):
    texts = defaultdict(list)
    for path, command in commands():
        for parameter in command.params:
            if option in parameter.opts and (path[-1], option) not in DIFFERENT:
                texts[parameter.help, parameter.metavar, parameter.is_flag].append(" ".join(path))
    assert len(texts) == 1, f"{option} is described differently: take it from cli/options.py"


def test_a_time_limit_is_called_for_everywhere():
    for path, command in commands():
        for parameter in command.params:
            if "--for" in parameter.opts:
                assert parameter.metavar == "TIME", " ".join(path)
                assert type(parameter.type).__name__ == "Quantity", " ".join(path)


@pytest.mark.parametrize(
    "words, code, cause",
    [
        (["explain", "E-NONE"], 2, "E-CODE"),
        (["run", "nowhere"], 2, "E-FILE-NAME"),
        (["runn"], 2, "There is no command 'runn'. Did you mean 'run'?"),
        (["run", "goal", "--for", "3 m"], 2, "--for"),
        (["run", "goal", "--for", "-1s"], 2, "--for"),
        (["drive", "--for", "-1s"], 2, "above 0"),
        (["goto", "nan", "0"], 2, "'nan' is not a number"),
        (["goto", "0", "0", "90"], 2, "the angle 90 has no unit: write 90 deg"),
        (["goto", "0", "0", "1e308"], 2, "the angle 1e308 has no unit"),
        (["run", "goal", "--goal", "2.5 0"], 2, "E-GOAL-WALL"),
        (["run", "goal", "--goal", "0 0", "--goal", "2.45 0.3"], 2, "--goal '2.45 0.3'"),
        (["topic", "pub", "operator.twist", '{"linear": NaN}'], 2, "NaN is no number"),
        (["topic", "pub", "operator.twist", "[" * 5000], 2, "nested too deeply"),
        (["help", "nothing"], 2, "There is no command 'nothing'."),
    ],
)
def test_an_error_is_marked_and_goes_to_standard_error(words, code, cause):
    done = run(*words)
    assert done.code == code and done.printed == ""
    marked = [line for line in done.complaints.splitlines() if line.startswith("error: ")]
    assert len(marked) == 1 and cause in done.complaints
    assert "\x1b" not in done.complaints and "Traceback" not in done.complaints


@pytest.mark.parametrize(
    ("words", "options"),
    [
        (("--distance", "-0.1m", "--speed", "0.1"), "--distance and --speed"),
        (("--distance", "0.1m", "--speed", "-0.1"), "--distance and --speed"),
        (("--angle", "-30deg", "--turn", "1"), "--angle and --turn"),
    ],
)
def test_a_drive_whose_signs_contradict_each_other_is_refused(words, options):
    done = run("drive", *words)
    assert done.code == 2
    assert f"{options} have opposite signs" in " ".join(done.complaints.split())


@pytest.mark.parametrize("plain", [False, True])
def test_the_mark_is_red_on_a_terminal_unless_no_color_is_set(plain):
    terminal, ours = os.openpty()
    environment = {name: value for name, value in os.environ.items() if name != "NO_COLOR"}
    environment |= {"NO_COLOR": "1"} if plain else {}
    subprocess.run(
        [sys.executable, "-m", "diffbotctl", "explain", "E-NONE"],
        stdin=subprocess.DEVNULL, stdout=ours, stderr=ours, env=environment, timeout=60,
    )  # fmt: skip
    os.close(ours)
    text = os.read(terminal, 4096).decode()
    os.close(terminal)
    assert ("\x1b[31m" in text) is not plain and "error:" in text


def test_the_suffix_decides_the_format(tmp_path):
    done = run("wiring", "book_2wd", "--output", tmp_path / "x.png")
    assert done.code == 2 and ".svg" in done.complaints
    assert not (tmp_path / "x.png").exists()


def test_the_robot_is_accepted_as_argument_and_as_option():
    assert run("frames", "book_2wd").printed == run("frames", "--robot", "book_2wd").printed != ""
    assert run("frames", "book_2wd", "--robot", "book_2wd").code == 2


# Writes `ready` when the program imports its first module, just after it has set its handler.
INTERRUPTED = """
import os, runpy, sys
sys.path[:0] = {path!r}
def report(event, arguments):
    if event == "import" and arguments[0] == "diffbotctl.cli.main":
        os.write(1, b"ready")
sys.addaudithook(report)
sys.argv = ["diffbotctl", *{words!r}]
runpy.run_module("diffbotctl", run_name="__main__")
"""


@pytest.mark.parametrize("words", [["--help"], ["run", "goal", "--fast", "--quiet"]])
def test_an_interrupt_at_any_moment_exits_with_130_and_no_traceback(words):
    rng = random.Random(5)
    for _ in range(6):
        process = subprocess.Popen(
            [sys.executable, "-S", "-c", INTERRUPTED.format(path=sys.path, words=words)],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        assert os.read(process.stdout.fileno(), 5) == b"ready"
        time.sleep(rng.uniform(0, 0.4))
        process.send_signal(signal.SIGINT)
        _, complaint = process.communicate(timeout=60)
        assert b"Traceback" not in complaint, complaint.decode()
        # 0: it had ended before. -SIGINT: at the very end Python has removed all handlers; a shell
        # reports 130 for that.
        assert process.returncode in (0, 130, -signal.SIGINT)


@pytest.mark.parametrize(
    "words, code",
    [
        (["goal", "--for", "1s"], 1),  # the goal is more than a metre away
        (["goal", "--goal", "0 0", "--for", "5s"], 0),  # it is there already
        (["hello", "--for", "1s"], 0),  # it has no goals
    ],
)
def test_a_time_limit_before_the_goal_exits_with_1(words, code):
    assert run("run", *words, "--fast", "--quiet").code == code
