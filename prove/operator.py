"""Rows on operators, dashboards and clients: `python -m prove.operator --seed N`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from prove import dashboard, operator_load, operator_people, page, viewers
from tests.support.trials import page_losses
from tests.support.trials.row import Row, printed, with_failure

OPENED = 10  # times that the page is opened on each device


def rows(seed: int, trials: int, lines: int) -> Iterator[Row]:
    """`trials` of each way to lose a driver, `lines` invalid requests; then the loads."""
    parts = {
        "operators": operator_people.rows(seed, trials, lines),
        "dashboard": dashboard.rows(seed, max(trials // 4, 1)),
        "viewers": viewers.rows(seed, trials),
        "page": page.rows(OPENED),
        "lost phones": page_losses.rows(trials),
        "loads": operator_load.rows(),
    }
    for name, part in parts.items():
        yield from with_failure(name, part)


def main() -> int:
    """Print the rows. Returns the exit code: 1 when a row is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--lines", type=int, default=2000)
    options = parser.parse_args()
    missed = printed(rows(options.seed, options.trials, options.lines))
    print(f"{missed} rows missed")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
