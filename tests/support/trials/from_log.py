"""`calibrate from-log` on random drives, good and wrong, and on corrupted real ones."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from math import pi
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import NamedTuple, Protocol

import numpy as np
from click.testing import CliRunner

from diffbotctl.calibrate.dead_reckoning import Floats, Geometry
from diffbotctl.calibrate.result import LEFT_DIAMETER, RIGHT_DIAMETER, TRACK
from diffbotctl.cli.calibrate import from_log
from diffbotctl.config.load import load_robot
from diffbotctl.errors import UsageError
from diffbotctl.units import quantity
from tests.support.optiodom_session import is_session, read_session
from tests.support.trials.drawn_drives import (
    CORRUPTIONS,
    NEEDS_HEADINGS,
    draw_set,
)
from tests.support.trials.row import NoData, Row

TWO_WAY_DRIVES = 6
WRONG_DEVIATION = 4.0  # standard deviations


class Saved(NamedTuple):
    """What one call of the command came to."""

    exit_code: int
    text: str
    deviations: list[float]
    """of the values that were saved, in standard deviations; empty if none were"""


class WritableSet(Protocol):
    """Drives of one robot whose geometry is known."""

    @property
    def true(self) -> Geometry: ...

    def write(self, folder: Path) -> list[str]:
        """Write robot, drives and ends into `folder`. Returns arguments of `from-log`."""
        ...


class DrivenSet(WritableSet, Protocol):
    """The same, with what `accuracy_rows` asks of it."""

    @property
    def drives(self) -> Sequence[object]: ...
    @property
    def is_two_way(self) -> bool: ...


def calibrated(drawn: WritableSet, folder: Path) -> Saved:
    """Run `from-log --save --yes` on the files of a set."""
    shutil.rmtree(folder, ignore_errors=True)
    arguments = [*drawn.write(folder), "--save", "--yes"]
    result = CliRunner().invoke(from_log, arguments)
    code = result.exit_code
    text = result.output + (str(result.exception) if result.exception else "")
    calibration = load_robot(str(folder / "robot.yaml")).robot.calibration
    true = drawn.true
    fields = {RIGHT_DIAMETER: true.right, LEFT_DIAMETER: true.left, TRACK: true.track}
    deviations = []
    for field, value in fields.items():
        entry = calibration.get(field)
        if entry is not None:
            error = quantity(str(entry.value), "m") - value
            deviations.append(abs(error) / quantity(str(entry.sd), "m"))
    return Saved(code, text, deviations)


def accuracy_rows(
    what: str, drawn_sets: Iterable[DrivenSet], targets: Sequence[tuple[float, float]]
) -> Iterator[Row]:
    """Sets without a mistake: values within their standard deviations, and how many are refused.

    `targets`: standard deviations, and the least share of the values within them.
    """
    deviations: list[float] = []
    refused = two_way = 0
    with TemporaryDirectory() as folder:
        for drawn in drawn_sets:
            saved = calibrated(drawn, Path(folder) / "set")
            deviations += saved.deviations
            if len(drawn.drives) >= TWO_WAY_DRIVES and drawn.is_two_way:
                two_way += 1
                refused += saved.exit_code != 0
    for limit, target in targets:
        share = sum(deviation <= limit for deviation in deviations) / max(len(deviations), 1)
        yield Row(
            f"{what}: values within {limit:g} sd",
            f"{100 * share:.1f} %",
            f">= {100 * target:.0f} % of {len(deviations)}",
            share >= target,
        )
    yield Row(
        f"{what}: refused, six or more both ways",
        f"{refused} of {two_way}",
        "<= 10 %",
        refused <= 0.1 * two_way,
    )


def wrong_values_row(what: str, results: Iterable[tuple[str, Saved]]) -> Row:
    """Sets with one mistake each, named: refused, or what is saved is right all the same."""
    refused = harmless = 0
    wrong: list[str] = []
    for name, saved in results:
        if saved.exit_code and not saved.deviations:
            refused += 1
        elif saved.exit_code == 0 and max(saved.deviations) <= WRONG_DEVIATION:
            harmless += 1
        else:
            wrong.append(name)
    return Row(
        f"{what}: wrong values saved",
        f"{len(wrong)}",
        f"0; refused {refused}, saved and right {harmless}" + "".join(f"; {w}" for w in wrong[:4]),
        not wrong,
    )


def good_rows(seed: int, sets: int) -> Iterator[Row]:
    """Sets without a mistake."""
    drawn_sets = (draw_set(f"{seed} {number}") for number in range(sets))
    yield from accuracy_rows(f"from-log, {sets} good sets", drawn_sets, ((2.0, 0.95), (4.0, 1.0)))


def wrong_rows(seed: int, sets: int) -> Iterator[Row]:
    """Each set with one corruption."""
    with TemporaryDirectory() as folder:
        results = _corrupted_sets(seed, sets, Path(folder) / "set")
        yield wrong_values_row(f"from-log, {sets} corrupted sets", results)


def _corrupted_sets(seed: int, sets: int, folder: Path) -> Iterator[tuple[str, Saved]]:
    names = list(CORRUPTIONS)
    for number in range(sets):
        drawn, rng = draw_set(f"{seed} wrong {number}"), Random(f"{seed} {number}")
        name = names[number % len(names)]
        if name in NEEDS_HEADINGS and not drawn.has_headings:
            name = rng.choice([each for each in names if each not in NEEDS_HEADINGS])
        yield f"{name} ({number})", calibrated(CORRUPTIONS[name](drawn, rng), folder)


TableChange = Callable[[Floats, Random], Floats]
"""From the rows of a run file (time, x, y, heading, right and left ticks) to wrong ones"""


def _columns(order: Sequence[int], signs: Sequence[float] = (1,) * 6) -> TableChange:
    return lambda table, rng: table[:, list(order)] * np.array(signs)


def _without_rows(table: Floats, rng: Random) -> Floats:
    first = rng.randint(len(table) // 5, len(table) // 2)
    return np.delete(table, slice(first, first + len(table) // 8), axis=0)


SAME = (0, 1, 2, 3, 4, 5)
SESSION_CORRUPTIONS: dict[str, TableChange] = {
    "x and y exchanged": _columns((0, 2, 1, 3, 4, 5)),
    "mirrored": _columns(SAME, (1, 1, -1, -1, 1, 1)),
    "y of the wrong sign": _columns(SAME, (1, 1, -1, 1, 1, 1)),
    "degrees for radians": _columns(SAME, (1, 1, 1, 180 / pi, 1, 1)),
    "millimetres": _columns(SAME, (1, 1000, 1000, 1, 1, 1)),
    "columns swapped": _columns((0, 1, 2, 3, 5, 4)),
    "right encoder reversed": _columns(SAME, (1, 1, 1, 1, -1, 1)),
    "left encoder dead": _columns(SAME, (1, 1, 1, 1, 1, 0)),
    "twice the ticks": _columns(SAME, (1, 1, 1, 1, 2, 2)),
    "gap": _without_rows,
}


def session_rows(seed: int, folders: Sequence[Path]) -> Iterator[Row]:
    """Sessions of the OptiOdom data set: accepted as they are, refused when corrupted."""
    sessions = sorted(
        {path for folder in folders for path in (folder, *folder.rglob("*")) if _is_data(path)}
    )
    if not sessions:
        target = "needs sessions: --optiodom FOLDER"
        yield NoData("from-log on corrupted real drives", "no data", target, True)
        return
    accepted, wrong, tried = 0, [], 0
    with TemporaryDirectory() as folder:
        for session in sessions:
            accepted += _is_accepted(session)
            for name, change in SESSION_CORRUPTIONS.items():
                rng = Random(f"{seed} {session.name} {name}")
                copy = _corrupted(session, Path(folder) / session.name, change, rng)
                tried += 1
                if _is_accepted(copy):
                    wrong.append(f"{name} in {session.name}")
    count = len(sessions)
    yield Row("from-log, real sessions accepted", f"{accepted}", f"{count}", accepted == count)
    yield Row(
        "from-log, real sessions corrupted: accepted",
        f"{len(wrong)} of {tried}",
        "0" + "".join(f"; {name}" for name in wrong[:4]),
        not wrong,
    )


def _is_accepted(folder: Path) -> bool:
    try:
        read_session(folder).fit()
    except (UsageError, ValueError):
        return False
    return True


def _is_data(path: Path) -> bool:
    return path.is_dir() and is_session(path)


def _corrupted(session: Path, copy: Path, change: TableChange, rng: Random) -> Path:
    shutil.rmtree(copy, ignore_errors=True)
    copy.mkdir()
    for file in session.glob("*_metadata.csv"):
        shutil.copy(file, copy)
    for file in session.glob("*_run-*.csv"):
        table = np.loadtxt(file, delimiter=",", encoding="utf-8-sig")
        np.savetxt(copy / file.name, change(table, rng), delimiter=",", fmt="%.6f")
    return copy


def rows(seed: int, sets: int) -> Iterator[Row]:
    """Sets without a mistake, and as many with one."""
    yield from good_rows(seed, sets)
    yield from wrong_rows(seed, sets)
