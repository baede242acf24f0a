"""The command `emulate`: a board for other programs, which ends cleanly."""

import os
import re
import signal
import subprocess
from contextlib import contextmanager
from pathlib import Path

import pytest

from diffbotctl.flash.intel_hex import write_hex
from tests.sampling import by_day
from tests.support.command_process import children_of, command_line, start_in_pipe
from tests.support.running import PlainClient, cli, moves, running, stands
from tests.support.virtual_board import LONGEST, diffbotctl, flat, run


@contextmanager
def emulated(*words):
    """Start `emulate`; its process, and its USB and radio port."""
    shell = [*command_line("emulate", *words)]
    shell.insert(1, "-u")
    process = start_in_pipe(shell)
    output = ""
    try:
        while "Ctrl-C ends" not in output:
            line = process.stdout.readline()
            assert line, output
            output += line
        ports = re.findall(r"^(?:USB|radio) port +(\S+)$", output, re.M)
        yield process, output, *ports
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("how", by_day(1, [signal.SIGTERM, signal.SIGINT]))
def test_a_run_on_it_and_a_clean_end(how):
    with emulated("book_2wd") as (process, output, usb, radio):
        assert "EMULATED board with diffbot_mega2560.hex, SIMULATED robot" in output
        code, reported = diffbotctl(*run(radio, "--goal", "0.1 0"))
        assert code == 0, reported
        process.send_signal(how)
        rest, _ = process.communicate(timeout=LONGEST)
    assert process.returncode == 0
    assert "Traceback" not in rest
    assert not os.path.lexists(usb) and not os.path.lexists(radio)
    assert not Path(usb).parent.exists()


def test_stop_reports_a_board_that_does_not_answer(tmp_path):
    """As a radio out of range: the engine holds the robot, but what the board does is unknown."""
    drive = ("goal", "--stay", "--goal", "30 0", "--port")
    with (
        emulated("book_2wd") as (process, _, _usb, radio),
        running(tmp_path, *drive, radio),
        running(tmp_path, *drive, "sim", name="other"),
    ):
        client, other = PlainClient(tmp_path), PlainClient(tmp_path, "other")
        client.until(moves)
        other.until(moves)
        pids = [process.pid, *children_of(process.pid)]
        for pid in pids:
            os.kill(pid, signal.SIGSTOP)
        try:
            for _ in range(2):  # at once, and when the link is known to be lost
                code, out, err = cli(tmp_path, "stop")
                assert code == 1 and "NOT CONFIRMED: the board does not answer" in err, out
                assert "other: stopped" in out and stands(other.request("status"))
                client.until(lambda status: status["robot.link"]["state"] != "up")
        finally:
            for pid in pids:
                os.kill(pid, signal.SIGCONT)


def test_stop_reports_a_board_that_never_answered(tmp_path):
    master, slave = os.openpty()
    try:
        port = os.ttyname(slave)
        with running(tmp_path, "goal", "--stay", "--goal", "30 0", "--port", port):
            code, out, err = cli(tmp_path, "stop")
            assert code == 1 and "NOT CONFIRMED: the board does not answer" in err, out
    finally:
        os.close(master)
        os.close(slave)


def test_a_blank_board_is_flashed():
    with emulated("book_2wd", "--blank") as (_, output, usb, _radio):
        assert "nothing but its bootloader" in output
        words = ("flash", "firmware", "--robot", "book_2wd", "--port", usb, "--yes")
        code, reported = diffbotctl(*words)
    assert code == 0, reported


def test_wrong_arguments_are_reported(tmp_path):
    hangs = tmp_path / "hangs.hex"
    hangs.write_text(write_hex(b"\xff\xcf").replace("FFCF", "FFCE"))
    code, output = diffbotctl("emulate", "book_2wd_stock")
    assert code == 2
    assert "this robot's board speaks rosserial" in flat(output)
    code, output = diffbotctl("emulate", "book_2wd", "--hex", hangs)
    assert code == 1
    assert "E-FLASH-IMAGE" in output


def test_missing_packages_are_named(tmp_path):
    """A machine without a compiler, on which nothing has been built yet."""
    without = {**os.environ, "PATH": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path)}
    for words in (("emulate", "book_2wd"), ("run", "goal", "--port", "emulated", "--quiet")):
        done = subprocess.run(
            command_line(*words), env=without, capture_output=True, text=True, check=False
        )
        assert done.returncode == 1
        assert re.search("sudo apt-get install( [a-z-]+)* gcc", flat(done.stderr)), done.stderr


def test_the_walls_of_a_pipeline(tmp_path):
    """The robot stops for a wall 20 cm in front of the sensor."""
    walled = tmp_path / "walled.yaml"
    walled.write_text(
        "include: " + str(Path("pipelines/goal.yaml").resolve()) + "\n"
        "world: {walls: [{from: [0.35 m, -1 m], to: [0.35 m, 1 m]}]}\n"
    )
    with emulated("book_2wd", "--world", walled) as (_, _, _usb, radio):
        code, output = diffbotctl(*run(radio, "--goal", "0.6 0", "--set", "follower.patience=1 s"))
    assert code == 1, output  # the goal was not reached
    assert "obstacle" in output and "goals 0 of 1" in output, output
