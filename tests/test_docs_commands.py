"""Every command that README and docs show is typed, in a shell, as a reader would type it.

Commands on a line of their own are run: those for a board on an emulated one, those for a running
robot while one runs. Commands inside a sentence are read, down to their options.
"""

import os
import re
import shlex
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import click
import pytest

from diffbotctl.cli.main import commands, program
from diffbotctl.cli.other_words import ros_answer
from diffbotctl.processes.real_time import prefer
from tests.support.command_process import command_line, start_in_pipe
from tests.support.terminal import Terminal
from tests.support.virtual_board import LONGEST, board, outcome

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SHOWN = re.compile(r"^    (diffbotctl .*)$", re.M)
MENTIONED = re.compile(r"`(diffbotctl [^`]+)`|^(diffbotctl .*)$", re.M)  # or fenced: with questions
SHELL_WORK = re.compile(r"[|<>;&$*?~`\\{]")  # more than one command, or words that a shell changes
ON_A_BOARD = {"flash", "blink"}  # and whatever names a port
HELD_TIMES_MAX = 10  # times that a command is typed to a robot which a loaded machine has stopped
PIPELINES = {"robots.md": "turtles"}  # what runs while a page's commands speak to it; else standby
# What a page takes for granted: files of the reader's own.
PREPARED = {
    "trials.md": ("diffbotctl new robot other",),
    "recordings.md": (
        "diffbotctl run goal --fast --quiet --record monday.mcap",
        "diffbotctl run goal --fast --quiet --seed 2 --record tuesday.mcap",
        "head -c 20000 monday.mcap > cut.mcap",
        "cp monday.mcap drive.mcap",
    ),
}
# After a command: fewer runs than the file has that it wrote. The number of runs is no command.
AFTERWARDS = {
    "diffbotctl new trials first": "sed -i 's/^seeds: 10 /seeds: 1 /' trials/first.yaml",
}
# These say by their exit code what they found: no board on this machine, two files that differ.
FINDS = {"ports", "doctor", "bag diff", "learn check", "trials"}
ON_AN_ENGINE = {"why", "stop", "resume", "goto", "drive", "topic", "param", "call"}


def lines(page):
    """The commands that a page shows on lines of their own."""
    return SHOWN.findall(page.read_text())


def bare(line):
    """The command without its comment."""
    return line.partition(" #")[0].rstrip()


def words_of(line):
    """The words of a command without its comment, and without what the shell does itself."""
    return shlex.split(line, comments=True)[1:]


def on_a_board(line):
    words = words_of(line)
    return words[0] in ON_A_BOARD or ("--port" in words and words[0] != "service")


def on_the_air(line):
    """Over a radio that is not here: tests/bluetooth run each of these against its double."""
    return words_of(line)[0] == "bluetooth" or "bluetooth:" in line


def asks(line):
    """Calibrations ask for a person's eyes and hands."""
    words = words_of(line)
    return words[0] == "calibrate" and words[1:2] not in (["show"], ["undo"], ["from-log"])


def on_a_terminal(line):
    words = words_of(line)
    return words[0] in ("dash", "teleop") or "--dash" in words


def on_an_engine(line):
    words = words_of(line)
    is_bag = words[:2] in (["bag", "record"], ["bag", "save"])
    return is_bag or words[0] in ON_AN_ENGINE or {"--live", "--running"} & set(words)


@pytest.fixture
def reader(tmp_path):
    """A folder like a reader's checkout, with `diffbotctl` on the path."""
    program_file = tmp_path / "bin" / "diffbotctl"
    program_file.parent.mkdir()
    program_file.write_text(f'#!/bin/sh\nexec {sys.executable} -m diffbotctl "$@"\n')
    program_file.chmod(0o755)
    work = tmp_path / "work"
    work.mkdir()
    for folder in ("robots", "pipelines"):
        (work / folder).mkdir()
        for file in (ROOT / folder).glob("*.yaml"):
            (work / folder / file.name).write_text(file.read_text())
    (tmp_path / "run").mkdir(mode=0o700)
    return Reader(work, tmp_path)


class Reader:
    """Types lines into a shell."""

    def __init__(self, work, home):
        self.work = work
        self.environment = os.environ | {
            "PATH": f"{home / 'bin'}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(ROOT),
            "XDG_STATE_HOME": str(home / "state"),
            "XDG_CACHE_HOME": str(home / "cache"),
            "XDG_RUNTIME_DIR": str(home / "run"),
            "TMPDIR": str(home),
        }

    def types(self, line):
        """Run the line; its exit code and output."""
        # Files of this test alone; the ports of its board are in /tmp/diffbot-*.
        line = re.sub(r"/tmp/(?!diffbot-)", f"{self.environment['TMPDIR']}/", line)
        options = {"cwd": self.work, "env": self.environment}
        is_alone = line.startswith("diffbotctl ") and not SHELL_WORK.search(bare(line))
        typed = command_line(*words_of(line)) if is_alone else ["bash", "-c", line]
        process = start_in_pipe(typed, stdin=subprocess.DEVNULL, **options)
        prefer(process.pid)
        return outcome(process, **options)

    @contextmanager
    def running(self, pipeline):
        """A robot that stands and waits in another terminal, until it is used no more."""
        engine = start_in_pipe(
            command_line("run", pipeline, "--stay"),
            cwd=self.work,
            env=self.environment,
            stdin=subprocess.DEVNULL,
        )
        try:
            for output in engine.stdout:
                if "odometry" in output or "pose" in output or " s " in output:
                    break
            yield
        finally:
            engine.terminate()
            engine.communicate(timeout=LONGEST)


