"""Trials of the binary under faults: an encoder pin that never rests, and resets in mid-frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import pi
from random import Random
from statistics import median
from typing import NamedTuple

from diffbotctl.emulator.process import LINE
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import FrameDecoder
from diffbotctl.links.diffbot_settings import BAUDS, BoardSettings
from diffbotctl.links.link_protocol import USB_BAUD
from diffbotctl.time import MILLISECOND as MS
from diffbotctl.time import SECOND
from tests.support.board_bench import (
    COMMAND_BYTES,
    DEADMAN_TARGET,
    ENCODERS,
    RADIO,
    BoardBench,
    speed,
    trial_board,
    wire_ns,
)
from tests.support.trials.row import Row

STOP_TARGET = 50 * MS
STOP_BYTES = 6
STORM_RATES = (1_000, 200_000)  # pulses/s
SPEED_MARGIN = 8  # of storm.c: below this multiple of its rated speed a wheel's speed is plausible
STORM_FLAGS = (frames.FLAG_LEFT_STORM, frames.FLAG_RIGHT_STORM)


class StormResult(NamedTuple):
    """One storm. Times are ns."""

    was_named: bool
    """the flags of exactly the noisy pins were set"""
    stop_time: int | None
    """from the end of the stop frame to PWM 0; None without one, or when a fault came before it"""
    silent_time: int
    """from the end of the last command to PWM 0"""


def storms(seed: int, count: int) -> Iterator[Row]:
    """Pulses at one or both encoder pins of random robots, from before the start or under way."""
    rng = Random(seed)
    results = [_storm(rng) for _ in range(count)]
    named = sum(result.was_named for result in results)
    yield Row.counted(f"{count} encoder storms of 1 k to 200 k pulses/s: named", named, count)
    silent = max(result.silent_time for result in results)
    yield Row(
        "the same: PWM 0 after the last command",
        f"{silent / MS:.1f} ms",
        "<= 320 ms",
        silent <= DEADMAN_TARGET,
    )
    stops = [result.stop_time for result in results if result.stop_time is not None]
    worst = max(stops, default=0)
    yield Row(
        f"the same: PWM 0 after a stop frame ({len(stops)} stopped by it)",
        f"{worst / MS:.1f} ms",
        "<= 50 ms",
        worst <= STOP_TARGET and bool(stops),
    )


def _noisy_robot(rng: Random) -> tuple[BoardSettings, float]:
    """A robot, and pulses/s that none of its wheels can give."""
    slots = round(8 * 512 ** rng.random())
    rated = rng.uniform(3.0, 40.0)
    while slots * rated / (2 * pi) * SPEED_MARGIN * 1.2 > STORM_RATES[1] / 2:
        slots //= 2
    gain = min((1.0 - trial_board().settings.left.start) / rated, 0.7)
    bench = trial_board().settings
    sides = [replace(side, gain=gain, slots=slots) for side in (bench.left, bench.right)]
    settings = replace(bench, left=sides[0], right=sides[1])
    settings = replace(settings, glitch=rng.choice((0, 2 * MS, 2 * MS, MS // 4)))
    plausible = max(STORM_RATES[0], slots / (2 * pi * gain) * SPEED_MARGIN * 1.2)
    return settings, plausible * (STORM_RATES[1] / plausible) ** rng.random()


def _storm(rng: Random) -> StormResult:
    settings, rate = _noisy_robot(rng)
    noisy = rng.choice(((True, False), (False, True), (True, True)))
    owner = rng.choice(trial_board().ports)
    share, jitter = rng.uniform(0.1, 0.9), rng.choice((0.0, rng.uniform(0.0, 0.5)))
    period = 1e9 / rate / (1.0 + jitter)
    pulses = [max(63, round(part)) for part in (period * share, period * (1.0 - share))]
    under_way = rng.random() < 0.7
    with BoardBench(settings=settings) as bench:
        bench.ready(owner)
        last = bench.now
        if under_way:
            last = _drive(bench, owner, rng, rng.uniform(50, 300))
        for pin in [pin for pin, is_noisy in zip(ENCODERS, noisy, strict=True) if is_noisy]:
            bench.emulator.pulses(pin, pulses[0], pulses[1], round(jitter * period))
        # Most storms are a fault after some milliseconds: half of the stops come before that.
        is_stopped_at_once = under_way and rng.random() < 0.5
        if not is_stopped_at_once:
            last = _drive(bench, owner, rng, rng.uniform(0, 150))
        stop_time = None
        if (is_stopped_at_once or rng.random() < 0.5) and bench.duty != [0.0, 0.0]:
            bench.changes.clear()
            end = bench.now + wire_ns(owner, STOP_BYTES)
            bench.send(owner, frames.StopFrame(5))
            bench.wait(120)
            stop_time = _time_off(bench, end)
            bench.wait(rng.uniform(0, 300))
        last = _drive(bench, owner, rng, rng.uniform(50, 2_000)) or last
        bench.changes.clear()
        bench.wait(400)
        silent_time = _time_off(bench, last)
        bench.wait(1_200)
        flags = _flags(bench)
    was_named = flags is not None and all(
        bool(flags & flag) is is_noisy for flag, is_noisy in zip(STORM_FLAGS, noisy, strict=True)
    )
    return StormResult(was_named, stop_time, silent_time)


def _drive(bench: BoardBench, owner: int, rng: Random, ms: float) -> int:
    """Command random speeds for `ms`; when the last command has arrived (ns)."""
    end, last = bench.now + round(ms * MS), bench.now
    number = 0
    while bench.now < end or not number:
        number += 1
        left, right = (rng.choice((-1, 1)) * rng.uniform(0.8, 9) for _ in range(2))
        last = bench.now + wire_ns(owner, COMMAND_BYTES)
        bench.send(owner, speed(number, left, right))
        bench.wait(rng.uniform(20, 60))
    return last


def _time_off(bench: BoardBench, since: int) -> int:
    """ns from `since` to PWM 0 of both motors; an hour when one is still driven."""
    if bench.duty != [0.0, 0.0]:
        return 3_600_000 * MS
    return max(0, max((change.time for change in bench.changes), default=since) - since)


def _flags(bench: BoardBench) -> int | None:
    """The newest flags that the board has reported."""
    items = [each.frame for each in bench.received if isinstance(each.frame, frames.StatusFrame)]
    values = [item.value for item in items if item.item == frames.ItemCode.FLAGS]
    return values[-1] if values else None


def hellos(seed: int, count: int) -> Iterator[Row]:
    """A reset while a frame is on the wire: the first hello arrives, at the stored baud rate."""
    rng = Random(seed)
    arrived = sum(_hello_arrives(rng, number) for number in range(count))
    yield Row.counted("hello after a reset in mid-frame, 9600 to 115200 baud", arrived, count)


def _hello_arrives(rng: Random, number: int) -> bool:
    baud = sorted(BAUDS)[number % len(BAUDS)]
    settings = replace(trial_board().settings, baud=baud)
    uart = rng.choice((RADIO, *trial_board().ports))
    with BoardBench(settings=settings) as bench:
        bench.ready(uart)
        bench.wait(500)  # the settings are stored
        wire = 10 * SECOND // (baud if uart == RADIO else USB_BAUD)
        decoder = FrameDecoder()
        received = b"\0"
        while received[-1] == 0:  # until a frame has begun
            result = bench.emulator.step(bench.now + rng.randrange(1, 10 * MS))
            data = result.bytes_of(bench.uart(uart))
            decoder.feed(data)
            received += data
        bench.emulator.reset(LINE)
        times: list[int] = []
        data = b""
        for _ in range(4):
            sent = bench.emulator.step(bench.now + 20 * MS).sent
            of_uart = [byte for byte in sent if byte.uart == bench.uart(uart)]
            times += [byte.time for byte in of_uart]
            data += bytes(byte.byte for byte in of_uart)
        frames_read = decoder.feed(data)
        spacing = median(later - earlier for earlier, later in pairwise(times))
    hello = next((f for f in frames_read if isinstance(f, frames.HelloFrame)), None)
    at_baud = abs(spacing / wire - 1) < 0.05
    return hello is not None and hello.settings == settings.mark() and at_baud
