"""Engine side of the programs: a driver that reads what they publish and sends what they read.

A program is another process that may do anything. What it sends is bounded in size and rate, and
checked; the first invalid line, a flood or a long silence ends it, and it is started again. The
engine never waits for it.
"""

from __future__ import annotations

import json
import os
import pickle
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diffbotctl.config.configuration import ProgramUse
from diffbotctl.control_socket.protocol import RefusalError
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.drivers.input_leases import InputLeases
from diffbotctl.engine.driver import Delivery
from diffbotctl.graph import Sink
from diffbotctl.message_types import type_name
from diffbotctl.messages import LogLevel
from diffbotctl.programs.faults import ProgramFaults
from diffbotctl.programs.link import ProgramLink
from diffbotctl.programs.supervisor import Order, end_of, read_events, start_supervisor
from diffbotctl.recording.json_codec import message_encoder
from diffbotctl.time import MILLISECOND, NEVER

if TYPE_CHECKING:
    from diffbotctl.plant.faults import Fault

PROTOCOL = 1
EXIT_REPORT_TIMEOUT = 100 * MILLISECOND  # how it ended is known a little after its socket closes
EVENTS_PERIOD = 20 * MILLISECOND  # between two looks at the supervisor's channel, at least


class ProgramsDriver:
    """A driver with all programs of a pipeline. `kinds` maps each wire to its message class."""

    def __init__(
        self,
        programs: Sequence[ProgramUse],
        kinds: dict[str, type],
        inputs: InputLeases,
        operator: Operator,
        control_socket: Path | None = None,
    ) -> None:
        """Fork the supervisor; the programs start with the run.

        `control_socket` is the engine's, for programs that command it.
        """
        self.links = {use.name: ProgramLink(use) for use in programs}
        self.kinds = kinds
        self.inputs = inputs
        self.operator = operator
        self.channel, self.pid = start_supervisor(programs, control_socket)
        self.channel.setblocking(False)
        self.is_supervised = True
        self.has_started = False
        self.has_data = False  # whether a program had sent something when it was last looked at
        self.events_due = 0
        self.faults = ProgramFaults()
        self.pending: list[tuple[str, Any]] = []
        self.readers: dict[str, list[tuple[ProgramLink, str]]] = {}
        for link in self.links.values():
            for port, wire in link.use.wires.items():
                self.readers.setdefault(wire, []).append((link, port))
        self.encoders: dict[str, Callable[[Any], bytes]] = {
            wire: message_encoder(kinds[wire]) for wire in self.readers
        }

    def set_faults(self, faults: Iterable[Fault]) -> None:
        """Let those of `faults`, of a simulated robot, act that are of programs."""
        self.faults = ProgramFaults(faults)

    def sinks(self) -> Iterator[tuple[str, Sink]]:
        """What takes the messages that programs read; they are sent in the loop's idle time."""
        for wire in self.readers:
            yield wire, self._sink(wire)

    def _sink(self, wire: str) -> Sink:
        def take(now: int, message: Any) -> None:
            self.pending.append((wire, message))

        return take

    def due(self) -> int:
        """When a program counts as hanging, or its outputs expire."""
        if not self.has_started:
            return 0
        losses = (min(link.silent_at, link.lost_at) for link in self.links.values())
        return min(self.faults.due(), *losses)

    def files(self) -> list[int]:
        files = [self.channel.fileno()] if self.is_supervised else []
        return files + [
            link.socket.fileno() for link in self.links.values() if link.socket is not None
        ]

    def deliver(self, now: int) -> list[Delivery]:
        """What programs have published, stamped with `now`."""
        if not self.has_started:
            self.has_started = True
            for name in self.links:
                self._order("start", name)
        # Most times a program has sent something, and the supervisor has not.
        if self.is_supervised and (not self.has_data or now >= self.events_due):
            self.events_due = now + EVENTS_PERIOD
            self._read_events(now)
        self.has_data = False
        if now >= self.faults.due():
            self.faults.act(now, self.links.values())
        deliveries: list[Delivery] = []
        for link in self.links.values():
            if link.socket is not None:
                end_text = link.end_text
                deliveries += self._read(now, link)
                if end_text:
                    self._lose(now, link, f"{link.who} {end_text}")
            if now >= link.lost_at:
                self._lose_without_report(now, link)
            elif now >= link.silent_at:
                self._kill(now, link, "it has sent nothing for too long")
        return deliveries

    def idle(self) -> None:
        """Send what programs read. Called when the instant's commands have left."""
        if not self.pending:
            return
        for wire, message in self.pending:
            data = self.encoders[wire](message)
            for link, port in self.readers[wire]:
                link.send(b'{"%s": %s}\n' % (port.encode(), data))
        self.pending.clear()

    def close(self) -> None:
        """End all programs, and wait until they have ended."""
        for link in self.links.values():
            link.close()
        self.channel.close()
        os.waitpid(self.pid, 0)

    def _read(self, now: int, link: ProgramLink) -> list[Delivery]:
        deliveries: list[Delivery] = []
        try:
            data = link.read(now)
            if data is None:
                # Its exit code comes from the supervisor at once.
                link.lost_at = now + EXIT_REPORT_TIMEOUT
                link.close()
                return deliveries
            self.has_data = self.has_data or bool(data)
            for line in link.lines.take(data):
                link.silent_at = now + link.silence_max
                deliveries += link.messages(now, line)
        except RefusalError as refusal:
            self._kill(now, link, refusal.cause)
            return []
        for delivery in deliveries:
            self.inputs.renew(now, delivery.wire, link.use.name, link.who)
        return deliveries

    def _read_events(self, now: int) -> None:
        events, self.is_supervised = read_events(self.channel)
        for event, file in events:
            link = self.links[event.program]
            if event.kind == "started":
                if link.end_text:  # the engine was suspended meanwhile
                    self._lose(now, link, f"{link.who} {link.end_text}")
                link.open(now, event.pid, file)
                self._greet(link)
                self._log(now, "info", link, f"started as process {event.pid}")
            elif event.kind == "line":
                self._log(now, "info", link, event.text)
            elif event.kind == "ended" and link.pid == event.pid and link.lost_at < NEVER:
                self._lose(now, link, f"{link.who} {event.text}")
            elif event.kind == "ended" and link.socket is not None and link.pid == event.pid:
                link.end_text = event.text
            elif event.kind == "failed":
                self._lose(now, link, f"program {link.use.name}: {event.text}")
        if not self.is_supervised:
            for link in self.links.values():
                self._lose(now, link, f"{link.who}: the supervisor of programs has ended")

    def _greet(self, link: ProgramLink) -> None:
        fields = {
            "hello": PROTOCOL,
            "name": link.use.name,
            "in": {port: type_name(self.kinds[wire]) for port, wire in link.use.wires.items()},
            "out": {
                wire.rpartition(".")[2]: type_name(kind) for wire, kind in link.use.outputs.items()
            },
        }
        link.send(json.dumps(fields).encode() + b"\n")

    def _kill(self, now: int, link: ProgramLink, cause: str) -> None:
        """End a program that misbehaves; the supervisor starts it again."""
        self._order("kill", link.use.name)
        self._lose(now, link, f"{link.who} was ended: {cause}")

    def _lose_without_report(self, now: int, link: ProgramLink) -> None:
        """Its socket is closed, and the report of the supervisor is late (a busy computer)."""
        end = end_of(link.pid)
        if end:
            self._lose(now, link, f"{link.who} {end}")
        else:
            self._kill(now, link, "it has closed its output")

    def _lose(self, now: int, link: ProgramLink, cause: str) -> None:
        """The outputs of a program expire at once."""
        link.close()
        link.lost_at = NEVER
        self._log(now, "error", link, cause)
        self.inputs.end(now, link.use.name, cause, link.use.outputs)

    def _log(self, now: int, level: LogLevel, link: ProgramLink, text: str) -> None:
        self.operator.log(now, level, link.use.name, text)

    def _order(self, kind: str, program: str) -> None:
        with suppress(OSError):
            self.channel.send(pickle.dumps(tuple(Order(kind, program))))
