"""The rosserial host and an independent board half, run against each other in virtual time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable

from diffbotctl.links.rosserial import RosserialHost
from diffbotctl.links.rosserial_frames import Decoder, Frame
from diffbotctl.messages import Duty, Encoders, Link, Message
from tests.rosserial_device import RATED, Device

MS = 1_000_000
SECOND = 1_000_000_000
STEP = 4 * MS  # ns between two looks at the wire, about as often as a port wakes its reader


class Session:
    """One start of the host against `device`; everything said is kept, with its time."""

    def __init__(self, device: Device, host: RosserialHost | None = None) -> None:
        self.device = device
        self.host = host or RosserialHost(RATED)
        # Fed the same bytes under the same rule, so that what the host's own decoder delivers
        # can be compared frame by frame with what was sent.
        self.witness = Decoder(self.host.topics.plausible)
        self.frames: list[Frame] = []
        self.heard: list[tuple[int, str, Message]] = []
        self.written: list[tuple[int, bytes]] = []
        self.now = 0
        self.host.opened(0)
        self.host.stop(0)

    def run(self, until: int, drive: Callable[[int], Duty] | None = None) -> Session:
        """Go on until `until`; `drive` answers each telemetry message with a command."""
        while self.now < until:
            self.now += STEP
            data = self.device.advance(self.now)
            self.frames += self.witness.feed(data)
            heard = self.host.receive(self.now, data) if data else []
            heard += self.host.timed(self.now)
            self.heard += [(self.now, port, message) for port, message in heard]
            if drive is not None and any(port == "encoders" for port, _ in heard):
                self.host.command(self.now, drive(self.now))
            if self.host.due() <= self.now:
                written = self.host.send(self.now)
                if written:
                    self.written.append((self.now, written))
                    self.device.hear(self.now, written)
        return self

    @property
    def encoders(self) -> list[Encoders]:
        """All of them, in order."""
        return [message for _, _, message in self.heard if isinstance(message, Encoders)]

    @property
    def links(self) -> list[Link]:
        """All of them, in order."""
        return [message for _, _, message in self.heard if isinstance(message, Link)]

    def up_at(self) -> int:
        """When the link was up first. Raises StopIteration when it never was."""
        return next(link.time for link in self.links if link.state == "up")

    def lost_frames(self) -> int:
        """Frames that the board sent, that arrived whole, and that were not delivered in order."""
        at = lost = 0
        whole = [Frame(topic, payload) for topic, payload, intact in self.device.sent if intact]
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
        """Largest difference of the host's counts from what the wheels made, both counted from the
        first message of one boot (counts); the board's age of a frame leaves two or three."""
        times = [time for time, _, _ in self.device.truth]
        worst = 0.0
        base: dict[int, tuple[float, float]] = {}
        for message in self.encoders:
            _, left, right = self.device.truth[max(0, bisect_right(times, message.time) - 1)]
            off = (message.left - left, message.right - right)
            first = base.setdefault(message.boot, off)
            worst = max(worst, abs(off[0] - first[0]), abs(off[1] - first[1]))
        return worst

    def one_sided(self) -> int:
        """Longest time, in ns, for which one wheel's last accepted command was of a pair whose
        other half had not been accepted, by time of acceptance."""
        left = [time for time, _ in self.device.commands["set_left_speed"]]
        right = [time for time, _ in self.device.commands["set_right_speed"]]
        return max(_lag(left, right, self.now), _lag(right, left, self.now))


def _lag(these: list[int], those: list[int], end: int) -> int:
    """The longest wait from one of `these` to the next of `those`, not before it."""
    worst = 0
    for time in these:
        at = bisect_right(those, time - LOOP) if those else 0
        worst = max(worst, (those[at] if at < len(those) else end) - time)
    return worst


LOOP = 40 * MS  # the other half may have been accepted one or two passes of the loop earlier
