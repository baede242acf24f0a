"""A whole simulated robot: wheels, chassis, sensors, a board and its link, in virtual time."""

from collections import deque
from collections.abc import Callable, Sequence
from math import copysign, cos, pi, sin
from random import Random
from typing import NamedTuple

from diffbotctl.config.robot import Robot
from diffbotctl.config.simulation import Simulation
from diffbotctl.links.diffbot_frames import FLAG_GYRO_GRAVITY, REPORTED_DUTY_ONE
from diffbotctl.links.diffbot_states import GYRO_CAUSES
from diffbotctl.messages import Battery, Duty, Encoders, Message, Odometry, Volts, Wheels
from diffbotctl.plant.battery import read_analog
from diffbotctl.plant.chassis import Pose
from diffbotctl.plant.components import draw_components
from diffbotctl.plant.drive_train import Wheel
from diffbotctl.plant.encoder_disc import LevelChange
from diffbotctl.plant.faults import Fault, FaultSchedule
from diffbotctl.plant.gyro import SimulatedGyro
from diffbotctl.plant.imu_mounting import UP
from diffbotctl.plant.motor_bridge import BridgeHeat
from diffbotctl.plant.own_plant import OwnDrive
from diffbotctl.plant.robot_parameters import PlantParameters, board_kind, plant_parameters
from diffbotctl.plant.simulated_board import BOARD_MODELS, JITTER_MAX_SD, BoardKind, SimulatedBoard
from diffbotctl.plant.wiring import PlantWiring
from diffbotctl.plant.world import Pillar, World
from diffbotctl.time import SECOND

NO_COVARIANCE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # of a pose that is known exactly
BATTERY_PERIOD = 2_000_000_000  # ns between two battery messages
CAPTURE_RESOLUTION = 64_000  # ns, of the board's times of captured edges
OBSTACLE_RADIUS = 0.1  # m, of one that appears
ROLL_PERIOD = 20_000_000  # ns between two arcs of the chassis: 6 mm at 0.3 m/s, 0.08 rad at 4 rad/s


class CapturedEdge(NamedTuple):
    """A change of an encoder's pin."""

    time: int  # ns
    side: int  # 0 left, 1 right: of the board that captured it, or of the socket it is plugged into
    level: int  # 0 or 1, after the change
    channel: int = 0  # 0 A, 1 B


class PlantTruth(NamedTuple):
    """The true state of the plant: for tests and the summary only, never for a block."""

    time: int  # ns
    pose: Pose
    left_angle: float  # rad
    right_angle: float
    left_speed: float  # rad/s
    right_speed: float
    travel: float  # m, length of the path
    turned: float  # rad, sum of all turning


