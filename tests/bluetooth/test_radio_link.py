"""Driving over a radio link that is late, lossy and sometimes away: the real firmware behind it."""

import pytest

from prove import radio
from tests.radio import Radio
from tests.virtual_board import board, diffbotctl, flat, run, start, wait_until

STILL = [0.0, 0.0]


def words(link, *more):
    """A run over the radio, as fast as the robot goes."""
    return run(link.device, "--set", "robot.drive.polarity=by_hand", *more)


def test_a_goal_is_reached_over_a_late_and_lossy_link(tmp_path):
    with board() as virtual, Radio(virtual.radio, tmp_path / "radio") as link:
        code, said = diffbotctl(*words(link, "--goal", "0.5 0.2"))
        truth = virtual.board.plant.truth()
    assert code == 0, said
    assert "goals 1 of 1 reached" in said and "final stop confirmed" in said
    assert abs(truth.pose.x - 0.5) < 0.05 and abs(truth.pose.y - 0.2) < 0.05
    assert link.up.lost > 0  # it was lossy indeed


def released(said):
    """Whether `resume` has released the robot from something."""
    code, words = said
    return code == 0 and "released" in words


@pytest.mark.parametrize("how", ["away", "hung up"])
def test_after_an_outage_nothing_moves_until_a_person_consents(tmp_path, how):
    with board() as virtual, Radio(virtual.radio, tmp_path / "radio") as link:
        driver = start(*words(link, "--goal", "0.8 0", "--name", "radio"))
        wait_until(lambda: virtual.board.plant.truth().pose.x > 0.1)
        if how == "away":
            link.go_away(5.0)
        else:
            link.hang_up()
        wait_until(lambda: virtual.board.duty == STILL)  # the dead-man
        went = virtual.board.plant.truth().pose.x
        if how == "hung up":
            link.come_back()
        wait_until(lambda: released(diffbotctl("resume", "--engine", "radio")))
        said, _ = driver.communicate(timeout=90)
        arrived = virtual.board.plant.truth().pose
    assert driver.returncode == 0, said
    assert went < 0.4
    assert abs(arrived.x - 0.8) < 0.05 and abs(arrived.y) < 0.08
    assert "waits for `resume`" in flat(said)


def test_the_same_in_virtual_time():
    """No outage, out of reach, hung up: goals, and no stop for a silence of less than 100 ms."""
    for row in radio.rows(seed=5, trials=3):
        assert row.met, row.line()
