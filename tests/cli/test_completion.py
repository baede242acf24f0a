"""Completion in bash itself, and the replies for the other shells."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from diffbotctl.cli import COMPLETING, completion
from diffbotctl.cli.main import commands
from tests.command_result import invoke
from tests.support.running import PlainClient, running

ROOT = Path(__file__).parents[2]
SHELLS = ("bash", "zsh", "fish")


@pytest.fixture
def place(tmp_path):
    """A folder with a program called diffbotctl, and a robot."""
    program = tmp_path / "bin" / "diffbotctl"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m diffbotctl "$@"\n')
    program.chmod(0o755)
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "crawler.yaml").write_text("format: 1\nkind: robot\ninclude: book_2wd\n")
    return tmp_path


def environment(place, **more):
    path = f"{place / 'bin'}{os.pathsep}{os.environ['PATH']}"
    return os.environ | {"PATH": path, "PYTHONPATH": str(ROOT)} | more


def asked(place, shell, line):
    """What the program answers a shell that completes the last word of `line`."""
    words = line.split(" ")
    current = words[-1] if shell == "fish" else str(len(words) - 1)
    done = subprocess.run(
        [place / "bin" / "diffbotctl"],
        cwd=place,
        capture_output=True,
        text=True,
        check=True,
        env=environment(
            place,
            **{
                COMPLETING: f"{shell}_complete",
                "COMP_WORDS": line,
                "COMP_CWORD": current,
            },
        ),
    )
    return done.stdout


CASES = [
    ("diffbotctl wir", ["wiring"]),
    ("diffbotctl run sq", ["square"]),
    ("diffbotctl run goal --robot cra", ["crawler"]),  # one's own, from ./robots
    ("diffbotctl run goal --robot book_2wd_s", ["book_2wd_stock"]),
    ("diffbotctl run goal --port em", ["emulated"]),
    ("diffbotctl explain E-PIN-PW", ["E-PIN-PWM"]),
    ("diffbotctl blocks show odo", ["odometry"]),
    ("diffbotctl types TurtleP", ["TurtlePlacement", "TurtlePose"]),
    ("diffbotctl wiring book_2wd_c", ["book_2wd_counts"]),
    ("diffbotctl run goal --rec", ["--record"]),
    ("diffbotctl blocks sho", ["show"]),
    ("diffbotctl completion fi", ["fish"]),
]


@pytest.mark.parametrize(("line", "words"), CASES)
def test_words_are_completed(place, line, words):
    assert asked(place, "bash", line).split() == [f"plain,{word}" for word in words]


LIVE_CASES = [
    ("diffbotctl topic echo gate.wh", ["gate.wheels"]),
    ("diffbotctl topic hz --engine test odometry.", ["odometry.imu", "odometry.odometry"]),
    ("diffbotctl topic hz --engine none odometry.", []),
    ("diffbotctl param get guard.ma", ["guard.margin"]),
    ("diffbotctl param set limiter.", []),  # none of its parameters may change in a run
    ("diffbotctl param set guard.sl", ["guard.slowest"]),
    ("diffbotctl call odometry.set", ["odometry.set_pose"]),
    ("diffbotctl call odometry.set_pose h", ["heading="]),
    ("diffbotctl log level kine", ["kinematics"]),
    ("diffbotctl dash --plot odometry.odometry.li", ["odometry.odometry.linear"]),
    ("diffbotctl stop --engine te", ["test"]),
    ("diffbotctl bag record --exclude robot.enc", ["robot.encoders"]),
]


@pytest.fixture(scope="module")
def engine(tmp_path_factory):
    """A run whose robot waits, in a folder of its own."""
    folder = tmp_path_factory.mktemp("engine")
    with running(folder, "goal", "--stay", "--goal", "0 0"):
        client = PlainClient(folder)
        client.until(lambda status: status["goal_state"] is not None)
        yield folder


@pytest.mark.parametrize("shell", SHELLS)
def test_names_of_a_running_engine_are_completed(place, engine, shell, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(engine))
    cases = LIVE_CASES if shell == "bash" else LIVE_CASES[:1]
    for line, words in cases:
        output = asked(place, shell, line)
        separator = "\n" if shell == "zsh" else ","  # of type, word and help
        found = [
            word
            for word in output.replace("\n", separator).split(separator)
            if word not in ("plain", "_", "")
        ]
        assert found == words, line


def test_names_of_a_recording_and_of_a_pipeline_are_completed(place, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))  # no engine runs there
    words = ["run", "goal", "--fast", "--quiet", "--goal", "0 0", "--record", "short.mcap"]
    program = [place / "bin" / "diffbotctl", *words]
    subprocess.run(program, cwd=place, check=True, capture_output=True, env=environment(place))
    for line, word in (
        ("diffbotctl bag plot short.mcap odometry.odometry.li", "odometry.odometry.linear"),
        ("diffbotctl run goal --set guard.marg", "guard.margin="),
        ("diffbotctl new robot --kit rom", "romi_32u4"),
        ("diffbotctl calibrate range --sensor fr", "front"),
    ):
        assert asked(place, "bash", line).split() == [f"plain,{word}"], line
    assert asked(place, "bash", "diffbotctl topic echo gate").strip() == ""
    assert asked(place, "bash", "diffbotctl bag plot nothing.mcap odo").strip() == ""


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_the_other_shells_get_the_same_with_its_help(place, shell):
    output = asked(place, shell, "diffbotctl wir")
    assert "wiring" in output and commands()["wiring"].sentence in output


def test_a_path_is_left_to_the_shell(place):
    assert asked(place, "bash", "diffbotctl run ./pip").startswith("file,")


def test_completing_a_command_imports_none(place):
    code = (
        "import sys\nfrom diffbotctl.cli.main import program\n"
        "try: program.main([], prog_name='diffbotctl', standalone_mode=False)\n"
        "except SystemExit: pass\n"
        "print([name for name in sys.modules if name.startswith('diffbotctl.cli.')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=environment(
            place,
            **{
                COMPLETING: "bash_complete",
                "COMP_WORDS": "diffbotctl wi",
                "COMP_CWORD": "1",
            },
        ),
    )
    assert done.stdout.splitlines() == ["plain,wiring", "['diffbotctl.cli.main']"]


def script(shell):
    return invoke(completion.completion, shell)[1]


def test_bash_itself_completes(place):
    (place / "script").write_text(script("bash"))
    line = (
        "source ./script; COMP_WORDS=(diffbotctl run sq); COMP_CWORD=2; "
        'name=$(complete -p diffbotctl | sed "s/.*-F \\([^ ]*\\).*/\\1/"); '
        '$name diffbotctl; echo "${COMPREPLY[@]}"'
    )
    done = subprocess.run(
        ["bash", "-c", line], cwd=place, capture_output=True, text=True, env=environment(place)
    )
    assert done.stdout.strip() == "square", done.stderr


@pytest.mark.parametrize("shell", SHELLS)
def test_each_script_asks_this_program(shell):
    text = script(shell)
    assert f"{COMPLETING}={shell}_complete" in text
    if shutil.which(shell):  # the shell itself reads it without a word
        flag = "--no-execute" if shell == "fish" else "-n"
        done = subprocess.run([shell, flag], input=text, capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")
