"""The face of the product on a board that runs the real firmware, behind real pseudo-terminals.

The board keeps pace with real time in a thread of this process; each command is a process of its
own, as at a person's prompt.
"""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.drivers.port import Port
from diffbotctl.runs.virtual_board import virtual_board

MAIN = "from diffbotctl.cli.main import main; main()"
LONGEST = 60  # s; everything here takes a few


@contextmanager
def board(blank=False):
    ends, end = os.pipe()
    with virtual_board(load_robot("book_2wd").robot, seed=3, blank=blank) as virtual:
        pace = threading.Thread(target=virtual.serve, args=(ends,))
        pace.start()
        try:
            yield virtual
        finally:
            os.write(end, b"x")
            pace.join()
    os.close(ends)
    os.close(end)


def command(*words):
    return [sys.executable, "-c", MAIN, *map(str, words)]


def diffbotctl(*words):
    """Run a command to its end; (exit code, what it said)."""
    done = subprocess.run(
        command(*words), stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=LONGEST,
        check=False,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


def flash(virtual):
    return diffbotctl("flash", "firmware", "--port", virtual.usb, "--robot", "book_2wd", "--yes")


def test_from_a_blank_board_to_a_goal(tmp_path):
    log = tmp_path / "goal.mcap"
    with board(blank=True) as virtual:
        code, said = diffbotctl("blink", "--port", virtual.usb, "--times", 1)
        assert (code, "only the bootloader answers" in said) == (1, True), said
        code, said = flash(virtual)
        assert code == 0, said
        assert re.search(r"^diffbot 0\.1\.0 on Mega 2560, settings [0-9A-F]{4}, ready$", said, re.M)
        code, said = diffbotctl("blink", "--port", virtual.usb, "--times", 1)
        assert code == 0, said
        code, said = diffbotctl(
            "run", "goal", "--robot", "book_2wd", "--port", virtual.radio, "--goal", "0.15 0.05",
            "--record", log, "--quiet",
        )  # fmt: skip
        assert code == 0, said
        assert "goals 1 of 1 reached" in said
        assert "0 damaged, 0 lost" in said
        assert "final stop confirmed" in said
        truth = virtual.board.plant.truth()
        assert truth.left_speed == truth.right_speed == 0.0
        assert abs(truth.pose.x - 0.15) < 0.03 and abs(truth.pose.y - 0.05) < 0.03
    code, said = diffbotctl("replay", log, "--check")
    assert code == 0, said
    assert "bit for bit" in said


def test_the_usb_port_drives_as_well_and_the_other_port_takes_over_after_it():
    with board() as virtual:
        for port in (virtual.usb, virtual.radio):
            code, said = diffbotctl(
                "run", "goal", "--robot", "book_2wd", "--port", port, "--goal", "0.1 0", "--quiet"
            )
            assert code == 0, said


def test_an_interrupted_flash_can_be_done_again():
    with board(blank=True) as virtual:
        words = command("flash", "firmware", "--port", virtual.usb, "--robot", "book_2wd", "--yes")
        first = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        until = time.monotonic() + LONGEST
        while virtual.board.emulator.flash(1024, 1) == b"\xff":  # its fifth page is not written
            assert time.monotonic() < until
            time.sleep(0.01)
        first.send_signal(signal.SIGKILL)
        first.wait()
        assert virtual.board.emulator.flash(7936, 1) == b"\xff", "it was not to be whole yet"
        code, said = flash(virtual)
        assert code == 0, said


def test_a_port_in_use_names_who_uses_it():
    with board() as virtual:
        held = Port(str(virtual.usb), 115200)
        code, said = flash(virtual)
        held.close()
    assert code == 1
    assert "E-PORT-BUSY" in said
    assert f"(process {os.getpid()})" in said


def test_the_radio_cannot_flash():
    with board() as virtual:
        code, said = diffbotctl("flash", "firmware", "--port", virtual.radio, "--yes")
    assert (code, "E-FLASH-RADIO" in said) == (1, True)


def test_nobody_to_ask_is_no_consent():
    code, said = diffbotctl("flash", "firmware", "--port", "/dev/ttyACM9", "--robot", "book_2wd")
    assert code == 2
    assert "--yes" in said


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_driver_that_is_told_to_end_stops_the_robot_and_says_so(how):
    with board() as virtual:
        words = command(
            "run", "goal", "--robot", "book_2wd", "--port", virtual.radio, "--goal", "3 0",
            "--quiet",
        )  # fmt: skip
        run = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        wait_until(lambda: max(virtual.board.duty) > 0.1)
        run.send_signal(how)
        said, _ = run.communicate(timeout=LONGEST)
        assert virtual.board.duty == [0.0, 0.0]
    assert "final stop confirmed" in said
    assert run.returncode == 130, said


def test_a_driver_that_is_killed_leaves_the_stop_to_the_board():
    with board() as virtual:
        words = command(
            "run", "goal", "--robot", "book_2wd", "--port", virtual.radio, "--goal", "3 0",
            "--quiet",
        )  # fmt: skip
        run = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_until(lambda: max(virtual.board.duty) > 0.1)
        run.kill()
        run.wait()
        wait_until(lambda: virtual.board.duty == [0.0, 0.0])


def wait_until(holds):
    until = time.monotonic() + LONGEST
    while not holds():
        assert time.monotonic() < until, "it never came to that"
        time.sleep(0.005)
