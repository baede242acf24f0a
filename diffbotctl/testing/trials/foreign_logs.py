"""`calibrate from-log` on drives of robots that its model does not describe, good and wrong."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from diffbotctl.errors import ConfigurationError
from diffbotctl.testing.trials.foreign_drives import ForeignSet, draw_foreign_set
from diffbotctl.testing.trials.foreign_mistakes import (
    FOREIGN_MISTAKES,
    has_all_headings,
    needs_headings,
)
from diffbotctl.testing.trials.from_log import (
    TWO_WAY_DRIVES,
    WRONG_DEVIATION,
    Saved,
    calibrated,
)
from diffbotctl.testing.trials.row import Row, print_rows


def good_rows(seed: int, sets: int) -> Iterator[Row]:
    """Sets without a mistake: values within their standard deviations, and how many are refused."""
    deviations: list[float] = []
    refused = two_way = 0
    with TemporaryDirectory() as folder:
        for number in range(sets):
            drawn = draw_foreign_set(f"{seed} {number}")
            saved = calibrated(drawn, Path(folder) / "set")
            deviations += saved.deviations
            if len(drawn.drives) >= TWO_WAY_DRIVES and drawn.is_two_way:
                two_way += 1
                refused += saved.exit_code != 0
    what = f"from-log, {sets} sets of unmodelled robots"
    for limit, target in ((2.0, 0.90), (WRONG_DEVIATION, 0.99)):
        share = sum(deviation <= limit for deviation in deviations) / max(len(deviations), 1)
        target_text = f">= {100 * target:.0f} % of {len(deviations)}"
        yield Row(
            f"{what}: values within {limit:g} sd",
            f"{100 * share:.1f} %",
            target_text,
            share >= target,
        )
    yield Row(
        f"{what}: refused, six or more both ways",
        f"{refused} of {two_way}",
        "<= 10 %",
        refused <= 0.1 * two_way,
    )


def wrong_rows(seed: int, sets: int) -> Iterator[Row]:
    """Each set with one mistake: refused, or what is saved is right all the same."""
    refused = harmless = 0
    wrong: list[str] = []
    names = list(FOREIGN_MISTAKES)
    with TemporaryDirectory() as folder:
        for number in range(sets):
            drawn, rng = draw_foreign_set(f"{seed} wrong {number}"), Random(f"{seed} {number}")
            name = names[number % len(names)]
            if needs_headings(name) and not has_all_headings(drawn):
                name = rng.choice([each for each in names if not needs_headings(each)])
            saved = _calibrated(FOREIGN_MISTAKES[name](drawn, rng), Path(folder) / "set")
            if saved.exit_code and not saved.deviations:
                refused += 1
            elif saved.exit_code == 0 and max(saved.deviations) <= WRONG_DEVIATION:
                harmless += 1
            else:
                wrong.append(f"{name} ({number})")
    yield Row(
        f"from-log, {sets} sets of unmodelled robots, corrupted: wrong values saved",
        f"{len(wrong)}",
        f"0; refused {refused}, saved and right {harmless}" + "".join(f"; {w}" for w in wrong[:4]),
        not wrong,
    )


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
