"""What can go wrong while flashing; each is a RunError with its own code, cause and way out.

Which port leads to a board.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from diffbotctl.bluetooth.bluez import PORT_PREFIX
from diffbotctl.errors import Problem, RunError
from diffbotctl.ports.sysfs import SerialPort, serial_ports
from diffbotctl.ports.usb_ids import PortRole


class FlashError(RunError):
    """Flashing failed."""

    code = "E-FLASH"

    def __init__(self, place: str, cause: str, fix: str) -> None:
        super().__init__(Problem(self.code, place, cause, fix))


class NoBoardError(FlashError):
    """No port looks like a board."""

    code = "E-FLASH-NO-BOARD"

    def __init__(self) -> None:
        super().__init__(
            "ports",
            "no board is plugged in",
            "plug the Mega's USB cable in (a charging cable without data wires shows nothing), or "
            "name the port with --port",
        )


class OnlyRadioError(NoBoardError):
    """No board is plugged in, but modules are paired; `commands` lead over each of them."""

    def __init__(self, modules: list[str], commands: list[str]) -> None:
        FlashError.__init__(
            self,
            "ports",
            f"no board is plugged in; paired over Bluetooth: {', '.join(modules)}",
            f"drive over the radio with `{'` or `'.join(commands)}`, or plug the USB cable in",
        )


class SeveralBoardsError(FlashError):
    """More than one port looks like a board."""

    code = "E-FLASH-SEVERAL"

    def __init__(self, devices: list[str]) -> None:
        super().__init__(
            "ports",
            f"{len(devices)} boards are plugged in: {', '.join(devices)}",
            "say which one with --port DEVICE, or unplug the others",
        )


class RadioPortError(FlashError):
    """The port leads over Bluetooth."""

    code = "E-FLASH-RADIO"

    def __init__(self, device: str) -> None:
        super().__init__(
            f"port {device}",
            "this is a Bluetooth port: the bootloader listens on the USB port alone, while the "
            "radio module sits on pins 18 and 19",
            "use the USB cable",
        )


class NoSyncError(FlashError):
    """No bootloader answers."""

    code = "E-FLASH-NO-SYNC"

    def __init__(self, device: str) -> None:
        super().__init__(
            f"port {device}",
            "no bootloader answers at 115200 baud",
            "check port and cable; is anything wired to pins 0 and 1? Press the reset button "
            "within the first second when the board does not reset by itself",
        )


class WrongSignatureError(FlashError):
    """The chip is another one."""

    code = "E-FLASH-SIGNATURE"

    KNOWN = {"1e9703": "an ATmega1280 (Mega 1280)", "1e950f": "an ATmega328P (Uno)"}

    def __init__(self, device: str, signature: str) -> None:
        chip = self.KNOWN.get(signature, "another chip")
        super().__init__(
            f"port {device}",
            f"the signature {signature} is that of {chip}; this firmware is for an ATmega2560",
            "choose the port of the Mega 2560",
        )


class RefusedError(FlashError):
    """The bootloader does not do as told."""

    code = "E-FLASH-REFUSED"

    def __init__(self, device: str, what: str) -> None:
        super().__init__(
            f"port {device}",
            f"the bootloader refused to {what}",
            "flash again; the bootloader is still there. If it fails again, try --programmer "
            "avrdude",
        )


class VerifyMismatchError(FlashError):
    """What was read back is not what was written."""

    code = "E-FLASH-VERIFY"

    def __init__(self, device: str, address: int, wanted: int, got: int) -> None:
        super().__init__(
            f"port {device}",
            f"at address 0x{address:05X} the board has 0x{got:02X} instead of 0x{wanted:02X}",
            "flash again; if it always fails at one address, the chip is worn out",
        )


class SilentError(FlashError):
    """The program was written, but does not speak."""

    code = "E-FLASH-SILENT"

    def __init__(self, device: str, cause: str = "") -> None:
        super().__init__(
            f"port {device}",
            f"written and verified, but our firmware does not speak: {cause or 'nothing comes'}",
            "press the reset button; if it stays silent, flash again",
        )


class NoBackupError(FlashError):
    """What is on the board cannot be saved."""

    code = "E-FLASH-BACKUP"

    def __init__(self, file: str, cause: str) -> None:
        super().__init__(file, cause, "name another file, or leave --backup out")


class BadImageError(FlashError):
    """The file cannot be flashed."""

    code = "E-FLASH-IMAGE"

    def __init__(self, file: str, cause: str) -> None:
        super().__init__(file, cause, "use an Intel hex file for a Mega 2560, or leave --hex out")


class NoProgrammerError(FlashError):
    """avrdude is wanted but absent, or it failed."""

    code = "E-FLASH-AVRDUDE"

    def __init__(self, cause: str, fix: str) -> None:
        super().__init__("avrdude", cause, fix)


USB = re.compile(r"tty(ACM|USB)\d+\Z")
RADIO = re.compile(r"rfcomm\d+\Z")
# A genuine Mega, or a bound module; clones share their USB chip with other things.
LIKELY_ROLES = (PortRole.MEGA, PortRole.BLUETOOTH)


def candidates(radio: bool = False, root: Path = Path("/")) -> list[SerialPort]:
    """The ports below `root` that may lead to a Mega 2560; with `radio`, bound Bluetooth ports too.

    The likely ones come first.
    """
    roles = {PortRole.MEGA, PortRole.CHIP} | ({PortRole.BLUETOOTH} if radio else set())
    ports = [port for port in serial_ports(root) if port.role in roles]
    return sorted(ports, key=lambda port: (port.role not in LIKELY_ROLES, port.device))


def choose(ports: list[SerialPort]) -> SerialPort:
    """The one board. Raises NoBoardError, SeveralBoardsError."""
    likely = [port for port in ports if port.role in LIKELY_ROLES] or ports
    if not likely:
        raise NoBoardError
    if len(likely) > 1:
        raise SeveralBoardsError([port.name for port in likely])
    return likely[0]


def is_usb(device: str) -> bool:
    """Whether the port leads over USB: to UART0 at 115200 baud, and opening it resets the board."""
    return any(USB.search(name) for name in (device, os.path.realpath(device)))


def refuse_radio(device: str) -> None:
    """Raises RadioPortError for a port that leads over Bluetooth."""
    bound = any(RADIO.search(name) for name in (device, os.path.realpath(device)))
    if bound or device.startswith(PORT_PREFIX):
        raise RadioPortError(device)
