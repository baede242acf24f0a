"""Samples of RPLIDAR A1 and C1 in their standard scan mode.

The answer to A5 20 begins with the descriptor A5 5A 05 00 00 40 81; then each sample has 5 bytes:
quality with the start bit S and its complement, angle in 1/64 degree with the check bit 1, distance
in 1/4 mm; the low byte first. There is no checksum: only a run of samples shows what sends them. A
YDLIDAR X2 begins with the same descriptor.
"""

from __future__ import annotations

from diffbotctl.links.lidar_turns import SCAN_ANSWER, Distances, TurnCollector

SAMPLE_BYTES = 5
RUN_SAMPLES = 60  # without an error, which count as a packet


class RplidarDecoder:
    """Decoder of RPLIDAR A1 and C1."""

    def __init__(self, rays: int) -> None:
        self.turns = TurnCollector(rays)
        self.packets = 0
        self.period: float | None = None
        self.buffer = bytearray()
        self.is_scanning = False  # the descriptor has come
        self.run = 0  # samples since the last error

    def receive(self, data: bytes) -> list[Distances]:
        self.buffer += data
        while self.is_scanning or self._find_descriptor():
            if len(self.buffer) < SAMPLE_BYTES:
                break
            first, second = self.buffer[0], self.buffer[1]
            if (first & 1) == (first >> 1 & 1) or not second & 1:
                self._lose()
                continue
            angle = (second >> 1 | self.buffer[2] << 7) / 64.0
            quarters = self.buffer[3] | self.buffer[4] << 8
            self.turns.add(angle, quarters / 4000.0, angle)
            del self.buffer[:SAMPLE_BYTES]
            self.run += 1
            self.packets += self.run % RUN_SAMPLES == 0
        return self.turns.take()

    def _find_descriptor(self) -> bool:
        start = self.buffer.find(SCAN_ANSWER)
        if start < 0:
            del self.buffer[: 1 - len(SCAN_ANSWER)]
            return False
        del self.buffer[: start + len(SCAN_ANSWER)]
        self.is_scanning = True
        return True

    def _lose(self) -> None:
        """Skip a byte, or begin anew where another answer begins."""
        self.run = 0
        self.turns.lose()
        if self.buffer.startswith(SCAN_ANSWER[:2]):
            self.is_scanning = False
        else:
            del self.buffer[0]
