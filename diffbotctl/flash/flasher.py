"""Flashing a board, as a stream of events: backup, write, verify, send the settings."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from diffbotctl.board.session import BoardSession, JobEvent, JobMessage, JobProgress
from diffbotctl.drivers.board_ports import (
    BadImageError,
    NoBackupError,
    NoProgrammerError,
    NoSyncError,
    RefusedError,
    SilentError,
    refuse_radio,
)
from diffbotctl.drivers.serial_port import open_port
from diffbotctl.errors import RunError
from diffbotctl.flash import stk500
from diffbotctl.flash.intel_hex import read_hex, write_hex
from diffbotctl.flash.stk500 import BootloaderRequest, Procedure
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.links.diffbot_settings import BoardSettings
from diffbotctl.links.stk500_frames import BAUD, ReplyParser

SYNC_TRIES = 15
SYNC_TIMEOUT_S = 0.1  # of one try; the bootloader waits 0.8 s for requests
REPLY_TIMEOUT_S = 1.0  # a page takes 15 ms


def load(file: Path) -> bytes:
    """The program in a hex file. Raises BadImageError."""
    try:
        return read_hex(file.read_text("ascii"), str(file))
    except OSError as error:
        raise BadImageError(str(file), error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise BadImageError(str(file), "it is not a text file") from error


def flash(
    device: str,
    file: Path,
    *,
    programmer: str = "built-in",
    backup: Path | None = None,
    settings: BoardSettings | None = None,
) -> Iterator[JobEvent]:
    """Write and verify `file`, then connect to the firmware and send it `settings`.

    `backup`: file for the present program of the board, saved first. With `settings` of None the
    job ends when the new program starts. Raises RunError: a FlashError, or of opening the port.
    """
    refuse_radio(device)
    image = load(file)
    if backup is not None:
        _check_backup_file(backup)
    if backup is not None or programmer == "built-in":
        with BoardSession(device, BAUD) as session:
            session.reset()
            yield from _write(Bootloader(session), image, backup, programmer == "built-in")
            if settings is not None and programmer == "built-in":
                yield from _send_settings(session, settings)
    if programmer == "avrdude":
        yield from _avrdude(device, file)
        if settings is not None:
            with BoardSession(device, BAUD) as session:
                session.reset()
                yield from _send_settings(session, settings)


def _write(
    bootloader: Bootloader, image: bytes, backup: Path | None, writes: bool
) -> Iterator[JobEvent]:
    bootloader.synchronise()
    yield from bootloader.run(stk500.identify(bootloader.device))
    yield JobMessage(f"Mega 2560 on {bootloader.device}")
    if backup is not None:
        saved = bytearray()
        yield from bootloader.run(stk500.read(bootloader.device, saved))
        _save(backup, write_hex(bytes(saved)))
        yield JobMessage(f"the former program of the board is in {backup}")
    if writes:
        yield from bootloader.run(stk500.write(bootloader.device, image))
        yield JobMessage(f"{len(image)} bytes written and verified")
    yield from bootloader.run(stk500.leave(bootloader.device))


def _check_backup_file(backup: Path) -> None:
    """Check before half a minute of reading; an earlier backup is never overwritten."""
    if backup.exists():
        raise NoBackupError(str(backup), "the file exists, and may hold an earlier backup")
    if not os.access(backup.parent, os.W_OK):
        raise NoBackupError(str(backup), "its folder does not exist or cannot be written to")


def _save(backup: Path, text: str) -> None:
    try:
        backup.write_text(text)
    except OSError as error:
        raise NoBackupError(str(backup), error.strerror or str(error)) from error


class Bootloader:
    """The bootloader of a board that has just been reset."""

    def __init__(self, session: BoardSession) -> None:
        self.device = session.device
        self._session = session
        self._sequence = 0
        self._replies = ReplyParser()

    def synchronise(self) -> None:
        """Send sign-ons until the bootloader replies. Raises NoSyncError."""
        for _ in range(SYNC_TRIES):
            if self._request(stk500.HELLO, SYNC_TIMEOUT_S) is not None:
                return
        raise NoSyncError(self.device)

    def run(self, procedure: Procedure) -> Iterator[JobProgress]:
        """Carry out a procedure; yields its progress. Raises what it raises, and RefusedError."""
        step = next(procedure, None)
        while step is not None:
            reply = b""
            if isinstance(step, JobProgress):
                yield step
            else:
                reply = self._reply_to(step)
            try:
                step = procedure.send(reply)
            except StopIteration:
                return

    def _reply_to(self, request: BootloaderRequest) -> bytes:
        reply = self._request(request, REPLY_TIMEOUT_S)
        if reply is None:
            raise RefusedError(self.device, "answer")
        return reply

    def _request(self, request: BootloaderRequest, timeout: float) -> bytes | None:
        self._sequence = (self._sequence + 1) & 0xFF
        self._session.write(request.wire(self._sequence))
        end = time.monotonic() + timeout
        while (remaining := end - time.monotonic()) > 0:
            reply = self._replies.feed(self._session.read(remaining), self._sequence)
            if reply is not None:
                return reply
        return None


def _send_settings(session: BoardSession, settings: BoardSettings) -> Iterator[JobEvent]:
    """Connect to the firmware over USB, which sends it its settings; yields its name.

    Raises SilentError, or RunError when it takes no settings.
    """
    host = DiffbotHost(replace(settings, uart=0))
    try:
        yield from session.connect(host)
    except RunError as error:
        if host.hello is None:
            raise SilentError(session.device, host.cause) from error
        raise


def _avrdude(device: str, file: Path) -> Iterator[JobEvent]:
    program = shutil.which("avrdude")
    if program is None:
        raise NoProgrammerError(
            "avrdude is not installed",
            "sudo apt-get install avrdude, or leave --programmer out: diffbotctl flashes by itself",
        )
    open_port(
        device, BAUD
    ).close()  # its errors (port in use, missing rights) are clearer than avrdude's
    target = f"-c wiring -p m2560 -b {BAUD} -D".split()
    command = [program, *target, "-P", device, "-U", f"flash:w:{os.path.abspath(file)}:i"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        errors = [line for line in result.stderr.splitlines() if "error" in line.lower()]
        raise NoProgrammerError(
            "; ".join(errors) or f"it ended with code {result.returncode}",
            "leave --programmer out to flash without it",
        )
    yield JobMessage("written and verified by avrdude")
