"""Which command answers which tick: what came over the wire beside what the run recorded."""

from __future__ import annotations

import os
import select
import struct
import time
from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import NamedTuple

from diffbotctl.links.rosserial_frames import HEADER_BYTES, OVERHEAD_BYTES
from diffbotctl.links.rosserial_wheels import PWM_MAX
from diffbotctl.messages import Duty, Volts
from diffbotctl.recording.reader import RecordingReader
from tests.support.book_board import frame

PAIR = 24  # bytes of both wheels' commands
LEFT, RIGHT = 100, 101  # topics of the commands
NUMBERS = 1000  # ticks whose distances differ
RANGE_CONSTANT_V_CM = 13.0  # the sketch's centimetres are this over the volts
DISTANCE_CM, DISTANCE_STEP_CM = 25.0, 0.01  # of tick 0; from one tick to the next

Duties = tuple[int, int]  # PWM values of both wheels


class ReceivedPair(NamedTuple):
    """Commands for both wheels, and when they were read (s)."""

    time: float
    duties: Duties


def distance(tick: int) -> float:
    """Distance (cm) in the frames of a tick: the recording shows its number by it."""
    return DISTANCE_CM + tick % NUMBERS * DISTANCE_STEP_CM


def pair(left: int, right: int) -> bytes:
    """The frames that command both wheels."""
    return frame(LEFT, struct.pack("<i", left)) + frame(RIGHT, struct.pack("<i", right))


def duties_of(data: bytes) -> Duties:
    """What a pair of frames commands."""
    left, right = (struct.unpack_from("<i", data, HEADER_BYTES + at)[0] for at in (0, PAIR // 2))
    return left, right


class Answers:
    """Waits for changed commands on the port, and keeps all of them with their times.

    A pair of commands equal to the one before is a repetition. Frames of other topics, such as the
    host's time, are no commands.
    """

    def __init__(self, port: int) -> None:
        self.port = port
        self.rest = self.last = b""
        self.received: list[ReceivedPair] = []

    def wait(self, seconds: float) -> bool:
        """True when a changed pair of commands has arrived in that time."""
        end = time.perf_counter() + seconds
        while not self._next_changed():  # several may have come in one read
            remaining = end - time.perf_counter()
            if remaining <= 0 or not select.select([self.port], [], [], remaining)[0]:
                return False
            self.rest += os.read(self.port, 4096)
        return True

    def _next_changed(self) -> bool:
        while len(self.rest) >= OVERHEAD_BYTES:
            topic, size = self.rest[5], OVERHEAD_BYTES + self.rest[2]
            if topic == LEFT:
                size = PAIR
            if len(self.rest) < size:
                return False
            data, self.rest = self.rest[:size], self.rest[size:]
            if topic != LEFT:
                continue
            before, self.last = self.last, data
            self.received.append(ReceivedPair(time.perf_counter(), duties_of(data)))
            if data != before:
                return True
        return False


def recorded_commands(recording: Path) -> list[tuple[int, Duties]]:
    """The number of each recorded tick, modulo NUMBERS, and the command that was in force after it.

    Raises RunError when the recording cannot be read.
    """
    commands: list[tuple[int, Duties]] = []
    tick: int | None = None
    duties = (0, 0)
    for recorded in RecordingReader(recording).messages():
        message = recorded.message
        if isinstance(message, Volts):
            if tick is not None:
                commands.append((tick, duties))
            centimetres = RANGE_CONSTANT_V_CM / message.volts
            tick = round((centimetres - DISTANCE_CM) / DISTANCE_STEP_CM)
        elif isinstance(message, Duty):
            duties = (round(message.left * PWM_MAX), round(message.right * PWM_MAX))
    if tick is not None:
        commands.append((tick, duties))
    return commands


def commands_of(ticks: int, recorded: list[tuple[int, Duties]]) -> list[Duties | None]:
    """The command after each tick of 0 to `ticks`; None for one that was not recorded."""
    commands: list[Duties | None] = [None] * ticks
    place = 0
    for number, duties in recorded:
        place += (number - place) % NUMBERS
        if place < ticks:
            commands[place] = duties
    return commands


def answer_times(
    sent: Sequence[float], received: Sequence[ReceivedPair], commands: Sequence[Duties | None]
) -> list[float | None]:
    """Seconds from each tick to the first pair that carries its command or that of a later tick.

    `sent` has the times of the ticks. None for a tick that leaves the command as it was, so that
    its answer could not be distinguished from a repetition; infinity for one without an answer.
    """
    times: list[float | None] = [None]
    for tick in range(1, len(sent)):
        is_same = commands[tick] is not None and commands[tick] == commands[tick - 1]
        times.append(None if is_same else inf)
    answered = 0
    for pair_time, duties in received:
        for tick in range(answered + 1, len(sent)):
            if sent[tick] > pair_time:
                break
            if commands[tick] == duties and times[tick] is not None:
                for earlier in range(answered + 1, tick + 1):
                    if times[earlier] is not None:
                        times[earlier] = pair_time - sent[earlier]
                answered = tick
                break
    return times