class SimulatedRobot:
    """A robot drawn from its truth by a seeded generator, driven in virtual time.

    `due` is when it next has a message; `advance` lets time pass; `deliver` returns the messages
    that have arrived by then; `command` is what the host sends, at a time not after the last
    `advance`.
    """

    def __init__(
        self,
        kind: BoardKind,
        parameters: PlantParameters,
        simulation: Simulation,
        rng: Random,
        world: World | None = None,
        start: Pose | None = None,
    ) -> None:
        """`kind` of the board. `start`: pose of `odom` in the world."""
        model = BOARD_MODELS[kind]
        if parameters.period is not None:
            model = model._replace(period=parameters.period)
        self._model, self._rng, self.simulation = model, rng, simulation
        self.parameters = parameters
        self.now = 0
        self._start = start or _start_pose(simulation)
        components = draw_components(parameters, simulation, rng, world or World())
        self.motors, self.discs = components.motors, components.discs
        self.chassis, self.drive = components.chassis, components.drive
        self._sensors, self._cameras = components.sensors, components.cameras
        self._board_rng = components.board_rng
        # A generator of its own: a robot is the same with and without an IMU.
        self.gyro = None if parameters.gyro_axes is None else _draw_gyro(simulation, rng)
        self._battery = components.battery
        self.faults = _draw_faults(simulation, rng)
        self._built_world, self._appeared = self._sensors.world, dict[Fault, Pillar]()
        self._pushed_at = 0  # ns
        self.button_pressed = False
        self.board = self._new_board(0)
        if not parameters.has_encoders:
            for wheel in self.wheels:
                wheel.stop_counting()
        self._wiring = PlantWiring(simulation.wiring, parameters, rng)
        self._motor_duties = (0.0, 0.0)
        self._output_duties = (0.0, 0.0)  # of the board, whichever it is
        self._bridge_heat = BridgeHeat(parameters.bridge)
        self._heated_at = 0
        self._shorted = (0.0, 0.0)  # share of the time without drive, each output
        self._is_capturing = False
        # what the board has captured, until it is taken
        self.captured_edges: list[CapturedEdge] = []
        self._next_battery = 0
        self._next_roll = ROLL_PERIOD
        self._next_frame = model.period
        self._shown_side = 1  # whose level was in the last frame: 0 left, 1 right
        self._arriving: deque[tuple[int, str, Message]] = deque()
        self._late: deque[tuple[int, str, Message]] = deque()

    @property
    def world(self) -> World:
        """The obstacles around it now."""
        return self._sensors.world.at(self.now / SECOND)

    @property
    def has_contact(self) -> bool:
        """Whether a plant of one's own reports contact; the shipped ones drive through walls."""
        return isinstance(self.drive, OwnDrive) and self.drive.last.has_contact

    @property
    def wheels(self) -> Sequence[Wheel]:
        """The left and the right wheel."""
        return self.drive.wheels

    def restart_board(self, parameters: PlantParameters) -> None:
        """Restart the board with other settings; of `parameters` only those of the board count."""
        self._turn_wheels(self.now)
        self.parameters = parameters
        self.board = self._new_board(self.board.boot + 1)
        self.board.press(self.now, self.button_pressed)
        self._wiring.set_board(parameters)
        self._arriving.clear()
        self._update_motor_duties()

    def turn_by_hand(self, wheel: int, angle: float, speed: float) -> int:
        """A hand turns a wheel (0 left, 1 right) by `angle` rad from now on, at `speed` rad/s.

        Returns when it will be done, ns.
        """
        self._turn_wheels(self.now)
        return self.wheels[wheel].turn_by_hand(angle, speed)

    def sharp_curves(self) -> dict[str, Callable[[float], float]]:
        """The voltage of each Sharp sensor at a distance (m), without noise."""
        return self._sensors.sharp_curves()

    def raise_wheels(self, is_raised: bool) -> None:
        """Put a box under the chassis, so that the wheels turn freely, or take it away."""
        self._turn_wheels(self.now)
        self.drive.set_raised(is_raised)

    def lift_by_hand(self, front: float, left: float, seconds: float) -> None:
        """A hand lifts front and left side to angles (rad), 0 on the floor, in `seconds` from now.

        The wheels do not turn; only the gyro notices.
        """
        if self.gyro is not None:
            self.gyro.lift(self.now, front, left, seconds)

    def due(self) -> int:
        """When the next message arrives at the host, as far as it is known; never in the past."""
        if self._arriving:
            return max(self.now, self._arriving[0][0])
        return self._next_frame + self._model.frame_delay

    def advance(self, until: int) -> None:
        """Let time pass until `until`."""
        if until <= self.now:
            return
        board, sensors, faults = self.board, self._sensors, self.faults
        rare = min(sensors.next_sharp, sensors.next_scan, sensors.next_turn, faults.due)
        while True:
            at = min(self._next_roll, self._next_frame, board.due, rare)
            if at > until:
                break
            self._turn_wheels(at)
            if at == faults.due:
                self._begin_and_end_faults(at)
            if at == board.due:
                board.serve(at)
                self._update_motor_duties()
            if at == self._next_roll:
                self._next_roll += ROLL_PERIOD
                self._roll(at)
                self._heat_bridge(at)
            if at == rare:
                if at == sensors.next_sharp:
                    self._measure(at)
                if at == sensors.next_scan:
                    self._scan(at)
                if at == sensors.next_turn:
                    self._measure_in_turn(at)
                rare = min(sensors.next_sharp, sensors.next_scan, sensors.next_turn, faults.due)
            if at == self._next_frame:
                self._next_frame += self._model.period
                self._send_frame(at)
        # Nothing on the board changes before the next of these times, so the wheels can wait.
        self.now = until

    def deliver(self) -> list[tuple[str, Message]]:
        """(port, message) of what has arrived at the host by now, in order."""
        arrived = []
        while self._late and self._late[0][0] <= self.now:
            _, port, message = self._late.popleft()
            arrived.append((port, message))
        while self._arriving and self._arriving[0][0] <= self.now:
            _, port, message = self._arriving.popleft()
            arrived.append((port, message))
        return arrived

    def command(self, now: int, command: Wheels | Duty) -> None:
        """The host sends `command` at `now`. Raises TypeError where the board takes the other."""
        if not self.faults.loses():
            self.board.command(now + self.faults.delay(), command)

    def capture(self, on: bool) -> None:
        """Start or stop collecting all changes of the encoders' pins in `captured_edges`."""
        self._turn_wheels(self.now)
        self._is_capturing = on
        for wheel in self.wheels:
            wheel.watch(on)

    def encoder_levels(self) -> list[CapturedEdge]:
        """The levels of the encoders' pins now."""
        wiring = self._wiring
        return [
            CapturedEdge(
                self.now,
                wiring.socket(number),
                level,
                wiring.channel(number, channel),
            )
            for number in range(2)
            for channel, level in enumerate(self._pin_levels(number))
        ]

    def advance_with_duties(
        self, until: int, left: float, right: float, shorted: tuple[float, float] | None = None
    ) -> list[CapturedEdge]:
        """Let time pass for everything but the board, whose outputs are `left`, `right` (duty).

        `shorted`: share of a pulse for which each output shorts its motor; None: as our firmware
        and the driver of the robot file do.
        Returns the changes of the encoders' pins, in order: `capture` must be on. For a board that
        is not simulated here; not to be mixed with `advance`.
        """
        if self.now >= self.faults.due:
            self._begin_and_end_faults(self.now)
        if shorted is None:
            self._short_between(left, right)
        else:
            shares = zip(shorted, (left, right), strict=True)
            a, b = (share / (1.0 - abs(duty)) if share else 0.0 for share, duty in shares)
            self._set_shorted(a, b)
        self._motor_duties = self._duties_of(left, right)
        if self.now - self._heated_at >= ROLL_PERIOD:
            self._heat_bridge(self.now)
        changes: list[CapturedEdge] = []
        self.drive.advance(until, self._motor_duties)
        for number in range(2):
            socket = self._wiring.socket(number)
            changes += [
                CapturedEdge(time, socket, level, self._wiring.channel(number, channel))
                for channel, channel_changes in enumerate(
                    (self._level_changes(number, until), self.wheels[number].changes_b(until))
                )
                for time, level in channel_changes
            ]
        self._roll()
        if until >= self._sensors.next_sharp:
            self._measure(until)
        if until >= self._sensors.next_scan:
            self._scan(until)
        self.now = until
        return sorted(changes)

    def sensor_volts(self) -> dict[str, float]:
        """The distance sensors' output voltages now."""
        return self._sensors.volts(self.now)

    def echo_us(self, name: str) -> int:
        """Length of the echo of an HC-SR04 now, in us, as the emulator takes it."""
        return self._sensors.echo_us(name, self.pose_in_world())

    def battery_voltage(self) -> float:
        """The battery's voltage now, in V."""
        loads = (0.0, 0.0) if self._bridge_heat.is_off else self._output_duties
        return self._battery.voltage(*loads)

    def battery_pin_voltage(self) -> float:
        """The battery's voltage behind its divider, at the board's pin, in V."""
        return self._battery.pin_voltage(self.battery_voltage(), self.parameters.built_divider)

    def teleport(self, x: float, y: float, heading: float) -> None:
        """Put the robot elsewhere in the world (m, rad); its wheels do not turn."""
        self._update_pose()
        self._set_pose_in_world(Pose(*self._sensors.world.kept(x, y), heading))

    def home(self) -> None:
        """Put the robot back to where the run began."""
        self.teleport(*self._start)

    def put_before(self, name: str, distance: float) -> None:
        """Put a wide board across a sensor's axis, `distance` (m) from it; take all else away."""
        self._update_pose()
        self._sensors.put_before(name, distance, self.now, self.pose_in_world())

    def pose_in_world(self) -> Pose:
        """Pose in the world, as of the last step of the chassis."""
        return self._start.to_parent(self.chassis.pose)

    def truth_in_world(self) -> Pose:
        """True pose in the world now."""
        self._update_pose()
        return self.pose_in_world()

    def truth(self) -> PlantTruth:
        """True state now, the pose in the frame `odom`."""
        self._update_pose()
        left, right = self.wheels
        return PlantTruth(
            self.now,
            self.chassis.pose,
            left.angle,
            right.angle,
            left.speed,
            right.speed,
            self.chassis.travel,
            self.chassis.turned,
        )

    def _new_board(self, boot: int) -> SimulatedBoard:
        parameters = self.parameters
        return SimulatedBoard(
            self._model,
            parameters.gains,
            parameters.counts,
            parameters.lag,
            parameters.glitch,
            parameters.deadman,
            self._board_rng,
            boot,
            self.now,
            parameters.has_encoders,
        )

    def _turn_wheels(self, until: int) -> None:
        """Turn the wheels until `until`; the board counts their edges, the chassis stays."""
        left, right = self.drive.advance(until, self._motor_duties)
        needs_levels = self._is_capturing or bool(self._wiring.pickups)
        if left or needs_levels:
            self._count_edges(0, left, until, needs_levels)
        if right or needs_levels:
            self._count_edges(1, right, until, needs_levels)

    def _count_edges(
        self, number: int, edges: Sequence[int], until: int, needs_levels: bool
    ) -> None:
        """Pass the counted `edges` of a wheel, or of its floating wire, to the board's pin."""
        changes = self._level_changes(number, until) if needs_levels else []
        if number in self._wiring.pickups:
            edges = [time for time, level in changes if level]
        side = self._wiring.pins[number]
        if side is None:
            return
        board_side, directions = self.board.sides[side], self.wheels[number].taken_directions
        if directions and number not in self._wiring.pickups:
            sign = -1 if self._wiring.counts_down(number, side) else 1
            for time, direction in zip(edges, directions, strict=True):
                self.board.edge(board_side, time, sign * direction)
        else:
            for time in edges:
                self.board.edge(board_side, time)
        if self._is_capturing:
            resolution = CAPTURE_RESOLUTION
            self.captured_edges += [
                CapturedEdge(time // resolution * resolution, side, level)
                for time, level in changes
            ]

    def _level_changes(self, number: int, until: int) -> list[LevelChange]:
        """Changes on the wire of a wheel's encoder: of the watched wheel, or of mains pick-up."""
        pickup = self._wiring.pickups.get(number)
        changes = self.wheels[number].changes(until)
        return changes if pickup is None else pickup.changes(until)

    def _roll(self, now: int | None = None) -> None:
        """Move the chassis to the wheels' angles, and as it is pushed, within the world's field."""
        left, right = self.wheels
        self.chassis.roll(left.angle, right.angle)
        now = self.now if now is None else now
        push = self.faults.active.pushes() if self.faults.faults else 0.0
        if push:
            aside = push * (now - self._pushed_at) / SECOND
            self.chassis.x -= aside * sin(self.chassis.heading)
            self.chassis.y += aside * cos(self.chassis.heading)
        self._pushed_at = now
        if self._sensors.world.field is not None:
            pose = self.pose_in_world()
            inside = self._sensors.world.kept(pose.x, pose.y)
            if inside != (pose.x, pose.y):
                self._set_pose_in_world(Pose(*inside, pose.heading))

    def _update_pose(self) -> None:
        self._turn_wheels(self.now)
        self._roll()

    def _set_pose_in_world(self, pose: Pose) -> None:
        self.chassis.x, self.chassis.y, self.chassis.heading = self._start.from_parent(pose)
        if self.gyro is not None:
            self.gyro.put_down(self.chassis.heading)

    def _begin_and_end_faults(self, now: int) -> None:
        """Begin and end the faults that are due."""
        self._roll(now)  # with the pushes until now
        active, truth = self.faults.update(now), self.simulation
        self._battery.supply = active.supply()
        self._battery.sag = active.largest("battery_sag", truth.battery.sag)
        self.drive.set_drag(*active.drags())
        self.drive.set_raised(active.has("wheel_lifted", 0) and active.has("wheel_lifted", 1))
        self.chassis.slide(*active.slides())
        self.chassis.slip(*(active.largest("wheel_slip", truth.slip, side) for side in (0, 1)))
        for side, wheel in enumerate(self.wheels):
            wheel.set_encoder_faults(active.encoder(side))
        self._wiring.set_faults(now, active)
        self._sensors.set_faults(now, active)
        if self.gyro is not None:
            self.gyro.set_faults(now, active)
        self._change_surroundings(now)
        if self.faults.beginning("board_reset", now):
            self.restart_board(self.parameters)
        self.button_pressed = active.has("stop_button") and self.parameters.has_button
        self.board.press(now, self.button_pressed)
        self._update_motor_duties()

    def _change_surroundings(self, now: int) -> None:
        """Put the robot elsewhere, and an obstacle before it or away."""
        for fault in self.faults.beginning("robot_moved", now):
            rng, pose = self.faults.rng, self.pose_in_world()
            bearing, heading = rng.uniform(-pi, pi), rng.uniform(-pi, pi)
            x, y = pose.x + fault.size * cos(bearing), pose.y + fault.size * sin(bearing)
            self.teleport(x, y, heading)
        for fault in self.faults.beginning("obstacle_appears", now):
            ahead = self.parameters.front + fault.size + OBSTACLE_RADIUS
            at = self.pose_in_world().to_parent(Pose(ahead))
            self._appeared[fault] = Pillar(at.x, at.y, OBSTACLE_RADIUS)
        pillars = [pillar for fault, pillar in self._appeared.items() if now < fault.end]
        if self._appeared:
            self._sensors.set_world(now, self._built_world.with_pillars(pillars))

    def _update_motor_duties(self) -> None:
        (a, b), sides = self.parameters.channels, self.board.sides
        self._short_between(sides[a].duty, sides[b].duty)
        self._motor_duties = self._duties_of(sides[a].duty, sides[b].duty)

    def _heat_bridge(self, now: int) -> None:
        """Heat the motor driver with the currents since the last call; it may switch off or on."""
        seconds, self._heated_at = (now - self._heated_at) * 1e-9, now
        if self.parameters.bridge.stall_load is None:
            return
        was_off, bridge = self._bridge_heat.is_off, self.parameters.bridge
        left, right = (
            bridge.current(
                duty,
                1.0,
                copysign(1.0, duty) * wheel.speed / motor.no_load_speed,
                (1.0 - abs(duty)) * shorted,
            )
            if duty
            else 0.0
            for duty, shorted, wheel, motor in zip(
                self._motor_duties, self._shorted, self.wheels, self.motors, strict=True
            )
        )
        self._bridge_heat.update((left, right), seconds)
        if self._bridge_heat.is_off is not was_off:
            self._set_shorted(*self._shorted)
            self._update_motor_duties()

    def _short_between(self, left: float, right: float) -> None:
        """Short the motors between the pulses of these duties, and at rest, as the driver does."""
        between, at_rest = self.parameters.shorted_between, self.parameters.shorted_at_rest
        self._set_shorted(between if left else at_rest, between if right else at_rest)

    def _set_shorted(self, left: float, right: float) -> None:
        """Short outputs for these shares of the time without drive, and so the motors on them."""
        self._shorted = (left, right)
        if self._bridge_heat.is_off:
            left = right = 0.0
        (_, is_crossed), _ = self._wiring.outputs
        self.drive.set_shorted(*((right, left) if is_crossed else (left, right)))

    def _duties_of(self, left: float, right: float) -> tuple[float, float]:
        """Share of the battery's rest voltage at each motor, forward positive, for the outputs."""
        self._output_duties = (left, right)
        if (not left and not right) or self._bridge_heat.is_off:
            return (0.0, 0.0)
        ratio = self._battery.voltage_ratio(left, right)
        (ll, lr), (rl, rr) = self._wiring.outputs
        return (ratio * (ll * left + lr * right), ratio * (rl * left + rr * right))

    def _send_frame(self, now: int) -> None:
        """Sample board and sensors, and put the messages on their way to the host."""
        model, late = self._model, 0
        if model.stamp_jitter:
            deviation = self._rng.gauss(0.0, 1.0)
            late = int(min(max(deviation, -JITTER_MAX_SD), JITTER_MAX_SD) * model.stamp_jitter)
        arrival = now + model.frame_delay + late + self.faults.delay()
        if self._arriving:
            arrival = max(arrival, self._arriving[-1][0])
        frame = self._with_shown_side(self._with_turn(self.board.sample(now)))
        if self.faults.loses():
            return
        if late:  # the driver dates a frame by its arrival, less the usual delay
            frame = frame._replace(time=now + late)
        self._arriving.append((arrival, "encoders", frame))
        for name, volts in self._sensors.volts(now).items():
            if name not in self._sensors.further:
                self._arriving.append((arrival, name, Volts(now + late, volts)))
        for name in self._cameras:
            self._arriving.append((arrival, name, self._camera_pose(now)))
        divider = self.parameters.divider
        # The published firmware does not measure its battery.
        if model.has_speed_loop and divider is not None and now >= self._next_battery:
            self._next_battery = now + BATTERY_PERIOD
            volts = read_analog(self.battery_pin_voltage()) * divider
            battery = Battery(now, volts, volts < self.parameters.low)
            self._arriving.append((arrival, "battery", battery))

    def _with_shown_side(self, frame: Encoders) -> Encoders:
        """The frame with the duty of one motor and the level of its encoder's pin, in turn. The
        published firmware reports neither, and frames with the turn of a gyro no level."""
        if not self._model.has_speed_loop:
            return frame
        side = self._shown_side = 1 - self._shown_side
        duty = round(self.board.sides[side].duty * REPORTED_DUTY_ONE) / REPORTED_DUTY_ONE
        wheel = self._wiring.wheels_at[side] if self.gyro is None else None
        level = None if wheel is None else self._pin_levels(wheel)[0]
        if side:
            return frame._replace(right_level=level, right_duty=duty)
        return frame._replace(left_level=level, left_duty=duty)

    def _pin_levels(self, wheel: int) -> tuple[int, ...]:
        """Levels on the wires of a wheel's encoder; a wire that does not carry them begins at 0."""
        levels = self.wheels[wheel].levels
        return (0,) * len(levels) if wheel in self._wiring.pickups else levels

    def _with_turn(self, frame: Encoders) -> Encoders:
        """The frame with what the gyro has measured. The published firmware reads none."""
        if self.gyro is None or not self._model.has_speed_loop:
            return frame
        self._roll()
        direction = self.parameters.gyro_direction
        self.gyro.measure(frame.time, self.chassis, direction)
        fault = self.gyro.fault(frame.time)
        is_upward = direction == UP and not self.gyro.is_upside_down
        if self.parameters.is_upward_checked and not is_upward:
            fault = fault or GYRO_CAUSES[FLAG_GYRO_GRAVITY]
        return frame._replace(turn=self.gyro.reported(), turn_fault=fault)

    def _camera_pose(self, now: int) -> Odometry:
        """The true pose and velocity, in the world."""
        self._roll()
        chassis, (left, right) = self.chassis, self.wheels
        left_speed, right_speed = (
            left.speed * chassis.left_radius,
            right.speed * chassis.right_radius,
        )
        linear, angular = (
            0.5 * (left_speed + right_speed),
            (right_speed - left_speed) / chassis.track,
        )
        return Odometry(now, *self.pose_in_world(), linear, angular, NO_COVARIANCE)

    def _measure(self, now: int) -> None:
        """Let every distance sensor measure that is due at `now`."""
        self._roll()
        self._sensors.measure(now, self.pose_in_world())

    def _scan(self, now: int) -> None:
        """Put the scans of every scanner whose turn ends at `now` on their way to the host."""
        self._roll()
        late = round(self.faults.active.largest("lidar_late") * SECOND)
        for name, scan in self._sensors.scan(now, self.pose_in_world()):
            self._add_arriving(now, name, scan, late)

    def _measure_in_turn(self, now: int) -> None:
        """Let the sensor measure whose turn it is, and put the result on its way to the host.

        The published firmware has only one sensor.
        """
        self._roll()
        name, message = self._sensors.take_turn(now, self.pose_in_world())
        if self._model.has_speed_loop:
            self._add_arriving(now, name, message)

    def _add_arriving(self, now: int, name: str, message: Message, late: int = 0) -> None:
        """Put a message behind what already waits, so that messages arrive in order.

        One that is `late` (ns) waits apart until then.
        """
        if late:
            self._late.append((now + late, name, message))
            return
        waiting = [arrival for arrival, _, _ in self._arriving]
        arrival = max([now + self._model.frame_delay, *waiting])
        self._arriving.append((arrival, name, message))


def _draw_gyro(simulation: Simulation, rng: Random) -> SimulatedGyro:
    state = rng.getstate()
    gyro = SimulatedGyro(simulation.gyro, Random(rng.getrandbits(64)))
    rng.setstate(state)
    return gyro


def _draw_faults(simulation: Simulation, rng: Random) -> FaultSchedule:
    """The robot is the same with and without faults."""
    state = rng.getstate()
    faults = FaultSchedule(simulation.faults, Random(rng.getrandbits(64) ^ 1))
    rng.setstate(state)
    return faults


def _start_pose(simulation: Simulation) -> Pose:
    return Pose(simulation.start.x, simulation.start.y, simulation.start.heading)


def draw_robot(
    robot: Robot,
    nominal: Robot,
    seed: int,
    world: World | None = None,
    is_upward_checked: bool = True,
) -> SimulatedRobot:
    """The plant of a robot: built as `nominal` states, with a board set up as `robot` states.

    `nominal` is the robot file without its calibration, `robot` the file with it.
    """
    parameters = plant_parameters(robot, nominal, is_upward_checked)
    return SimulatedRobot(board_kind(robot), parameters, nominal.simulation, Random(seed), world)
