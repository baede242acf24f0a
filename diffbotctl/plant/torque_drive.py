"""Two geared DC motors on one chassis, integrated in steps of a millisecond.

A plant of other equations than the exponential one, to find out what a block owes to those. The
torque of a motor whose driver opens between two pulses of the PWM (fast decay), in units of its
stall torque, is

    duty * (supply - speed / no-load speed)

While the driver is open no current brakes the wheel, so it settles at `no-load speed * (supply -
friction / duty)`, slowly at a low duty, and without drive only friction stops it. A driver that
shorts the motor between two pulses (slow decay) lets the current go on, and the speed is linear in
the duty:

    duty * supply - speed / no-load speed

Through a bipolar bridge the current of a shorted motor loses the threshold, and only the voltage
above it brakes; see `BridgeModel.mean_current`.

Friction is static, then falls to the sliding friction (Stribeck); the teeth cog; the wheels feel
each other through mass and inertia of the chassis, and both a caster that has to swivel when the
motion of the robot is reversed. The battery recovers from a load with two time constants. Torques
are shares of the stall torque, speeds rad/s, times ns unless stated.
"""

from __future__ import annotations

from collections import deque
from math import atan2, copysign, cos, exp, hypot, pi, sin
from random import Random
from typing import NamedTuple

from diffbotctl.plant.battery import RecoveringBattery
from diffbotctl.plant.drive_train import Edges
from diffbotctl.plant.encoder_disc import EncoderDisc
from diffbotctl.plant.encoder_wheel import EncoderWheel
from diffbotctl.plant.motor_bridge import IDEAL_BRIDGE, BridgeModel
from diffbotctl.plant.wheel import MotorModel
from diffbotctl.time import MILLISECOND, SECOND

STEP, STEP_S = MILLISECOND, 0.001
SLOW_STEPS = 4  # steps between two evaluations of battery and caster
LAG_DUTY = 0.6  # the duty at which the time constant of a motor is the stated lag
COG_CYCLES = 12  # per wheel turn
CREEP_SPEED = 0.005  # m/s; below it the drag of the caster fades


class TorqueMotor(NamedTuple):
    """The true parameters of one motor with its gear."""

    speed: float  # rad/s without friction at the full supply
    acceleration: float  # rad/s2 at the stall torque, both wheels together
    static: float  # friction at rest
    sliding: float  # friction in motion
    viscous: float  # torque at the no-load speed
    stribeck: float  # rad/s; speed at which most of the static friction is gone
    cog: float  # amplitude
    cog_phase: float  # rad


class Caster(NamedTuple):
    """A swivelling caster behind the axle."""

    x: float  # m, forward of the axle
    trail: float  # m
    drag: float  # of both wheels, straight on


class DriveSetup(NamedTuple):
    """What both motors share."""

    left_radius: float  # m
    right_radius: float  # m
    track: float  # m
    turning: float  # acceleration by opposite torques over that by equal ones
    dead_time: int  # steps from a duty to its torque
    caster: Caster
    bridge: BridgeModel = IDEAL_BRIDGE

    @property
    def own(self) -> float:
        """Acceleration of a wheel by its own torque, over that by equal torques on both."""
        return 0.5 * (1.0 + self.turning)

    @property
    def other(self) -> float:
        """Acceleration of a wheel by the other's torque, over that by equal torques on both."""
        return 0.5 * (1.0 - self.turning)


def draw_torque_motor(motor: MotorModel, rng: Random) -> TorqueMotor:
    """A motor with the full-duty speed, breakaway and keeping duty, and lag of `motor`."""
    viscous = rng.uniform(0.02, 0.10)
    speed = motor.speed * (1.0 + viscous) / max(1.0 - motor.keep, 0.1)
    return TorqueMotor(
        speed,
        speed / (motor.lag * LAG_DUTY),
        static=motor.start,
        sliding=motor.keep,
        viscous=viscous,
        stribeck=rng.uniform(0.02, 0.10) * speed,
        cog=motor.ripple * rng.uniform(0.5, 1.5),
        cog_phase=rng.uniform(0.0, 2 * pi),
    )


def draw_setup(radii: tuple[float, float], track: float, rng: Random) -> DriveSetup:
    """Inertia, dead time and caster."""
    caster = Caster(-rng.uniform(0.5, 0.9) * track, 0.02, rng.uniform(0.005, 0.03))
    return DriveSetup(*radii, track, rng.uniform(0.9, 1.6), rng.randint(2, 15), caster)


