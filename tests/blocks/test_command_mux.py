"""A manual command overrides the autonomous one."""

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
        (HAND, None, Twist(9, 0.1, 0.5)),  # stamped with the present time
        (HAND, OWN, Twist(9, 0.1, 0.5)),
    ],
)
def test_selection(teleop, autonomous, result):
    assert CommandMux().react(9, teleop, autonomous) == result


def test_after_manual_driving_the_robot_stops_until_a_new_command():
    mux = CommandMux()
    mux.react(9, HAND, OWN)
    # The engine triggers the block when the manual command expires.
    assert mux.react(409, None, OWN) == Twist(409, 0.0, 0.0)
    assert mux.react(420, None, OWN._replace(time=420)) == Twist(420, 0.3, 0.0)


def test_after_manual_driving_it_stops_without_an_autonomous_command():
    mux = CommandMux()
    mux.react(9, HAND, None)
    assert mux.react(409, None, None) == Twist(409, 0.0, 0.0)
    assert mux.react(430, None, None) is None
