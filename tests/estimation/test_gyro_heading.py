"""When the heading comes from the gyro: it waits for a robot that stands."""

from diffbotctl.estimation.gyro_heading import SLID, UNUSED, WAITING_MAX_NS, GyroHeading
from diffbotctl.estimation.gyro_pose_filter import GyroPoseFilter
from diffbotctl.messages import Encoders
from diffbotctl.time import MILLISECOND, SECOND
from tests.estimation.test_gyro_pose_filter import SLIP, TRACK, Wheel

FRAME = 25 * MILLISECOND


class Bench:
    """A robot whose frames are given; its wheels travel 10 mm an edge."""

    def __init__(self):
        self.pose = GyroPoseFilter(TRACK, SLIP, (), 0.003, is_calibrated=True)
        self.heading = GyroHeading(self.pose, 1.0, has_fine_encoders=True)
        self.time = self.left = self.right = 0

    def run(self, seconds, left=0, right=0, command=0.0, rate=0.0):
        """Frames with these edges in each. `rate`: rad/s of the robot."""
        until = self.time + seconds * SECOND
        while self.time < until:
            self.time += FRAME
            self.left += left
            self.right += right
            turn = getattr(self, "turn", 0.0) + rate * FRAME / SECOND
            self.turn = turn
            wheels = Wheel(0.01 * left), Wheel(0.01 * right)
            frame = Encoders(
                self.time,
                self.left,
                self.right,
                None,
                None,
                command,
                command,
                "wheels",
                self.time,
                1,
            )._replace(turn=turn)
            self.heading.take(frame, wheels)
            self.pose.move(*wheels)
            self.heading.moved(frame, wheels)


def test_it_is_used_after_two_seconds_at_rest():
    bench = Bench()
    bench.run(0.5)
    assert bench.heading.awaits_rest and not bench.heading.is_used
    bench.run(1.8)
    assert bench.heading.is_used and not bench.heading.awaits_rest


def test_a_push_before_it_is_used_makes_it_wait_until_the_robot_stands_again():
    bench = Bench()
    bench.run(1.0)
    bench.run(0.3, 1, 1)
    bench.run(1.0)
    assert bench.heading.awaits_rest
    bench.run(1.5)
    assert bench.heading.is_used and not bench.heading.warning


def test_a_robot_that_never_stands_begins_without_it_and_warns():
    bench = Bench()
    for _ in range(WAITING_MAX_NS // SECOND - 1):
        bench.run(1.0, 1, 1)
    assert bench.heading.awaits_rest and not bench.heading.warning
    bench.run(2.0, 1, 1)
    assert not bench.heading.awaits_rest
    assert bench.heading.warning == UNUSED


def test_a_robot_that_trembles_begins_without_it_and_warns():
    bench = Bench()
    while bench.time < WAITING_MAX_NS - SECOND:
        bench.run(0.1, rate=0.02)
        bench.run(0.1, rate=-0.02)
    assert bench.heading.awaits_rest
    for _ in range(10):
        bench.run(0.1, rate=0.02)
        bench.run(0.1, rate=-0.02)
    assert not bench.heading.awaits_rest
    assert bench.heading.warning == UNUSED


def test_a_robot_that_is_driven_at_once_begins_without_it_and_warns():
    bench = Bench()
    bench.run(0.5)
    bench.run(0.5, 1, 1, command=5.0)
    assert not bench.heading.awaits_rest
    assert bench.heading.warning == UNUSED
    bench.run(2.5)
    assert bench.heading.is_used and not bench.heading.warning


def test_wheels_that_slide_are_reported_once_a_drive():
    bench = Bench()
    bench.run(2.5)
    bench.heading.news.clear()
    bench.run(1.0, 0, 1, command=5.0)
    assert [text for text in bench.heading.news if "slide" in text] == bench.heading.news[-1:]
    assert "the wheels slide on the floor, or the IMU" in bench.heading.news[-1]
    assert bench.heading.warning == SLID
