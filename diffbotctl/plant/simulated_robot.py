"""A whole simulated robot: two wheels, a body, sensors, a board and its link, in virtual time."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import cos, sin
from random import Random
from typing import NamedTuple

from diffbotctl.config.robot import Robot
from diffbotctl.config.simulation import Simulation
from diffbotctl.messages import Battery, Duty, Encoders, Message, Odometry, Volts, Wheels
from diffbotctl.model.laser_scanners import LASER_SCANNERS
from diffbotctl.plant.chassis import Pose, draw_body
from diffbotctl.plant.range_sensors import RangeSensors, draw_scanners, draw_sharps
from diffbotctl.plant.robot_parameters import PlantParameters, board_kind, plant_parameters
from diffbotctl.plant.simulated_board import KINDS, MOST_JITTER, BoardModel, SimulatedBoard
from diffbotctl.plant.wheel import LevelChange, WheelModel, draw_disc, draw_motors
from diffbotctl.plant.wiring import PlantWiring
from diffbotctl.plant.world import World

CAMERA = "overhead_camera"
EXACT = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # covariance of a pose that is known
CONVERTER = 5.0  # V; the board's analog inputs read up to this
BATTERY_PERIOD = 2_000_000_000  # ns between two readings of the battery that are told
CAPTURED = 64_000  # ns, in which the board tells the flanks that it captures
STEP = 20_000_000  # ns between two arcs of the body: 6 mm at 0.3 m/s, 0.08 rad at 4 rad/s


class CapturedEdge(NamedTuple):
    """What an encoder's pin did at `time` (ns): it went to `level`, 0 or 1."""

    time: int
    side: int
    """0 left, 1 right: of the board that captured it, or of the socket it is plugged into"""
    level: int


class PlantTruth(NamedTuple):
    """The plant's truth at `time`: for tests and the summary only, never for a block."""

    time: int
    pose: Pose
    left_angle: float  # rad
    right_angle: float
    left_speed: float  # rad/s
    right_speed: float
    travel: float  # m, length of the path
    turned: float  # rad, sum of all turning


