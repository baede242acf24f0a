"""The simulated sensors that measure distances in the world: Sharp sensors and laser scanners."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import cos, inf, sin
from random import Random

from diffbotctl.config.simulation import SensorTruth
from diffbotctl.geometry.distance_sensors import (
    ECHOES,
    TURN,
    SharpFacts,
    further_sensors,
    sensor_facts,
)
from diffbotctl.messages import Message, Scan, Volts
from diffbotctl.model.laser_scanners import LASER_SCANNERS, ScannerModel
from diffbotctl.plant.chassis import Pose
from diffbotctl.plant.echo_sensor import EchoSensor
from diffbotctl.plant.robot_parameters import MountedSensor
from diffbotctl.plant.sharp_ir import Sharp
from diffbotctl.plant.world import Wall, World
from diffbotctl.time import NEVER, SECOND

TURN_TIME = round(TURN * SECOND)
TARGET_WIDTH = 0.3  # m, of the board that `put_before` places


class Scanner:
    """One simulated scanner. All rays of a turn are measured at its end, at one moment.

    The first ray of a real scanner is a fifth of a second older than the last one: 44 mm at
    0.22 m/s, which a driver that knows the robot's motion corrects.
    """

    def __init__(self, model: ScannerModel, spread: float, rng: Random) -> None:
        """`spread`: standard deviation of a distance, m."""
        self.model, self._spread, self._rng = model, spread, rng
        self.due = model.period

    def measure(self, world: World, x: float, y: float, heading: float) -> tuple[float, ...]:
        """Distances (m) seen from (x, y) in the world: inf when clear, 0 when too close."""
        self.due += self.model.period
        nearest, reach, spread = self.model.nearest, self.model.reach, self._spread
        gauss = self._rng.gauss
        distances = []
        for distance in world.scan(x, y, heading, self.model.rays):
            if distance > reach:
                distances.append(inf)
            elif distance < nearest:
                distances.append(0.0)
            elif spread:
                measured = distance + gauss(0.0, spread)
                distances.append(measured if measured > nearest else nearest)
            else:
                distances.append(distance)
        return tuple(distances)


class RangeSensors:
    """All distance sensors of one robot. `pose` is the pose of its base_link in the world.

    `next_sharp` and `next_scan`: when a sensor of each kind next measures, ns.
    """

    __slots__ = (
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
        self.next_turn = TURN_TIME if self.further else NEVER
        # In an empty world a Sharp sensor never measures anything.
        self.next_sharp = NEVER if world.empty else self._next_sharp()
        self.next_scan = self._next_scan()

    def volts(self, now: int) -> dict[str, float]:
        """The Sharp sensors' output voltages, by sensor name."""
        return {mounting.name: sensor.output(now) for mounting, sensor in self.sharps}

    def sharp_curves(self) -> dict[str, Callable[[float], float]]:
        """The voltage of each Sharp sensor at a distance (m), without noise."""
        return {mounting.name: sensor.volts_at for mounting, sensor in self.sharps}

    def measure(self, now: int, pose: Pose) -> None:
        """Let every Sharp sensor measure that is due."""
        for mounting, sensor in self.sharps:
            if sensor.due <= now:
                sensor.measure(self.world.distance(*_sensor_pose(mounting, pose)))
        self.next_sharp = self._next_sharp()

    def take_turn(self, now: int, pose: Pose) -> tuple[str, Message]:
        """(name, message) of the sensor whose turn it is."""
        self.next_turn += TURN_TIME
        name = self.further[self._turn]
        self._turn = (self._turn + 1) % len(self.further)
        if name in self.echoes:
            mounting, echo = self.echoes[name]
            return name, echo.reading(now, self.world, _sensor_pose(mounting, pose))
        sharp = next(sharp for mounting, sharp in self.sharps if mounting.name == name)
        return name, Volts(now, sharp.output(now))

    def echo_us(self, name: str, pose: Pose) -> int:
        """Length of the echo of a sensor in us, for an emulated board."""
        mounting, echo = self.echoes[name]
        return echo.echo_us(self.world, _sensor_pose(mounting, pose))

    def scan(self, now: int, pose: Pose) -> list[tuple[str, Scan]]:
        """(sensor name, scan) of every scanner whose turn ends now."""
        scans = []
        for mounting, scanner in self.scanners:
            if scanner.due <= now:
                distances = scanner.measure(self.world, *_sensor_pose(mounting, pose))
                scans.append((mounting.name, Scan(now, 0.0, scanner.model.ray_angle, distances)))
        self.next_scan = self._next_scan()
        return scans

    def put_before(self, name: str, distance: float, now: int, pose: Pose) -> None:
        """Replace the world by a wide board across a sensor's axis, `distance` (m) from it."""
        mounting = next(mounting for mounting, _ in self.sharps if mounting.name == name)
        x, y, bearing = _sensor_pose(mounting, pose)
        c, s = cos(bearing), sin(bearing)
        x, y, half = x + distance * c, y + distance * s, 0.5 * TARGET_WIDTH
        self.world = World([Wall(x - half * s, y + half * c, x + half * s, y - half * c)])
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
        model = LASER_SCANNERS.get(mounting.kind)
        if model is not None:
            truth = errors.get(mounting.name) or SensorTruth()
            scanner = Scanner(model, truth.spread, Random(rng.getrandbits(64)))
            scanners.append((mounting, scanner))
    return scanners
