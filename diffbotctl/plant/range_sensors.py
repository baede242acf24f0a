"""The simulated sensors that measure distances in the world: Sharp, echo and laser sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import cos, inf, radians, sin
from random import Random
from typing import Literal

from diffbotctl.config.simulation import SensorTruth
from diffbotctl.geometry.distance_sensors import (
    ECHOES,
    RESIDUAL_VOLTS,
    SHARPS,
    SPEED_OF_SOUND,
    TURN,
    EchoFacts,
    SharpFacts,
    echo_distance,
    further_sensors,
    paper_volts,
    sensor_facts,
)
from diffbotctl.geometry.lidars import LIDARS, LidarModel
from diffbotctl.messages import Message, Range, Scan, Volts
from diffbotctl.plant.chassis import Pose
from diffbotctl.plant.faults import ActiveFaults
from diffbotctl.plant.robot_parameters import MountedSensor
from diffbotctl.plant.world import Wall, World
from diffbotctl.time import NEVER, SECOND

GP2Y0A41 = SHARPS["sharp_gp2y0a41sk0f"]
CURVE = GP2Y0A41.points  # (distance in m, volts)
MEASURING_PERIOD = round(GP2Y0A41.period * SECOND)  # ns
SETTLING_TIME = 5_000_000  # ns, at most, from a measurement to its output


def volts(distance: float) -> float:
    """Voltage of a GP2Y0A41 at `distance` (m) of white paper."""
    return paper_volts(GP2Y0A41, distance)


class Sharp:
    """One sensor. Its output is constant between two measurements.

    The caller passes the true distance to `measure` at `due`, and reads `output` at any time.
    """

    def __init__(
        self,
        noise: float,
        offset: float,
        rng: Random,
        now: int = 0,
        facts: SharpFacts = GP2Y0A41,
    ) -> None:
        """`noise`: standard deviation in V of each reading; `offset` in V."""
        self._noise, self._offset, self._rng = noise, offset, rng
        self._facts, self._period = facts, round(facts.period * SECOND)
        self.due = now + rng.randrange(self._period)
        self._valid = self.due + SETTLING_TIME
        self._before = self._after = RESIDUAL_VOLTS

    def measure(self, distance: float) -> None:
        """Do the measurement that is due, at `distance` (m)."""
        self._before, self._after = self._after, paper_volts(self._facts, distance)
        self._valid = self.due + SETTLING_TIME
        self.due += self._period

    def catch_up(self, now: int) -> None:
        """Skip the measurements that were due before `now`: there was nothing to measure."""
        if self.due < now:
            self.due += -(-(now - self.due) // self._period) * self._period

    def volts_at(self, distance: float) -> float:
        """Voltage at `distance` (m), without noise."""
        return paper_volts(self._facts, distance) + self._offset

    def output(self, now: int) -> float:
        """Voltage at the pin at `now`, with noise; never below 0."""
        volts = self._after if now >= self._valid else self._before
        return max(0.0, volts + self._offset + self._rng.gauss(0.0, self._noise))


# An HC-SR04 detects objects within 15 degrees of its axis, those at the edge only if large.
RAYS = tuple(radians(angle) for angle in (-12, -6, 0, 6, 12))
ENDLESS_US, SILENT_US, NOTHING_US = 0xFFFF, 0, 60_000  # as the emulator takes them
SHORTEST_US = 100  # the sensor detects nothing while its burst leaves


EchoFault = Literal["plain", "silent", "endless", "stuck"]


class EchoSensor:
    """One HC-SR04."""

    def __init__(self, kind: str, truth: SensorTruth, rng: Random) -> None:
        self.facts: EchoFacts = ECHOES[kind]
        self.fault: EchoFault = "plain"
        self._stuck: float | None = None
        self._spread, self._rng = truth.echo_spread, rng

    def distance(self, world: World, pose: Pose) -> float:
        """Distance (m) of the nearest object in the cone, with noise; inf when there is none."""
        if self.fault == "stuck" and self._stuck is not None:
            return self._stuck
        self._stuck = self._measured(world, pose)
        return self._stuck

    def _measured(self, world: World, pose: Pose) -> float:
        nearest = min(
            world.distance(pose.x, pose.y, pose.heading + ray, is_light=False) for ray in RAYS
        )
        if nearest == inf:
            return inf
        return max(nearest + self._rng.gauss(0.0, self._spread), 0.0)

    def reading(self, now: int, world: World, pose: Pose) -> Range:
        """What a board makes of a measurement."""
        if self.fault in ("silent", "endless"):
            return Range(now, 0.0, "fault")
        distance = self.distance(world, pose)
        if distance == inf:
            return Range(now, self.facts.reach, "clear")
        return Range(now, *echo_distance(2 * distance / SPEED_OF_SOUND, self.facts))

    def echo_us(self, world: World, pose: Pose) -> int:
        """Length of the echo in us for an emulated board."""
        if self.fault in ("silent", "endless"):
            return ENDLESS_US if self.fault == "endless" else SILENT_US
        distance = self.distance(world, pose)
        if distance == inf:
            return NOTHING_US
        return min(max(round(2e6 * distance / SPEED_OF_SOUND), SHORTEST_US), NOTHING_US)


TURN_TIME = round(TURN * SECOND)
SECTOR_TIME = 20_000_000  # ns, of a lidar's turn, within which the robot moves evenly
# rad; by which what a sector sees may lie aside of it, for the robot moves while it is measured
SECTOR_MARGIN = 0.15
TARGET_WIDTH = 0.3  # m, of the board that `put_before` places


class Scanner:
    """One simulated lidar. It measures each ray at its own time, clockwise as real ones do."""

    def __init__(
        self, model: LidarModel, spread: float, rng: Random, upside_down: bool = False
    ) -> None:
        """`spread`: standard deviation of a distance, m."""
        self.model, self._spread, self._rng = model, spread, rng
        self.step = model.ray_angle if upside_down else -model.ray_angle
        self._sectors = max(1, round(model.period / SECTOR_TIME))
        self._sector = 0  # of the present turn, which began at `_begin`
        self._begin = 0
        self._distances: list[float] = []
        self._pose: Pose | None = None  # at the end of the last sector
        self.due = model.period // self._sectors
        self.is_zero = self.is_blocked = False

    def sweep(self, now: int, world: World, pose: Pose) -> Scan | None:
        """Measure the sector that ends now, at this pose in the world; the turn if it ends, too."""
        rays, first = self.model.rays, len(self._distances)
        self._sector += 1
        last = rays * self._sector // self._sectors
        before, self._pose = self._pose or pose, pose
        half = 0.5 * (last - first) * self.model.ray_angle
        middle = 0.5 * (before.heading + pose.heading) + 0.5 * (first + last) * self.step
        ahead = world.towards(pose.x, pose.y, middle, half + SECTOR_MARGIN)
        for ray in range(first, last):
            share = (ray - first) / (last - first)
            x = before.x + share * (pose.x - before.x)
            y = before.y + share * (pose.y - before.y)
            heading = before.heading + share * (pose.heading - before.heading)
            distance = ahead.distance(x, y, heading + ray * self.step)
            self._distances.append(self._measured(distance))
        is_whole = self._sector == self._sectors
        scan = None
        if is_whole:
            duration = self.model.period / SECOND
            scan = Scan(now, 0.0, self.step, tuple(self._distances), duration)
            self._sector, self._distances = 0, []
            self._begin += self.model.period
        self.due = self._begin + self.model.period * (self._sector + 1) // self._sectors
        return scan

    def _measured(self, distance: float) -> float:
        """What it reports of a distance (m): inf when clear, 0 when too close."""
        near = self.model.near
        if self.is_zero:
            return 0.0
        if distance > self.model.reach:
            return inf
        if distance < near:
            return 0.0
        return (
            max(near, distance + self._rng.gauss(0.0, self._spread)) if self._spread else distance
        )


class RangeSensors:
    """All distance sensors of one robot. `pose` is the pose of its base_link in the world.

    `next_sharp` and `next_scan`: when a sensor of each kind next measures, ns; a lidar measures in
    sectors.
    """

    __slots__ = (
        "_held",
        "_silent",
        "_turn",
        "echoes",
        "further",
        "next_scan",
        "next_sharp",
        "next_turn",
        "scanners",
        "sharps",
        "world",
    )

    def __init__(
        self,
        world: World,
        sharps: list[tuple[MountedSensor, Sharp]],
        scanners: list[tuple[MountedSensor, Scanner]],
        echoes: Sequence[tuple[MountedSensor, EchoSensor]] = (),
    ) -> None:
        self.world, self.sharps, self.scanners = world, sharps, scanners
        self.echoes = {mounting.name: (mounting, sensor) for mounting, sensor in echoes}
        kinds = {mounting.name: mounting.kind for mounting, _ in (*sharps, *echoes)}
        self.further = further_sensors(kinds)
        """names of the sensors that the board measures in turn"""
        self._turn = 0
        self._silent: set[str] = set()
        self._held: dict[str, float] = {}  # V, of sensors that are stuck
        self.next_turn = TURN_TIME if self.further else NEVER
        # In an empty world a Sharp sensor never measures anything.
        self.next_sharp = NEVER if world.empty else self._next_sharp()
        self.next_scan = self._next_scan()

    def volts(self, now: int) -> dict[str, float]:
        """The Sharp sensors' output voltages, by sensor name."""
        return {
            mounting.name: self._output(mounting.name, sensor, now)
            for mounting, sensor in self.sharps
        }

    def _output(self, name: str, sensor: Sharp, now: int) -> float:
        if name in self._silent:
            return 0.0
        return self._held[name] if name in self._held else sensor.output(now)

    def set_faults(self, now: int, faults: ActiveFaults) -> None:
        """What is wrong from `now` (ns) on."""
        self._silent = {
            each.name for each, _ in self.sharps if faults.of("range_silent", each.name)
        }
        self._held = {
            each.name: self._held[each.name] if each.name in self._held else sensor.output(now)
            for each, sensor in self.sharps
            if faults.of("range_stuck", each.name)
        }
        kinds: tuple[EchoFault, ...] = ("silent", "endless", "stuck")
        for name, (_, echo) in self.echoes.items():
            active = (kind for kind in kinds if faults.of(f"range_{kind}", name))
            echo.fault = next(active, "plain")
        for _, scanner in self.scanners:
            scanner.is_zero = faults.has("lidar_zero")
            scanner.is_blocked = faults.has("lidar_blocked")

    def sharp_curves(self) -> dict[str, Callable[[float], float]]:
        """The voltage of each Sharp sensor at a distance (m), without noise."""
        return {mounting.name: sensor.volts_at for mounting, sensor in self.sharps}

    def measure(self, now: int, pose: Pose) -> None:
        """Let every Sharp sensor measure that is due."""
        for mounting, sensor in self.sharps:
            if sensor.due <= now:
                world = self.world.at(now / SECOND)
                sensor.measure(world.distance(*_sensor_pose(mounting, pose)))
        self.next_sharp = self._next_sharp()

    def take_turn(self, now: int, pose: Pose) -> tuple[str, Message]:
        """(name, message) of the sensor whose turn it is."""
        self.next_turn += TURN_TIME
        name = self.further[self._turn]
        self._turn = (self._turn + 1) % len(self.further)
        if name in self.echoes:
            mounting, echo = self.echoes[name]
            world = self.world.at(now / SECOND)
            return name, echo.reading(now, world, _sensor_pose(mounting, pose))
        sharp = next(sharp for mounting, sharp in self.sharps if mounting.name == name)
        return name, Volts(now, self._output(name, sharp, now))

    def echo_us(self, name: str, pose: Pose) -> int:
        """Length of the echo of a sensor in us, for an emulated board."""
        mounting, echo = self.echoes[name]
        return echo.echo_us(self.world, _sensor_pose(mounting, pose))

    def scan(self, now: int, pose: Pose) -> list[tuple[str, Scan]]:
        """(sensor name, scan) of every scanner whose turn ends now."""
        scans = []
        for mounting, scanner in self.scanners:
            if scanner.due <= now:
                world = self.world.at(now / SECOND)
                scan = scanner.sweep(now, world, _sensor_pose(mounting, pose))
                if scan is not None and not scanner.is_blocked:
                    scans.append((mounting.name, scan))
        self.next_scan = self._next_scan()
        return scans

    def put_before(self, name: str, distance: float, now: int, pose: Pose) -> None:
        """Replace the world by a wide board across a sensor's axis, `distance` (m) from it."""
        mounting = next(mounting for mounting, _ in self.sharps if mounting.name == name)
        x, y, bearing = _sensor_pose(mounting, pose)
        c, s = cos(bearing), sin(bearing)
        x, y, half = x + distance * c, y + distance * s, 0.5 * TARGET_WIDTH
        self.set_world(now, World([Wall(x - half * s, y + half * c, x + half * s, y - half * c)]))

    def set_world(self, now: int, world: World) -> None:
        """Other obstacles from `now` (ns) on."""
        self.world = world
        for _, sensor in self.sharps:
            sensor.catch_up(now)
        self.next_sharp = self._next_sharp()

    def _next_sharp(self) -> int:
        return min([sensor.due for _, sensor in self.sharps], default=NEVER)

    def _next_scan(self) -> int:
        return min([scanner.due for _, scanner in self.scanners], default=NEVER)


