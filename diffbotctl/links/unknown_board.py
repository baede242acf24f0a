"""What answers on a port where our firmware does not: told from the bytes that came."""

from __future__ import annotations

from collections.abc import Mapping

from diffbotctl.errors import join_words
from diffbotctl.links import bootloader
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.link_protocol import Refusal
from diffbotctl.links.rosserial_frames import SYNC, VERSION
from diffbotctl.links.rosserial_frames import encode as rosserial_frame
from diffbotctl.links.rosserial_topics import REQUEST

# Questions for strangers. Our firmware takes them for noise.
SIGN_ON = bootloader.message(1, bytes([bootloader.SIGN_ON]))
LEAVE = bootloader.message(2, bytes([bootloader.LEAVE, 1, 1]))
"""ends a bootloader's wait: the program starts, if there is one"""
TOPICS = rosserial_frame(REQUEST)

FLASH = "`diffbotctl flash firmware` puts our program on it, over the USB cable"
ROSSERIAL = bytes((SYNC, VERSION))
ENOUGH = 2  # such pairs of bytes; one may be chance


def known(heard: Mapping[int, bytes]) -> Refusal | None:
    """A stranger by name; `heard` has the bytes that came at each baud rate."""
    if any(bootloader.NAME in data for data in heard.values()):
        return Refusal(
            "E-BOARD-BLANK", "only the bootloader answers: the board has no program", FLASH
        )
    if any(data.count(ROSSERIAL) >= ENOUGH for data in heard.values()):
        return Refusal(
            "E-BOARD-ROSSERIAL",
            "the board runs the book's firmware, which speaks rosserial",
            f"{FLASH}; or drive it as it is with link: {{protocol: rosserial}}, as the robot "
            "book_2wd_stock does",
        )
    return None


def unknown(heard: Mapping[int, bytes], rates: tuple[int, ...]) -> Refusal:
    """Silence, or bytes that mean nothing."""
    tried = f"{join_words(rates)} baud"
    if not any(heard.values()):
        return Refusal(
            "E-PORT-SILENT",
            f"nothing answers at {tried}",
            "is the robot switched on, this the right port, the module's RX wired to the board's "
            f"TX and its TX to RX? Press the reset button; if it stays silent, {FLASH}",
        )
    return Refusal(
        "E-BOARD-UNKNOWN",
        f"bytes come that mean nothing at {tried}",
        f"another firmware ({FLASH}), or a radio module set to another baud rate than link.baud "
        "says",
    )


def another_version(theirs: int) -> Refusal:
    """Our firmware, of another time."""
    fix = (
        FLASH
        if theirs < frames.VERSION
        else (f"upgrade diffbotctl (pip install --upgrade diffbotctl); or {FLASH}, an older one")
    )
    cause = (
        f"the board's firmware speaks version {theirs} of the protocol, this diffbotctl "
        f"version {frames.VERSION}"
    )
    return Refusal("E-BOARD-VERSION", cause, fix)


def refused_setting(field: int, code: int) -> Refusal:
    """The board cannot use one of the robot's settings."""
    names = frames.SettingsFrame._fields
    name = names[field] if field < len(names) else f"number {field}"
    why = frames.REFUSAL.get(code, "")
    meaning = frames.REFUSAL_MEANING.get(why, "for a reason that this version does not know")
    return Refusal(
        "E-BOARD-SETTINGS",
        f"the board refuses the setting `{name}`: {meaning}",
        "change it in the robot file, and the wire with it",
    )


def unsettled(cause: str) -> Refusal:
    """The board answers, but takes no settings."""
    return Refusal(
        "E-BOARD-SETTINGS",
        cause or "the board does not answer to its settings",
        "let the wheels come to rest and end what else drives this board, over its other port too",
    )
