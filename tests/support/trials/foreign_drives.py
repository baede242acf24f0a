"""Recorded drives of robots that slip, scrub and lean, by equations unlike those of the plant.

Commands are followed with a lag; the diameter of a tyre falls with its load, the track grows with
the speed, slip grows with acceleration and drifts slowly, the floor is not plane, and a caster
kicks the robot round at each reversal. The ends are read from a tape and a protractor that round,
by a person who always puts the robot down a little askew; or a camera sees the whole drive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil, cos, isnan, nan, pi, radians, sin
from pathlib import Path
from random import Random
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats, Geometry

STEP_S = 0.01
REST_S = 0.5  # before and after a drive
PITCH_RATIO_MAX = 0.19  # of the track; coarser discs are refused
TURN_MIN_RAD = 1.0  # to one side, of a drive that turns to it

Command = tuple[float, float, float]
"""m/s, rad/s, s"""


@dataclass(frozen=True, slots=True)
class ForeignRobot:
    """Effects that the calibration's model does not contain."""

    track: float
    diameters: tuple[float, float]
    """m, of the right and left wheel under their usual load"""
    lag_s: float
    load: float
    """relative change of a diameter by a lateral acceleration of 1 m/s^2"""
    scrub: float
    """relative growth of the track by a speed of 1 m/s"""
    skid: float
    """share of the way that is lost at an acceleration of 1 m/s^2"""
    drift: float
    """relative standard deviation of the slip, which changes within half a second"""
    floor: float
    """rad per m by which the unevenness of the floor turns the robot, at most"""
    caster: float
    """rad, standard deviation of a kick at a reversal"""


@dataclass(frozen=True, slots=True)
class ForeignDrive:
    """One recorded drive."""

    name: str
    times: Floats
    counts: Floats
    """(rows, 2): of the right and left wheel since the start"""
    poses: Floats
    """(rows, 3): seen by a camera: x, y in m, heading in rad; nan in the rows between"""
    end: tuple[float, float, float]
    """as noted by a person"""
    turned: float
    """rad, to the left"""


class TableFormat(NamedTuple):
    """How the tables are written."""

    header: tuple[str, ...] = ("time", "right", "left")
    newline: str = "\n"
    is_degrees: bool = True
    is_camera: bool = False
    """the poses stand in the file of the drive; else its end stands in the table of ends"""
    time_factor: float = 1.0
    time_digits: int = 3


@dataclass(frozen=True, slots=True)
class ForeignSet:
    """Drives of one robot, its stated and its effective geometry."""

    stated: Geometry
    true: Geometry
    slots: int
    drives: list[ForeignDrive]
    format: TableFormat
    edits: Mapping[str, Callable[[str], str]] = field(default_factory=dict)
    """changes of the texts of tables by their role: `counts` or `ends`"""

    @property
    def is_two_way(self) -> bool:
        """Whether there are drives to the left and to the right."""
        turns = [drive.turned for drive in self.drives]
        return min(turns) < -TURN_MIN_RAD and max(turns) > TURN_MIN_RAD

    @property
    def has_headings(self) -> bool:
        return not any(isnan(drive.end[2]) for drive in self.drives)

    def write(self, folder: Path) -> list[str]:
        """Write robot, drives and ends into `folder`. Returns arguments of `from-log`."""
        folder.mkdir(parents=True, exist_ok=True)
        robot, stated = folder / "robot.yaml", self.stated
        robot.write_text(
            "format: 1\nkind: robot\ninclude: book_2wd\n"
            f"drive: {{track: {stated.track!r} m, wheel: {{diameter: {stated.mean!r} m}}, "
            f"encoder: {{slots: {self.slots}, glitch: 10 us}}}}\n"
            "body: {width: 0.8 m}\nlimits: {speed: 0.1 m/s}\ncalibration: {}\n"
        )
        arguments = [*self._write_drives(folder), "--robot", str(robot)]
        if not self.format.is_camera:
            ends = folder / "ends.csv"
            self._write_text(ends, "ends", self._end_lines())
            arguments += ["--ends", str(ends)]
        return arguments

    def _write_drives(self, folder: Path) -> list[str]:
        files = []
        for drive in self.drives:
            file = folder / f"{drive.name}.csv"
            columns = {"right": drive.counts[:, 0], "left": drive.counts[:, 1]}
            cells = {name: [f"{value:.0f}" for value in each] for name, each in columns.items()}
            times = drive.times * self.format.time_factor
            cells["time"] = [f"{time:.{self.format.time_digits}f}" for time in times]
            for number, name in enumerate(("x", "y", "heading")):
                values = drive.poses[:, number]
                cells[name] = ["" if isnan(value) else f"{value:.4f}" for value in values]
            cells["volts"] = ["7.4"] * len(drive.times)
            rows = zip(*(cells[name] for name in self.format.header), strict=True)
            lines = [",".join(self.format.header), *(",".join(row) for row in rows)]
            self._write_text(file, "counts", lines)
            files.append(str(file))
        return files

    def _end_lines(self) -> list[str]:
        name = "heading_deg" if self.format.is_degrees else "heading"
        factor = 180 / pi if self.format.is_degrees else 1.0
        lines = [f"recording,x,y,{name}"]
        for drive in self.drives:
            x, y, heading = drive.end
            cell = "" if isnan(heading) else f"{heading * factor:.10g}"
            lines.append(f"{drive.name},{x:.6g},{y:.6g},{cell}")
        return lines

    def _write_text(self, file: Path, role: str, lines: Sequence[str]) -> None:
        text = self.format.newline.join(lines) + self.format.newline
        edit = self.edits.get(role)
        file.write_text(text if edit is None else edit(text), encoding="utf-8", newline="")


