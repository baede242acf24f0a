"""Trials of the binary on the bench: latency, telemetry, edges, restarts, dead-man."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from random import Random
from statistics import median

from diffbotctl.emulator.process import BROWNOUT, LINE, PinTransition
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import encode
from diffbotctl.time import MILLISECOND as MS
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

FIRMWARE = Path(__file__).resolve().parents[3] / "firmware"
# Bytes of stack never used; more than any interrupt on top of any function takes.
# That of the RP2040 is of 2048 that are watched.
SPARE_STACK = {
    frames.BoardCode.MEGA2560: 1024,
    frames.BoardCode.ATMEGA328P: 400,
    frames.BoardCode.RP2040: 1024,
}
# Bytes; those of the ATmega328P leave 900 of its 2048 for the stack.
STATIC_RAM_MAX = {"mega2560": 1400, "atmega328p": 1100}


def image(folder: Path = FIRMWARE) -> Iterator[Row]:
    """Size of each image, as the build in the source's `folder` prints it."""
    command = ["make", "-C", str(folder), f"ROOT={FIRMWARE.parent}", "size"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    sizes = re.findall(r"(\w+): flash (\d+) bytes .* static RAM (\d+) bytes", done.stdout)
    assert {name for name, *_ in sizes} == set(STATIC_RAM_MAX), done.stdout
    for name, flash, ram in sizes:
        most = STATIC_RAM_MAX[name]
        yield Row(f"{name} image: flash", f"{flash} B", "<= 20480 B", int(flash) <= 20_480)
        yield Row(f"{name} image: static RAM", f"{ram} B", f"<= {most} B", int(ram) <= most)


def latency(seed: int, count: int) -> Iterator[Row]:
    """From the first bit of a command on the wire to the change of the PWM, at 9600 baud."""
    rng = Random(seed)
    taken = []
    with BoardBench() as bench:
        bench.ready()
        bench.turn(count * 0.05)
        for number in range(count):
            bench.changes.clear()
            start = bench.now
            bench.send(RADIO, speed(number, rng.uniform(1, 9), rng.uniform(1, 9)))
            bench.run(start + round(rng.uniform(30, 50) * MS))
            taken.append(bench.changes[0].time - start)
    middle = median(taken) / MS
    yield Row.at_most("command on the wire to PWM, median", middle, 12, "ms")
    worst = max(taken) / MS
    yield Row("command on the wire to PWM, worst", f"{worst:.1f} ms", "(no target)", True)
    yield Row(
        "command frame",
        f"{COMMAND_BYTES} B",
        "<= 10 B",
        len(encode(speed(0, 1, 1))) <= COMMAND_BYTES,
    )


def telemetry(seconds: int) -> Iterator[Row]:
    """State frames with edge ages at 9600 baud while driving."""
    with BoardBench() as bench:
        bench.ready()
        bench.turn(seconds + 1)
        bench.received.clear()
        start = bench.now
        for number in range(seconds * 20):
            bench.send(RADIO, speed(number, 8, 8))
            bench.wait(50)
        states = [h.frame for h in bench.received if isinstance(h.frame, frames.StateFrame)]
        took = (bench.now - start) / 1e9
        gaps = sum((b.sequence - a.sequence - 1) % 64 for a, b in pairwise(states))
        dropped = sum(state.dropped for state in states)
        damaged = bench.decoders[RADIO].damaged
        status = [h.frame for h in bench.received if isinstance(h.frame, frames.StatusFrame)]
    rate = len(states) / took
    yield Row(
        "state frames with edge ages at 9600 baud",
        f"{rate:.2f} Hz",
        ">= 38 Hz",
        len(states) >= int(38 * took),
    )
    yield Row(
        "state frames lost, dropped, damaged",
        f"{gaps}, {dropped}, {damaged}",
        "0, 0, 0",
        gaps + dropped + damaged == 0,
    )
    stack = min(each.value for each in status if each.item == frames.ItemCode.FREE_STACK)
    least = SPARE_STACK[trial_board().settings.board]
    yield Row("stack never used meanwhile", f"{stack} B", f">= {least} B", stack >= least)


def edges(rate: int = 20_000, seconds: float = 0.8) -> Iterator[Row]:
    """Edges on both channels at once, without a glitch filter."""
    with BoardBench(settings=replace(trial_board().settings, glitch=0)) as bench:
        bench.ready()
        before = bench.state()
        period, count = 1_000_000_000 // rate, int(rate * seconds)
        for index in range(count):
            rise = bench.now + MS + index * period
            for shift, pin in ((0, ENCODERS[0]), (period // 3, ENCODERS[1])):
                bench.pins += [
                    PinTransition(rise + shift, pin, 1),
                    PinTransition(rise + shift + period // 2, pin, 0),
                ]
        bench.pins.sort()
        received = _in_pieces(bench, seconds + 0.2)
        after = bench.state()
    lost = [
        (count - (b - a)) % 65536
        for a, b in ((before.left, after.left), (before.right, after.right))
    ]
    lost = [each - 65536 if each > 32767 else each for each in lost]
    yield Row(
        f"edges lost of {count} a channel at {rate}/s",
        f"{lost[0]}, {lost[1]}",
        "0, 0",
        lost == [0, 0],
    )
    rate_least = bench.settings.telemetry - 1
    yield Row(
        "state frames meanwhile",
        f"{received / (seconds + 0.2):.0f} Hz",
        f">= {rate_least} Hz",
        received >= rate_least * (seconds + 0.2),
    )


def _in_pieces(bench: BoardBench, seconds: float) -> int:
    """Let time pass in steps whose edges fit one request; how many state frames came."""
    received = 0
    for _ in range(round(seconds * 20)):
        received += sum(isinstance(h.frame, frames.StateFrame) for h in bench.wait(50))
    return received


def bounce(seed: int, seconds: int) -> Iterator[Row]:
    """A hundred edges a second; both flanks bounce for up to 1.5 ms, the glitch time is 2 ms."""
    rng = Random(seed)
    with BoardBench() as bench:
        bench.ready()
        before = bench.state()
        count = 100 * seconds
        for index in range(count):
            rise = bench.now + MS + index * 10 * MS
            for pin in ENCODERS:
                bench.pins += _bouncing(rng, rise, pin, 1)
                bench.pins += _bouncing(rng, rise + 5 * MS, pin, 0)
        bench.pins.sort()
        _in_pieces(bench, seconds + 0.2)
        after = bench.state()
    counted = [(after.left - before.left) % 65536, (after.right - before.right) % 65536]
    yield Row(
        f"bouncing edges counted of {count}",
        f"{counted[0]}, {counted[1]}",
        f"{count}, {count}",
        counted == [count, count],
    )


def _bouncing(rng: Random, at: int, pin: int, level: int) -> list[PinTransition]:
    times = sorted(rng.randrange(1_500_000) for _ in range(2 * rng.randrange(6)))
    flips = [PinTransition(at, pin, level)]
    flips += [
        PinTransition(at + time, pin, level ^ (index + 1) % 2) for index, time in enumerate(times)
    ]
    return flips


def restarts(seed: int, count: int) -> Iterator[Row]:
    """Reset line, brown-out and a hung program while driving."""
    rng = Random(seed)
    worst = still = reported = 0
    for number in range(count):
        kind = ("line", "brownout", "watchdog")[number % 3]
        with BoardBench() as bench:
            bench.ready()
            bench.wait(400)
            boot = bench.state().boot
            bench.claim()
            bench.turn(2)
            for step in range(rng.randrange(4, 12)):
                bench.send(RADIO, speed(step, rng.uniform(2, 9), -rng.uniform(2, 9)))
                bench.wait(50)
            bench.wait(rng.uniform(0, 50))
            assert bench.duty[0] > 0 > bench.duty[1], "it must be driving before the restart"
            start = bench.now
            bench.changes.clear()
            {
                "line": lambda b: b.emulator.reset(LINE),
                "brownout": lambda b: b.emulator.reset(BROWNOUT),
                "watchdog": lambda b: b.emulator.hang(),
            }[kind](bench)
            for step in range(20):  # the host goes on commanding: it must not be obeyed
                bench.send(RADIO, speed(step, 5, 5))
                bench.wait(50)
            hello = bench.ask()
            worst = max(worst, max(c.time for c in bench.changes) - start)
            still += bench.duty == [0.0, 0.0]
            reported += frames.ResetCode(hello.reset).name.lower() == kind and hello.boot != boot
    yield Row.counted("restart in motion: motors off and stay off", still, count)
    yield Row.counted("cause and new start reported", reported, count)
    yield Row(
        "a hung program's motors are off after",
        f"{worst / MS:.0f} ms",
        "<= 320 ms",
        worst <= DEADMAN_TARGET,
    )


CUTS = ("killed", "half frame", "garbage", "half frames", "second host", "replay")


def deadman(seed: int, count: int) -> Iterator[Row]:
    """The owner falls silent at a random state and speed, and an intruder goes on."""
    rng = Random(seed)
    worst = late = moved = trials = 0
    bench = None
    for number in range(count):
        if bench is None:
            bench = BoardBench()
            bench.ready(RADIO)
        kind = CUTS[number % len(CUTS)]
        silence, again = _trial(bench, rng, kind)
        worst, late = max(worst, silence), late + (silence > DEADMAN_TARGET)
        moved += again
        trials += 1
        if number % 50 == 49:  # a fresh board now and then
            bench.emulator.close()
            bench = None
    if bench is not None:
        bench.emulator.close()
    yield Row(
        f"{trials} cuts: PWM 0 after the owner's last command",
        f"{worst / MS:.1f} ms",
        "<= 320 ms",
        late == 0,
    )
    yield Row(
        "an intruder moved the robot or kept it moving", f"{moved} of {trials}", "none", moved == 0
    )


def _trial(bench: BoardBench, rng: Random, kind: str) -> tuple[int, bool]:
    """One cut: ns from the last valid command to PWM 0, and whether anything moved after that."""
    owner = rng.choice(trial_board().ports)
    bench.wait(600)
    bench.claim(owner, rng.randrange(16))
    bench.turn(3.0, rate=50)
    numbers = iter(range(10_000))
    last = bench.now
    for _ in range(rng.randrange(2, 12)):
        left, right = (rng.choice((-1, 1)) * rng.uniform(0.8, 9) for _ in range(2))
        frame = speed(next(numbers), left, right)
        last = bench.now + wire_ns(owner, COMMAND_BYTES)
        bench.send(owner, frame)
        bench.wait(rng.uniform(25, 60))
    assert bench.duty != [0.0, 0.0], "the robot must be moving before the cut"
    bench.changes.clear()
    for _ in range(16):
        _intrude(bench, rng, kind, owner, numbers, frame)
        bench.wait(50)
    stopped = [change.time for change in bench.changes]
    end = max(stopped, default=bench.now)
    again = bench.duty != [0.0, 0.0]
    bench.pins = [PinTransition(bench.now, pin, 0) for pin in ENCODERS]
    return end - last, again


def _intrude(
    bench: BoardBench,
    rng: Random,
    kind: str,
    owner: int,
    numbers: Iterator[int],
    last: frames.CommandFrame,
) -> None:
    foreign = 1 - owner
    if foreign not in trial_board().ports and kind in ("second host", "replay"):
        return  # the board has no other port
    if kind == "half frame":
        if not bench.received or rng.random() < 0.1:
            bench.send(owner, encode(last)[: rng.randrange(1, 9)])
    elif kind == "garbage":
        bench.send(owner, rng.randbytes(rng.randrange(40)))
        if foreign in trial_board().ports:
            bench.send(foreign, rng.randbytes(rng.randrange(40)))
    elif kind == "half frames":
        bench.send(owner, encode(last)[: rng.randrange(1, 9)] + b"\0")
    elif kind == "second host":
        bench.send(foreign, speed(next(numbers), 6, 6), frames.AskFrame(frames.VERSION))
    elif kind == "replay":
        bench.send(foreign, last)
