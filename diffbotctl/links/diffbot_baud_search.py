"""Looking for our firmware behind a port: at which baud rate, and who else answers. Sans-IO."""

from __future__ import annotations

from collections.abc import Iterable

from diffbotctl.links import bootloader
from diffbotctl.links.link_protocol import Refusal
from diffbotctl.links.unknown_board import LEAVE, SIGN_ON, TOPICS, known, unknown
from diffbotctl.time import MILLISECOND

TRY = 2_000 * MILLISECOND  # at one baud rate; eight questions of ours
POKE_AFTER = 800 * MILLISECOND  # by then our own firmware has had three of them
POKE_EVERY = 400 * MILLISECOND
ROUNDS = 2  # through all baud rates, before silence is final
HEARD_MOST = 512  # bytes kept to tell a stranger by


class BaudSearch:
    """What the host does besides asking while no firmware of ours has answered.

    `rate` is the baud rate to use now. `finding` says what seems to be there, None before every
    rate was tried; `final` that it will not change. A board whose bootloader waits, because it was
    reset while we were talking, is told to start its program.
    """

    def __init__(self, rates: Iterable[int]) -> None:
        """`rates`: the likeliest first."""
        self.rates = tuple(dict.fromkeys(rates))
        self.begin(0, self.rates[0])

    def begin(self, now: int, rate: int) -> None:
        """Start over, at `rate`."""
        self._order = tuple(dict.fromkeys((rate, *self.rates)))
        self._tries = 0
        self._heard: dict[int, bytes] = {}
        self._left = False  # a bootloader was told to start the program
        self.finding: Refusal | None = None
        self.final = False
        self._try(now)

    def _try(self, now: int) -> None:
        self.turn_at = now + TRY
        """when `turn` has something to do"""
        self.poke_at = now + POKE_AFTER
        """when `poke` has something to say"""
        self._pokes = 0

    @property
    def rate(self) -> int:
        """The baud rate to use now."""
        return self._order[self._tries % len(self._order)]

    def hear(self, data: bytes) -> None:
        """Take what came, whether it meant something or not."""
        if data:
            self._heard[self.rate] = (self._heard.get(self.rate, b"") + data)[-HEARD_MOST:]

    def poke(self, now: int) -> bytes:
        """A question that a stranger would answer, when one is due."""
        if now < self.poke_at:
            return b""
        self.poke_at = now + POKE_EVERY
        if self.rate != bootloader.BAUD:
            return TOPICS
        if not self._left and bootloader.NAME in self._heard.get(self.rate, b""):
            self._left, self._pokes = True, 0
            self._heard.clear()
            return LEAVE
        self._pokes += 1
        return SIGN_ON if self._pokes % 2 else TOPICS

    def turn(self, now: int) -> None:
        """Judge what was heard, and go on to the next rate, when it is time."""
        if now < self.turn_at:
            return
        self._tries += 1
        self._try(now)
        stranger = known(self._heard)
        if stranger is not None:
            self.finding = stranger
            self.final = self._left or not self._bootloader  # which may yet start a program
        elif self._tries >= len(self._order):
            self.finding = unknown(self._heard, self._order)
            self.final = self._tries >= ROUNDS * len(self._order)

    @property
    def _bootloader(self) -> bool:
        return any(bootloader.NAME in data for data in self._heard.values())