class TorqueWheel(EncoderWheel):
    """The state of one wheel. `TorqueDrive` moves it."""

    __slots__ = (
        "angle",
        "drag",
        "hand_speed",
        "hand_until",
        "motor",
        "now",
        "speed",
    )

    def __init__(
        self, motor: TorqueMotor, disc: EncoderDisc, rng: Random, falling: bool = False
    ) -> None:
        super().__init__(disc, rng, falling)
        self.motor = motor
        self.angle = self.speed = self.drag = 0.0
        self.now = self.hand_until = 0
        self.hand_speed = 0.0

    def turn_by_hand(self, angle: float, speed: float) -> int:
        """From now on a hand turns it by `angle` rad at `speed` rad/s. Returns its end, ns."""
        self.hand_until = self.now + round(abs(angle) / speed * SECOND)
        self.hand_speed = copysign(speed, angle)
        return self.hand_until

    def move(self, start: int, following: float) -> None:
        """Move by one step from `start`; the speed becomes `following`."""
        speed = self.speed
        if start < self.hand_until:
            speed = following = self.hand_speed
            if start + STEP >= self.hand_until:
                following = 0.0
        before = self.angle
        angle = before + 0.5 * (speed + following) * STEP_S
        self.speed, self.angle = following, angle
        if angle >= self._next_edge or angle < self._previous_edge:
            pace = STEP / (angle - before)  # the speed is constant within the step
            self._cross_edges(angle, lambda place: start + int((place - before) * pace))


def _stopped(wheel: TorqueWheel, acceleration: float, torque: float) -> float:
    """The speed after a step. Friction stops a wheel, it does not turn it back."""
    speed = wheel.speed
    following = speed + acceleration * STEP_S
    if following * speed < 0.0 and abs(torque) <= wheel.motor.static + wheel.drag:
        return 0.0
    return following


