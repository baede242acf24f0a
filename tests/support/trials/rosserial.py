"""How the rosserial host fares against damage: recorded bytes, false headers, starts in noise."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from random import Random
from statistics import median
from typing import NamedTuple

from diffbotctl.links.rosserial_host import RosserialHost
from diffbotctl.messages import Duty, Encoders, Message
from diffbotctl.time import MILLISECOND as MS
from diffbotctl.time import SECOND
from tests.support.rosserial_device import RATED, RosserialDevice
from tests.support.rosserial_session import RosserialSession
from tests.support.trials.row import Row

# The first is a session of an emulated board, kept beside the checkout; the second is our own.
RECORDINGS = (
    Path("../shared/data/rosserial/session_100ms.json"),
    Path("tests/data/rosserial_session.json"),
)
TICK_HEADERS = ("fffe0400fb7d00", "fffe0400fb7e00")
NOISE = 1e-3  # flips a bit
MINUTE = 60 * SECOND
FALSE_HEADERS = {  # sync, length, and a length sum that is right
    "30000": bytes.fromhex("fffe30755a"),
    "-1": bytes.fromhex("fffeffff01"),
}


class Replayed(NamedTuple):
    """What the host made of a recording."""

    host: RosserialHost
    received: list[tuple[str, Message]]
    ticks: int  # frames of ticks in the recording, found without the host


def replay(path: Path, one_by_one: bool) -> Replayed:
    """Feed the board's half of a recording to a new host, by bursts or byte by byte."""
    events = json.loads(path.read_text())["events"]
    host, received = RosserialHost(RATED), []
    host.opened(0)
    stream = "".join(data for _, who, data in events if who == "d")
    for seconds, who, text in events:
        data = bytes.fromhex(text) if who == "d" else b""
        pieces = [bytes((byte,)) for byte in data] if one_by_one else [data]
        for piece in pieces:
            received += host.receive(round(seconds * SECOND), piece)
    return Replayed(host, received, sum(stream.count(header) for header in TICK_HEADERS))


def recorded(path: Path) -> Iterator[Row]:
    """Every topic known, every tick read, however the bytes are cut."""
    whole, single = replay(path, False), replay(path, True)
    name = path.stem
    known = len(whole.host.topics.numbers)
    yield Row(f"{name}: topics known", f"{known} of 6", "6 of 6", known == 6)
    read = ticks_read(whole)
    yield Row.counted(f"{name}: ticks read", read, whole.ticks)
    counts = [
        [m for _, m in each.received if isinstance(m, Encoders)] for each in (whole, single)
    ]  # Link messages differ: each states how far the stream has been read
    same = counts[0] == counts[1] and bool(counts[0])
    yield Row(f"{name}: byte by byte", "same" if same else "differs", "same", same)


def ticks_read(replayed: Replayed) -> int:
    """Frames of ticks that reached the counters."""
    return sum(count.taken for count in replayed.host.counts.values())


