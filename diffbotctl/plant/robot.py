"""A whole simulated robot: two wheels, a body, sensors, a board and its link, in virtual time."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from math import cos, pi, sin
from random import Random
from typing import NamedTuple

from diffbotctl.messages import (
    Battery,
    Duty,
    Encoders,
    Message,
    Odometry,
    Scan,
    Volts,
    Wheels,
)
from diffbotctl.plant.board import KINDS, MOST_JITTER, NEVER, Board, Kind
from diffbotctl.plant.body import Body, Pose
from diffbotctl.plant.hum import Hum
from diffbotctl.plant.scanner import PARTS, Scanner
from diffbotctl.plant.sharp import Sharp
from diffbotctl.plant.speed_loop import Gains
from diffbotctl.plant.truth import SensorTruth, Simulation
from diffbotctl.plant.wheel import Change, Disc, Motor, Wheel, draw_disc
from diffbotctl.plant.world import Wall, World

CAMERA = "overhead_camera"
EXACT = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # covariance of a pose that is known
CONVERTER = 5.0  # V; the board's analog inputs read up to this
BATTERY_PERIOD = 2_000_000_000  # ns between two readings of the battery that are told
BOARD = 0.3  # m, width of what a hand puts before a sensor
STEP = 20_000_000  # ns between two arcs of the body: 6 mm at 0.3 m/s, 0.08 rad at 4 rad/s


class Mounting(NamedTuple):
    """Where a sensor sits, in base_link (m, rad), and which part it is."""

    name: str
    x: float
    y: float = 0.0
    heading: float = 0.0
    kind: str = "sharp_gp2y0a41sk0f"


class Machine(NamedTuple):
    """What the robot file says of the robot, as the plant needs it.

    What is bolted and soldered (lengths, `rated`, `disc`) is what the file states; what the board
    is told (`slots`, `gains`, `reversed`, `channels`, `sockets`) may have been calibrated.
    """

    track: float  # m
    left_diameter: float  # m
    right_diameter: float  # m
    rated: float  # rad/s at full duty
    slots: int
    glitch: int  # ns
    deadman: int  # ns
    gains: tuple[Gains, Gains]  # of the board's speed loop, left and right
    reversed: tuple[bool, bool] = (False, False)  # motor leads, as the robot file has them
    sensors: tuple[Mounting, ...] = ()
    falling: bool = False  # the encoders count falling edges instead of rising ones
    period: int | None = None  # ns between two frames; None: that of the kind of board
    disc: int = 0  # slots that the file states; 0: as many as the board is told
    # Which of the driver's outputs (0, 1: stated for left, right) the board takes for each side,
    # and which of the encoders' sockets.
    channels: tuple[int, int] = (0, 1)
    sockets: tuple[int, int] = (0, 1)
    divider: float | None = None  # that the board's readings are multiplied with; None: no pin
    built_divider: float = 1.0  # that the file states
    low: float = 0.0  # V


class Flank(NamedTuple):
    """What an encoder's pin did at `time` (ns): it went to `level`, 0 or 1."""

    time: int
    side: int
    """0 left, 1 right: of the board that captured it, or of the socket it is plugged into"""
    level: int


