"""`calibrate from-log` on drives of robots that its model does not describe, good and wrong."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from diffbotctl.errors import ConfigurationError
from tests.support.trials.foreign_drives import ForeignSet, draw_foreign_set
from tests.support.trials.foreign_mistakes import (
    FOREIGN_MISTAKES,
    has_all_headings,
    needs_headings,
)
from tests.support.trials.from_log import (
    WRONG_DEVIATION,
    Saved,
    accuracy_rows,
    calibrated,
    wrong_values_row,
)
from tests.support.trials.row import Row, print_rows


def good_rows(seed: int, sets: int) -> Iterator[Row]:
    """Sets without a mistake."""
    drawn_sets = (draw_foreign_set(f"{seed} {number}") for number in range(sets))
    what = f"from-log, {sets} sets of unmodelled robots"
    yield from accuracy_rows(what, drawn_sets, ((2.0, 0.90), (WRONG_DEVIATION, 0.99)))


def wrong_rows(seed: int, sets: int) -> Iterator[Row]:
    """Each set with one mistake."""
    with TemporaryDirectory() as folder:
        results = _mistaken_sets(seed, sets, Path(folder) / "set")
        what = f"from-log, {sets} sets of unmodelled robots, corrupted"
        yield wrong_values_row(what, results)


def _mistaken_sets(seed: int, sets: int, folder: Path) -> Iterator[tuple[str, Saved]]:
    names = list(FOREIGN_MISTAKES)
    for number in range(sets):
        drawn, rng = draw_foreign_set(f"{seed} wrong {number}"), Random(f"{seed} {number}")
        name = names[number % len(names)]
        if needs_headings(name) and not has_all_headings(drawn):
            name = rng.choice([each for each in names if not needs_headings(each)])
        yield f"{name} ({number})", _calibrated(FOREIGN_MISTAKES[name](drawn, rng), folder)


def _calibrated(drawn: ForeignSet, folder: Path) -> Saved:
    """As `calibrated`; a robot file that `check` refuses counts as refused."""
    try:
        return calibrated(drawn, folder)
    except ConfigurationError as error:
        return Saved(1, str(error), [])


def rows(seed: int, sets: int) -> Iterator[Row]:
    """All rows."""
    yield from good_rows(seed, sets)
    yield from wrong_rows(seed, sets)


if __name__ == "__main__":
    raise SystemExit(print_rows(rows, __doc__ or "", seed=1, sets=200))
