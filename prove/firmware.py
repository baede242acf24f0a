"""Figures of firmware, protocol, virtual board and flashing: `python -m prove.firmware`.

Everything but the codecs runs the real binary on the emulated Mega 2560.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from functools import partial

from diffbotctl.testing.trials import board, board_restarts, board_runs, flash, frame_damage
from diffbotctl.testing.trials.row import Row, printed


def rows(seed: int, share: float = 1.0) -> Iterator[Row]:
    """Every row; `share` of the trials of each, at least a few."""

    def many(count: float, least: int = 1) -> int:
        return max(least, round(count * share))

    parts: list[Callable[[], Iterator[Row]]] = [
        partial(board.image),
        partial(board.latency, seed, many(200, 20)),
        partial(board.telemetry, many(60, 5)),
        partial(board.edges),
        partial(board.bounce, seed, many(3, 1)),
        partial(board.refused_settings, seed, many(400, 40)),
        partial(board.eeprom_cuts, seed, many(200, 20)),
        partial(board.restarts, seed, many(15, 3)),
        partial(board.deadman, seed, many(1000, 20)),
        partial(frame_damage.to_board, seed, many(1e7, 100_000)),
        partial(frame_damage.to_host, seed, many(1e7, 20_000)),
        partial(frame_damage.through_binary, seed, many(1e4, 100)),
        partial(board_runs.agreement, seed, many(10, 2)),
        partial(board_runs.goals, seed, many(20, 3)),
        partial(board_runs.same_twice, seed),
        partial(board_restarts.rows, seed, many(30, 3)),
        partial(flash.rows),
    ]
    for part in parts:
        yield from part()


def main() -> None:
    """Print every row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--share", type=float, default=1.0, help="of the trials")
    asked = parser.parse_args()
    raise SystemExit(printed(rows(asked.seed, asked.share)) > 0)


if __name__ == "__main__":
    main()
