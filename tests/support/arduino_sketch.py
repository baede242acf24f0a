"""An Arduino with a sketch of its own, as rosserial's client library behaves, in virtual time.

Written from the facts of the protocol; it shares no code with the host. It publishes what is in
`values` every 61 ms, and keeps what it receives.
"""

import struct
from collections.abc import Mapping

from tests.support.book_board import BookBoard, frame, text

# From the definitions of std_msgs: the sums that `rosmsg md5` prints.
MD5 = {
    "Bool": "8b94c1b53db61fb6aed406028ad6332a",
    "Empty": "d41d8cd98f00b204e9800998ecf8427e",
    "Float32": "73fcbf46b49191e672908e50842a83d4",
    "Float64": "fdb28210bfa9d7c91146260178d9a584",
    "Int16": "8524586e34fbd7cb1c08c5f5f1ca0e57",
    "Int32": "da5909fbe378aeaf85e547e830cc1bb7",
    "Int64": "34add168574510e6e17f5d23ecc077ef",
    "String": "992ce8a1687cec8c8bd883ec73ca41d1",
    "UInt16": "1df79edf208b629fe6b81923a544552d",
    "UInt8": "7c8164229e7d2c17eb95e9231617fdee",
}


class ArduinoSketch(BookBoard):
    """`published` and `subscribed`: type of each topic by its name, `Int32` or `Int32 <md5>`."""

    def __init__(
        self, published: Mapping[str, str], subscribed: Mapping[str, str], space: int = 512
    ) -> None:
        super().__init__()
        self.published: dict[int, str] = dict(zip(range(125, 150), published, strict=False))
        self.subscribed = dict(zip(range(100, 125), subscribed, strict=False))
        self.types = {**published, **subscribed}
        self.space = space
        self.values: dict[str, bytes] = {}  # payload of each published topic
        self.received: list[tuple[str, bytes]] = []  # (name, payload)
        self.requests = 0

    def turn(self, step: float) -> None:
        pass

    def handle(self, topic: int, payload: bytes) -> None:
        if topic == 0:
            self.requests += 1
        if topic in self.subscribed:
            self.received.append((self.subscribed[topic], payload))
        else:
            super().handle(topic, payload)

    def negotiate(self) -> None:
        self.send(frame(10, bytes(8)), "time")
        for kind, topics in ((0, self.published), (1, self.subscribed)):
            for number, name in topics.items():
                short, _, md5 = self.types[name].partition(" ")
                about = struct.pack("<H", number) + text(name) + text(f"std_msgs/{short}")
                about += text(md5 or MD5[short]) + struct.pack("<i", self.space)
                self.send(frame(kind, about), "topic")
        self.configured = True
        self.time_answered = self.next_report = self.now
        self.next_sync = self.now + 2.5

    def say(self, words: str, level: int = 1) -> None:
        self.send(frame(7, bytes([level]) + text(words)), "log")

    def report(self) -> None:
        for number, name in self.published.items():
            if name in self.values:
                self.send(frame(number, self.values[name]), "data")
