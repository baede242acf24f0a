"""Driving over a radio link that is late, lossy and sometimes away: the real firmware behind it.

In real time what goes through sockets is looked at: it drives, it stops, it waits, it drives again.
How well it drives is judged in virtual time, where a busy machine is no second outage.
"""

import os
import signal
from contextlib import contextmanager

import pytest

from tests.support.radio_module import RadioModule
from tests.support.trials import radio
from tests.support.virtual_board import board, diffbotctl, flat, run, start, wait_until

STILL = [0.0, 0.0]
FRAMES = 80  # two seconds of telemetry


@contextmanager
def driving(link, name):
    """A run over the radio, as fast as the robot goes, that ends with the block. It is not the
    follower's to say that the robot is stuck: a busy machine lets it stand now and then."""
    sets = ("--set", "robot.drive.polarity=checked_by_hand", "--set", "follower.stuck_after=60 s")
    driver = start(*run(link.device, *sets, "--goal", "30 0", "--name", name))
    try:
        yield driver
    finally:
        driver.kill()
        driver.wait()
        driver.stdout.close()


def ended(driver):
    """The output until Ctrl-C."""
    driver.send_signal(signal.SIGINT)
    output, _ = driver.communicate(timeout=60)
    return flat(output)


def travel(virtual):
    """Actual distance of the middle of the axle, in m."""
    return virtual.board.plant.truth().travel


def goes(virtual, name, metres):
    """Whether it has gone so far; a person lets it go on, also when this machine fell behind by a
    second, which passes for a lost link."""
    diffbotctl("resume", "--engine", name)
    return travel(virtual) > metres


def still(virtual):
    """Whether it has rolled out."""
    truth = virtual.board.plant.truth()
    return truth.left_speed == truth.right_speed == 0.0


def test_it_drives_over_a_late_and_lossy_link(tmp_path):
    name = f"lossy{os.getpid()}"
    with (
        board() as virtual,
        RadioModule(virtual.radio, tmp_path / "radio", loss=0.05) as link,
        driving(link, name) as driver,
    ):
        wait_until(lambda: goes(virtual, name, 0.2))
        output = ended(driver)
        assert virtual.board.duty == STILL
    assert "final stop" in output
    assert link.up.lost > 0  # it was lossy indeed


@pytest.mark.parametrize("how", ["away", "hung up"])
def test_after_an_outage_nothing_moves_until_the_user_resumes(tmp_path, how):
    name = f"{how.replace(' ', '-')}{os.getpid()}"
    with (
        board() as virtual,
        RadioModule(virtual.radio, tmp_path / "radio") as link,
        driving(link, name) as driver,
    ):
        wait_until(lambda: goes(virtual, name, 0.1))
        if how == "away":
            link.go_away(3.0)
        else:
            link.hang_up()
        wait_until(lambda: virtual.board.duty == STILL)  # the dead-man
        if how == "hung up":
            link.come_back()
        wait_until(lambda: still(virtual))
        before, gone = len(link.passed), travel(virtual)
        wait_until(lambda: len(link.passed) > before + FRAMES)
        assert travel(virtual) == gone
        wait_until(lambda: goes(virtual, name, gone + 0.05))
        output = ended(driver)
        assert virtual.board.duty == STILL
    assert "waits for `resume`" in output and "final stop" in output


def test_the_figures_in_virtual_time():
    """No outage, out of reach, hung up: goals, and no stop for a silence of less than 100 ms."""
    for row in radio.rows(seed=5, trials=3):
        assert row.met, row
