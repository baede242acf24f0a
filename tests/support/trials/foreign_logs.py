"""`calibrate from-log` on drives of robots that its model does not describe."""

from __future__ import annotations

from collections.abc import Iterator

from tests.support.trials.foreign_drives import draw_foreign_set
from tests.support.trials.from_log import WRONG_DEVIATION, accuracy_rows
from tests.support.trials.row import Row


def rows(seed: int, sets: int) -> Iterator[Row]:
    """Accuracy of what is saved, and how many sets are refused."""
    drawn_sets = (draw_foreign_set(f"{seed} {number}") for number in range(sets))
    what = f"from-log, {sets} sets of unmodelled robots"
    yield from accuracy_rows(what, drawn_sets, ((2.0, 0.90), (WRONG_DEVIATION, 0.99)))
