"""Frames damaged on the wire, bit error rates 1e-4 to 1e-2 evenly in the logarithm."""

from __future__ import annotations

from collections.abc import Iterator
from math import log, log1p
from random import Random

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import FrameDecoder, encode
from tests.support import firmware_parts
from tests.support.board_bench import RADIO, BoardBench, speed
from tests.support.trials.row import Row

LEAST, MOST = 1e-4, 1e-2


def to_board(seed: int, count: int) -> Iterator[Row]:
    """Command frames through the board's own codec, compiled for this machine."""
    (output,) = firmware_parts.run("damage", seed, count, sanitized=False)
    words = output.split()
    wrong, lost = int(words[1]), int(words[3])
    yield Row(
        f"{count:.0e} damaged frames to the board: wrong accepted", str(wrong), "0", wrong == 0
    )
    yield Row("not resynchronised within one frame", str(lost), "0", lost == 0)


def to_host(seed: int, count: int) -> Iterator[Row]:
    """State frames through the host's codec."""
    rng = Random(seed)
    decoder = FrameDecoder()
    wrong = lost = 0
    for number in range(count):
        if number % 1000 == 0:
            frame = state(rng)
            whole = encode(frame)
        got = decoder.feed(damage(rng, whole) + whole + whole)
        wrong += sum(each != frame for each in got)
        lost += not got or got[-1] != frame
    yield Row(
        f"{count:.0e} damaged frames to the host: wrong accepted", str(wrong), "0", wrong == 0
    )
    yield Row("not resynchronised within one frame", str(lost), "0", lost == 0)


def damage(rng: Random, wire: bytes) -> bytes:
    """Flip at least one bit of `wire`."""
    bits = 8 * len(wire)
    rate = LEAST * (MOST / LEAST) ** rng.random()
    value = int.from_bytes(wire, "little")
    first = rng.randrange(bits)
    value ^= 1 << first
    scale = log1p(-rate)
    at = log(1.0 - rng.random()) / scale
    while at < bits:
        if int(at) != first:
            value ^= 1 << int(at)
        at += 1 + log(1.0 - rng.random()) / scale
    return value.to_bytes(len(wire), "little")


def state(rng: Random) -> frames.StateFrame:
    """A state frame with random content."""
    bits = [4, 6, 1, 0, 3, 12, 16, 16, 16, 12, 4, 7, 16, 16]
    return frames.StateFrame(*(rng.getrandbits(width) if width else 0 for width in bits))


def through_binary(seed: int, count: int) -> Iterator[Row]:
    """Damaged commands to the running board: the motors only ever do what was truly commanded."""
    rng = Random(seed)
    wrong = lost = 0
    with BoardBench() as bench:
        bench.ready()
        before = expected = speed(0, 5, 5)
        for number in range(count):
            if number % 100 == 0:
                bench.claim()
                bench.turn(10)
            before = expected
            expected = speed(3 * number, rng.uniform(1, 9), rng.uniform(1, 9))
            second, third = (expected._replace(sequence=(3 * number + n) & 0xF) for n in (1, 2))
            bench.changes.clear()
            bench.send(RADIO, damage(rng, encode(expected)), second, third)
            bench.wait(90)
            lost += bench.state().command != third.sequence
            allowed = (expected,) if number % 100 == 0 else (before, expected)
            for change in bench.changes:
                duty = abs(change.duty)
                wrong += not any(plausible(duty, each[1 + change.motor]) for each in allowed)
    title = f"{count:.0e} damaged frames through the binary"
    yield Row(f"{title}: wrong obeyed", str(wrong), "0", wrong == 0)
    yield Row("not resynchronised within one frame", str(lost), "0", lost == 0)


def plausible(duty: float, expected: int) -> bool:
    """Whether a motor runs as commanded: feed-forward and at most what the integrator may add."""
    forward = 0.10 + 0.086 * expected / 256
    return abs(duty - min(forward, 1.0)) <= 0.25 + 0.01  # and a step of the PWM