class SimulatedRobot:
    """A robot drawn from its truth by a seeded generator, driven in virtual time.

    `due` says when it next has a message; `advance` lets time pass; `deliver` hands out what has
    arrived by then; `command` is what the host sends, at a time not after the last `advance`.
    """

    def __init__(
        self,
        kind: str,
        machine: PlantParameters,
        simulation: Simulation,
        chance: Random,
        world: World | None = None,
        start: Pose | None = None,
    ) -> None:
        """`kind`: `stock`, `counts` or `edges`. `start`: where in the world frame `odom` begins."""
        self._kind: BoardModel = KINDS[kind]
        if machine.period is not None:
            self._kind = self._kind._replace(period=machine.period)
        self._chance = chance
        self.machine = machine
        self.motors = draw_motors(machine.rated, simulation.motor, chance)
        slots = simulation.encoder.slots or machine.disc or machine.slots
        self.discs = tuple(draw_disc(simulation.encoder, slots, chance) for _ in range(2))
        self.body = draw_body(machine, simulation, chance)
        where = simulation.start
        self._start = start or Pose(where.x, where.y, where.heading)
        sharps = [each for each in machine.sensors if each.kind not in (*LASER_SCANNERS, CAMERA)]
        sensors = draw_sharps(sharps, simulation.sensors, chance)
        # Own generators for what happens often, so that one wheel's luck does not move the other's.
        seeds = [chance.getrandbits(64) for _ in range(3)]
        self.wheels = tuple(
            WheelModel(motor, disc, Random(seed), falling=machine.falling)
            for motor, disc, seed in zip(self.motors, self.discs, seeds, strict=False)
        )
        scanners = draw_scanners(machine.sensors, simulation.sensors, chance)
        self._eyes = RangeSensors(world or World(), sensors, scanners)
        self._cameras = [each.name for each in machine.sensors if each.kind == CAMERA]
        self._luck = Random(seeds[2])
        self._simulation = simulation
        self.board = self._new_board(0)
        self._battery_at = 0
        self._sag = simulation.battery.sag
        self._wires = PlantWiring(simulation.wiring, machine, chance)
        self._captures = False
        self.flanks: list[CapturedEdge] = []
        """what the board has captured, until it is taken"""
        self.now = 0
        self._next_step = STEP
        self._next_frame = self._kind.period
        self._waiting: deque[tuple[int, str, Message]] = deque()
        self._pushes = (0.0, 0.0)

    def rewire(self, machine: PlantParameters) -> None:
        """Restart the board with other settings: what it is told of `machine` counts, no more."""
        self._move(self.now)
        self.machine = machine
        self.board = self._new_board(self.board.boot + 1)
        self._wires.tell(machine)
        self._waiting.clear()
        self._push()

    def turn_by_hand(self, wheel: int, angle: float, speed: float) -> int:
        """A hand turns a wheel (0 left, 1 right) by `angle` rad from now on, at `speed` rad/s.

        Returns when it will be done, ns.
        """
        self._move(self.now)
        return self.wheels[wheel].turn_by_hand(angle, speed)

    def due(self) -> int:
        """When the next message arrives at the host, as far as it is known; never in the past."""
        if self._waiting:
            return max(self.now, self._waiting[0][0])
        return self._next_frame + self._kind.frame

    def advance(self, until: int) -> None:
        """Let time pass until `until`."""
        if until <= self.now:
            return
        board, eyes = self.board, self._eyes
        while True:
            at = min(self._next_step, self._next_frame, eyes.next_sharp, eyes.next_scan, board.due)
            if at > until:
                break
            self._move(at)
            if at == board.due:
                board.serve(at)
                self._push()
            if at == self._next_step:
                self._next_step += STEP
                self._roll()
            if at == eyes.next_sharp:
                self._look(at)
            if at == eyes.next_scan:
                self._scan(at)
            if at == self._next_frame:
                self._next_frame += self._kind.period
                self._sample(at)
        # Nothing on the board changes before the next of these times, so the wheels can wait.
        self.now = until

    def deliver(self) -> list[tuple[str, Message]]:
        """What has arrived at the host by now, in order, as (port, message)."""
        arrived = []
        while self._waiting and self._waiting[0][0] <= self.now:
            _, port, message = self._waiting.popleft()
            arrived.append((port, message))
        return arrived

    def command(self, now: int, wanted: Wheels | Duty) -> None:
        """The host sends `wanted` at `now`. Raises TypeError where the board takes the other."""
        self.board.command(now, wanted)

    def capture(self, on: bool) -> None:
        """From now on `flanks` gathers what the encoders' pins do, or no longer."""
        self._move(self.now)
        self._captures = on
        for wheel in self.wheels:
            wheel.watch(on)

    def levels(self) -> list[CapturedEdge]:
        """How the encoders' pins stand now."""
        wires = self._wires
        return [
            CapturedEdge(self.now, wires.socket(number), 0 if number in wires.hums else wheel.level)
            for number, wheel in enumerate(self.wheels)
        ]

    def roll(self, until: int, left: float, right: float) -> list[CapturedEdge]:
        """Let time pass for everything but the board, whose outputs are `left`, `right` (duty).

        Returns what the encoders' pins did, in order: `capture` must be on. For a board that is not
        simulated here; not to be mixed with `advance`.
        """
        self._pushes = self._shares(left, right)
        found: list[CapturedEdge] = []
        for number, wheel in enumerate(self.wheels):
            wheel.advance(until, self._pushes[number])
            socket = self._wires.socket(number)
            found += [
                CapturedEdge(time, socket, level) for time, level in self._changes(number, until)
            ]
        self._roll()
        if until >= self._eyes.next_sharp:
            self._look(until)
        self.now = until
        return sorted(found)

    def volts(self) -> dict[str, float]:
        """The distance sensors' output voltages now."""
        return self._eyes.volts(self.now)

    def teleport(self, x: float, y: float, heading: float) -> None:
        """Put the robot elsewhere in the world, as a hand does: m, rad; its wheels do not turn."""
        self._move(self.now)
        self._roll()
        self._put(*self._eyes.world.kept(x, y), heading)

    def home(self) -> None:
        """Put the robot back to where the run began."""
        self.teleport(*self._start)

    def truth_in_world(self) -> Pose:
        """Where the robot truly is now, in the world."""
        self._move(self.now)
        self._roll()
        return self.place()

    def place(self) -> Pose:
        """Where the robot is in the world, as of the last step of its body."""
        start, body = self._start, self.body
        return Pose(
            start.x + body.x * cos(start.heading) - body.y * sin(start.heading),
            start.y + body.x * sin(start.heading) + body.y * cos(start.heading),
            start.heading + body.heading,
        )

    def _put(self, x: float, y: float, heading: float) -> None:
        """Set the body's pose in `odom` from one in the world."""
        start = self._start
        ahead, aside = cos(start.heading), sin(start.heading)
        self.body.x = (x - start.x) * ahead + (y - start.y) * aside
        self.body.y = (y - start.y) * ahead - (x - start.x) * aside
        self.body.heading = heading - start.heading

    def supply(self) -> float:
        """The battery's voltage now, in V."""
        a, b = self.board.sides
        load = 0.5 * (abs(a.duty) + abs(b.duty))
        return self._simulation.battery.volts * (1.0 - self._sag * load)

    def battery_pin(self) -> float:
        """What the battery's divider makes of that, at the board's pin, in V."""
        return self.supply() / (
            self.machine.built_divider * (1.0 + self._simulation.battery.divider_error)
        )

    def put_before(self, name: str, distance: float) -> None:
        """Put a wide board across a sensor's axis, `distance` (m) from it; take all else away."""
        self._move(self.now)
        self._roll()
        self._eyes.put_before(name, distance, self.now, self.place())

    def truth(self) -> PlantTruth:
        """Where the robot truly is now, in the frame `odom`."""
        self._move(self.now)
        self._roll()
        left, right = self.wheels
        body = self.body
        return PlantTruth(
            self.now,
            Pose(body.x, body.y, body.heading),
            left.angle,
            right.angle,
            left.speed,
            right.speed,
            body.travel,
            body.turned,
        )

    def _move(self, until: int) -> None:
        """Turn the wheels until `until`; the board hears of the edges, the body is not rolled."""
        for number, wheel in enumerate(self.wheels):
            found = wheel.advance(until, self._pushes[number])
            if found or self._wires.hums or self._captures:
                self._hear(number, found, until)

    def _hear(self, number: int, edges: Sequence[int], until: int) -> None:
        """The board's pin of a wheel's encoder, of which the wheel truly made `edges`."""
        changes = self._changes(number, until)
        if number in self._wires.hums:
            edges = [time for time, level in changes if level]
        side = self._wires.pins[number]
        if side is None:
            return
        for time in edges:
            self.board.edge(self.board.sides[side], time)
        if self._captures:
            self.flanks += [
                CapturedEdge(time // CAPTURED * CAPTURED, side, level) for time, level in changes
            ]

    def _roll(self) -> None:
        left, right = self.wheels
        self.body.roll(left.angle, right.angle)
        if self._eyes.world.field is not None:
            here = self.place()
            inside = self._eyes.world.kept(here.x, here.y)
            if inside != (here.x, here.y):
                self._put(*inside, here.heading)

    def _push(self) -> None:
        """Find the share of the battery's rest voltage at each motor, forward positive."""
        a, b = (self.board.sides[side] for side in self.machine.channels)
        self._pushes = self._shares(a.duty, b.duty)

    def _shares(self, left: float, right: float) -> tuple[float, float]:
        if not left and not right:
            return (0.0, 0.0)
        supply = 1.0 - self._sag * 0.5 * (abs(left) + abs(right))
        (ll, lr), (rl, rr) = self._wires.outputs
        return (supply * (ll * left + lr * right), supply * (rl * left + rr * right))

    def _changes(self, wheel: int, until: int) -> list[LevelChange]:
        """What the wire of a wheel's encoder did, as far as it is watched, or hums by itself."""
        hum, made = self._wires.hums.get(wheel), self.wheels[wheel].changes(until)
        return made if hum is None else hum.changes(until)

    def _new_board(self, boot: int) -> SimulatedBoard:
        machine = self.machine
        return SimulatedBoard(
            self._kind,
            machine.gains,
            machine.slots,
            machine.glitch,
            machine.deadman,
            self._luck,
            boot,
            getattr(self, "now", 0),
        )

    def _sample(self, now: int) -> None:
        kind = self._kind
        late = 0
        if kind.stamp_jitter:
            share = self._chance.gauss(0.0, 1.0)
            late = int(min(max(share, -MOST_JITTER), MOST_JITTER) * kind.stamp_jitter)
        arrival = now + kind.frame + late
        frame: Encoders = self.board.sample(now)
        if late:  # the driver dates a frame by its arrival, less the usual delay
            frame = frame._replace(time=now + late)
        self._waiting.append((arrival, "encoders", frame))
        for name, volts in self._eyes.volts(now).items():
            self._waiting.append((arrival, name, Volts(now + late, volts)))
        for name in self._cameras:
            self._waiting.append((arrival, name, self._seen_from_above(now)))
        if self._kind.regulates:  # the published firmware tells nothing of its battery
            self._tell_battery(now, arrival)

    def _tell_battery(self, now: int, arrival: int) -> None:
        """The converter rounds; the host multiplies with the divider that it was told."""
        divider = self.machine.divider
        if divider is None or now < self._battery_at:
            return
        self._battery_at = now + BATTERY_PERIOD
        steps = min(round(self.battery_pin() / CONVERTER * 1023), 1023)
        volts = steps / 1023 * CONVERTER * divider
        self._waiting.append((arrival, "battery", Battery(now, volts, volts < self.machine.low)))

    def _seen_from_above(self, now: int) -> Odometry:
        """The true pose and velocity, in the world."""
        self._roll()
        body, (left, right) = self.body, self.wheels
        to_left, to_right = left.speed * body.left_radius, right.speed * body.right_radius
        linear, angular = 0.5 * (to_left + to_right), (to_right - to_left) / body.track
        return Odometry(now, *self.place(), linear, angular, EXACT)

    def _scan(self, now: int) -> None:
        """Let every scanner whose turn ends at `now` tell what it saw."""
        self._roll()
        for name, seen in self._eyes.scan(now, self.place()):
            # Behind what already waits, so that messages arrive in order.
            arrival = max([now + self._kind.frame, *(each[0] for each in self._waiting)])
            self._waiting.append((arrival, name, seen))

    def _look(self, now: int) -> None:
        """Let every sensor measure that is due at `now`."""
        self._roll()
        self._eyes.measure(now, self.place())


def draw_robot(
    robot: Robot, nominal: Robot, seed: int, world: World | None = None
) -> SimulatedRobot:
    """The plant of a robot: built as `nominal` states, with a board set up as `robot` states.

    `nominal` is the robot file without its calibration, `robot` the file with it.
    """
    parameters = plant_parameters(robot, nominal)
    return SimulatedRobot(board_kind(robot), parameters, nominal.simulation, Random(seed), world)
