"""Sets of recorded drives of random robots, as files that `calibrate from-log` reads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import cos, isnan, nan, pi, radians, sin
from pathlib import Path
from random import Random

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats, Geometry

STEP_M = 0.005  # of a wheel, between two rows
PERIOD_S = 0.02
REST_ROWS = 15  # before and after a drive

Steps = list[tuple[float, float]]
"""m that the right and the left wheel rolled by odometry"""


@dataclass(frozen=True, slots=True)
class DrawnDrive:
    """One drive."""

    name: str
    times: Floats
    counts: Floats
    """(rows, 2): of the right and left wheel"""
    end: tuple[float, float, float]
    """as noted: x, y in m, heading in rad, nan if it was not measured"""
    turned: float
    """rad; sum of the turns to the left, less those to the right"""


@dataclass(frozen=True, slots=True)
class DriveSet:
    """Drives of one robot, its stated and its true geometry."""

    stated: Geometry
    true: Geometry
    slots: int
    drives: list[DrawnDrive]
    heading_column: str = "heading"

    @property
    def is_two_way(self) -> bool:
        """Whether there are drives to the left and to the right."""
        turns = [drive.turned for drive in self.drives]
        return min(turns) < -1.0 and max(turns) > 1.0

    @property
    def has_headings(self) -> bool:
        return not any(isnan(drive.end[2]) for drive in self.drives)

    def write(self, folder: Path) -> list[str]:
        """Write robot, drives and ends into `folder`. Returns arguments of `from-log`."""
        folder.mkdir(parents=True, exist_ok=True)
        robot, ends = folder / "robot.yaml", folder / "ends.csv"
        stated = self.stated
        robot.write_text(
            "format: 1\nkind: robot\ninclude: book_2wd\n"
            f"drive: {{track: {stated.track!r} m, wheel: {{diameter: {stated.mean!r} m}}, "
            f"encoder: {{slots: {self.slots}, glitch: 10 us}}}}\n"
            "body: {width: 0.6 m}\nlimits: {speed: 0.1 m/s}\ncalibration: {}\n"
        )
        lines = [f"recording,x,y,{self.heading_column}"]
        files = []
        for drive in self.drives:
            file = folder / f"{drive.name}.csv"
            rows = zip(drive.times, *drive.counts.T, strict=True)
            text = "".join(f"{time:.3f},{right:.0f},{left:.0f}\n" for time, right, left in rows)
            file.write_text(f"time,right,left\n{text}")
            files.append(str(file))
            x, y, heading = drive.end
            lines.append(f"{drive.name},{x!r},{y!r},{'' if isnan(heading) else repr(heading)}")
        ends.write_text("\n".join(lines) + "\n")
        return [*files, "--robot", str(robot), "--ends", str(ends)]


def _straight(length: float) -> Steps:
    count = max(1, round(abs(length) / STEP_M))
    return [(length / count, length / count)] * count


def _arc(radius: float, angle: float, track: float) -> Steps:
    """An arc of `angle` rad, to the left if positive; on the spot with radius 0."""
    way, turn = abs(angle) * radius, angle * track / 2
    count = max(1, round((way + abs(turn)) / STEP_M))
    return [((way + turn) / count, (way - turn) / count)] * count


def _square(rng: Random, track: float) -> Steps:
    side, turn = rng.uniform(0.5, 2.0), rng.choice((-1, 1)) * pi / 2
    return 4 * [*_straight(side), *_arc(0.0, turn, track)]


def _circle(rng: Random, track: float) -> Steps:
    return _arc(rng.uniform(0.2, 1.0), rng.choice((-1, 1)) * rng.uniform(pi, 4 * pi), track)


def _joystick(rng: Random, track: float) -> Steps:
    steps: Steps = []
    for _ in range(rng.randint(4, 12)):
        kind = rng.random()
        if kind < 0.3:
            steps += _straight(rng.uniform(0.2, 1.2))
        elif kind < 0.5:
            steps += _arc(0.0, rng.uniform(-pi, pi), track)
        else:
            radius, angle = rng.uniform(0.15, 1.0), rng.uniform(0.3, pi)
            steps += _arc(radius, rng.choice((-1, 1)) * angle, track)
    return steps


def _there_and_back(rng: Random, track: float) -> Steps:
    length, turn = rng.uniform(0.5, 2.0), rng.choice((-1, 1)) * pi
    return 2 * [*_straight(length), *_arc(0.0, turn, track)]


def _line(rng: Random, track: float) -> Steps:
    return _straight(rng.uniform(1.0, 3.0))


PATHS: dict[str, Callable[[Random, float], Steps]] = {
    "square": _square,
    "circle": _circle,
    "joystick": _joystick,
    "there": _there_and_back,
    "line": _line,
}
STYLES = (("square",), ("circle",), ("joystick",), ("square", "line"), tuple(PATHS), tuple(PATHS))


def draw_set(seed: object) -> DriveSet:
    """A random robot, four to ten drives of it, and ends that were measured with random noise."""
    rng = Random(f"drives {seed}")
    diameter = rng.uniform(0.03, 0.20)
    stated = Geometry(diameter, diameter, rng.uniform(max(0.07, diameter / 1.2), 0.40))
    wheel, track = rng.choice((0.002, 0.01, 0.03)), rng.choice((0.01, 0.03, 0.08))
    right, left = (diameter * (1 + rng.uniform(-wheel, wheel)) for _ in range(2))
    true = Geometry(right, left, stated.track * (1 + rng.uniform(-track, track)))
    slots = rng.choice((20, 20, 64, 360, 2048))
    noise = _Noise(
        slip=rng.choice((0.0002, 0.0005, 0.001)),
        position=rng.choice((0.001, 0.002, 0.004, 0.008)),
        heading=radians(rng.choice((0.5, 1.0, 2.0, 4.0))) if rng.random() < 0.75 else nan,
        start=rng.choice((0.0, 0.0, radians(0.5))),
    )
    style = rng.choice(STYLES)
    drives = []
    for number in range(rng.randint(4, 10)):
        kind = rng.choice(style)
        steps = PATHS[kind](rng, stated.track)
        drives.append(_drive(rng, f"{kind}-{number}", steps, stated, true, slots, noise))
    return DriveSet(stated, true, slots, drives)


@dataclass(frozen=True, slots=True)
class _Noise:
    """Standard deviations: m per square root of m, m, rad (nan: not measured), rad."""

    slip: float
    position: float
    heading: float
    start: float


def _drive(
    rng: Random,
    name: str,
    steps: Steps,
    stated: Geometry,
    true: Geometry,
    slots: int,
    noise: _Noise,
) -> DrawnDrive:
    draw = np.random.default_rng(rng.getrandbits(32))
    turns = np.array(steps) / (pi * np.array([stated.right, stated.left]))
    rolled = turns * pi * np.array([true.right, true.left])
    rolled += draw.normal(size=rolled.shape) * noise.slip * np.sqrt(np.abs(rolled))
    turned = (rolled[:, 0] - rolled[:, 1]) / true.track
    headings = np.cumsum(turned)
    middle, chord = headings - turned / 2, rolled.mean(axis=1)
    start = draw.normal() * noise.start
    x, y = (chord * np.cos(middle + start)).sum(), (chord * np.sin(middle + start)).sum()
    heading = nan
    if not isnan(noise.heading):
        heading = float(headings[-1] + start + draw.normal() * noise.heading)
        heading = (heading + pi) % (2 * pi) - pi
    angles = np.concatenate([np.zeros((1, 2)), np.cumsum(turns, axis=0)]) * slots
    counts = np.floor(angles + draw.uniform(size=2))
    counts = np.pad(counts, ((REST_ROWS, REST_ROWS), (0, 0)), mode="edge")
    error = draw.normal(size=2) * noise.position
    return DrawnDrive(
        name,
        np.linspace(0.0, PERIOD_S * (len(counts) - 1), len(counts)),
        counts - counts[0],
        (float(x + error[0]), float(y + error[1]), heading),
        float(headings[-1]),
    )


# --- wrong input ---

Corruption = Callable[[DriveSet, Random], DriveSet]


def _ends(change: Callable[[float, float, float], tuple[float, float, float]]) -> Corruption:
    def corrupt(drawn: DriveSet, rng: Random) -> DriveSet:
        drives = [replace(drive, end=change(*drive.end)) for drive in drawn.drives]
        return replace(drawn, drives=drives)

    return corrupt


def _counts(change: Callable[[Floats, Random], Floats]) -> Corruption:
    def corrupt(drawn: DriveSet, rng: Random) -> DriveSet:
        wheel = rng.randrange(2)
        drives = []
        for drive in drawn.drives:
            counts = drive.counts.copy()
            counts[:, wheel] = change(counts[:, wheel], rng)
            drives.append(replace(drive, counts=counts))
        return replace(drawn, drives=drives)

    return corrupt


def _shifted(drawn: DriveSet, rng: Random) -> DriveSet:
    by = rng.choice((-1, 1))
    count = len(drawn.drives)
    drives = [
        replace(drive, end=drawn.drives[(number + by) % count].end)
        for number, drive in enumerate(drawn.drives)
    ]
    return replace(drawn, drives=drives)


def _gap(drawn: DriveSet, rng: Random) -> DriveSet:
    """A third of the rows of one drive is missing, with the counts in them."""
    number = rng.randrange(len(drawn.drives))
    drive = drawn.drives[number]
    rows = len(drive.times)
    first = rng.randint(rows // 10, rows // 2)
    kept = [*range(first), *range(first + rows // 3, rows)]
    broken = replace(drive, times=drive.times[kept], counts=drive.counts[kept])
    drives = [*drawn.drives[:number], broken, *drawn.drives[number + 1 :]]
    return replace(drawn, drives=drives)


def _without_ends(drawn: DriveSet, rng: Random) -> DriveSet:
    """The last twentieth of the rows of each drive is missing."""
    drives = []
    for drive in drawn.drives:
        rows = len(drive.times) - REST_ROWS - len(drive.times) // 20
        drives.append(replace(drive, times=drive.times[:rows], counts=drive.counts[:rows]))
    return replace(drawn, drives=drives)


def _stopped(column: Floats, rng: Random) -> Floats:
    row = rng.randint(len(column) // 4, len(column) // 2)
    return np.append(column[:row], np.full(len(column) - row, column[row]))


def _swapped(drawn: DriveSet, rng: Random) -> DriveSet:
    drives = [replace(drive, counts=drive.counts[:, ::-1]) for drive in drawn.drives]
    return replace(drawn, drives=drives)


def _other_slots(drawn: DriveSet, rng: Random) -> DriveSet:
    """The robot file states a tenth more or fewer slots than the discs have."""
    return replace(drawn, slots=round(drawn.slots * rng.choice((0.9, 1.1))))


def _degrees(drawn: DriveSet, rng: Random) -> DriveSet:
    return _ends(lambda x, y, heading: (x, y, heading * 180 / pi))(drawn, rng)


def _radians(drawn: DriveSet, rng: Random) -> DriveSet:
    return replace(drawn, heading_column="heading_deg")


def _random_ends(drawn: DriveSet, rng: Random) -> DriveSet:
    def any_end(x: float, y: float, heading: float) -> tuple[float, float, float]:
        way, bearing = rng.uniform(0.1, 1.5), rng.uniform(-pi, pi)
        return way * cos(bearing), way * sin(bearing), rng.uniform(-pi, pi)

    return _ends(any_end)(drawn, rng)


CORRUPTIONS: dict[str, Corruption] = {
    "x and y exchanged": _ends(lambda x, y, heading: (y, x, heading)),
    "degrees for radians": _degrees,
    "radians for degrees": _radians,
    "ends mirrored": _ends(lambda x, y, heading: (x, -y, -heading)),
    "y of the wrong sign": _ends(lambda x, y, heading: (x, -y, heading)),
    "headings of the wrong sign": _ends(lambda x, y, heading: (x, y, -heading)),
    "ends of the next drive": _shifted,
    "random ends": _random_ends,
    "millimetres": _ends(lambda x, y, heading: (1000 * x, 1000 * y, heading)),
    "x measured five per cent too long": _ends(lambda x, y, heading: (1.05 * x, y, heading)),
    "y measured five per cent too short": _ends(lambda x, y, heading: (x, 0.95 * y, heading)),
    "yards": _ends(lambda x, y, heading: (x / 0.9144, y / 0.9144, heading)),
    "centimetres": _ends(lambda x, y, heading: (100 * x, 100 * y, heading)),
    "columns swapped": _swapped,
    "encoder reversed": _counts(lambda column, rng: -column),
    "encoder dead": _counts(lambda column, rng: np.zeros_like(column)),
    "encoder misses half": _counts(lambda column, rng: np.floor(column / 2)),
    "encoder misses one in fourteen": _counts(lambda column, rng: np.floor(column * 13 / 14)),
    "other slots": _other_slots,
    "counter of 8 bits": _counts(lambda column, rng: (column + 128) % 256),
    "ticks of each row": _counts(lambda column, rng: np.diff(column, prepend=0.0)),
    "gap": _gap,
    "ends of the drives missing": _without_ends,
    "encoder stops": _counts(_stopped),
}
NEEDS_HEADINGS = ("degrees for radians", "radians for degrees", "headings of the wrong sign")
