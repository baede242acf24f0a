"""The board's half of rosserial, as the client library does it, in virtual time.

Written from the protocol's description alone; it shares no code with the host. The sketch's shape
is the book's: a loop that pauses 20 ms, publishes left_ticks, right_ticks and obstacle_distance
when 50 ms have passed, and blocks while its send buffer is full. Faults are switched on from
outside: bit errors each way, a dead wire, bytes that come from nowhere, a restart, and the real
library's loss of a frame that straddles two passes.
"""

from __future__ import annotations

import os
import select
import struct
import threading
import time
from collections import deque
from collections.abc import Callable
from math import log
from random import Random

from diffbotctl.processes.real_time import prefer
from diffbotctl.time import MILLISECOND as MS
from diffbotctl.time import SECOND

BYTE_BITS = 10
LOOP_PAUSE = 20 * MS
PUBLISH_AFTER = 50 * MS
SEND_BUFFER = 64  # bytes
HALF_READ_LIFE = 20  # ms
LINE_BYTES_MAX = 16  # that a late reader may take at once
SYNC_EVERY = 2500 * MS
SYNC_LOST = 11 * SECOND
BOOT = 1200 * MS
RATED = 100 / 60 * 20  # counts/s at full duty: 100 rpm, 20 slots
LAG = 0.1  # s
DIVISOR = 13.0  # cm V
TYPES = {
    "Int32": "da5909fbe378aeaf85e547e830cc1bb7",
    "Float32": "73fcbf46b49191e672908e50842a83d4",
    "Bool": "8b94c1b53db61fb6aed406028ad6332a",
    "Int16": "8524586e34fbd7cb1c08c5f5f1ca0e57",
}
PUBLISHERS = (("left_ticks", "Int32"), ("right_ticks", "Int32"), ("obstacle_distance", "Float32"))
SUBSCRIBERS = (("set_left_speed", "Int32"), ("set_right_speed", "Int32"), ("reset", "Bool"))


class Noise:
    """Flips each bit of a stream with one probability."""

    def __init__(self, rate: float, rng: Random) -> None:
        self.rate, self.rng = rate, rng
        self.gap = self._draw()

    def _draw(self) -> int:
        """Clean bits up to the next flip."""
        if self.rate <= 0.0:
            return 1 << 62
        return int(log(1.0 - self.rng.random()) / log(1.0 - self.rate))

    def through(self, byte: int) -> int:
        """The byte as it arrives."""
        while self.gap < 8:
            byte ^= 1 << self.gap
            self.gap += 1 + self._draw()
        self.gap -= 8
        return byte


def framed(topic: int, payload: bytes) -> bytes:
    """A frame, the way the client library's publish() lays it down."""
    size = len(payload)
    out = bytearray([0xFF, 0xFE, size & 0xFF, size >> 8, 255 - ((size & 0xFF) + (size >> 8)) % 256])
    out += bytes([topic & 0xFF, topic >> 8]) + payload
    total = sum(out[5:])
    out.append(255 - total % 256)
    return bytes(out)