class Truth(NamedTuple):
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
        machine: Machine,
        simulation: Simulation,
        chance: Random,
        world: World | None = None,
        start: Pose | None = None,
    ) -> None:
        """`kind`: `stock`, `counts` or `edges`. `start`: where in the world frame `odom` begins."""
        self._kind: Kind = KINDS[kind]
        if machine.period is not None:
            self._kind = self._kind._replace(period=machine.period)
        self._chance = chance
        self.machine = machine
        self.motors = _draw_motors(machine, simulation, chance)
        slots = simulation.encoder.slots or machine.disc or machine.slots
        self.discs = tuple(draw_disc(simulation.encoder, slots, chance) for _ in range(2))
        self.body = _draw_body(machine, simulation, chance)
        where = simulation.start
        self._start = start or Pose(where.x, where.y, where.heading)
        self._world = world or World()
        sharps = [each for each in machine.sensors if each.kind not in (*PARTS, CAMERA)]
        self._sensors = _draw_sensors(sharps, simulation.sensors, chance)
        # Own generators for what happens often, so that one wheel's luck does not move the other's.
        seeds = [chance.getrandbits(64) for _ in range(3)]
        self.wheels = tuple(
            Wheel(motor, disc, Random(seed), falling=machine.falling)
            for motor, disc, seed in zip(self.motors, self.discs, seeds, strict=False)
        )
        self._scanners = _draw_scanners(machine.sensors, simulation.sensors, chance)
        self._cameras = [each.name for each in machine.sensors if each.kind == CAMERA]
        self._luck = Random(seeds[2])
        self._simulation = simulation
        self.board = self._new_board(0)
        self._battery_at = 0
        self._sag = simulation.battery.sag
        self._outputs = _outputs(machine, simulation)
        self._pins = _pins(machine, simulation)
        self._hums = _hums(simulation, chance)
        self._captures = False
        self.flanks: list[Flank] = []
        """what the board has captured, until it is taken"""
        self.now = 0
        self._next_step = STEP
        self._next_frame = self._kind.period
        self._waiting: deque[tuple[int, str, Message]] = deque()
        self._pushes = (0.0, 0.0)
        sees = not self._world.empty
        self._next_look = min([s.due for _, s in self._sensors], default=NEVER) if sees else NEVER
        self._next_scan = min([s.due for _, s in self._scanners], default=NEVER)

    def rewire(self, machine: Machine) -> None:
        """Restart the board with other settings: what it is told of `machine` counts, no more."""
        self._move(self.now)
        self.machine = machine
        self.board = self._new_board(self.board.boot + 1)
        self._outputs = _outputs(machine, self._simulation)
        self._pins = _pins(machine, self._simulation)
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
        board = self.board
        while True:
            at = min(self._next_step, self._next_frame, self._next_look, self._next_scan, board.due)
            if at > until:
                break
            self._move(at)
            if at == board.due:
                board.serve(at)
                self._push()
            if at == self._next_step:
                self._next_step += STEP
                self._roll()
            if at == self._next_look:
                self._look(at)
            if at == self._next_scan:
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

    def levels(self) -> list[Flank]:
        """How the encoders' pins stand now."""
        return [
            Flank(self.now, self._socket(number), 0 if number in self._hums else wheel.level)
            for number, wheel in enumerate(self.wheels)
        ]

    def roll(self, until: int, left: float, right: float) -> list[Flank]:
        """Let time pass for everything but the board, whose outputs are `left`, `right` (duty).

        Returns what the encoders' pins did, in order: `capture` must be on. For a board that is not
        simulated here; not to be mixed with `advance`.
        """
        self._pushes = self._shares(left, right)
        found: list[Flank] = []
        for number, wheel in enumerate(self.wheels):
            wheel.advance(until, self._pushes[number])
            socket = self._socket(number)
            found += [Flank(time, socket, level) for time, level in self._changes(number, until)]
        self._roll()
        if until >= self._next_look:
            self._look(until)
        self.now = until
        return sorted(found)

    def volts(self) -> dict[str, float]:
        """The distance sensors' output voltages now."""
        return {mounting.name: sensor.output(self.now) for mounting, sensor in self._sensors}

    def teleport(self, x: float, y: float, heading: float) -> None:
        """Put the robot elsewhere in the world, as a hand does: m, rad; its wheels do not turn."""
        self._move(self.now)
        self._roll()
        self._put(*self._world.kept(x, y), heading)

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
        mounting = next(each for each, _ in self._sensors if each.name == name)
        self._move(self.now)
        self._roll()
        x, y, bearing = self._eye(mounting)
        ahead, aside = cos(bearing), sin(bearing)
        x, y = x + distance * ahead, y + distance * aside
        half = 0.5 * BOARD
        self._world = World([Wall(x - half * aside, y + half * ahead,
                                  x + half * aside, y - half * ahead)])  # fmt: skip
        for _, sensor in self._sensors:
            sensor.catch_up(self.now)
        self._next_look = min(sensor.due for _, sensor in self._sensors)

    def truth(self) -> Truth:
        """Where the robot truly is now, in the frame `odom`."""
        self._move(self.now)
        self._roll()
        left, right = self.wheels
        body = self.body
        return Truth(
            self.now, Pose(body.x, body.y, body.heading), left.angle, right.angle,
            left.speed, right.speed, body.travel, body.turned,
        )  # fmt: skip

    def _move(self, until: int) -> None:
        """Turn the wheels until `until`; the board hears of the edges, the body is not rolled."""
        for number, wheel in enumerate(self.wheels):
            found = wheel.advance(until, self._pushes[number])
            if found or self._hums or self._captures:
                self._hear(number, found, until)

    def _hear(self, number: int, edges: Sequence[int], until: int) -> None:
        """The board's pin of a wheel's encoder, of which the wheel truly made `edges`."""
        changes = self._changes(number, until)
        if number in self._hums:
            edges = [time for time, level in changes if level]
        side = self._pins[number]
        if side is None:
            return
        for time in edges:
            self.board.edge(self.board.sides[side], time)
        if self._captures:
            self.flanks += [Flank(time, side, level) for time, level in changes]

    def _roll(self) -> None:
        left, right = self.wheels
        self.body.roll(left.angle, right.angle)
        if self._world.field is not None:
            here = self.place()
            inside = self._world.kept(here.x, here.y)
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
        (ll, lr), (rl, rr) = self._outputs
        return (supply * (ll * left + lr * right), supply * (rl * left + rr * right))

    def _socket(self, wheel: int) -> int:
        """The socket that the encoder of `wheel` is plugged into: 0 stated for left, 1 right."""
        return 1 - wheel if self._simulation.wiring.encoders == "swapped" else wheel

    def _changes(self, wheel: int, until: int) -> list[Change]:
        """What the wire of a wheel's encoder did, as far as it is watched, or hums by itself."""
        hum, made = self._hums.get(wheel), self.wheels[wheel].changes(until)
        return made if hum is None else hum.changes(until)

    def _new_board(self, boot: int) -> Board:
        machine = self.machine
        return Board(
            self._kind, machine.gains, machine.slots, machine.glitch, machine.deadman,
            self._luck, boot, getattr(self, "now", 0),
        )  # fmt: skip

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
        for mounting, sensor in self._sensors:
            volts = Volts(now + late, sensor.output(now))
            self._waiting.append((arrival, mounting.name, volts))
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
        for mounting, scanner in self._scanners:
            if scanner.due <= now:
                told = scanner.measure(self._world, *self._eye(mounting))
                seen = Scan(now, 0.0, scanner.step, told)
                # Behind what already waits, so that messages arrive in order.
                arrival = max([now + self._kind.frame, *(each[0] for each in self._waiting)])
                self._waiting.append((arrival, mounting.name, seen))
        self._next_scan = min(scanner.due for _, scanner in self._scanners)

    def _look(self, now: int) -> None:
        """Let every sensor measure that is due at `now`."""
        self._roll()
        for mounting, sensor in self._sensors:
            if sensor.due <= now:
                sensor.measure(self._distance(mounting))
        self._next_look = min(sensor.due for _, sensor in self._sensors)

    def _distance(self, mounting: Mounting) -> float:
        return self._world.distance(*self._eye(mounting))

    def _eye(self, mounting: Mounting) -> tuple[float, float, float]:
        """Where in the world a sensor sits, and where it looks."""
        base_x, base_y, facing = self.place()
        x = base_x + mounting.x * cos(facing) - mounting.y * sin(facing)
        y = base_y + mounting.x * sin(facing) + mounting.y * cos(facing)
        return x, y, facing + mounting.heading