# --- commands ---


def _turn(angle: float, rate: float) -> Command:
    return 0.0, rate if angle > 0.0 else -rate, abs(angle) / rate


def _square(rng: Random) -> list[Command]:
    side, speed, sign = rng.uniform(0.5, 1.8), rng.uniform(0.1, 0.4), rng.choice((-1, 1))
    turn = _turn(sign * pi / 2, rng.uniform(0.6, 2.0))
    return [(speed, 0.0, side / speed), turn] * 4


def _circle(rng: Random) -> list[Command]:
    speed, radius = rng.uniform(0.1, 0.35), rng.uniform(0.25, 0.9) * rng.choice((-1, 1))
    return [(speed, speed / radius, rng.uniform(pi, 4 * pi) * abs(radius) / speed)]


def _eight(rng: Random) -> list[Command]:
    speed, radius = rng.uniform(0.1, 0.35), rng.uniform(0.25, 0.6)
    lobe = rng.uniform(1.0, 2.2) * pi * radius / speed
    return [(speed, speed / radius, lobe), (speed, -speed / radius, rng.uniform(0.6, 1.2) * lobe)]


def _joystick(rng: Random) -> list[Command]:
    """A thumb that moves a stick: speeds that change every few tenths of a second."""
    commands: list[Command] = []
    speed, rate = 0.2, 0.0
    for _ in range(rng.randint(15, 60)):
        speed = min(max(speed + rng.gauss(0.0, 0.08), -0.15), 0.4)
        rate = 0.8 * rate + rng.gauss(0.0, 0.5)
        commands.append((speed, rate, rng.uniform(0.2, 0.8)))
    return commands


def _out_and_back(rng: Random) -> list[Command]:
    length, speed = rng.uniform(0.6, 2.5), rng.uniform(0.1, 0.4)
    turn = _turn(rng.choice((-1, 1)) * pi, rng.uniform(0.6, 2.0))
    return [(speed, 0.0, length / speed), turn, (speed, 0.0, length / speed), turn]


def _reverse(rng: Random) -> list[Command]:
    """Ahead, and back without turning round."""
    length, speed = rng.uniform(0.6, 2.0), rng.uniform(0.1, 0.3)
    back = rng.uniform(0.2, 0.9) * length
    return [(speed, 0.0, length / speed), (-speed, 0.0, back / speed)]


def _line(rng: Random) -> list[Command]:
    speed = rng.uniform(0.1, 0.4)
    return [(speed, 0.0, rng.uniform(1.0, 4.0) / speed)]


KINDS: dict[str, Callable[[Random], list[Command]]] = {
    "square": _square,
    "circle": _circle,
    "eight": _eight,
    "joystick": _joystick,
    "out": _out_and_back,
    "reverse": _reverse,
    "line": _line,
}
STYLES: tuple[tuple[str, ...], ...] = (
    *(("square",), ("circle",), ("joystick",), ("eight",), ("square", "line")),
    *(("out", "circle"), ("joystick", "reverse"), tuple(KINDS), tuple(KINDS)),
)


# --- motion ---


