"""Figures of firmware, protocol, virtual board and flashing: `python -m prove.firmware`.

Everything but the codecs runs the real binary on an emulated Mega 2560, on an Uno and on a
Pico.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from tests.support.board_bench import (
    PICO_BOARD,
    PICO_HALL_BOARD,
    UNO_BOARD,
    BenchBoard,
    trials_on,
)
from tests.support.trials import (
    board,
    board_faults,
    board_restarts,
    board_runs,
    board_settings,
    flash,
    frame_damage,
    two_channels,
    wheel_loop,
)
from tests.support.trials.row import Row, print_rows

Section = Callable[[], Iterator[Row]]


def rows(seed: int, share: float = 1.0) -> Iterator[Row]:
    """All rows, with the fraction `share` of the trials, at least a few of each."""
    trials = partial(trials_of, share)
    sections: list[Section] = [
        partial(board.image),
        *chip_sections(seed, trials, partial(board.edges)),
        partial(wheel_loop.starts, seed, trials(1000, 50)),
        partial(wheel_loop.starts, seed + 1, trials(100, 10), emulated=True),
        partial(wheel_loop.stalls, seed, trials(200, 20)),
        partial(wheel_loop.stalls, seed + 1, trials(50, 10), emulated=True),
        partial(wheel_loop.settling, seed, trials(40, 10)),
        partial(wheel_loop.settling, seed, trials(10, 3), emulated=True),
        partial(frame_damage.to_board, seed, trials(1e7, 100_000)),
        partial(frame_damage.to_host, seed, trials(1e7, 20_000)),
        partial(flash.rows),
    ]
    for section in sections:
        yield from section()
    yield from rows_of("Uno", UNO_BOARD, 12_000, seed, share)
    yield from rows_of("Pico", PICO_BOARD, 20_000, seed, share)
    hall = partial(board_runs.goals, seed, trials(20, 3))
    yield from _named("Pico, encoders with two channels", PICO_HALL_BOARD, hall)


def rows_of(
    name: str, bench: BenchBoard, edges: int, seed: int, share: float = 1.0
) -> Iterator[Row]:
    """The rows of the Mega that concern its chip, on another board, with `edges` per second."""
    trials = partial(trials_of, share)
    for section in chip_sections(seed, trials, partial(board.edges, edges)):
        yield from _named(name, bench, section)


def _named(name: str, bench: BenchBoard, section: Section) -> Iterator[Row]:
    """The rows of a section on another board."""
    with trials_on(bench):
        found = list(section())
    for row in found:
        yield row._replace(what=f"{name}: {row.what}")


def chip_sections(seed: int, trials: Callable[[float, int], int], edges: Section) -> list[Section]:
    """What each chip has to show; `edges`: at the highest rate of its encoders."""
    return [
        partial(board.latency, seed, trials(200, 20)),
        partial(board.telemetry, trials(60, 5)),
        edges,
        partial(two_channels.full_speed),
        partial(two_channels.rocking, trials(100, 20)),
        partial(board.bounce, seed, trials(3, 1)),
        partial(board_settings.refused_settings, seed, trials(400, 40)),
        partial(board_settings.eeprom_cuts, seed, trials(200, 20)),
        partial(board.restarts, seed, trials(15, 3)),
        partial(board.deadman, seed, trials(1000, 20)),
        partial(board_faults.storms, seed, trials(100, 20)),
        partial(board_faults.hellos, seed, trials(20, 20)),
        partial(frame_damage.through_binary, seed, trials(1e4, 100)),
        partial(board_runs.agreement, seed, trials(10, 2)),
        partial(board_runs.goals, seed, trials(20, 3)),
        partial(board_runs.same_twice, seed),
        partial(board_restarts.rows, seed, trials(30, 3)),
    ]


def trials_of(share: float, full: float, minimum: int) -> int:
    """The `share` of the trials of a full proof, at least `minimum`."""
    return max(minimum, round(full * share))


if __name__ == "__main__":
    raise SystemExit(print_rows(rows, __doc__, seed=1, share=1.0))
