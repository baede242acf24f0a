"""Figures of firmware, protocol and virtual board.

Everything but the codecs runs the real binary on an emulated Mega 2560, on an Uno and on a
Pico.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
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
    frame_damage,
    two_channels,
    wheel_loop,
)
from tests.support.trials.row import Row
from tests.support.trials.section import drawn

Part = Callable[[], Iterator[Row]]


ALL = 100


def mega(seed: int, share: float, parts: int = ALL) -> Iterator[Row]:
    """The sizes of both AVR images, and what a Mega shows, with a share of the trials.

    `parts`: how many of its parts are drawn.
    """
    yield from board.image()
    for part in drawn(parts_of(seed, share, board.edges), parts, seed):
        yield from part()


def uno(seed: int, share: float, parts: int = ALL) -> Iterator[Row]:
    """What an Uno shows."""
    todo = parts_of(seed, share, partial(board.edges, 12_000))
    yield from _on(UNO_BOARD, drawn(todo, parts, seed + 1))


def pico(seed: int, share: float, parts: int = ALL) -> Iterator[Row]:
    """What a Pico shows, also with encoders with two channels."""
    todo = parts_of(seed, share, partial(board.edges, 20_000))
    yield from _on(PICO_BOARD, drawn(todo, parts, seed + 2))
    hall = [partial(board_runs.goals, seed, trials(share, 20))] if parts == ALL else []
    for row in _on(PICO_HALL_BOARD, hall):
        yield row._replace(what=f"encoders with two channels: {row.what}")


def _on(bench: BenchBoard, todo: Sequence[Part]) -> Iterator[Row]:
    for part in todo:
        with trials_on(bench):
            found = list(part())
        yield from found


def parts_of(seed: int, share: float, edges: Part) -> list[Part]:
    """What each chip has to show; `edges`: at the highest rate of its encoders."""
    of = partial(trials, share)
    return [
        partial(board.latency, seed, of(200)),
        partial(board.telemetry, of(60)),
        edges,
        two_channels.full_speed,
        partial(two_channels.rocking, of(100)),
        partial(board.bounce, seed, of(3)),
        partial(board_settings.refused_settings, seed, of(400)),
        partial(board_settings.eeprom_cuts, seed, of(200)),
        partial(board.restarts, seed, of(15)),
        partial(board.deadman, seed, of(1000)),
        partial(board_faults.storms, seed, of(100)),
        partial(board_faults.hellos, seed, of(20)),
        partial(frame_damage.through_binary, seed, of(10_000)),
        partial(board_runs.agreement, seed, of(10)),
        partial(board_runs.goals, seed, of(20)),
        partial(board_runs.same_twice, seed),
        partial(board_restarts.rows, seed, of(30)),
    ]


def trials(share: float, full: int) -> int:
    """The share of the trials of a full proof, at least one."""
    return max(1, round(full * share))


def wheel_loops(seed: int, share: float) -> Iterator[Row]:
    """The speed loop of a wheel on simulated robots, and on some of an emulated Mega."""
    of = partial(trials, share)
    yield from wheel_loop.starts(seed, of(1000))
    yield from wheel_loop.starts(seed + 1, of(100), emulated=True)
    yield from wheel_loop.stalls(seed, of(200))
    yield from wheel_loop.stalls(seed + 1, of(50), emulated=True)
    yield from wheel_loop.settling(seed, of(40))
    yield from wheel_loop.settling(seed, of(10), emulated=True)


def damaged_frames(seed: int, count: int) -> Iterator[Row]:
    """Damaged frames in both codecs; those of the binary are in the sections of the boards."""
    yield from frame_damage.to_board(seed, count)
    yield from frame_damage.to_host(seed, count)
