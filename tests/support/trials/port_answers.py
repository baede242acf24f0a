"""What answers on a port: devices on a pseudo-terminal, and the error for each."""

from __future__ import annotations

import os
import select
import tempfile
import tty
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from random import Random
from typing import NamedTuple

from diffbotctl.config.load import load_robot
from diffbotctl.drivers.robot_link import diffbot_host
from diffbotctl.errors import RunError
from diffbotctl.flash.board_jobs import identify
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links import stk500_frames
from diffbotctl.links.diffbot_codec import encode
from tests.support.background import repeating
from tests.support.book_board import BookBoard

Say = Callable[[bytes], bytes]  # bytes received, bytes sent


class Answer(NamedTuple):
    """A port's name, what is behind it, and the expected error."""

    name: str
    device: str
    make: Callable[[], Say]
    code: str
    fix: str


def silent() -> Say:
    """A device that sends nothing."""
    return lambda _: b""


def noise() -> Say:
    """A module at another rate: bytes without sense, some at every look."""
    rng = Random(3)
    return lambda _: rng.randbytes(12)


def blank() -> Say:
    """A bootloader without a program behind it: it answers its own language alone."""
    return lambda received: stk500_frames.message(1, HELLO_ANSWER) if b"\x1b" in received else b""


NAME = stk500_frames.BOOTLOADER_NAME
HELLO_ANSWER = bytes([stk500_frames.SIGN_ON, 0, len(NAME)]) + NAME


def book() -> Say:
    """The book's firmware."""
    device = BookBoard()

    def say(received: bytes) -> bytes:
        device.take(received)
        device.run(device.now + POLL_PERIOD_S)
        sent = b"".join(data for at, data, _ in device.out if at <= device.now)
        device.out = [each for each in device.out if each[0] > device.now]
        return sent

    return say


def newer() -> Say:
    """Our firmware of a later version."""
    hello = frames.HelloFrame(*(0 for _ in frames.HelloFrame._fields))._replace(
        version=frames.VERSION + 1
    )
    return lambda received: encode(hello) if received else b""


def older() -> Say:
    """Our firmware of version 2 of the protocol."""
    hello = frames.HelloFrame(*(0 for _ in frames.HelloFrame._fields))._replace(version=2)
    return lambda received: encode(hello) if received else b""


POLL_PERIOD_S = 0.02  # s between two answers
ANSWERS = [
    Answer("silent board", "ttyUSB0", silent, "E-PORT-SILENT", "reset button"),
    Answer("silent module", "rfcomm0", silent, "E-PORT-SILENT", "wired to the board's TX"),
    Answer("garbage: wrong baud rate", "rfcomm0", noise, "E-BOARD-UNKNOWN", "baud rate"),
    Answer("bootloader, no program", "ttyACM0", blank, "E-BOARD-BLANK", "flash firmware"),
    Answer("the book's rosserial", "rfcomm0", book, "E-BOARD-ROSSERIAL", "book_2wd_stock"),
    Answer("a firmware of version 2", "rfcomm0", older, "E-BOARD-VERSION", "flash firmware"),
    Answer("a later firmware", "rfcomm0", newer, "E-BOARD-VERSION", "install the newer diffbotctl"),
]


@contextmanager
def named_port(folder: Path, name: str) -> Iterator[tuple[Path, int]]:
    """A serial port called `name` in `folder`, and the file of whoever is behind it."""
    master, slave = os.openpty()
    tty.setraw(slave)
    (folder / name).symlink_to(os.ttyname(slave))
    try:
        yield folder / name, master
    finally:
        os.close(master)
        os.close(slave)


def problem_of(answer: Answer) -> tuple[str, str]:
    """Code and fix of the error; ("", "") when the board could be driven."""
    robot = load_robot("book_2wd").robot
    with (
        tempfile.TemporaryDirectory() as folder,
        named_port(Path(folder), answer.device) as (port, end),
        talking(end, answer.make()),
    ):
        try:
            for _ in identify(str(port), diffbot_host(robot, str(port))):
                pass
        except RunError as error:
            return error.problems[0].code, error.problems[0].fix
    return "", ""


def talking(end: int, say: Say, period_s: float = POLL_PERIOD_S) -> AbstractContextManager[None]:
    """Somebody behind a port writes what `say` returns for what has come, again and again."""

    def talk() -> None:
        ready = select.select([end], [], [], 0)[0]
        answer = say(os.read(end, 4096) if ready else b"")
        if answer:
            with suppress(BlockingIOError):  # no reader: lost, as on a line
                os.write(end, answer)

    os.set_blocking(end, False)
    return repeating(talk, period_s)


def is_right(answer: Answer) -> bool:
    """Whether it is named rightly, with its fix."""
    code, fix = problem_of(answer)
    return code == answer.code and answer.fix in fix
