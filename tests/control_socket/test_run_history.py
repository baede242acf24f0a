"""What the server keeps of the past: two minutes of numbers, and the way of the robot."""

from math import inf, nan
from typing import NamedTuple

from diffbotctl.control_socket.run_state import (
    HISTORY_SAMPLES,
    REPLY_MAX_VALUES,
    TRAIL_MAX_POINTS,
    RunHistory,
    TopicHistory,
)
from diffbotctl.messages import Goal, LogLine, Odometry, Range
from diffbotctl.time import MILLISECOND

CERTAIN = (0.0,) * 6


def odometry(time, x=0.0):
    return Odometry(time, x, 0.0, 0.0, 0.1, 0.0, CERTAIN)


def test_a_sample_is_taken_five_times_a_second_and_two_minutes_are_kept():
    history = RunHistory({"odometry.odometry": Odometry, "log": LogLine})
    for step in range(200 * 40):  # 200 s at 40 Hz
        now = step * 25 * MILLISECOND
        history.sample(now, {"odometry.odometry": odometry(now, step * 0.001)})
    reply = history.topics["odometry.odometry"].reply()
    assert len(reply["times"]) == HISTORY_SAMPLES
    assert reply["times"][-1] == 199.8 and reply["times"][0] == 80.0
    assert reply["fields"]["x"][-1] == 7.992 and reply["fields"]["linear"][-1] == 0.1
    assert "covariance" not in reply["fields"]
    assert reply["trail"][:3] == [[0.0, 0.0], [0.024, 0.0], [0.048, 0.0]]  # samples 8 mm apart
    assert reply["trail"][-1] == [7.992, 0.0]
    assert history.topics["log"].reply() == {"times": [], "fields": {}, "trail": []}


def test_a_topic_that_is_silent_is_not_sampled_again():
    history = RunHistory({"operator.goal": Goal})
    for step in range(10):
        history.sample(step * 1000 * MILLISECOND, {"operator.goal": Goal(7, 1, 0.5, 0.5, None)})
    reply = history.topics["operator.goal"].reply()
    assert reply["times"] == [0.0] and reply["fields"]["heading"] == [None]


class Odd(NamedTuple):
    """A message of another package."""

    time: int
    count: int
    flag: bool
    text: str


def test_what_is_no_finite_number_is_null():
    ranges = TopicHistory(Range)
    for time, distance in enumerate((0.25, inf, nan)):
        ranges.add(Range(time, distance, "clear"))
    assert ranges.reply()["fields"] == {"distance": [0.25, None, None]}
    odd = TopicHistory(Odd)
    odd.add(Odd(1, 10**400, True, "x"))
    assert odd.reply()["fields"] == {"count": [None], "flag": [1.0]}


def test_the_trail_and_the_reply_are_bounded():
    history = TopicHistory(Odometry)
    for step in range(3 * TRAIL_MAX_POINTS):
        history.add(odometry(step, step * 0.03))
    assert len(history.reply()["trail"]) == TRAIL_MAX_POINTS
    names = [f"f{number}" for number in range(200)]
    wide = TopicHistory(NamedTuple("Wide", [("time", int), *((name, float) for name in names)]))
    for time in range(HISTORY_SAMPLES):
        wide.add(WideMessage(time, names))
    reply = wide.reply()
    assert len(reply["times"]) * len(names) <= REPLY_MAX_VALUES
    assert all(len(values) == len(reply["times"]) for values in reply["fields"].values())


class WideMessage:
    """A message with many fields."""

    def __init__(self, time, names):
        self.time = time
        for name in names:
            setattr(self, name, 0.5)
