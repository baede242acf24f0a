"""Who may use the page: codes that work once, and the sessions that they become.

The link and the QR code in the terminal carry a code. The first device that presents it gets a
session, whose key is a cookie; the code is void from then on, so that a photograph of it is too.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable
from enum import StrEnum

from diffbotctl.web.deadman import EndedPresses

KEY_BYTES = 16  # 128 bits cannot be guessed over a network
SESSIONS_MAX = 16


class DeviceKind(StrEnum):
    """Kind of a device, as the terminal and the cause of a stop name it."""

    PHONE = "phone"
    TABLET = "tablet"
    COMPUTER = "computer"


def device_kind(user_agent: str) -> DeviceKind:
    """The kind of device that a browser claims to run on; nothing else of its text is used."""
    text = user_agent.lower()
    if "ipad" in text or "tablet" in text or ("android" in text and "mobile" not in text):
        return DeviceKind.TABLET
    if "mobile" in text or "iphone" in text:
        return DeviceKind.PHONE
    return DeviceKind.COMPUTER


class Session:
    """One device that has presented a code. `name` is unique, such as `phone 1`.

    Browsers send the cookie `key` to all ports of a machine, so that a server of another user there
    could learn it. The page keeps `proof` in its storage, which belongs to one port.
    """

    def __init__(self, key: str, proof: str, name: str) -> None:
        self.key = key
        self.proof = proof
        self.name = name
        self.sets_goals = False  # the person was asked once, and agreed
        self.ended = EndedPresses()
        self.sockets = 0  # pages that are open


class Sessions:
    """The present code, and the sessions by key. `make_key` returns a new random text."""

    def __init__(self, make_key: Callable[[], str] | None = None) -> None:
        self.make_key = make_key or (lambda: secrets.token_urlsafe(KEY_BYTES))
        self.code = self.make_key()
        self.by_key: dict[str, Session] = {}
        self.count = 0

    @property
    def is_full(self) -> bool:
        """Whether no further device can have a session."""
        return len(self.by_key) >= SESSIONS_MAX and not self._unused()

    def enter(self, code: str, user_agent: str) -> Session | None:
        """A new session for the device that presents the present code. None for a wrong code."""
        if not secrets.compare_digest(code.encode(), self.code.encode()) or self.is_full:
            return None
        self.code = self.make_key()
        if len(self.by_key) >= SESSIONS_MAX:
            del self.by_key[self._unused()[0]]
        self.count += 1
        name = f"{device_kind(user_agent)} {self.count}"
        session = Session(self.make_key(), self.make_key(), name)
        self.by_key[session.key] = session
        return session

    def find(self, key: str) -> Session | None:
        return self.by_key.get(key)

    def find_proven(self, key: str, proof: str) -> Session | None:
        """The session of a cookie, for a page that also has its proof."""
        session = self.find(key)
        if session is None or not secrets.compare_digest(proof.encode(), session.proof.encode()):
            return None
        return session

    def _unused(self) -> list[str]:
        """The keys of sessions without an open page, the oldest first."""
        return [key for key, session in self.by_key.items() if not session.sockets]