def _draw_motors(machine: Machine, simulation: Simulation, chance: Random) -> tuple[Motor, Motor]:
    truth = simulation.motor
    lag = chance.uniform(*truth.lag)
    drawn = []
    for _ in range(2):
        start = chance.uniform(*truth.start_duty)
        drawn.append(
            Motor(
                speed=machine.rated * (1.0 + chance.uniform(-1.0, 1.0) * truth.gain_spread),
                lag=lag * (1.0 + chance.uniform(-1.0, 1.0) * truth.lag_spread),
                start=start,
                keep=start * truth.keep_share,
                ripple=truth.ripple,
                ripple_phase=chance.uniform(0.0, 2 * pi),
                coulomb=truth.coasting == "coulomb",
            )
        )
    return drawn[0], drawn[1]


def _draw_body(machine: Machine, simulation: Simulation, chance: Random) -> Body:
    truth = simulation.geometry
    track = machine.track * (1.0 + chance.uniform(-1.0, 1.0) * truth.track_spread)
    radii = [
        0.5 * diameter * (1.0 + chance.uniform(-1.0, 1.0) * truth.diameter_spread)
        for diameter in (machine.left_diameter, machine.right_diameter)
    ]
    return Body(track, radii[0], radii[1], simulation.slip, Random(chance.getrandbits(64)))