def drive_by(seed: int) -> Callable[[int], Duty]:
    """A new random pair of duties each second."""
    rng = Random(seed)
    pairs = [(rng.uniform(-1, 1), rng.uniform(-1, 1)) for _ in range(61)]
    return lambda now: Duty(now, *pairs[min(60, now // SECOND)])


def start(seed: int, length: int = MINUTE, straddle: bool = False) -> RosserialSession:
    """One start of a minute, bits flipped both ways."""
    device = RosserialDevice(seed, flips_up=NOISE, flips_down=NOISE, straddle=straddle)
    return RosserialSession(device).run(length, drive_by(seed))


def gap_after(header: bytes) -> tuple[float, int]:
    """Longest pause between two Encoders, s, and frames lost, when `header` comes 20 times."""
    session = RosserialSession(RosserialDevice(1)).run(3 * SECOND)
    for _ in range(20):
        session.device.inject(session.now, header)
        session.run(session.now + 500 * MS)
    times = [message.time for message in session.encoders]
    pauses = (after - before for before, after in pairwise(times))
    return max(pauses) / SECOND, session.lost_frames()


def false_headers() -> Iterator[Row]:
    """No gap, where the stock host pauses for 5 s."""
    usual, _ = gap_after(b"")
    for name, header in FALSE_HEADERS.items():
        gap, lost = gap_after(header)
        met = lost == 0 and gap <= usual + 0.02  # the header's own bytes, and a look at the wire
        figure = f"{gap:.3f} s, {lost} lost"
        yield Row(f"false header, length {name}: longest gap", figure, f"{usual:.3f} s", met)


class Figures(NamedTuple):
    """What one start showed."""

    up: float
    lost: int
    intact: int
    mixed: float
    lone: int
    error: float
    boots: int


def figures(seed: int, straddle: bool) -> Figures:
    """Run one start."""
    session = start(seed, straddle=straddle)
    return Figures(
        next((link.time / SECOND for link in session.links if link.state == "up"), float("inf")),
        session.lost_frames() + abs(session.host.decoder.frames - len(session.frames)),
        sum(whole for _, _, whole in session.device.sent),
        session.mixed() / SECOND,
        session.lone_frames(),
        session.worst_error(),
        # A damaged speed may reach the board as a reset: then it truly counts anew.
        max(0, session.host.boot - len(session.device.commands["reset"])),
    )


MIXED = 0.5  # s; some ten pairs in a row, each of which may lose its other half
ERROR = 3.0  # counts; what a count may stray within the AGE of a message


def starts_in_noise(seed: int, starts: int, straddle: bool) -> Iterator[Row]:
    """Many starts of a minute."""
    found = [figures(seed * 100_000 + number, straddle) for number in range(starts)]
    name = "noise and straddling" if straddle else "noise"
    lost, intact = sum(f.lost for f in found), sum(f.intact for f in found)
    yield Row(f"{name}: intact frames lost", f"{lost} of {intact}", "0", lost == 0)
    ups = [f.up for f in found]
    half, most = median(ups), max(ups)
    yield Row.at_most(f"{name}: negotiated, median", half, 3.0, "s", ".2f")
    yield Row.at_most(f"{name}: negotiated, worst", most, 12.0, "s", ".2f")
    lone = sum(f.lone for f in found)
    yield Row(f"{name}: writes for one wheel alone", str(lone), "0", lone == 0)
    mixed = max(f.mixed for f in found)
    yield Row.at_most(f"{name}: longest drive on half a pair", mixed, MIXED, "s", ".2f")
    error = max(f.error for f in found)
    yield Row(
        f"{name}: counts off the wheels', most", f"{error:.1f}", f"<= {ERROR}", error <= ERROR
    )
    boots = sum(f.boots for f in found)
    yield Row(f"{name}: restarts reported but not made", str(boots), "0", boots == 0)


def rows(seed: int, starts: int) -> Iterator[Row]:
    """All rows on the rosserial link."""
    for path in RECORDINGS:
        if path.exists():
            yield from recorded(path)
    yield from false_headers()
    yield from starts_in_noise(seed, starts, straddle=False)
    yield from starts_in_noise(seed, starts, straddle=True)


def record(path: Path) -> None:
    """Write ten seconds of a session with our own board half, as the tests' recording.

    `python -m tests.support.trials.rosserial` writes it anew.
    """
    session = RosserialSession(RosserialDevice(1))
    events: list[tuple[float, str, str]] = []
    drive = drive_by(1)
    while session.now < 10 * SECOND:
        sent_before = len(session.written)
        session.run(session.now + 1, drive)
        if session.arrived:
            events.append((session.now / SECOND, "d", session.arrived.hex()))
        events += [(at / SECOND, "h", data.hex()) for at, data in session.written[sent_before:]]
    path.write_text(json.dumps({"baud": 9600, "events": events}, indent=0) + "\n")


if __name__ == "__main__":
    record(RECORDINGS[1])
