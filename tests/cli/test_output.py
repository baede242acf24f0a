"""What becomes of words that their terminal, pipe or disk does not take."""

import os
import subprocess

import pytest

from diffbotctl.testing.command_process import command_line

# Each prints letters beyond ASCII to a UTF-8 terminal: boxes, braille, branches.
PICTURES = (
    ("show", "book_2wd"),
    ("wiring", "book_2wd"),
    ("frames", "book_2wd"),
    ("graph", "goal", "--robot", "book_2wd"),
)


def said(*words, stdout=subprocess.PIPE, **variables):
    return subprocess.run(
        command_line(*words),
        stdin=subprocess.DEVNULL,
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | variables,
    )


@pytest.mark.parametrize("words", PICTURES)
def test_a_terminal_without_the_letters_is_no_defect(words):
    done = said(*words, PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) > 5


@pytest.mark.parametrize("words", (*PICTURES[:1], ("explain",), ("run", "goal", "--fast")))
def test_a_full_disk_is_named_and_is_no_defect(words):
    with open("/dev/full", "w") as full:
        done = said(*words, stdout=full)
    assert done.returncode == 1
    assert "E-DISK-FULL" in done.stderr and "E-DEFECT" not in done.stderr
    assert "Traceback" not in done.stderr and "Exception" not in done.stderr


def test_the_end_of_a_run_states_how_well_the_pose_is_known():
    process = said("run", "goal", "--fast", "--quiet")
    line = next(line for line in process.stdout.splitlines() if "estimated error" in line)
    assert line.endswith("deg (standard deviation)") and "; known to " in line and len(line) <= 80
