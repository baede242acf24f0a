"""Two-channel encoders at full speed and at rest, on an emulated board."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import sqrt

from diffbotctl.config.board_pins import BOARDS
from diffbotctl.emulator.process import PinTransition
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_settings import BoardSettings
from diffbotctl.plant.quadrature import EDGES_PER_PITCH
from diffbotctl.time import MILLISECOND as MS
from diffbotctl.time import SECOND
from tests.support.board_bench import ENCODERS, BoardBench, trial_board
from tests.support.trials.row import Row

PINS_B = {
    frames.BoardCode.MEGA2560: (22, 23),
    frames.BoardCode.ATMEGA328P: (4, 12),
    frames.BoardCode.RP2040: (4, 12),
}
SLOTS = 4096
RAMP_S = 0.15  # from rest to full speed; a gear motor takes as long
SHIFT = 13_337  # ns between the edges of both wheels


def two_channels() -> BoardSettings:
    """The settings of the board with two channels on each wheel: a Pico counts every edge."""
    settings = trial_board().settings
    left, right = PINS_B[settings.board]
    every_edge = settings.board == frames.BoardCode.RP2040
    counts = SLOTS * (EDGES_PER_PITCH if every_edge else 1)
    return replace(
        settings,
        glitch=0,
        every_edge=every_edge,
        left=replace(settings.left, encoder_b=left, slots=counts),
        right=replace(settings.right, encoder_b=right, slots=counts),
    )


def counts_of_slot() -> int:
    """Counts that the board makes of a slot."""
    return EDGES_PER_PITCH if two_channels().every_edge else 1


def slot_rate() -> int:
    """Slots a second up to which no count may be lost on the board, by its table."""
    chip = trial_board().settings.board.name
    return next(pins.slot_rate for pins in BOARDS.values() if pins.chip == chip)


def full_speed(seconds: float = 0.5) -> Iterator[Row]:
    """Both wheels from rest to the highest speed that `check` accepts, and back, each way."""
    rate = slot_rate()
    for is_forward in (True, False):
        with BoardBench(settings=two_channels()) as bench:
            bench.pins += [PinTransition(0, pin, 0) for pin in PINS_B[bench.settings.board]]
            bench.ready()
            bench.wait(60)
            before = bench.state()
            slots = round(rate * (seconds + RAMP_S))
            bench.pins += _turning(bench, rate, seconds, slots, is_forward)
            received = _in_pieces(bench, seconds + 2 * RAMP_S + 0.2)
            after = bench.state()
        count = slots * counts_of_slot()
        expected = count if is_forward else -count
        lost = [
            (expected - (now - then) + 32768) % 65536 - 32768
            for then, now in ((before.left, after.left), (before.right, after.right))
        ]
        yield Row(
            f"counts lost of {count} a wheel, two channels"
            f" {'forward' if is_forward else 'backward'} at {rate} slots/s",
            f"{lost[0]}, {lost[1]}",
            "0, 0",
            lost == [0, 0],
        )
        rate_least = bench.settings.telemetry - 1
        rate_received = received / (seconds + 2 * RAMP_S + 0.2)
        yield Row(
            "state frames meanwhile",
            f"{rate_received:.1f} Hz",
            f">= {rate_least} Hz",
            rate_received >= rate_least,
        )


def _in_pieces(bench: BoardBench, seconds: float) -> int:
    """Let time pass in steps whose edges fit one request; how many state frames came."""
    received = 0
    for _ in range(round(seconds * 50)):
        received += sum(isinstance(frame.frame, frames.StateFrame) for frame in bench.wait(20))
    return received


def _turning(
    bench: BoardBench, rate: int, seconds: float, slots: int, is_forward: bool
) -> list[PinTransition]:
    """The changes of all pins while both wheels turn by `slots`."""
    changes = []
    wheels = zip(ENCODERS, PINS_B[bench.settings.board], strict=True)
    for wheel, (a, b) in enumerate(wheels):
        # In one pitch A leads going forward, B going backward.
        order = ((a, 1), (b, 1), (a, 0), (b, 0)) if is_forward else ((b, 1), (a, 1), (b, 0), (a, 0))
        start = bench.now + 5 * MS + wheel * SHIFT
        for quarter in range(1, EDGES_PER_PITCH * slots + 1):
            time = _time_of(quarter / EDGES_PER_PITCH, rate, seconds)
            pin, level = order[(quarter - 1) % EDGES_PER_PITCH]
            changes.append(PinTransition(start + round(time * SECOND), pin, level))
    return sorted(changes)


def _time_of(pitches: float, rate: int, seconds: float) -> float:
    """When a wheel has turned by `pitches`: it accelerates, keeps its speed, and slows down."""
    ramp, whole = 0.5 * rate * RAMP_S, rate * (seconds + RAMP_S)
    if pitches < ramp:
        return sqrt(2 * pitches * RAMP_S / rate)
    if pitches < whole - ramp:
        return RAMP_S + (pitches - ramp) / rate
    return 2 * RAMP_S + seconds - sqrt(max(2 * (whole - pitches) * RAMP_S / rate, 0.0))


def rocking(times: int = 100) -> Iterator[Row]:
    """A wheel that rocks over each of the four edges of a pitch."""
    worst = 0
    with BoardBench(settings=two_channels()) as bench:
        bench.pins += [PinTransition(0, pin, 0) for pin in PINS_B[bench.settings.board]]
        bench.ready()
        bench.wait(60)
        a, b = ENCODERS[0], PINS_B[bench.settings.board][0]
        for pin, level in ((a, 1), (b, 1), (a, 0), (b, 0)):
            before = bench.state().left
            for index in range(2 * times):
                at = bench.now + MS + index * MS // 2
                bench.pins.append(PinTransition(at, pin, level if index % 2 == 0 else 1 - level))
            bench.wait(2 * times)
            bench.wait(100)
            worst = max(worst, abs((bench.state().left - before + 32768) % 65536 - 32768))
            bench.pins.append(PinTransition(bench.now + MS, pin, level))  # over this edge
            bench.wait(60)
    yield Row(f"counts by rocking {times} times over an edge", f"{worst}", "<= 1", worst <= 1)
