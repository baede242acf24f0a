"""A simple controller that knows the true pose: it decides which goals are feasible.

It shares nothing with the follower, the odometry and the board's loops: it sets the duties of the
motors itself, one frame late, from the true speeds of the wheels.
"""

from __future__ import annotations

from collections import deque
from math import atan2, copysign, cos, hypot, pi, sin, sqrt
from typing import Literal

from diffbotctl.config.robot import Robot
from diffbotctl.messages import Goal
from diffbotctl.plant.chassis import Pose
from diffbotctl.plant.simulated_robot import PlantTruth, SimulatedRobot
from diffbotctl.time import MILLISECOND, SECOND

PERIOD, PERIOD_S = 20 * MILLISECOND, 0.02
DELAY_PERIODS = 2  # from the truth to the motors
REST_S = 0.2  # without motion, after which the robot rests
GAIN = 0.4  # of the duty, for a speed error of the rated speed
INTEGRAL = 2.0  # 1/s, likewise
COAST_GAIN = 0.5  # share of a stop's error by which the coast time is corrected
HEADING_GAIN = 3.0  # 1/s
SPEED_MIN_RATIO = 0.15  # of the limit
STEERING_RATIO_MAX = 0.4  # of the speed

Leg = Literal["turning", "driving", "aligning"]


class WheelDuty:
    """Duty of one wheel from its true speed: a proportional and an integral part."""

    def __init__(self, rated: float) -> None:
        self._rated, self._integral, self._sign = rated, 0.0, 0.0

    def update(self, target: float, speed: float) -> float:
        """Duty for a target (rad/s, 0: free) at a true speed."""
        sign = copysign(1.0, target) if target else 0.0
        if sign != self._sign:
            self._sign, self._integral = sign, 0.0
        if not sign:
            return 0.0
        error = (target - speed) / self._rated
        duty = self._integral + GAIN * error
        if abs(duty) < 1.0 or duty * error < 0.0:
            self._integral += INTEGRAL * error * PERIOD_S
        return min(max(duty, -1.0), 1.0)


