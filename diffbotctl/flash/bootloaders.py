"""The bootloader behind a port: which of the stock ones it is, and its requests and replies."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Generator, Iterator
from types import ModuleType
from typing import Any

from diffbotctl.drivers.board_ports import LostError, NoSyncError, WrongSignatureError
from diffbotctl.flash import stk500, stk500v1
from diffbotctl.flash.board_session import BoardSession, JobProgress
from diffbotctl.flash.intel_hex import FLASH_BYTES_MAX
from diffbotctl.links import stk500_frames, stk500v1_frames
from diffbotctl.links.diffbot_frames import BoardCode

SYNC_TIMEOUT_S = 0.1  # of one try; the bootloaders wait 0.8 s and more for requests
# Some boards start late: bootloaders with a long delay, USB chips that pass nothing for a while.
SYNC_TIME_S = 4.0  # after a reset, of the bootloader that the board is expected to have
SHORT_SYNC_TIME_S = 1.2  # of the others
# From a reset to the first request: optiboot starts the program when it receives half of one.
START_S = 0.1
ROUNDS = 2  # through all bootloaders
REPLY_TIMEOUT_S = 1.0  # a page takes 30 ms
RESTARTS = 3  # of a write whose bootloader stopped answering
SIGNATURES = {
    BoardCode.MEGA2560: ("1e9801",),
    BoardCode.ATMEGA328P: ("1e950f", "1e9514"),  # the ATmega328 runs the same program
}


class Bootloader(ABC):
    """A kind of bootloader, on a port whose board can be reset."""

    title: str
    baud: int
    board: BoardCode
    flash_max: int  # bytes of a program
    procedures: ModuleType  # which commands identify the chip, write, read and leave

    def __init__(self, session: BoardSession) -> None:
        self.session = session

    @abstractmethod
    def answers(self, seconds: float) -> bool:
        """Send sign-ons for `seconds` until it replies."""

    @abstractmethod
    def request(self, request: Any, timeout: float) -> bytes | None:
        """The reply to a request; None when there is none within `timeout` s."""

    def signature(self) -> str:
        """The chip's signature, in hex digits. Raises FlashError."""
        signature = bytearray()
        list(self.run(self.procedures.identify(self.session.device, signature)))
        return signature.hex()

    def write(self, image: bytes) -> Iterator[JobProgress]:
        """Write and verify. Raises FlashError."""
        yield from self.run(self.procedures.write(self.session.device, image))

    def read(self, into: bytearray) -> Iterator[JobProgress]:
        """Read the program. Raises FlashError."""
        yield from self.run(self.procedures.read(self.session.device, into))

    def leave(self) -> Iterator[JobProgress]:
        """Start the program."""
        yield from self.run(self.procedures.leave())

    def run(self, procedure: Generator[Any, bytes | None, None]) -> Iterator[JobProgress]:
        """Carry out a procedure; yields its progress. Raises what it raises."""
        step = next(procedure, None)
        while step is not None:
            reply: bytes | None = None
            if isinstance(step, JobProgress):
                yield step
            else:
                reply = self.request(step, REPLY_TIMEOUT_S)
            try:
                step = procedure.send(reply)
            except StopIteration:
                return


class Stk500v2Bootloader(Bootloader):
    """Bootloader of a Mega 2560."""

    title = "STK500v2"
    baud = stk500_frames.BAUD
    board = BoardCode.MEGA2560
    flash_max = FLASH_BYTES_MAX
    procedures = stk500

    def __init__(self, session: BoardSession) -> None:
        super().__init__(session)
        self._sequence = 0
        self._replies = stk500_frames.ReplyParser()

    def answers(self, seconds: float) -> bool:
        """Send sign-ons for `seconds` until it replies."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if self.request(stk500.HELLO, SYNC_TIMEOUT_S) is not None:
                return True
        return False

    def request(self, request: stk500.BootloaderRequest, timeout: float) -> bytes | None:
        """The reply to a request, by its sequence number."""
        self._sequence = (self._sequence + 1) & 0xFF
        self.session.write(request.wire(self._sequence))
        end = time.monotonic() + timeout
        while (remaining := end - time.monotonic()) > 0:
            reply = self._replies.feed(self.session.read(remaining), self._sequence)
            if reply is not None:
                return reply
        return None


class Stk500v1Bootloader(Bootloader):
    """Bootloader of an Uno or Nano: optiboot at 115200 baud, or ATmegaBOOT at 57600."""

    board = BoardCode.ATMEGA328P
    flash_max = stk500v1.FLASH_BYTES_MAX
    procedures = stk500v1

    def __init__(self, session: BoardSession, title: str, baud: int) -> None:
        super().__init__(session)
        self.title, self.baud = title, baud

    def answers(self, seconds: float) -> bool:
        """Send sign-ons for `seconds` until it replies, and until late replies have come."""
        time.sleep(START_S)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if self.request(stk500v1.SYNC, SYNC_TIMEOUT_S) is not None:
                while self.session.read(SYNC_TIMEOUT_S):
                    pass
                return True
        return False

    def write(self, image: bytes) -> Iterator[JobProgress]:
        """Write and verify, from the start again when it stops answering. Raises FlashError."""
        for remaining in reversed(range(RESTARTS)):
            try:
                yield from super().write(image)
            except LostError:
                if not remaining:
                    raise
                self.session.reset()
                self.answers(SYNC_TIME_S)
            else:
                return

    def request(self, request: stk500v1.SyncedRequest, timeout: float) -> bytes | None:
        """The reply to a request, by its size."""
        self.session.write(request.wire())
        received, end = b"", time.monotonic() + timeout
        while (remaining := end - time.monotonic()) > 0:
            received += self.session.read(remaining)
            reply = stk500v1_frames.read_reply(received, request.size)
            if reply is not None:
                return reply
        return None


def find_bootloader(session: BoardSession, board: BoardCode) -> Bootloader:
    """The bootloader of the board on this port, which is expected to be a `board`.

    Resets the board for each kind, since a bootloader that receives another one's requests starts
    the program. Raises NoSyncError when none answers, WrongSignatureError for another chip.
    """
    for _ in range(ROUNDS):
        for bootloader in _kinds(session, board):
            session.change_baud(bootloader.baud)
            session.reset()
            is_usual = bootloader.board is board is BoardCode.MEGA2560
            if bootloader.answers(SYNC_TIME_S if is_usual else SHORT_SYNC_TIME_S):
                signature = bootloader.signature()
                if signature not in SIGNATURES[board]:
                    raise WrongSignatureError(session.device, signature, board.meaning)
                return bootloader
    raise NoSyncError(session.device)


def _kinds(session: BoardSession, board: BoardCode) -> list[Bootloader]:
    """All kinds, those of `board` first."""
    kinds: list[Bootloader] = [
        Stk500v2Bootloader(session),
        Stk500v1Bootloader(session, "optiboot", stk500v1_frames.OPTIBOOT_BAUD),
        Stk500v1Bootloader(session, "ATmegaBOOT", stk500v1_frames.ATMEGABOOT_BAUD),
    ]
    return sorted(kinds, key=lambda kind: kind.board is not board)
