"""The whole task of flashing a board, as a stream of events."""

from __future__ import annotations

import os
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from diffbotctl.board.progress import Event, FlashMessage, FlashProgress
from diffbotctl.board.session import BoardVisit
from diffbotctl.drivers.board_candidates import refuse_radio
from diffbotctl.drivers.board_errors import (
    BadImageError,
    NoBackupError,
    NoProgrammerError,
    NoSyncError,
    RefusedError,
    SilentError,
)
from diffbotctl.drivers.serial_port import disconnected_error, open_port
from diffbotctl.errors import RunError
from diffbotctl.flash import stk500
from diffbotctl.flash.intel_hex import read_hex, write_hex
from diffbotctl.flash.stk500 import BootloaderRequest, BootloaderSession
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.links.diffbot_settings import BoardSettings
from diffbotctl.links.stk500_frames import BAUD, ReplyParser

RESET_PULSE = 0.05  # s that DTR is low; the capacitor to the reset line needs a tenth of that
SYNC_TRIES = 15
SYNC_WAIT = 0.1  # s for the answer to one try; the bootloader listens for 0.8 s
ANSWER_WAIT = 1.0  # s; a page takes 15 ms


def load(file: Path) -> bytes:
    """The program in a hex file. Raises BadImageError."""
    try:
        return read_hex(file.read_text("ascii"), str(file))
    except OSError as error:
        raise BadImageError(str(file), error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise BadImageError(str(file), "it is no text") from error


def flash(
    device: str,
    file: Path,
    *,
    programmer: str = "built-in",
    backup: Path | None = None,
    settings: BoardSettings | None = None,
) -> Iterator[Event]:
    """Write and verify `file`, then greet the firmware and send it `settings`.

    `backup` first saves what is on the board. With `settings` of None the board is left as soon as
    its program runs. Raises RunError: a FlashError, or what opening the port has to say.
    """
    refuse_radio(device)
    image = load(file)
    if backup is not None:
        _check_place(backup)
    if backup is not None or programmer == "built-in":
        with Bootloader(device) as board:
            yield from _with_bootloader(board, image, backup, programmer == "built-in")
            if settings is not None and programmer == "built-in":
                yield from greet(board, settings)
    if programmer == "avrdude":
        yield from _avrdude(device, file)
        if settings is not None:
            with Bootloader(device) as board:
                yield from greet(board, settings)


def _with_bootloader(
    board: Bootloader, image: bytes, backup: Path | None, writes: bool
) -> Iterator[Event]:
    board.synchronise()
    yield from board.hold(stk500.identify(board.device))
    yield FlashMessage(f"Mega 2560 on {board.device}")
    if backup is not None:
        saved = bytearray()
        yield from board.hold(stk500.read(board.device, saved))
        _save(backup, write_hex(bytes(saved)))
        yield FlashMessage(f"what was on the board is in {backup}")
    if writes:
        yield from board.hold(stk500.write(board.device, image))
        yield FlashMessage(f"{len(image)} bytes written and verified")
    yield from board.hold(stk500.leave(board.device))


def _check_place(backup: Path) -> None:
    """Before half a minute of reading; and what was saved before the last flash stays saved."""
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
    """A board behind an open USB port, just reset."""

    def __init__(self, device: str) -> None:
        """Raises RunError when the port cannot be opened."""
        self.device = device
        self.port = open_port(device, BAUD)
        self._sequence = 0
        self._answers = ReplyParser()
        _pulse_reset(self.port.fd)

    def __enter__(self) -> Bootloader:
        return self

    def __exit__(self, *_: object) -> None:
        self.port.close()

    def synchronise(self) -> None:
        """Find the bootloader. Raises NoSyncError."""
        for _ in range(SYNC_TRIES):
            if self._ask(stk500.HELLO, SYNC_WAIT) is not None:
                return
        raise NoSyncError(self.device)

    def hold(self, conversation: BootloaderSession) -> Iterator[FlashProgress]:
        """Have a conversation; yields how far it is. Raises what it raises, and NoSyncError."""
        answer = b""
        started = False
        while True:
            try:
                wish = conversation.send(answer) if started else next(conversation)
            except StopIteration:
                return
            started = True
            if isinstance(wish, FlashProgress):
                yield wish
                answer = b""
                continue
            got = self._ask(wish, ANSWER_WAIT)
            if got is None:
                raise RefusedError(self.device, "answer")
            answer = got

    def read(self, wait: float) -> bytes:
        """What arrives within `wait` seconds; b"" when nothing does."""
        if not select.select([self.port.fd], [], [], max(0.0, wait))[0]:
            return b""
        try:
            return self.port.read()
        except OSError as error:
            raise disconnected_error(self.device, error) from error

    def write(self, data: bytes) -> None:
        """Write all of `data`. Raises RunError when the port is gone."""
        while data:
            try:
                data = data[self.port.write(data) :]
            except OSError as error:
                raise disconnected_error(self.device, error) from error
            if data:
                select.select([], [self.port.fd], [], SYNC_WAIT)

    def _ask(self, wish: BootloaderRequest, wait: float) -> bytes | None:
        self._sequence = (self._sequence + 1) & 0xFF
        self.write(wish.wire(self._sequence))
        until = time.monotonic() + wait
        while (left := until - time.monotonic()) > 0:
            answer = self._answers.feed(self.read(left), self._sequence)
            if answer is not None:
                return answer
        return None


def _pulse_reset(fd: int) -> None:
    """Drop DTR for a moment, which resets a Mega. A pseudo-terminal has no such line."""
    import fcntl
    import struct
    import termios

    line = struct.pack("I", termios.TIOCM_DTR)
    try:
        fcntl.ioctl(fd, termios.TIOCMBIC, line)
        time.sleep(RESET_PULSE)
        fcntl.ioctl(fd, termios.TIOCMBIS, line)
    except OSError:
        return


def greet(board: Bootloader, settings: BoardSettings) -> Iterator[Event]:
    """Meet the firmware over USB, send it its settings, tell its name.

    Raises SilentError, or RunError when it takes no settings.
    """
    host = DiffbotHost(replace(settings, uart=0))
    try:
        yield from BoardVisit(board.port, host).meet()
    except OSError as error:
        raise disconnected_error(board.device, error) from error
    except RunError as error:
        if host.hello is None:
            raise SilentError(board.device, host.cause) from error
        raise


def _avrdude(device: str, file: Path) -> Iterator[Event]:
    program = shutil.which("avrdude")
    if program is None:
        raise NoProgrammerError(
            "avrdude is not installed",
            "sudo apt-get install avrdude, or leave --programmer out: diffbotctl flashes by itself",
        )
    open_port(device, BAUD).close()  # who else holds it, and what rights we lack, we say better
    words = [
        program,
        "-c",
        "wiring",
        "-p",
        "m2560",
        "-P",
        device,
        "-b",
        str(BAUD),
        "-D",
        "-U",
        f"flash:w:{os.path.abspath(file)}:i",
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = [line for line in done.stderr.splitlines() if "error" in line.lower()]
        raise NoProgrammerError(
            "; ".join(said) or f"it ended with code {done.returncode}",
            "leave --programmer out to flash without it",
        )
    yield FlashMessage("written and verified by avrdude")