def _wheel_speeds(commands: Sequence[Command], track: float, lag: float) -> Floats:
    """(steps, 2): m/s that the robot's controller makes of right and left wheel."""
    rest = [(0.0, 0.0, REST_S)]
    parts = []
    for speed, rate, duration in [*rest, *commands, *rest]:
        count = max(round(duration / STEP_S), 1)
        wheels = (speed + rate * track / 2, speed - rate * track / 2)
        # The controller keeps the way exact, whatever the steps are.
        parts.append(np.tile(wheels, (count, 1)) * (duration / (count * STEP_S)))
    expected = np.concatenate(parts)
    share = 1 - np.exp(-STEP_S / lag)
    actual = np.zeros_like(expected)
    speeds = np.zeros(2)
    for number, target in enumerate(expected):
        speeds = speeds + share * (target - speeds)
        actual[number] = speeds
    actual[np.abs(actual) < 0.002] = 0.0
    return actual


class _Motion(NamedTuple):
    turns: Floats
    """(steps, 2): of right and left wheel"""
    poses: Floats
    effective: Floats
    """(5,): sums of the way and the turns of each wheel, and what the track needs"""


def _move(
    robot: ForeignRobot, speeds: Floats, stated: Geometry, draw: np.random.Generator
) -> _Motion:
    steps = speeds * STEP_S  # m, by odometry
    turned = steps / (pi * np.array([stated.right, stated.left]))
    lateral = speeds.mean(axis=1) * (speeds[:, 0] - speeds[:, 1]) / robot.track
    loads = np.stack([-lateral, lateral], axis=1) * robot.load
    way = pi * np.array(robot.diameters) * turned * (1 + loads)
    acceleration = np.abs(np.gradient(speeds, STEP_S, axis=0))
    way *= 1 - robot.skid * acceleration
    effective = np.abs(way).sum(axis=0)
    slip = np.zeros_like(way)
    state, keep = np.zeros(2), float(np.exp(-STEP_S / 0.5))
    noise = draw.normal(size=way.shape) * (1 - keep**2) ** 0.5
    for number in range(len(way)):
        state = keep * state + noise[number]
        slip[number] = state
    way = way * (1 + robot.drift * slip)
    track = robot.track * (1 + robot.scrub * np.abs(speeds).mean(axis=1))
    difference = way[:, 0] - way[:, 1]
    turn = difference / track
    signs = np.sign(np.where(np.abs(speeds.mean(axis=1)) > 0.01, speeds.mean(axis=1), np.nan))
    moving = np.flatnonzero(np.isfinite(signs))
    kicks = moving[1:][signs[moving[1:]] != signs[moving[:-1]]]
    turn[kicks] += draw.normal(size=len(kicks)) * robot.caster
    poses = np.zeros((len(way), 3))
    x = y = heading = 0.0
    phase, wave = draw.uniform(0, 2 * pi), draw.uniform(0.3, 1.0)
    for number, (chord, change) in enumerate(zip(way.mean(axis=1), turn, strict=True)):
        uneven = robot.floor * sin((x + 0.7 * y) / wave + phase) * abs(chord)
        middle = heading + (change + uneven) / 2
        x, y, heading = x + chord * cos(middle), y + chord * sin(middle), heading + change + uneven
        poses[number] = x, y, heading
    weights = np.abs(difference)
    sums = np.array(
        [*effective, *np.abs(turned).sum(axis=0), (weights * track).sum(), weights.sum()]
    )
    return _Motion(np.cumsum(turned, axis=0), poses, sums)


def _row_numbers(steps: int, rate: float, rng: Random) -> list[int]:
    """The steps at which a row was written: a usual period, jitter, and a late row now and then."""
    numbers, at = [0], 0.0
    while at < steps - 1:
        at += (1 / rate / STEP_S) * rng.uniform(0.8, 1.2) * (2.0 if rng.random() < 0.002 else 1.0)
        numbers.append(min(max(round(at), numbers[-1] + 1), steps - 1))
    return sorted(set(numbers))


class Measuring(NamedTuple):
    """How one person notes an end."""

    tape_sd: float
    tape_scale: float
    tape_mark: float
    """m, to which it is rounded"""
    angle_sd: float
    """rad; nan: not measured"""
    angle_mark: float
    start_bias: float
    """rad; each time the same"""
    start_sd: float
    place_sd: float

    def note(self, pose: Floats, rng: Random) -> tuple[float, float, float]:
        """The end as noted."""
        askew = self.start_bias + rng.gauss(0.0, self.start_sd)
        x = pose[0] * cos(askew) - pose[1] * sin(askew) + rng.gauss(0.0, self.place_sd)
        y = pose[0] * sin(askew) + pose[1] * cos(askew) + rng.gauss(0.0, self.place_sd)
        x, y = (self.tape_scale * value + rng.gauss(0.0, self.tape_sd) for value in (x, y))
        x, y = (round(value / self.tape_mark) * self.tape_mark for value in (x, y))
        if isnan(self.angle_sd):
            return x, y, nan
        angle = pose[2] + askew + rng.gauss(0.0, self.angle_sd)
        angle = round(angle / self.angle_mark) * self.angle_mark
        return x, y, float((angle + pi) % (2 * pi) - pi)