def _sensor_pose(mounting: MountedSensor, pose: Pose) -> Pose:
    """Pose of a sensor in the world; it measures along its heading."""
    return pose.to_parent(Pose(mounting.x, mounting.y, mounting.heading))


def draw_sharps(
    mountings: Sequence[MountedSensor], errors: Mapping[str, SensorTruth], rng: Random
) -> list[tuple[MountedSensor, Sharp]]:
    """A Sharp sensor for each of the mountings, with its own generator."""
    sensors = []
    for mounting in mountings:
        truth = errors.get(mounting.name) or SensorTruth()
        facts = sensor_facts(mounting.kind)
        assert isinstance(facts, SharpFacts)
        sensor = Sharp(truth.noise, truth.offset, Random(rng.getrandbits(64)), facts=facts)
        sensors.append((mounting, sensor))
    return sensors


def draw_echoes(
    mountings: Sequence[MountedSensor], errors: Mapping[str, SensorTruth], rng: Random
) -> list[tuple[MountedSensor, EchoSensor]]:
    """An ultrasonic sensor for each of the mountings that is one, with its own generator."""
    return [
        (
            mounting,
            EchoSensor(
                mounting.kind,
                errors.get(mounting.name) or SensorTruth(),
                Random(rng.getrandbits(64)),
            ),
        )
        for mounting in mountings
        if mounting.kind in ECHOES
    ]


def draw_scanners(
    mountings: Sequence[MountedSensor], errors: Mapping[str, SensorTruth], rng: Random
) -> list[tuple[MountedSensor, Scanner]]:
    """A laser scanner for each of the mountings that is one, with its own generator."""
    scanners = []
    for mounting in mountings:
        model = LIDARS.get(mounting.kind)
        if model is not None:
            truth = errors.get(mounting.name) or SensorTruth()
            generator = Random(rng.getrandbits(64))
            scanner = Scanner(model, truth.spread, generator, mounting.upside_down)
            scanners.append((mounting, scanner))
    return scanners