def _draw_sensors(
    mountings: Sequence[Mounting], errors: Mapping[str, SensorTruth], chance: Random
) -> list[tuple[Mounting, Sharp]]:
    drawn = []
    for mounting in mountings:
        truth = errors.get(mounting.name) or SensorTruth()
        sensor = Sharp(truth.noise, truth.offset, Random(chance.getrandbits(64)))
        drawn.append((mounting, sensor))
    return drawn


def _draw_scanners(
    mountings: Sequence[Mounting], errors: Mapping[str, SensorTruth], chance: Random
) -> list[tuple[Mounting, Scanner]]:
    drawn = []
    for mounting in mountings:
        if mounting.kind in PARTS:
            truth = errors.get(mounting.name) or SensorTruth()
            seed = chance.getrandbits(64)
            drawn.append((mounting, Scanner(PARTS[mounting.kind], truth.spread, Random(seed))))
    return drawn


def _outputs(
    machine: Machine, simulation: Simulation
) -> tuple[tuple[float, float], tuple[float, float]]:
    """How each motor (row) follows each driver output (column): 1, -1, or 0 for not at all.

    What the board is told as `reversed` undoes leads that are soldered the other way round.
    """
    wiring = (simulation.wiring.left, simulation.wiring.right)
    table = [[0.0, 0.0], [0.0, 0.0]]
    for motor in (0, 1):
        if wiring[motor] == "dead":
            continue
        output = 1 - motor if wiring[motor] == "swapped" else motor
        leads = -1.0 if wiring[motor] == "reversed" else 1.0
        side = machine.channels[output]
        table[motor][output] = -leads if machine.reversed[side] else leads
    return (table[0][0], table[0][1]), (table[1][0], table[1][1])


def _pins(machine: Machine, simulation: Simulation) -> tuple[int | None, int | None]:
    """Which side of the board hears the encoder of each wheel, None for neither."""
    crossed = simulation.wiring.encoders == "swapped"
    found: list[int | None] = []
    for wheel in (0, 1):
        socket = 1 - wheel if crossed else wheel
        sides = [side for side in (0, 1) if machine.sockets[side] == socket]
        found.append(sides[0] if sides else None)
    return found[0], found[1]


def _hums(simulation: Simulation, chance: Random) -> dict[int, Hum]:
    """What the wires of encoders carry that tell nothing of their wheel."""
    wiring = simulation.wiring
    found = {}
    for wheel, (motor, encoder) in enumerate(
        ((wiring.left, wiring.left_encoder), (wiring.right, wiring.right_encoder))
    ):
        if encoder == "dead":
            found[wheel] = Hum(None)
        elif "floating" in (motor, encoder):
            found[wheel] = Hum(Random(chance.getrandbits(64)))
    return found


__all__ = ["NEVER", "Disc", "Flank", "Machine", "Mounting", "SimulatedRobot", "Truth"]
