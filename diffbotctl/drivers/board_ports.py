"""The ports that may lead to a board, and the errors of finding and flashing one."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

from diffbotctl.bluetooth.bluez import PORT_PREFIX
from diffbotctl.errors import Problem, RunError
from diffbotctl.links.diffbot_frames import BoardCode
from diffbotctl.links.uf2_format import INFO_FILE
from diffbotctl.ports.diagnosis import other_ports_text
from diffbotctl.ports.sysfs import SerialPort, serial_ports
from diffbotctl.ports.usb_ids import PortRole


class FlashError(RunError):
    """Flashing failed."""

    code = "E-FLASH"

    def __init__(self, place: str, cause: str, fix: str) -> None:
        super().__init__(Problem(self.code, place, cause, fix))


class NoBoardError(FlashError):
    """No port looks like a board."""

    code = "E-NO-BOARD"
    others: Sequence[SerialPort] = ()

    def __init__(self, simulates: bool = False, others: Sequence[SerialPort] = ()) -> None:
        """`simulates`: the command works on the simulated robot too.

        `others`: ports that may lead to a board, as far as is known; they are named.
        """
        self.others = others
        cause = "no board is plugged in"
        fix = (
            "plug in the board's USB cable (not a charging cable without data wires), or name the "
            "port with --port"
        )
        if others:
            cause = f"no board of a known kind is plugged in; {other_ports_text(others)}"
            fix = f"if it is the robot's board, name it: --port {others[0].name}"
        if simulates:
            fix += "; --port sim is the simulated robot"
        super().__init__("ports", cause, fix)


class OnlyRadioError(NoBoardError):
    """No board is plugged in, but Bluetooth modules are paired; one command for each of them."""

    def __init__(self, modules: list[str], commands: list[str]) -> None:
        FlashError.__init__(
            self,
            "ports",
            f"no board is plugged in; paired over Bluetooth: {', '.join(modules)}",
            f"drive over Bluetooth with `{'` or `'.join(commands)}`, or plug in the USB cable",
        )


class SeveralBoardsError(FlashError):
    """More than one port looks like a board."""

    code = "E-SEVERAL-BOARDS"

    def __init__(self, devices: list[str]) -> None:
        super().__init__(
            "ports",
            f"{len(devices)} boards are plugged in: {', '.join(devices)}",
            "choose one with --port DEVICE, or unplug the others",
        )


class RadioPortError(FlashError):
    """The port leads over Bluetooth."""

    code = "E-FLASH-RADIO"

    def __init__(self, device: str) -> None:
        super().__init__(
            f"port {device}",
            "this is a Bluetooth port: the bootloader listens on the USB port only, which a Mega's "
            "Bluetooth module is not connected to, and an Uno's cannot reset the board",
            "use the USB cable",
        )


class NoSyncError(FlashError):
    """No bootloader answers."""

    code = "E-FLASH-NO-SYNC"

    def __init__(self, device: str) -> None:
        super().__init__(
            f"port {device}",
            "no bootloader answers, neither that of a Mega 2560 nor of an Uno or Nano",
            "check port and cable, and disconnect anything from pins 0 and 1; press the reset "
            "button within the first second if the board does not reset by itself",
        )


class WrongSignatureError(FlashError):
    """The board has another chip."""

    code = "E-FLASH-SIGNATURE"

    KNOWN = {
        "1e9801": "an ATmega2560 (Mega 2560)",
        "1e9703": "an ATmega1280 (Mega 1280)",
        "1e950f": "an ATmega328P (Uno, Nano)",
        "1e9514": "an ATmega328 (Uno, Nano)",
        "1e9406": "an ATmega168 (old Uno or Nano)",
    }

    def __init__(self, device: str, signature: str, board: str) -> None:
        """`board`: what the program is for."""
        chip = self.KNOWN.get(signature, "another chip")
        super().__init__(
            f"port {device}",
            f"its signature {signature} is that of {chip}; this program is for {board}",
            "choose the port of that board, or correct board.type in the robot file",
        )


class OtherBoardError(FlashError):
    """The board that is plugged in is not that of the robot file."""

    code = "E-FLASH-SIGNATURE"

    def __init__(self, place: str, found: BoardCode, board: BoardCode) -> None:
        """`board`: that of the robot file."""
        super().__init__(
            place,
            f"here is {_with_article(found)}, and the robot file is for {_with_article(board)}",
            "plug in the robot's board, name its port with --port, or take the robot file of this "
            "board with --robot",
        )


class RefusedError(FlashError):
    """The bootloader refused a command."""

    code = "E-FLASH-REFUSED"

    def __init__(self, device: str, what: str) -> None:
        super().__init__(
            f"port {device}",
            f"the bootloader refused to {what}",
            "flash again; the bootloader is still there. If it fails again, try --programmer "
            "avrdude",
        )


class LostError(FlashError):
    """The bootloader has stopped answering."""

    code = "E-FLASH-REFUSED"

    def __init__(self, device: str, action: str) -> None:
        super().__init__(
            f"port {device}",
            f"the bootloader does not answer when asked to {action}",
            "check the cable, disconnect an HC-05 from pins 0 and 1, and flash again; the "
            "bootloader is still there",
        )


class VerifyMismatchError(FlashError):
    """The flash read back differs from what was written."""

    code = "E-FLASH-VERIFY"

    def __init__(self, device: str, address: int, expected: int, actual: int) -> None:
        super().__init__(
            f"port {device}",
            f"at address 0x{address:05X} the board has 0x{actual:02X} instead of 0x{expected:02X}",
            "flash again; if it always fails at the same address, the chip's flash is worn out",
        )


class SilentError(FlashError):
    """The program was written, but does not answer."""

    code = "E-FLASH-SILENT"

    def __init__(self, device: str, cause: str = "") -> None:
        super().__init__(
            f"port {device}",
            f"written and verified, but our firmware does not answer: {cause or 'no reply'}",
            "press the reset button; if it still does not answer, flash again",
        )


class NoBackupError(FlashError):
    """The program on the board cannot be saved."""

    code = "E-FLASH-BACKUP"

    def __init__(self, file: str, cause: str) -> None:
        super().__init__(file, cause, "name another file, or leave --backup out")


class BadImageError(FlashError):
    """The file cannot be flashed."""

    code = "E-FLASH-IMAGE"

    def __init__(self, file: str, cause: str) -> None:
        super().__init__(file, cause, "use a program for the board, or leave --hex out")


class NoProgrammerError(FlashError):
    """avrdude is not installed, or it failed."""

    code = "E-FLASH-AVRDUDE"

    def __init__(self, cause: str, fix: str) -> None:
        super().__init__("avrdude", cause, fix)


USB = re.compile(r"tty(ACM|USB)\d+\Z")
RADIO = re.compile(r"rfcomm\d+\Z")
# A genuine Mega or Uno, or a bound module; clones share their USB chip with other things.
LIKELY_ROLES = (PortRole.BOARD, PortRole.BLUETOOTH)


def _with_article(board: BoardCode) -> str:
    return f"{'an' if board.meaning[0] in 'AEIOU' else 'a'} {board.meaning}"


CODES_OF_BOARDS = {
    "mega2560": BoardCode.MEGA2560,
    "uno": BoardCode.ATMEGA328P,
    "pico": BoardCode.RP2040,
}


def board_of(port: SerialPort) -> BoardCode | None:
    """The board by a port's USB identity; None for the serial chip of a clone."""
    chip = port.usb.chip if port.usb else None
    return CODES_OF_BOARDS[chip.board] if chip and chip.board else None


