"""Search for our firmware behind a port: its baud rate, or what else answers. Sans-IO."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from diffbotctl.errors import join_words
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links import rosserial_frames, stk500_frames
from diffbotctl.links.link_protocol import Refusal
from diffbotctl.links.rosserial_topics import REQUEST
from diffbotctl.time import MILLISECOND

RATE_TIMEOUT = 2_000 * MILLISECOND  # at one baud rate; time for eight of our questions
FIRST_PROBE_DELAY = 800 * MILLISECOND  # our own firmware has received three of them by then
PROBE_PERIOD = 400 * MILLISECOND
ROUNDS = 2  # through all baud rates, before a finding is final
RECEIVED_BYTES_MAX = 512  # kept of each rate, to recognise a board by
STRAY_BYTES_MAX = 8  # of a port that is opened and a board that is reset: no program sent them
# Questions to other programs. Our firmware discards them as noise.
SIGN_ON = stk500_frames.message(1, bytes([stk500_frames.SIGN_ON]))
LEAVE = stk500_frames.message(2, bytes([stk500_frames.LEAVE, 1, 1]))
"""makes a waiting bootloader start the program, if there is one"""
LEAVE_REPLY = stk500_frames.message(2, bytes([stk500_frames.LEAVE, 0]))
"""the bootloader's reply to it"""
TOPICS = rosserial_frames.encode(REQUEST)
FLASH = "`diffbotctl flash firmware` installs our firmware over the USB cable"


class BaudSearch:
    """Tries one baud rate after the other until our firmware answers.

    `rate` is the baud rate to use now. `finding` is what seems to be behind the port, None before
    every rate was tried; `final` is True when it will not change. A bootloader that waits, because
    the board was reset while bytes were sent to it, is asked to start the program.
    """

    def __init__(self, rates: Iterable[int]) -> None:
        """`rates`: baud rates, the most likely first."""
        self.rates = tuple(dict.fromkeys(rates))
        self.begin(0, self.rates[0])

    def begin(self, now: int, rate: int) -> None:
        """Start over, at `rate`."""
        self._order = tuple(dict.fromkeys((rate, *self.rates)))
        self._tries = 0
        self._received: dict[int, bytes] = {}
        self._left_bootloader = False
        self.finding: Refusal | None = None
        self.final = False
        self._start_rate(now)

    def _start_rate(self, now: int) -> None:
        self.next_rate_at = now + RATE_TIMEOUT
        """time of the next call of `next_rate`"""
        self.probe_at = now + FIRST_PROBE_DELAY
        """time of the next call of `probe`"""
        self._probes = 0

    @property
    def rate(self) -> int:
        return self._order[self._tries % len(self._order)]

    def receive(self, data: bytes) -> None:
        """Take received bytes, whether they were valid frames or not."""
        if data:
            received = self._received.get(self.rate, b"") + data
            self._received[self.rate] = received[-RECEIVED_BYTES_MAX:]

    def probe(self, now: int) -> bytes:
        """The next question to other programs; empty when none is due."""
        if now < self.probe_at:
            return b""
        self.probe_at = now + PROBE_PERIOD
        if self.rate != stk500_frames.BAUD:
            return TOPICS
        received = self._received.get(self.rate, b"")
        if not self._left_bootloader and stk500_frames.BOOTLOADER_NAME in received:
            self._left_bootloader, self._probes = True, 0
            self._received.clear()
            return LEAVE
        self._probes += 1
        return SIGN_ON if self._probes % 2 else TOPICS

    def next_rate(self, now: int) -> None:
        """Update `finding` and change to the next rate, when the time of this one is over."""
        if now < self.next_rate_at:
            return
        self._tries += 1
        self._start_rate(now)
        recognised = recognise_board(self._received)
        if recognised is not None:
            self.finding = recognised
            may_start_program = _has_bootloader(self._received) and not self._left_bootloader
            self.final = not may_start_program
        elif self._tries >= len(self._order):
            self.finding = unknown_board(self._received, self._order)
            self.final = self._tries >= ROUNDS * len(self._order)


def _bootloader_left(data: bytes) -> bool:
    """Whether a bootloader confirmed that it starts the program, and nothing came after that."""
    return LEAVE_REPLY in data and len(_sent_by_program(data)) <= STRAY_BYTES_MAX


def _has_bootloader(received: Mapping[int, bytes]) -> bool:
    return any(stk500_frames.BOOTLOADER_NAME in data for data in received.values())


