"""Commands that drive a board with the real firmware."""

import os
import re
import signal

import pytest

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import FrameDecoder
from tests.sampling import by_day
from tests.support.serial_wire import SerialWire
from tests.support.virtual_board import (
    board,
    diffbotctl,
    flash,
    flat,
    moving,
    run,
    start,
    wait_until,
)

FAR = ("--goal", "30 0")  # further than any test lets the robot come
STILL = [0.0, 0.0]
RECONNECT = 5_000_000_000  # ns, with the bootloader's second and a port that is reopened


def test_from_a_blank_board_to_a_goal_and_the_same_again(tmp_path):
    log = tmp_path / "goal.mcap"
    with board(image=None) as virtual:
        code, output = flash(virtual)
        assert code == 0, output
        assert re.search(
            r"^diffbot 0\.2\.0 on Mega 2560, settings [0-9A-F]{4}, ready$", output, re.M
        )
        code, output = diffbotctl(
            *run(virtual.radio, "--goal", "0.15 0.05", "--record", log, "--digest")
        )
        assert code == 0, output
        assert "goals 1 of 1 reached" in output
        assert "0 damaged, 0 lost" in output
        assert "final stop confirmed" in output
        truth = virtual.board.plant.truth()
        assert truth.left_speed == truth.right_speed == 0.0
        assert abs(truth.pose.x - 0.15) < 0.03 and abs(truth.pose.y - 0.05) < 0.03
    digest = re.search(r"digest ([0-9a-f]+)", output)[1]
    code, output = diffbotctl("replay", log, "--check")
    assert code == 0, output
    assert "bit for bit" in output
    assert digest in output


def test_a_new_link_begins_with_a_stop_and_a_new_board_without_a_faulty_sensor(tmp_path):
    """Whatever drove the board before drives it no longer; a frame comes before a distance."""
    with board() as virtual, SerialWire(virtual.radio, tmp_path / "rfcomm0") as wire:
        code, output = diffbotctl(*run(wire.name, "--goal", "0.05 0"))
        assert code == 0, output
        sent = FrameDecoder().feed(wire.to_board)
    assert isinstance(sent[0], frames.StopFrame)
    assert "range_fault" not in output


def test_the_usb_port_drives_under_any_name_and_the_other_port_takes_over_after_it(tmp_path):
    """A port of an unknown name is tried at 115200 baud, after the robot file's rate."""
    with board() as virtual:
        usb = tmp_path / "board"
        usb.symlink_to(os.path.realpath(virtual.usb))
        for port in (usb, virtual.radio):
            code, output = diffbotctl(*run(port, "--goal", "0.05 0"))
            assert code == 0, output


@pytest.mark.parametrize("how", by_day(1, [signal.SIGTERM, signal.SIGINT, signal.SIGHUP]))
def test_a_run_that_is_interrupted_stops_the_robot_and_reports_it(how):
    with board() as virtual:
        driver = start(*run(virtual.radio, *FAR))
        wait_until(lambda: moving(virtual))
        driver.send_signal(how)
        output, _ = driver.communicate()
        assert virtual.board.duty == STILL
    assert "final stop confirmed" in output
    assert driver.returncode == 130, output


def _interrupted(driver, virtual):
    """The output of a run that is interrupted after its board has had time to reconnect.

    The board's time never passes faster than the run's.
    """
    begin = virtual.board.now
    wait_until(lambda: virtual.board.now > begin + RECONNECT)
    driver.send_signal(signal.SIGINT)
    return driver.communicate()[0]


def test_the_board_stops_by_itself_when_the_run_is_killed():
    with board() as virtual:
        driver = start(*run(virtual.radio, *FAR))
        wait_until(lambda: moving(virtual))
        driver.kill()
        driver.communicate()
        wait_until(lambda: virtual.board.duty == STILL)


def test_after_a_reconnect_a_stop_comes_first_and_resume_is_needed(tmp_path):
    with board() as virtual, SerialWire(virtual.radio, tmp_path / "rfcomm0") as wire:
        driver = start(*run(wire.name, *FAR))
        wait_until(lambda: moving(virtual))
        wire.pull()
        wait_until(lambda: virtual.board.duty == STILL)
        went = virtual.board.plant.truth().pose.x
        wire.plug()
        output = _interrupted(driver, virtual)
        sent = FrameDecoder().feed(wire.to_board)
        assert virtual.board.plant.truth().pose.x - went < 0.03  # it rolls out, no more
    assert isinstance(sent[0], frames.StopFrame)
    assert not [frame for frame in sent if isinstance(frame, frames.CommandFrame) and frame.left]
    output = flat(output)
    assert "link_lost" in output and "waits for `resume`" in output
    assert "link up" in output and "final stop confirmed" in output


def test_a_link_that_stays_disconnected_is_a_failure(tmp_path):
    with board() as virtual, SerialWire(virtual.radio, tmp_path / "rfcomm0") as wire:
        driver = start(*run(wire.name, *FAR, "--for", "6s"))
        wait_until(lambda: moving(virtual))
        wire.pull()
        output, _ = driver.communicate()
        assert virtual.board.duty == STILL
    assert "final stop NOT CONFIRMED" in output
    # Though nothing has come for long:
    assert re.search(r"ended time limit of 6 s reached, after 6\.\d s", output), output
    assert driver.returncode == 1


@pytest.mark.parametrize("port", by_day(1, ["usb", "radio"]))
def test_a_board_that_is_reset_in_motion_stays_stopped(port):
    """Over USB the bootloader starts first, and receives the host's frames."""
    with board() as virtual:
        driver = start(*run(getattr(virtual, port), *FAR))
        wait_until(lambda: moving(virtual))
        virtual.board.emulator.reset()
        wait_until(lambda: virtual.board.duty == STILL)
        went = virtual.board.plant.truth().pose.x
        output = _interrupted(driver, virtual)
        assert virtual.board.plant.truth().pose.x - went < 0.03
    output = flat(output)
    assert "waits for `resume`" in output
    assert "link up" in output and "final stop confirmed" in output