def picos(root: Path = Path("/")) -> list[SerialPort]:
    """The USB ports of Picos, whatever program they run."""
    return [port for port in serial_ports(root) if board_of(port) is BoardCode.RP2040]


def port_named(device: str, root: Path = Path("/")) -> SerialPort | None:
    """The port with this name, or to which this name is a link."""
    names = {device, os.path.realpath(device)}
    return next((port for port in serial_ports(root) if port.device in names), None)


def candidates(radio: bool = False, root: Path = Path("/")) -> list[SerialPort]:
    """The ports below `root` that may lead to a board; with `radio`, bound Bluetooth ports too.

    The likely ones come first.
    """
    roles = {PortRole.BOARD, PortRole.CHIP} | ({PortRole.BLUETOOTH} if radio else set())
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
    """Whether the port is USB: UART0, and opening it resets the board."""
    return any(USB.search(name) for name in (device, os.path.realpath(device)))


def refuse_radio(device: str) -> None:
    """Raises RadioPortError for a Bluetooth port."""
    bound = any(RADIO.search(name) for name in (device, os.path.realpath(device)))
    if bound or device.startswith(PORT_PREFIX):
        raise RadioPortError(device)


def refuse_other_board(device: str, board: BoardCode) -> None:
    """Raises OtherBoardError when the port's USB identity is that of another board than `board`.

    Also when it is the boot drive of a Pico.
    """
    port = port_named(device)
    found = board_of(port) if port else None
    if (Path(device) / INFO_FILE).is_file():
        found = BoardCode.RP2040
    if found not in (None, board):
        assert found is not None
        raise OtherBoardError(f"port {device}", found, board)
