"""The sensors that look into the world: distance sensors and laser scanners."""

from __future__ import annotations

from math import cos, sin

from diffbotctl.messages import Scan
from diffbotctl.plant.chassis import Pose
from diffbotctl.plant.laser_scanner import Scanner
from diffbotctl.plant.robot_parameters import MountedSensor
from diffbotctl.plant.sharp_ir import Sharp
from diffbotctl.plant.world import Wall, World
from diffbotctl.time import NEVER

BOARD = 0.3  # m, width of what a hand puts before a sensor


class RangeSensors:
    """All of one robot. `at` is the pose of its base_link in the world.

    `next_look` and `next_scan`: when one of them next measures, ns.
    """

    __slots__ = ("next_look", "next_scan", "scanners", "sharps", "world")

    def __init__(
        self,
        world: World,
        sharps: list[tuple[MountedSensor, Sharp]],
        scanners: list[tuple[MountedSensor, Scanner]],
    ) -> None:
        self.world = world
        self.sharps = sharps
        self.scanners = scanners
        # In an empty world a distance sensor sees nothing, whenever it looks.
        sees = not world.empty
        self.next_look = min([s.due for _, s in sharps], default=NEVER) if sees else NEVER
        self.next_scan = min([s.due for _, s in scanners], default=NEVER)

    def volts(self, now: int) -> dict[str, float]:
        """The distance sensors' output voltages."""
        return {mounting.name: sensor.output(now) for mounting, sensor in self.sharps}

    def look(self, now: int, at: Pose) -> None:
        """Let every distance sensor measure that is due."""
        for mounting, sensor in self.sharps:
            if sensor.due <= now:
                sensor.measure(self.world.distance(*_eye(mounting, at)))
        self.next_look = min(sensor.due for _, sensor in self.sharps)

    def scan(self, now: int, at: Pose) -> list[tuple[str, Scan]]:
        """What every scanner saw whose turn ends now, by its name."""
        found = []
        for mounting, scanner in self.scanners:
            if scanner.due <= now:
                told = scanner.measure(self.world, *_eye(mounting, at))
                found.append((mounting.name, Scan(now, 0.0, scanner.step, told)))
        self.next_scan = min(scanner.due for _, scanner in self.scanners)
        return found

    def put_before(self, name: str, distance: float, now: int, at: Pose) -> None:
        """Put a wide board across a sensor's axis, `distance` (m) from it; take all else away."""
        mounting = next(each for each, _ in self.sharps if each.name == name)
        x, y, bearing = _eye(mounting, at)
        ahead, aside = cos(bearing), sin(bearing)
        x, y = x + distance * ahead, y + distance * aside
        half = 0.5 * BOARD
        self.world = World(
            [Wall(x - half * aside, y + half * ahead, x + half * aside, y - half * ahead)]
        )
        for _, sensor in self.sharps:
            sensor.catch_up(now)
        self.next_look = min(sensor.due for _, sensor in self.sharps)


def _eye(mounting: MountedSensor, at: Pose) -> tuple[float, float, float]:
    """Where in the world a sensor sits, and where it looks."""
    x = at.x + mounting.x * cos(at.heading) - mounting.y * sin(at.heading)
    y = at.y + mounting.x * sin(at.heading) + mounting.y * cos(at.heading)
    return x, y, at.heading + mounting.heading
