"""Faults of programs: their processes are really killed or suspended, or send far too much."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from diffbotctl.programs.link import ProgramLink
from diffbotctl.time import NEVER

if TYPE_CHECKING:
    from diffbotctl.plant.faults import Fault


class ProgramFaults:
    """Lets the faults of programs in `faults` act at their times (ns)."""

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        faults = [fault for fault in faults if fault.kind.startswith("program_")]
        self._begins: Sequence[Fault] = sorted(faults, key=lambda fault: fault.start)
        self._active: list[Fault] = []

    def due(self) -> int:
        """When the next one begins or ends."""
        begins = [fault.start for fault in self._begins]
        return min([*begins, *(fault.end for fault in self._active)], default=NEVER)

    def act(self, now: int, links: Iterable[ProgramLink]) -> None:
        """Begin and end what is due on the programs of `links`."""
        for fault in [each for each in self._active if each.end <= now]:
            self._active.remove(fault)
            for link in _of(fault, links):
                link.is_flooding = False
                if fault.kind == "program_hang":
                    _signal(link, signal.SIGCONT)
        for fault in [each for each in self._begins if each.start <= now]:
            if not all(link.socket for link in _of(fault, links)):
                continue  # it begins once they run
            self._begins = [each for each in self._begins if each is not fault]
            self._active.append(fault)
            for link in _of(fault, links):
                link.is_flooding = fault.kind == "program_flood"
                if fault.kind == "program_crash":
                    _signal(link, signal.SIGKILL)
                elif fault.kind == "program_hang":
                    _signal(link, signal.SIGSTOP)


def _of(fault: Fault, links: Iterable[ProgramLink]) -> list[ProgramLink]:
    return [link for link in links if fault.part in (None, link.use.name)]


def _signal(link: ProgramLink, number: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(link.pid, number)