def pages_that_show(condition):
    """Decorator of a test: once for each page that shows a command of this kind."""
    shown = [page for page in PAGES if any(map(condition, lines(page)))]
    return pytest.mark.parametrize("page", shown, ids=lambda page: page.name)


@pages_that_show(lambda line: True)
def test_commands_that_need_nothing(page, reader):
    for line in PREPARED.get(page.name, ()):
        assert reader.types(line)[0] == 0, line
    for line in lines(page):
        elsewhere = any(
            each(line) for each in (on_a_board, on_an_engine, on_a_terminal, on_the_air, asks)
        )
        if elsewhere or words_of(line)[0] == "emulate":
            continue
        if words_of(line)[0] == "run":
            line = re.sub(r"( +#.*)?$", " --fast --quiet", line, count=1)
        code, output = reader.types(line)
        finds = any(line.startswith(f"diffbotctl {words}") for words in FINDS)
        assert code == 0 or (code == 1 and finds), f"{page.name} shows: {line}\n{output}"
        if bare(line) in AFTERWARDS:
            assert reader.types(AFTERWARDS[bare(line)])[0] == 0


@pages_that_show(on_an_engine)
def test_commands_for_a_running_robot(page, reader):
    shown = [line for line in lines(page) if on_an_engine(line)]
    with reader.running(PIPELINES.get(page.name, "standby")):
        for line in shown:
            if " echo " in line and "--once" not in line:
                line += " --for 1s"  # it would go on until somebody ends it
            for _ in range(HELD_TIMES_MAX):  # a loaded machine stops the robot at any time
                reader.types("diffbotctl resume")
                code, output = reader.types(line)
                if "E-HELD" not in output:
                    break
            assert code == 0, f"{page.name} shows: {line}\n{output}"


@pages_that_show(on_a_terminal)
def test_commands_on_a_terminal(page, reader):
    for line in PREPARED.get(page.name, ()):
        assert reader.types(line)[0] == 0, line
    for line in filter(on_a_terminal, lines(page)):
        with Terminal(
            ["bash", "-c", f"cd {reader.work}; exec {line}"], reader.environment
        ) as terminal:
            terminal.until(lambda text: "pose" in text, f"the picture of {line}, on {page.name},")
            terminal.type("\x03")
            assert terminal.ended() in (0, 130)


@pages_that_show(asks)
def test_commands_that_ask(page, reader):
    for line in filter(asks, lines(page)):
        line = bare(line)
        line += " --port sim" * ("--port" not in line)
        with Terminal(
            ["bash", "-c", f"cd {reader.work}; exec {line}"], reader.environment
        ) as terminal:
            terminal.until(lambda text: "Wheels" in text or "wheels" in text, f"what {line} moves")
            terminal.type("\x03")
            assert terminal.ended() in (0, 130)


STOCK = "book_2wd_stock"  # its board runs the book's firmware: tests/links have a double of it


def on_the_emulated_board(line):
    is_on_it = on_a_board(line) and STOCK not in line
    return is_on_it and not on_the_air(line) and not asks(line)


def test_commands_for_a_board(reader):
    shown = dict.fromkeys(
        bare(line) for page in PAGES for line in lines(page) if on_the_emulated_board(line)
    )
    assert shown
    with board() as virtual:
        for line in shown:
            line = line.replace("/dev/rfcomm0", str(virtual.radio))
            line = re.sub(r"--port (auto|/dev/tty\w+)", f"--port {virtual.usb}", line)
            line += " --yes" * (" flash " in line) + " --quiet" * (" run " in line)
            code, output = reader.types(line)
            # A robot that was stopped under way, and resumed, may know its position less well.
            is_done = code == 0 or (code == 3 and "host_frozen" in output)
            assert is_done, f"a page shows: {line}\n{output}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_inside_a_sentence_can_be_read(page):
    whole = page.read_text().replace("\\\n", "")  # a command may go on in the next line
    for shown in map("".join, MENTIONED.findall(whole)):
        for line in shown.split(" | ")[:1]:
            words = [word for word in words_of(line) if word not in ("...", "…")]
            if ros_answer(words) is not None:
                continue
            read(words, f"{page.name} states `{line}`")


def read(words, where):
    """Read a command line as the program does, without running it."""
    if words[0].startswith("--"):
        words = words[1:]
    assert words[0] in commands(), f"{where}: there is no such command"
    command = program.get_command(None, words[0])
    rest = words[1:]
    while isinstance(command, click.Group) and rest and rest[0] in command.commands:
        command, rest = command.commands[rest[0]], rest[1:]
    try:
        with click.Context(command, resilient_parsing=True) as context:
            command.parse_args(context, list(rest))
            options = {name for each in command.params for name in each.opts}
            for word in rest:
                assert not word.startswith("--") or word in options | {"--help"}, where
    except click.UsageError as error:
        raise AssertionError(f"{where}: {error.format_message()}") from error
