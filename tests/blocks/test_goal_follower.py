"""The goal follower, apart from what whole runs show of it."""

from diffbotctl.config.load import load
from diffbotctl.messages import Goal, Odometry
from diffbotctl.runs.assembly import assemble

SECOND = 1_000_000_000


def at_rest(now):
    return Odometry(now, 0.0, 0.0, 0.0, 0.0, 0.0, (0.0,) * 6)


def test_number_zero_withdraws_the_goal_and_the_next_one_is_followed():
    follower = assemble(load("goal"), False).graph.block("follower")
    ahead = Goal(0, 1, 1.0, 0.0)
    says = []
    for number, goal in enumerate([ahead, Goal(1, 0), ahead._replace(time=2)]):
        for step in range(10):
            now = (10 * number + step) * SECOND // 50
            says.append(follower.react(now, at_rest(now), goal, None))
    assert any(twist.linear > 0 for twist, _ in says[:10])
    assert all((twist.linear, twist.angular) == (0, 0) for twist, _ in says[10:20])
    assert any(twist.linear > 0 for twist, _ in says[20:])
