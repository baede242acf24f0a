"""Two robots and an operator in networks of their own: both found, lost for 5 s, found again."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

from diffbotctl.testing.lossy_network import can_make_namespaces
from diffbotctl.testing.trials.row import NoData, Row, printed
from diffbotctl.testing.trials.two_robots import CUT_S, DELAY_S, LOSS, ROBOTS, CutOutcome, cut_trial

STOP_MAX_S = 0.5
LINK = f"{DELAY_S * 1e3:.0f} ms, {LOSS:.0%} loss, cut {CUT_S:g} s"


def rows(trials: int) -> Iterator[Row]:
    """All rows, of `trials` cuts."""
    if not can_make_namespaces():
        cause = "network namespaces need root here"
        yield NoData(f"two robots, {LINK}", cause, "both, 0.5 s", True)
        return
    outcomes = []
    for seed in range(trials):
        with tempfile.TemporaryDirectory() as name:
            outcomes.append(cut_trial(Path(name), seed))
    yield from _rows(outcomes)


def _rows(outcomes: list[CutOutcome]) -> Iterator[Row]:
    count = len(outcomes)
    found = sum(outcome.found == ROBOTS for outcome in outcomes)
    slowest = max(outcome.listed_s for outcome in outcomes)
    yield Row(
        f"two robots, {LINK}: listed through ssh",
        f"{found} of {count}, {slowest:.1f} s at most",
        "both",
        found == count,
    )
    worst = max(outcome.stop_s for outcome in outcomes)
    right = sum(
        outcome.stop_s <= STOP_MAX_S and set(outcome.causes) == {"operator_lost"}
        for outcome in outcomes
    )
    yield Row(
        "two robots: wheels 0 after the cut, latched, named",
        f"{right} of {count}, {worst:.2f} s at most",
        f"all, <= {STOP_MAX_S:g} s",
        right == count,
    )
    still = sum(not outcome.moved_after for outcome in outcomes)
    events = {event for outcome in outcomes for event in outcome.moved_after}
    yield Row(
        "two robots: nothing moves by itself afterwards",
        f"{still} of {count} {', '.join(sorted(events))}".rstrip(),
        "all, also after resume",
        still == count,
    )
    again = sum(outcome.drives_again for outcome in outcomes)
    yield Row("two robots: both are driven again", f"{again} of {count}", "all", again == count)


def main() -> int:
    """Print the rows of this section alone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=5)
    return 1 if printed(rows(parser.parse_args().trials)) else 0


if __name__ == "__main__":
    raise SystemExit(main())