class TruePoseController:
    """Turns to the goal, drives and aligns, each to rest, until the pose is within tolerance."""

    def __init__(self, robot: Robot, goal: Goal, tolerances: tuple[float, float]) -> None:
        """`tolerances` of the position (m) and the heading (rad)."""
        drive, limits = robot.drive, robot.limits
        self._goal, self._limits, self._track = goal, limits, drive.track
        self._radii = (drive.left.wheel.diameter / 2, drive.right.wheel.diameter / 2)
        self._position, self._heading = tolerances
        self._wheels = (WheelDuty(drive.left.motor.rated), WheelDuty(drive.right.motor.rated))
        self._coast = drive.left.motor.lag + DELAY_PERIODS * PERIOD_S  # s
        self._leg: Leg = "turning"
        self._is_backward = self._is_released = False
        self._released_speed = 0.0  # m/s, with the sign of the remaining way
        self._still = 0.0  # s
        self._speed_ratio = 1.0  # of the limits that the weaker motor reaches
        self._waiting: deque[tuple[float, float]] = deque([(0.0, 0.0)] * DELAY_PERIODS)

    def run(self, plant: SimulatedRobot, until: int) -> float | None:
        """Drive `plant` until the goal is reached, or `until` (ns). Returns the seconds it took."""
        for wheel in plant.wheels:
            wheel.stop_counting()
        while plant.now < until:
            self._waiting.append(self._duties(plant.truth()))
            duties = self._waiting.popleft()
            plant.advance_with_duties(plant.now + PERIOD, *duties)
            truth = plant.truth()
            moves = abs(truth.left_speed) + abs(truth.right_speed) > 0.01
            self._still = 0.0 if moves else self._still + PERIOD_S
            if (
                self._still >= REST_S
                and not any(self._waiting[-1])
                and self._is_at_goal(truth.pose)
            ):
                return plant.now / SECOND
        return None

    def _is_at_goal(self, pose: Pose) -> bool:
        return (
            self._distance(pose) <= self._position and abs(self._last_turn(pose)) <= self._heading
        )

    def _distance(self, pose: Pose) -> float:
        return hypot(self._goal.x - pose.x, self._goal.y - pose.y)

    def _last_turn(self, pose: Pose) -> float:
        heading = self._goal.heading
        return 0.0 if heading is None else _wrap(heading - pose.heading)

    def _bearing(self, pose: Pose) -> float:
        """Angle to turn until the goal is ahead, or behind on a short way back."""
        bearing = _wrap(atan2(self._goal.y - pose.y, self._goal.x - pose.x) - pose.heading)
        return _wrap(bearing + pi) if self._is_backward else bearing

    def _ahead(self, pose: Pose) -> float:
        """Way (m) until the robot is beside the goal, in the direction of the drive."""
        x, y = self._goal.x - pose.x, self._goal.y - pose.y
        ahead = x * cos(pose.heading) + y * sin(pose.heading)
        return -ahead if self._is_backward else ahead

    def _remaining(self, pose: Pose) -> float:
        """Way of the wheels to the end of the leg, m."""
        if self._leg == "driving":
            return self._ahead(pose)
        turn = self._bearing(pose) if self._leg == "turning" else self._last_turn(pose)
        return turn * self._track / 2

    def _duties(self, truth: PlantTruth) -> tuple[float, float]:
        pose = truth.pose
        rim = (truth.left_speed * self._radii[0], truth.right_speed * self._radii[1])
        if self._is_released:
            if self._still >= REST_S:
                self._learn(pose)
                self._choose_leg(pose)
            return self._drive(truth, 0.0, 0.0)
        remaining = self._remaining(pose)
        if self._leg == "driving":
            speed = 0.5 * (rim[0] + rim[1]) * (-1.0 if self._is_backward else 1.0)
        else:
            speed = 0.5 * (rim[1] - rim[0])
        toward = copysign(1.0, remaining)
        is_done = abs(remaining) <= max(speed * toward, 0.0) * self._coast
        if is_done or self._is_fine(remaining, speed):
            self._is_released, self._released_speed, self._still = True, speed, 0.0
            return self._drive(truth, 0.0, 0.0)
        limit = self._limits.speed
        if self._leg != "driving":
            limit = min(limit, 0.5 * self._limits.turn_rate * self._track)
        target = toward * self._profile(abs(remaining), limit)
        if self._leg != "driving":
            return self._turn(truth, target, rim)
        sign = -1.0 if self._is_backward else 1.0
        steer = HEADING_GAIN * self._bearing(pose) * self._track / 2
        if abs(remaining) < 4.0 * self._position:
            steer = 0.0
        most = STEERING_RATIO_MAX * abs(target)
        steer = min(max(steer, -most), most)
        return self._drive(truth, sign * target - steer, sign * target + steer)

    def _turn(
        self, truth: PlantTruth, target: float, rim: tuple[float, float]
    ) -> tuple[float, float]:
        """Duties for a turn at a rim speed in m/s, on the spot.

        Neither wheel runs ahead of one that starts later, and in the last turn the goal is held.
        """
        slowest = SPEED_MIN_RATIO * abs(target)
        left = -copysign(min(abs(target), abs(rim[1]) + slowest), target)
        right = copysign(min(abs(target), abs(rim[0]) + slowest), target)
        if self._leg == "aligning":
            pose = truth.pose
            x, y = self._goal.x - pose.x, self._goal.y - pose.y
            ahead = x * cos(pose.heading) + y * sin(pose.heading)
            most = STEERING_RATIO_MAX * abs(target)
            shift = min(max(HEADING_GAIN * ahead, -most), most)
            left, right = left + shift, right + shift
        return self._drive(truth, left, right)

    def _is_fine(self, remaining: float, speed: float) -> bool:
        """Whether a leg at rest need not begin."""
        if abs(speed) > 0.005 or self._still < REST_S:
            return False
        share = 0.5 * self._position
        if self._leg == "driving":
            return abs(remaining) <= share
        if self._leg == "aligning":
            return abs(remaining) <= 0.4 * self._heading * self._track
        return abs(remaining) <= 0.25 * self._track * self._heading

    def _profile(self, remaining: float, limit: float) -> float:
        """Speed (m/s) from which half the braking stops in time."""
        braking, lag = 0.5 * self._limits.braking, self._coast
        speed = braking * (sqrt(lag * lag + 2.0 * remaining / braking) - lag)
        slowest = SPEED_MIN_RATIO * limit
        # A short way is driven in several small pushes.
        slowest = min(slowest, max(remaining / self._coast, 0.3 * slowest))
        return min(max(speed, slowest), limit * self._speed_ratio)

    def _drive(self, truth: PlantTruth, left: float, right: float) -> tuple[float, float]:
        """Duties for rim speeds in m/s."""
        speeds = (truth.left_speed, truth.right_speed)
        targets = (left / self._radii[0], right / self._radii[1])
        duties = [
            wheel.update(target, speed)
            for wheel, target, speed in zip(self._wheels, targets, speeds, strict=True)
        ]
        for duty, target, speed in zip(duties, targets, speeds, strict=True):
            if abs(duty) >= 1.0 and abs(speed) < 0.8 * abs(target):
                self._speed_ratio = max(0.99 * self._speed_ratio, 0.05)
        return duties[0], duties[1]

    def _learn(self, pose: Pose) -> None:
        """Correct the coast time by the way that the last stop was short of its end."""
        speed = self._released_speed
        if abs(speed) > 0.02 * self._limits.speed:
            error = self._remaining(pose) * copysign(1.0, speed) / abs(speed)
            self._coast = min(max(self._coast - COAST_GAIN * error, 0.02), 2.0)

    def _choose_leg(self, pose: Pose) -> None:
        """The leg after a stop."""
        self._is_released, self._still = False, REST_S
        if self._distance(pose) <= 0.8 * self._position:
            self._leg = "aligning"
            return
        x, y = self._goal.x - pose.x, self._goal.y - pose.y
        ahead = x * cos(pose.heading) + y * sin(pose.heading)
        self._is_backward = ahead < 0.0 and self._distance(pose) < 10.0 * self._position
        seen = min(0.5 * self._position / self._distance(pose), 0.5)
        is_aimed = abs(self._bearing(pose)) <= max(seen, 0.5 * self._heading)
        self._leg = "driving" if is_aimed else "turning"


def _wrap(angle: float) -> float:
    return (angle + pi) % (2.0 * pi) - pi