class RosserialDevice:
    """The board. `receive` what the host writes, `advance` to a time and get what has arrived."""

    def __init__(
        self,
        seed: int = 1,
        *,
        baud: int = 9600,
        flips_up: float = 0.0,
        flips_down: float = 0.0,
        straddle: bool = False,
        publishers: tuple[tuple[str, str], ...] = PUBLISHERS,
        subscribers: tuple[tuple[str, str], ...] = SUBSCRIBERS,
    ) -> None:
        rng = Random(seed)
        self.up, self.down = Noise(flips_up, rng), Noise(flips_down, rng)
        self.byte_time = BYTE_BITS * SECOND // baud
        self.straddle = straddle
        self.publishers, self.subscribers = publishers, subscribers
        self.volts = 1.3
        self.dead = False  # the wire: nothing passes in either direction
        self.commands: dict[str, list[tuple[int, int]]] = {name: [] for name, _ in subscribers}
        self.sent: list[tuple[int, bytes, bool]] = []  # topic, payload, arrived whole
        self.requests: list[int] = []  # times at which the host's question was understood
        self.time_answers: list[tuple[int, int]] = []
        self.replies: list[tuple[int, bytes]] = []  # parameter replies
        self.truth: list[tuple[int, float, float]] = []  # counts at each pass, not wrapped
        self.incoming: deque[tuple[int, int]] = deque()  # arrival, byte
        self.outgoing: deque[tuple[int, int]] = deque()
        self.receive_free = self.send_free = 0
        self.counts = [0.0, 0.0]
        self._reset_state(0)

    def _reset_state(self, now: int) -> None:
        self.configured = False
        self.pwm, self.speed = [0, 0], [0.0, 0.0]
        self.next_pass = now
        self.last_pass = now
        self.published = now
        self.sync_asked = self.sync_answered = now
        self.half = bytearray()
        self.half_until = 0

    def restart(self, now: int) -> None:
        """The reset button: motors off, counts gone, silent until asked again."""
        self.advance(now)
        self._reset_state(now + BOOT)
        self.counts = [0.0, 0.0]
        self.incoming.clear()

    def receive(self, now: int, data: bytes) -> None:
        """The host writes `data` at `now`; it comes in at the baud rate's pace."""
        self.receive_free = max(self.receive_free, now)
        for byte in data:
            self.receive_free += self.byte_time
            if not self.dead:
                self.incoming.append((self.receive_free, self.down.through(byte)))

    def advance(self, now: int) -> bytes:
        """Run up to `now`; return the bytes that have arrived at the host by then."""
        while self.next_pass <= now:
            self._loop(self.next_pass)
        arrived = bytearray()
        while self.outgoing and self.outgoing[0][0] <= now:
            arrived.append(self.outgoing.popleft()[1])
        return bytes(arrived)

    def inject(self, now: int, data: bytes) -> None:
        """Bytes that the board never meant to send, behind those already on their way."""
        self.send_free = max(self.send_free, now)
        for byte in data:
            self.send_free += self.byte_time
            self.outgoing.append((self.send_free, byte))

    def _loop(self, now: int) -> None:
        """One pass of the sketch's loop."""
        self._turn_wheels(now)
        # The library counts whole milliseconds: only passes that are 21 apart lose the frame.
        if self.half and self.straddle and now // MS > self.half_until:
            self.half.clear()
        while self.incoming and self.incoming[0][0] <= now:
            self._parse(now, self.incoming.popleft()[1])
        if self.configured:
            self._keep_time(now)
        if now - self.published >= PUBLISH_AFTER:
            self.published = now
            if self.configured:
                self._publish(now)
        full = self.send_free - SEND_BUFFER * self.byte_time
        self.next_pass = max(now, full) + LOOP_PAUSE + MS // 3  # and a little for the work

    def _turn_wheels(self, now: int) -> None:
        step = (now - self.last_pass) / SECOND
        self.last_pass = max(now, self.last_pass)
        for side in (0, 1):
            target = self.pwm[side] / 255 * RATED
            self.speed[side] += (target - self.speed[side]) * min(1.0, max(0.0, step) / LAG)
            self.counts[side] += self.speed[side] * max(0.0, step)
        self.truth.append((now, self.counts[0], self.counts[1]))

    def _publish(self, now: int) -> None:
        values = {
            "left_ticks": struct.pack("<i", _int16(int(self.counts[0]))),
            "right_ticks": struct.pack("<i", _int16(int(self.counts[1]))),
            "obstacle_distance": struct.pack(
                "<f", DIVISOR / self.volts if self.volts else float("inf")
            ),
        }
        for slot, (name, _) in enumerate(self.publishers):
            if name.lstrip("/") in values:
                self.write(now, 125 + slot, values[name.lstrip("/")])

    def _keep_time(self, now: int) -> None:
        if now - self.sync_answered > SYNC_LOST:
            self.configured = False
        elif now - self.sync_asked > SYNC_EVERY:
            self._ask_time(now)

    def _ask_time(self, now: int) -> None:
        self.sync_asked = now
        self.write(now, 10, bytes(8))

    def write(self, now: int, topic: int, payload: bytes) -> None:
        """Put a frame on the wire."""
        self.send_free = max(self.send_free, now)
        whole = not self.dead
        for byte in framed(topic, payload):
            self.send_free += self.byte_time
            noisy = self.up.through(byte)
            whole = whole and noisy == byte
            if not self.dead:
                self.outgoing.append((self.send_free, noisy))
        self.sent.append((topic, payload, whole))

    def _parse(self, now: int, byte: int) -> None:
        """The client library's state machine: a false start costs the bytes read for it."""
        half = self.half
        if not half:
            if byte == 0xFF:
                half.append(byte)
                self.half_until = now // MS + HALF_READ_LIFE
            return
        half.append(byte)
        have = len(half)
        if (
            (have == 2 and byte != 0xFE)
            or (have == 5 and sum(half[2:5]) % 256 != 255)
            or (have == 5 and struct.unpack_from("<H", half, 2)[0] > 512)
        ):
            half.clear()
        elif have >= 8 and have == 8 + struct.unpack_from("<H", half, 2)[0]:
            frame = bytes(half)
            half.clear()
            if sum(frame[5:]) % 256 == 255:
                self._act(now, struct.unpack_from("<H", frame, 5)[0], frame[7:-1])

    def _act(self, now: int, topic: int, payload: bytes) -> None:
        if topic == 0:
            self.requests.append(now)
            self._ask_time(now)
            self._negotiate(now)
            self.sync_answered, self.configured = now, True
        elif topic == 10:
            self.sync_answered = now
            seconds, nanoseconds = struct.unpack("<II", payload)
            self.time_answers.append((now, seconds * SECOND + nanoseconds))
        elif topic == 6:
            self.replies.append((now, payload))
        elif topic == 11:
            self.configured = False
        elif 100 <= topic < 100 + len(self.subscribers):
            self._obey(now, self.subscribers[topic - 100][0], payload)

    def _negotiate(self, now: int) -> None:
        for role, base, topics in ((0, 125, self.publishers), (1, 100, self.subscribers)):
            for slot, (name, kind) in enumerate(topics):
                texts = (name, f"std_msgs/{kind}", TYPES[kind])
                info = struct.pack("<H", base + slot)
                info += b"".join(struct.pack("<I", len(text)) + text.encode() for text in texts)
                self.write(now, role, info + struct.pack("<i", 512))

    def _obey(self, now: int, name: str, payload: bytes) -> None:
        if name == "reset":
            self.counts = [0.0, 0.0]
            self.commands[name].append((now, payload[0] if payload else 1))
        elif len(payload) == 4:
            (value,) = struct.unpack("<i", payload)
            self.commands[name].append((now, value))
            if name in ("set_left_speed", "set_right_speed"):
                self.pwm[name == "set_right_speed"] = max(-255, min(255, value))