class TorqueDrive:
    """Both wheels, the battery and the caster, in steps that do not depend on the caller's."""

    def __init__(
        self, wheels: tuple[TorqueWheel, TorqueWheel], setup: DriveSetup, battery: RecoveringBattery
    ) -> None:
        self.wheels, self.setup, self._battery = wheels, setup, battery
        self._own, self._other = setup.own, setup.other
        self._shorted = (0.0, 0.0)  # share of the time without drive, each motor
        self._now = 0
        # Duties, and shares of the time for which the motors are shorted.
        self._torque_pulses: deque[tuple[float, float, float, float]] = deque(
            [(0.0, 0.0, 0.0, 0.0)] * setup.dead_time, maxlen=setup.dead_time + 1
        )
        self._duties = (0.0, 0.0)
        self._caster_angle = pi  # direction of the trail in base_link, rad
        self._loads = (0.0, 0.0)
        self._is_raised = False
        self._steps = 0
        self._rest_steps = 0  # since when nothing drives and nothing moves

    def advance(self, until: int, duties: tuple[float, float]) -> tuple[Edges, Edges]:
        """Let time pass; see `DriveTrain`. A step that `until` cuts is made by a later call."""
        left, right = self.wheels
        while self._now + STEP <= until:
            if self._is_at_rest(duties):
                skipped = (until - self._now) // STEP
                self._battery.load(0.0, skipped * STEP_S)
                self._now += skipped * STEP
            else:
                self._step(duties)
        left.now = right.now = self._now
        return left.take_edges(until), right.take_edges(until)

    def set_drag(self, left: float, right: float) -> None:
        """Add friction; see `DriveTrain`."""
        self.wheels[0].drag, self.wheels[1].drag = left, right

    def set_raised(self, is_raised: bool) -> None:
        """Raise the wheels off the ground, or put them down; see `DriveTrain`."""
        self._is_raised = is_raised

    @property
    def dead_time(self) -> int:
        """See `DriveTrain`."""
        return self.setup.dead_time * STEP

    def set_shorted(self, left: float, right: float) -> None:
        """Short the motors while they are not driven, or leave them open; see `DriveTrain`."""
        self._shorted = (left, right)

    def _is_at_rest(self, duties: tuple[float, float]) -> bool:
        left, right = self.wheels
        if duties != (0.0, 0.0) or left.speed or right.speed:
            self._rest_steps = 0
            return False
        if self._now < left.hand_until or self._now < right.hand_until:
            return False
        self._rest_steps += 1
        return self._rest_steps > self.setup.dead_time + 1

    def _step(self, duties: tuple[float, float]) -> None:
        left, right = self.wheels
        (left_duty, right_duty), (left_share, right_share) = duties, self._shorted
        left_short = (1.0 - abs(left_duty)) * left_share
        right_short = (1.0 - abs(right_duty)) * right_share
        self._torque_pulses.append((left_duty, right_duty, left_short, right_short))
        left_duty, right_duty, left_short, right_short = self._torque_pulses[0]
        if self._steps % SLOW_STEPS == 0:
            self._update_slow_parts((left_duty, left_short), (right_duty, right_short))
        self._steps += 1
        start, loads = self._now, self._loads
        left_torque, left_net = self._torques(left, left_duty, loads[0], left_short)
        right_torque, right_net = self._torques(right, right_duty, loads[1], right_short)
        own, other = self._own, self._other
        # A wheel that friction holds feels no torque from the other one.
        if left.speed or left_net:
            change = left.motor.acceleration * (own * left_net + other * right_net)
            left.move(start, _stopped(left, change, left_torque))
        elif start < left.hand_until:
            left.move(start, 0.0)
        if right.speed or right_net:
            change = right.motor.acceleration * (own * right_net + other * left_net)
            right.move(start, _stopped(right, change, right_torque))
        elif start < right.hand_until:
            right.move(start, 0.0)
        self._now = start + STEP

    def _torques(
        self, wheel: TorqueWheel, duty: float, load: float, shorted: float
    ) -> tuple[float, float]:
        """The torque on a wheel without friction, and with it."""
        motor, speed = wheel.motor, wheel.speed
        size, sign = (duty, 1.0) if duty >= 0.0 else (-duty, -1.0)
        back, supply = speed / motor.speed, self._battery.motor_share
        current = self.setup.bridge.mean_current(size, supply, sign * back, shorted)
        torque = sign * current + load - motor.viscous * back
        if motor.cog and size:
            torque += motor.cog * size * sin(COG_CYCLES * wheel.angle + motor.cog_phase)
        if speed == 0.0:
            static = motor.static + wheel.drag
            if -static <= torque <= static:
                return torque, 0.0
            return torque, torque - copysign(static, torque)
        ratio = speed / motor.stribeck
        force = motor.sliding + wheel.drag
        if -3.0 < ratio < 3.0:
            force += (motor.static - motor.sliding) * exp(-ratio * ratio)
        return torque, torque - force if speed > 0.0 else torque + force

    def _update_slow_parts(
        self, left_pulse: tuple[float, float], right_pulse: tuple[float, float]
    ) -> None:
        """Load the battery, which only the pulses do, and swivel the caster."""
        left, right = self.wheels
        current = 0.0
        for wheel, (duty, shorted) in ((left, left_pulse), (right, right_pulse)):
            if duty:
                back = copysign(wheel.speed / wheel.motor.speed, wheel.speed * duty)
                supply = self._battery.motor_share * abs(duty) / (abs(duty) + shorted)
                current += abs(duty) * max(supply - back, 0.0)
        self._battery.load(0.5 * current, SLOW_STEPS * STEP_S)
        self._update_caster(
            left.speed * self.setup.left_radius, right.speed * self.setup.right_radius
        )

    def _update_caster(self, left: float, right: float) -> None:
        """Swivel the caster, and spread its drag over the wheels. Speeds in m/s."""
        caster, track = self.setup.caster, self.setup.track
        forward, turn = 0.5 * (left + right), (right - left) / track
        sideways = turn * caster.x
        speed = hypot(forward, sideways)
        if speed == 0.0 or self._is_raised:
            self._loads = (0.0, 0.0)
            return
        direction = atan2(sideways, forward)
        # The trail tends to point against the motion, within a few lengths of itself.
        misalignment = direction + pi - self._caster_angle
        self._caster_angle += sin(misalignment) * min(
            speed / caster.trail * SLOW_STEPS * STEP_S, 1.0
        )
        fade = min(speed / CREEP_SPEED, 1.0)
        drag = caster.drag * fade * (2.0 - cos(misalignment))
        side = caster.drag * fade * sin(misalignment)
        force_x = -drag * cos(direction) - side * sin(direction)
        force_y = -drag * sin(direction) + side * cos(direction)
        moment = caster.x * force_y / track
        self._loads = (0.5 * force_x - moment, 0.5 * force_x + moment)