def _draw_measuring(rng: Random) -> Measuring:
    mark = rng.choice((0.001, 0.001, 0.005, 0.01))
    degrees = rng.choice((1.0, 1.0, 2.0, 5.0))
    return Measuring(
        tape_sd=rng.choice((0.001, 0.003, 0.005)),
        tape_scale=1 + rng.uniform(-0.001, 0.001),
        tape_mark=mark,
        angle_sd=radians(rng.choice((0.3, 1.0, 2.0))) if rng.random() < 0.7 else nan,
        angle_mark=radians(degrees),
        start_bias=radians(rng.choice((0.0, 0.2, 0.5))) * rng.choice((-1, 1)),
        start_sd=radians(rng.choice((0.1, 0.4))),
        place_sd=rng.choice((0.0005, 0.002)),
    )


def _draw_robot(rng: Random, stated: Geometry) -> ForeignRobot:
    wheel, track = rng.choice((0.002, 0.008, 0.025)), rng.choice((0.01, 0.03, 0.07))
    right, left = (stated.mean * (1 + rng.uniform(-wheel, wheel)) for _ in range(2))
    return ForeignRobot(
        track=stated.track * (1 + rng.uniform(-track, track)),
        diameters=(right, left),
        lag_s=rng.uniform(0.03, 0.3),
        load=rng.choice((0.0, 0.0002, 0.001)),
        scrub=rng.choice((0.0, 0.01, 0.03)),
        skid=rng.choice((0.0, 0.001, 0.003)),
        drift=rng.choice((0.001, 0.003, 0.006)),
        floor=rng.choice((0.0, 0.002, 0.006)),
        caster=radians(rng.choice((0.0, 0.2, 0.5))),
    )


def _draw_format(rng: Random) -> TableFormat:
    is_camera = rng.random() < 0.2
    header = ["time", "right", "left"]
    if is_camera:
        header += ["x", "y", "heading"]
    if rng.random() < 0.3:
        header.append("volts")
    if rng.random() < 0.5:
        rng.shuffle(header)
    return TableFormat(tuple(header), rng.choice(("\n", "\r\n")), rng.random() < 0.6, is_camera)


def draw_foreign_set(seed: object) -> ForeignSet:
    """A random robot, four to ten drives of it, and ends noted by one person."""
    rng = Random(f"foreign {seed}")
    diameter = rng.uniform(0.03, 0.20)
    stated = Geometry(diameter, diameter, rng.uniform(max(0.08, diameter / 1.2), 0.45))
    robot, measuring = _draw_robot(rng, stated), _draw_measuring(rng)
    coarsest = ceil(pi * diameter / (PITCH_RATIO_MAX * stated.track))
    slots = max(rng.choice((12, 20, 20, 40, 360, 1440, 4096)), coarsest)
    rate = rng.choice((10.0, 20.0, 50.0))
    style, table = rng.choice(STYLES), _draw_format(rng)
    camera_sd = rng.choice((0.0005, 0.002)), radians(rng.choice((0.1, 0.4)))
    drives, sums = [], np.zeros(6)
    for number in range(rng.randint(4, 10)):
        kind = rng.choice(style)
        draw = np.random.default_rng(rng.getrandbits(32))
        speeds = _wheel_speeds(KINDS[kind](rng), stated.track, robot.lag_s)
        motion = _move(robot, speeds, stated, draw)
        sums += motion.effective
        rows = _row_numbers(len(speeds), rate, rng)
        counts = np.floor(motion.turns[rows] * slots + draw.uniform(size=2))
        seen = motion.poses[rows] + draw.normal(size=(len(rows), 3)) * [camera_sd[0], *camera_sd]
        seen[~(draw.uniform(size=len(rows)) < min(10.0 / rate, 1.0))] = nan
        drives.append(
            ForeignDrive(
                f"{kind}-{number}",
                np.array(rows) * STEP_S,
                counts - counts[0],
                seen,
                measuring.note(motion.poses[-1], rng),
                float(motion.poses[-1, 2]),
            )
        )
    right, left = sums[:2] / sums[2:4] / pi
    true = Geometry(float(right), float(left), float(sums[4] / sums[5]) if sums[5] else robot.track)
    return ForeignSet(stated, true, slots, drives, table)
