"""Driving over a radio link that is late, lossy and sometimes away: the real firmware behind it."""

import pytest

from prove import radio
from tests.radio import Radio
from tests.virtual_board import board, diffbotctl, flat, run, start, wait_until

STILL = [0.0, 0.0]
SECOND_OF_FRAMES = 40  # of telemetry


def drive(link, goal, name):
    """Start a run over the radio, as fast as the robot goes. Not the follower's to say that it is
    stuck: on a busy machine board and host stand still by turns, each for the other's dead-man."""
    sets = ("--set", "robot.drive.polarity=by_hand", "--set", "follower.stuck_after=30 s")
    return start(*run(link.device, *sets, "--goal", goal, "--name", name))


def resumed_to_its_end(driver, name):
    """What was said. Whatever waits for a person is let go on, also after a hiccup of this
    machine: who falls behind by a second is taken for lost."""
    while driver.poll() is None:
        diffbotctl("resume", "--engine", name)
    return driver.communicate()[0]


def test_a_goal_is_reached_over_a_late_and_lossy_link(tmp_path):
    with board() as virtual, Radio(virtual.radio, tmp_path / "radio") as link:
        driver = drive(link, "0.5 0.2", "lossy")
        said = resumed_to_its_end(driver, "lossy")
        truth = virtual.board.plant.truth()
    assert driver.returncode == 0, said
    assert "goals 1 of 1 reached" in said and "final stop confirmed" in said
    assert abs(truth.pose.x - 0.5) < 0.1 and abs(truth.pose.y - 0.2) < 0.1
    assert link.up.lost > 0  # it was lossy indeed


@pytest.mark.parametrize("how", ["away", "hung up"])
def test_after_an_outage_nothing_moves_until_a_person_consents(tmp_path, how):
    with board() as virtual, Radio(virtual.radio, tmp_path / "radio") as link:
        driver = drive(link, "0.8 0", how.replace(" ", "-"))
        wait_until(lambda: virtual.board.plant.truth().pose.x > 0.1)
        if how == "away":
            link.go_away(3.0)
        else:
            link.hang_up()
        wait_until(lambda: virtual.board.duty == STILL)  # the dead-man
        if how == "hung up":
            link.come_back()
        wait_until(lambda: still_at(virtual))
        before, place = len(link.passed), virtual.board.plant.truth().pose.x
        wait_until(lambda: len(link.passed) > before + 2 * SECOND_OF_FRAMES)
        assert virtual.board.plant.truth().pose.x == place
        said = resumed_to_its_end(driver, how.replace(" ", "-"))
        arrived = virtual.board.plant.truth().pose
    assert driver.returncode == 0, said
    assert place < 0.4
    assert abs(arrived.x - 0.8) < 0.1 and abs(arrived.y) < 0.15
    assert "waits for `resume`" in flat(said)


def still_at(virtual):
    """Whether it has rolled out."""
    truth = virtual.board.plant.truth()
    return truth.left_speed == truth.right_speed == 0.0


def test_the_same_in_virtual_time():
    """No outage, out of reach, hung up: goals, and no stop for a silence of less than 100 ms."""
    for row in radio.rows(seed=5, trials=3):
        assert row.met, row.line()
