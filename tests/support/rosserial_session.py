"""The rosserial host and an independent board half, run against each other in virtual time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from struct import unpack_from

from diffbotctl.links.rosserial_frames import RosserialDecoder, RosserialFrame
from diffbotctl.links.rosserial_host import RosserialHost
from diffbotctl.messages import Duty, Encoders, Link, Message
from diffbotctl.time import MILLISECOND as MS
from tests.support.rosserial_device import RATED, RosserialDevice

STEP = 4 * MS  # ns between two looks at the wire, about as often as a port wakes its reader


class RosserialSession:
    """One start of the host against `device`; everything received is kept, with its time."""

    def __init__(self, device: RosserialDevice, host: RosserialHost | None = None) -> None:
        self.device = device
        self.host = host or RosserialHost(RATED)
        # Fed the same bytes under the same rule, so that what the host's own decoder delivers
        # can be compared frame by frame with what was sent.
        self.witness = RosserialDecoder(self.host.topics.plausible)
        self.frames: list[RosserialFrame] = []
        self.received: list[tuple[int, str, Message]] = []
        self.written: list[tuple[int, bytes]] = []
        self.arrived = b""  # at the last step
        self.now = 0
        self.host.opened(0)
        self.host.stop(0)

    def run(self, until: int, drive: Callable[[int], Duty] | None = None) -> RosserialSession:
        """Go on until `until`; `drive` answers each telemetry message with a command."""
        while self.now < until:
            self.now += STEP
            data = self.arrived = self.device.advance(self.now)
            self.frames += self.witness.feed(data)
            received = self.host.receive(self.now, data) if data else []
            received += self.host.on_time(self.now)
            self.received += [(self.now, port, message) for port, message in received]
            if drive is not None and any(port == "encoders" for port, _ in received):
                self.host.command(self.now, drive(self.now))
            if self.host.due() <= self.now:
                written = self.host.send(self.now)
                if written:
                    self.written.append((self.now, written))
                    self.device.receive(self.now, written)
        return self

    @property
    def encoders(self) -> list[Encoders]:
        """All of them, in order."""
        return [message for _, _, message in self.received if isinstance(message, Encoders)]

    @property
    def links(self) -> list[Link]:
        """All of them, in order."""
        return [message for _, _, message in self.received if isinstance(message, Link)]

    def lost_frames(self) -> int:
        """Frames that the board sent, that arrived whole, and that were not delivered in order."""
        at = lost = 0
        whole = [
            RosserialFrame(topic, payload) for topic, payload, intact in self.device.sent if intact
        ]
        # What is still on the wire at the end has not arrived; it is at most the tail of a burst.
        pending = len(self.device.outgoing)
        while pending > 0 and whole:
            pending -= len(whole.pop().payload) + 8
        for frame in whole:
            try:
                at = self.frames.index(frame, at) + 1
            except ValueError:
                lost += 1
        return lost

    def worst_error(self) -> float:
        """Largest difference of the host's counts from those of the wheels at about that time.

        The host's count is the board's own, so nothing needs to be lined up. The board took it at
        a pass of its loop between AGE before the message's time and the message's time.
        """
        times = [time for time, _, _ in self.device.truth]
        worst = 0.0
        for message in self.encoders:
            first = max(0, bisect_right(times, message.time - AGE) - 1)
            last = bisect_right(times, message.time + AGE) + 1
            for side, count in ((1, message.left), (2, message.right)):
                wheel = [row[side] for row in self.device.truth[first:last]]
                worst = max(worst, count - max(wheel), min(wheel) - count)
        return worst

    def mixed(self) -> int:
        """Longest time, in ns, during which the board drove on a pair that was never sent."""
        sent = {(0, 0)} | {values for data in self.written if (values := pair_in(data[1]))}
        events = sorted(
            (time, side, value)
            for side, name in enumerate(("set_left_speed", "set_right_speed"))
            for time, value in self.device.commands[name]
        )
        now, worst, since = [0, 0], 0, None
        for time, side, value in [*events, (self.now, 0, None)]:
            if since is not None:
                worst = max(worst, time - since)
            if value is None:
                break
            now[side] = value
            since = None if (now[0], now[1]) in sent else since or time
        return worst

    def lone_frames(self) -> int:
        """Writes of the host that hold a speed for one wheel alone."""
        return sum(1 for _, data in self.written if data[:5] == SPEED_HEADER and not pair_in(data))


AGE = 60 * MS  # a pass of the loop, a burst on the wire
SPEED_HEADER = bytes.fromhex("fffe0400fb")
SPEED_FRAME = 12  # bytes


def pair_in(data: bytes) -> tuple[int, int] | None:
    """The PWM values of a write that is a left and a right frame, back to back."""
    if len(data) != 2 * SPEED_FRAME or data[:5] != SPEED_HEADER:
        return None
    left, right = data[:SPEED_FRAME], data[SPEED_FRAME:]
    if (left[5], right[5]) != (100, 101):
        return None
    return unpack_from("<i", left, 7)[0], unpack_from("<i", right, 7)[0]