def recognise_board(received: Mapping[int, bytes]) -> Refusal | None:
    """The known program that answered, or None; `received` holds the bytes of each baud rate."""
    if any(map(_is_echo, received.values())):
        return Refusal(
            "E-PORT-ECHO",
            "the port returns what is sent to it",
            "no board is connected to this adapter, or its TX and RX touch; a radio module that "
            "does this is in its command mode: switch it off and on",
        )
    if _has_bootloader(received):
        return Refusal(
            "E-BOARD-BLANK", "only the bootloader answers: the board has no program", FLASH
        )
    if any(_rosserial_frames(data) for data in received.values()):
        return Refusal(
            "E-BOARD-ROSSERIAL",
            "the board runs the book's firmware, which uses rosserial",
            f"{FLASH}; or keep its firmware and set link: {{protocol: rosserial}}, as in the robot "
            "book_2wd_stock",
        )
    return None


def _is_echo(data: bytes) -> bool:
    """Whether a question of ours came back; no board has a reason to send one."""
    return TOPICS in data or SIGN_ON in data


def _rosserial_frames(data: bytes) -> bool:
    """Whether a frame of a rosserial board is in `data`: its sums are right, it is not empty."""
    return any(frame.payload for frame in rosserial_frames.RosserialDecoder().feed(data))


def _sent_by_program(data: bytes) -> bytes:
    """`data` without the replies of a bootloader."""
    parser, rest = stk500_frames.ReplyParser(), data
    for start in range(len(data)):
        if data[start] == stk500_frames.START and start + 1 < len(data):
            reply = parser.feed(data[start:], data[start + 1])
            parser = stk500_frames.ReplyParser()
            if reply is not None:
                rest = rest.replace(stk500_frames.message(data[start + 1], reply), b"")
    return rest


def unknown_board(received: Mapping[int, bytes], rates: tuple[int, ...]) -> Refusal:
    """Nothing was received that a program sent, or no known program sent it."""
    tried = f"{join_words(rates)} baud"
    if any(map(_bootloader_left, received.values())):
        return Refusal(
            "E-BOARD-UNKNOWN",
            "the board started its program, which does not answer: it is another firmware",
            FLASH,
        )
    if all(len(_sent_by_program(data)) <= STRAY_BYTES_MAX for data in received.values()):
        return Refusal(
            "E-PORT-SILENT",
            f"nothing answers at {tried}",
            "check that the robot is switched on, the port is the right one, and the module's RX "
            "is wired to the board's TX and its TX to RX; press the reset button. If that fails, "
            f"{FLASH}",
        )
    return Refusal(
        "E-BOARD-UNKNOWN",
        f"unknown bytes arrive at {tried}",
        f"the board has another firmware ({FLASH}), or the radio module has a baud rate other "
        "than link.baud",
    )


def wrong_version(version: int) -> Refusal:
    """Our firmware uses another version of the protocol."""
    fix, age = (
        "`diffbotctl flash firmware` writes that of this version, over the USB cable",
        "older",
    )
    if version > frames.VERSION:
        age = "newer"
        fix = (
            "install the newer diffbotctl that wrote this firmware, or write the firmware of this "
            "one: `diffbotctl flash firmware`"
        )
    cause = (
        f"the board's firmware is {age}: it uses version {version} of the protocol, this "
        f"diffbotctl version {frames.VERSION}"
    )
    return Refusal("E-BOARD-VERSION", cause, fix)


def other_board(code: int, expected: frames.BoardCode) -> Refusal:
    """The board is of another type than the robot file states."""
    board = frames.BoardCode.find(code)
    name = (board.meaning if board else "") or f"a board of an unknown type ({code})"
    return Refusal(
        "E-BOARD-KIND",
        f"the board is {name}, the robot file's is {expected.meaning}: its pins would be wrong",
        "correct board.type in the robot file, or name the file of this robot with --robot",
    )


def refused_setting(field: int, refusal: frames.RefusalCode | None) -> Refusal:
    """The board cannot use one of the robot's settings."""
    names = frames.SettingsFrame._fields
    name = names[field] if field < len(names) else f"number {field}"
    meaning = refusal.meaning if refusal else "for a reason unknown to this version"
    return Refusal(
        "E-BOARD-SETTINGS",
        f"the board refuses the setting `{name}`: {meaning}",
        "change it in the robot file, and the wiring accordingly",
    )


def settings_timeout(cause: str) -> Refusal:
    """The board answers, but has not accepted the settings in time."""
    return Refusal(
        "E-BOARD-SETTINGS",
        cause or "the board does not reply to its settings",
        "let the wheels stop, and end other programs that drive this board, over both its ports",
    )
