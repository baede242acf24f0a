"""Mistakes that people make with recorded drives and with the table of their ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import cos, isnan, pi, radians, sin
from random import Random

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats
from tests.support.trials.foreign_drives import ForeignDrive, ForeignSet, draw_foreign_set

ForeignMistake = Callable[[ForeignSet, Random], ForeignSet]
PoseChange = Callable[[Floats], Floats]
"""Of poses (n, 3): x, y in m, heading in rad"""


def _changed_drives(
    drawn: ForeignSet, change: Callable[[int, ForeignDrive], ForeignDrive | None]
) -> ForeignSet:
    drives = [change(number, drive) for number, drive in enumerate(drawn.drives)]
    return replace(drawn, drives=[drive for drive in drives if drive is not None])


def _with_poses(drive: ForeignDrive, change: PoseChange) -> ForeignDrive:
    x, y, heading = (float(value) for value in change(np.array([drive.end]))[0])
    return replace(drive, poses=change(drive.poses), end=(x, y, heading))


def _poses(change: PoseChange) -> ForeignMistake:
    """The same change of all poses."""
    return lambda drawn, rng: _changed_drives(drawn, lambda _, drive: _with_poses(drive, change))


def _scaled(x: float, y: float, heading: float = 1.0) -> ForeignMistake:
    return _poses(lambda poses: poses * (x, y, heading))


def _rotated(angle: float, dx: float = 0.0, dy: float = 0.0) -> PoseChange:
    matrix = np.array([[cos(angle), sin(angle)], [-sin(angle), cos(angle)]])
    return lambda poses: np.column_stack([poses[:, :2] @ matrix + (dx, dy), poses[:, 2] + angle])


def _other_frame(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """Ends in a frame of the room, in which the robot began turned to the left."""
    change = _rotated(rng.choice((pi / 2, -pi / 2, pi, radians(30))), 0.0, 0.0)
    return _poses(change)(drawn, rng)


def _other_origin(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """Ends measured from a corner of the room."""
    return _poses(_rotated(0.0, rng.uniform(0.3, 2.0), rng.uniform(0.3, 2.0)))(drawn, rng)


def _compass(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """Headings clockwise from y, as a compass shows them."""

    def turned(poses: Floats) -> Floats:
        return np.column_stack([poses[:, :2], pi / 2 - poses[:, 2]])

    return _poses(turned)(drawn, rng)


def _half_turn(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """Headings as those of a line, which a protractor reads modulo 180 degrees."""

    def folded(poses: Floats) -> Floats:
        return np.column_stack([poses[:, :2], poses[:, 2] % pi])

    return _poses(folded)(drawn, rng)


def _nose(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """The place of the nose instead of that of the axle."""
    ahead = rng.choice((0.08, 0.15))

    def moved(poses: Floats) -> Floats:
        headings = poses[:, 2]
        offsets = np.stack([np.cos(headings) - 1.0, np.sin(headings), 0.0 * headings], axis=1)
        return poses + ahead * offsets

    return _poses(moved)(drawn, rng)


def _in_some(share: float, change: PoseChange) -> ForeignMistake:
    """A change of the poses of some drives only."""

    def corrupt(drawn: ForeignSet, rng: Random) -> ForeignSet:
        count = max(1, round(share * len(drawn.drives)))
        chosen = rng.sample(range(len(drawn.drives)), count)
        return _changed_drives(
            drawn,
            lambda number, drive: _with_poses(drive, change) if number in chosen else drive,
        )

    return corrupt


def _swapped_ends(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """The ends of two drives exchanged."""
    one, other = rng.sample(range(len(drawn.drives)), 2)
    partner = {one: other, other: one}
    return _changed_drives(
        drawn,
        lambda number, drive: replace(
            drive,
            end=drawn.drives[partner.get(number, number)].end,
            poses=drive.poses if number not in partner else drive.poses[::-1],
        ),
    )


def _lost_line(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """From one drive on, each end is that of the next one."""
    first, last = rng.randrange(len(drawn.drives) // 2), len(drawn.drives) - 1

    def shifted(number: int, drive: ForeignDrive) -> ForeignDrive:
        other = drawn.drives[min(number + 1, last)] if number >= first else drive
        poses = drive.poses
        if number >= first:
            poses = np.full_like(drive.poses, np.nan)
            rows = min(len(poses), len(other.poses))
            poses[:rows] = other.poses[:rows]
        return replace(drive, end=other.end, poses=poses)

    return _changed_drives(drawn, shifted)


def _same_ends(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """The first end for all drives."""
    first = drawn.drives[0]
    return _changed_drives(
        drawn,
        lambda number, drive: replace(
            drive,
            end=first.end,
            poses=np.where(np.isnan(drive.poses), np.nan, np.array([first.end])),
        ),
    )


def _two_robots(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """Some drives are those of another robot."""
    other = draw_foreign_set(f"other robot {rng.random()}")
    count = min(max(2, len(drawn.drives) // 2), len(other.drives))
    kept = [replace(drive, name=f"other-{drive.name}") for drive in other.drives[:count]]
    return replace(drawn, drives=[*drawn.drives[: len(drawn.drives) - count], *kept])


def _counts(change: Callable[[Floats, Random], Floats], wheels: int = 1) -> ForeignMistake:
    """A change of the counts of one wheel, or of both, in all drives."""

    def corrupt(drawn: ForeignSet, rng: Random) -> ForeignSet:
        chosen = [rng.randrange(2)] if wheels == 1 else [0, 1]

        def changed(number: int, drive: ForeignDrive) -> ForeignDrive:
            counts = drive.counts.copy()
            for wheel in chosen:
                counts[:, wheel] = change(counts[:, wheel], rng)
            return replace(drive, counts=counts)

        return _changed_drives(drawn, changed)

    return corrupt


def _wrapping(bits: int, is_signed: bool) -> ForeignMistake:
    """A counter of few bits that began near its end."""
    size = 2.0**bits

    def wrapped(column: Floats, rng: Random) -> Floats:
        limit = size / 2 if is_signed else size
        offset = limit - rng.uniform(0.1, 0.9) * max(float(np.ptp(column)), 1.0)
        low = -size / 2 if is_signed else 0.0
        return np.asarray((column + round(offset) - low) % size + low)

    return _counts(wrapped, wheels=2)


def _set_back(column: Floats, rng: Random) -> Floats:
    """A counter that began again at 0 in the middle."""
    row = rng.randint(len(column) // 4, 3 * len(column) // 4)
    return np.concatenate([column[:row], column[row:] - column[row]])


def _late(column: Floats, rng: Random) -> Floats:
    """A column that was pasted one row too low."""
    return np.concatenate([column[:1], column[:-1]])


def _reversed_once(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """One encoder counts in the wrong direction in a third of the drives."""
    chosen = rng.sample(range(len(drawn.drives)), max(1, len(drawn.drives) // 3))
    signs = rng.choice(((-1.0, 1.0), (1.0, -1.0)))
    return _changed_drives(
        drawn,
        lambda number, drive: (
            replace(drive, counts=drive.counts * signs) if number in chosen else drive
        ),
    )


def _copied(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """The counts of one wheel in both columns."""
    wheel = rng.randrange(2)
    return _changed_drives(
        drawn, lambda _, drive: replace(drive, counts=drive.counts[:, [wheel, wheel]])
    )


def _clock_gap(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """The clock was set while the robot drove."""

    def changed(number: int, drive: ForeignDrive) -> ForeignDrive:
        times = drive.times.copy()
        times[len(times) // 2 :] += rng.choice((5.0, 3600.0))
        return replace(drive, times=times)

    return _changed_drives(drawn, changed)


def _missing_rows(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """A quarter of the rows of each drive was lost with the radio."""

    def changed(number: int, drive: ForeignDrive) -> ForeignDrive:
        rows = len(drive.times)
        first = rng.randint(rows // 8, rows // 2)
        kept = np.r_[0:first, first + rows // 4 : rows]
        return replace(
            drive, times=drive.times[kept], counts=drive.counts[kept], poses=drive.poses[kept]
        )

    return _changed_drives(drawn, changed)


def _duplicated(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """Some rows twice."""

    def changed(number: int, drive: ForeignDrive) -> ForeignDrive:
        rows = np.sort(np.r_[0 : len(drive.times), 10 : len(drive.times) : 40])
        return replace(
            drive, times=drive.times[rows], counts=drive.counts[rows], poses=drive.poses[rows]
        )

    return _changed_drives(drawn, changed)


def _descending(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """The last row first."""
    return _changed_drives(
        drawn,
        lambda _, drive: replace(
            drive, times=drive.times[::-1], counts=drive.counts[::-1], poses=drive.poses[::-1]
        ),
    )


def _edited(role: str, edit: Callable[[str], str]) -> ForeignMistake:
    """A change of the text of the tables."""

    def corrupt(drawn: ForeignSet, rng: Random) -> ForeignSet:
        is_absent = role == "ends" and drawn.format.is_camera
        return replace(drawn, edits={"counts" if is_absent else role: edit})

    return corrupt


def _decimal_commas(text: str) -> str:
    return text.replace(".", ",")


def _semicolons(text: str) -> str:
    return text.replace(",", ";").replace(".", ",")


def _thousands(text: str) -> str:
    """Numbers as a spreadsheet shows them: 12,345."""
    lines = text.splitlines()
    rows = [
        ",".join(
            f"{int(cell):,}" if cell.lstrip("-").isdigit() and len(cell) > 3 else cell
            for cell in line.split(",")
        )
        for line in lines[1:]
    ]
    return "\n".join([lines[0], *rows]) + "\n"


def _without_header(text: str) -> str:
    return text.split("\n", 1)[1]


def _exchanged_names(text: str) -> str:
    head, rest = text.split("\n", 1)
    swapped = head.replace("right", "?").replace("left", "right").replace("?", "left")
    return f"{swapped}\n{rest}"


def _times(factor: float) -> ForeignMistake:
    return lambda drawn, rng: replace(
        drawn, format=drawn.format._replace(time_factor=factor, time_digits=0)
    )


def _radius(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """The radius of the wheels stated as their diameter."""
    stated = drawn.stated
    return replace(drawn, stated=stated._replace(right=stated.right / 2, left=stated.left / 2))


def _half_track(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """Half of the track stated."""
    return replace(drawn, stated=drawn.stated._replace(track=drawn.stated.track / 2))


def _slots(drawn: ForeignSet, rng: Random) -> ForeignSet:
    """Other counts per turn stated than the discs have."""
    return replace(drawn, slots=max(2, round(drawn.slots * rng.choice((0.5, 2.0, 4.0, 0.9, 1.1)))))


def _half_slots(column: Floats, rng: Random) -> Floats:
    return np.floor(column / 2)


def _missed(column: Floats, rng: Random) -> Floats:
    """One edge in eight is missed, at random."""
    steps = np.diff(column, prepend=0.0)
    draw = np.random.default_rng(rng.getrandbits(32))
    lost = draw.binomial(np.abs(steps).astype(int), 1 / 8) * np.sign(steps)
    return np.asarray(np.cumsum(steps - lost))


FOREIGN_MISTAKES: dict[str, ForeignMistake] = {
    "x and y exchanged": _poses(lambda poses: poses[:, [1, 0, 2]]),
    "mirrored": _scaled(1, -1, -1),
    "y of the wrong sign": _scaled(1, -1),
    "x of the wrong sign": _scaled(-1, 1),
    "heading of the wrong sign": _scaled(1, 1, -1),
    "heading in degrees, named radians": _scaled(1, 1, 180 / pi),
    "heading in radians, named degrees": _scaled(1, 1, pi / 180),
    "heading modulo 180 degrees": _half_turn,
    "heading of a compass": _compass,
    "millimetres": _scaled(1000, 1000),
    "inches": _scaled(1 / 0.0254, 1 / 0.0254),
    "x in centimetres, y in metres": _scaled(100, 1),
    "y in inches, x in metres": _scaled(1, 1 / 0.0254),
    "x in feet": _scaled(1 / 0.3048, 1),
    "some ends in centimetres": _in_some(0.4, lambda poses: poses * (100, 100, 1)),
    "some ends mirrored": _in_some(0.4, lambda poses: poses * (1, -1, -1)),
    "some ends exchanged": _in_some(0.4, lambda poses: poses[:, [1, 0, 2]]),
    "another frame": _other_frame,
    "another origin": _other_origin,
    "the nose": _nose,
    "two ends exchanged": _swapped_ends,
    "one line of ends lost": _lost_line,
    "all ends alike": _same_ends,
    "two robots": _two_robots,
    "columns exchanged": _edited("counts", _exchanged_names),
    "one column in both": _copied,
    "encoder reversed": _counts(lambda column, rng: -column),
    "encoder reversed in some drives": _reversed_once,
    "both encoders reversed": _counts(lambda column, rng: -column, wheels=2),
    "encoder dead": _counts(lambda column, rng: 0.0 * column),
    "one encoder with half the slots": _counts(_half_slots),
    "encoder misses one in eight": _counts(_missed),
    "counter of 8 bits": _wrapping(8, is_signed=False),
    "counter of 16 bits": _wrapping(16, is_signed=True),
    "counter of 16 bits, unsigned": _wrapping(16, is_signed=False),
    "counter of 32 bits": _wrapping(32, is_signed=True),
    "counter set back": _counts(_set_back, wheels=2),
    "ticks of each row": _counts(lambda column, rng: np.diff(column, prepend=0.0), wheels=2),
    "one column a row late": _counts(_late),
    "other counts per turn": _slots,
    "radius for diameter": _radius,
    "half of the track": _half_track,
    "clock set": _clock_gap,
    "rows missing": _missing_rows,
    "rows twice": _duplicated,
    "descending": _descending,
    "milliseconds": _times(1e3),
    "microseconds": _times(1e6),
    "decimal commas in the counts": _edited("counts", _decimal_commas),
    "decimal commas in the ends": _edited("ends", _decimal_commas),
    "semicolons": _edited("ends", _semicolons),
    "thousand separators": _edited("counts", _thousands),
    "no header": _edited("counts", _without_header),
    "no header of the ends": _edited("ends", _without_header),
}


def needs_headings(name: str) -> bool:
    """Whether the mistake does nothing where no heading was measured."""
    return name.startswith("heading")


def has_all_headings(drawn: ForeignSet) -> bool:
    """Whether the heading of every end is known."""
    return drawn.format.is_camera or not any(isnan(drive.end[2]) for drive in drawn.drives)
