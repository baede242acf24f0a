"""A person's velocity goes before the pipeline's own."""

import pytest

from diffbotctl.blocks.command_mux import CommandMux
from diffbotctl.messages import Twist

HAND = Twist(5, 0.1, 0.5)
OWN = Twist(7, 0.3, 0.0)


@pytest.mark.parametrize(
    "teleop, autonomous, result",
    [
        (None, None, None),
        (None, OWN, OWN),
        (HAND, None, Twist(9, 0.1, 0.5)),  # dated now: it is in force now
        (HAND, OWN, Twist(9, 0.1, 0.5)),
    ],
)
def test_who_is_heard(teleop, autonomous, result):
    assert CommandMux().react(9, teleop, autonomous) == result


def test_when_a_person_lets_go_the_robot_stands_before_it_goes_on():
    mux = CommandMux()
    mux.react(9, HAND, OWN)
    # The engine wakes the block when the person's command has outlived its time.
    assert mux.react(409, None, OWN) == Twist(409, 0.0, 0.0)
    assert mux.react(420, None, OWN._replace(time=420)) == Twist(420, 0.3, 0.0)


def test_letting_go_stands_also_without_a_pipeline_s_command():
    mux = CommandMux()
    mux.react(9, HAND, None)
    assert mux.react(409, None, None) == Twist(409, 0.0, 0.0)
    assert mux.react(430, None, None) is None