def _int16(value: int) -> int:
    """As an AVR's int holds it."""
    return (value + 32768) % 65536 - 32768


class RosserialDevicePort:
    """The device on one end of a pseudo-terminal, in real time; `with OnTerminal(device, fd):`.

    It takes bytes at the baud rate's pace: the others wait in the kernel, where the host can still
    discard them. `on_pass` is called with the time (ns) after each step of the device.
    """

    def __init__(
        self,
        device: RosserialDevice,
        fd: int,
        on_pass: Callable[[int], None] = lambda now: None,
    ) -> None:
        self.device, self.fd, self.on_pass = device, fd, on_pass
        self.over = threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> RosserialDevice:
        self.thread.start()
        return self.device

    def __exit__(self, *_: object) -> None:
        self.over.set()
        self.thread.join()

    def _run(self) -> None:
        prefer()
        begin = time.monotonic_ns()
        line_free = 0
        while not self.over.is_set():
            ready, _, _ = select.select([self.fd], [], [], 0.001)
            now = time.monotonic_ns() - begin
            room = (now - line_free) // self.device.byte_time
            if ready and room > 0:
                data = os.read(self.fd, min(room, LINE_BYTES_MAX))
                self.device.receive(now, data)
                line_free = max(line_free, now - LINE_BYTES_MAX * self.device.byte_time)
                line_free += len(data) * self.device.byte_time
            elif ready:
                time.sleep(0.0005)
            arrived = self.device.advance(now)
            if arrived:
                os.write(self.fd, arrived)
            self.on_pass(now)
