"""Bluetooth addresses, and ports that are named by them: `bluetooth:98:D3:31:FC:12:34`.

The system's Bluetooth service, BlueZ: modules in reach, and pairing with a module's number.

Interfaces of BlueZ 5: org.bluez.Adapter1, Device1, AgentManager1, Agent1.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from typing import Any, NamedTuple

from diffbotctl.bluetooth.dbus import Bus, BusError, DBusCall
from diffbotctl.bluetooth.errors import no_radio, not_found, not_paired, refused
from diffbotctl.errors import Problem, RunError, UsageError

PORT_PREFIX = "bluetooth:"
PORT = re.compile(r"((?:[0-9A-F]{2}:){5}[0-9A-F]{2})(?:/(\d{1,2}))?\Z")
SERIAL_CHANNEL = 1  # the one channel of an HC-05, for its serial port profile
CHANNELS = range(1, 31)  # of RFCOMM: five bits, of which 0 and 31 are reserved


class RfcommPort(NamedTuple):
    """A Bluetooth module and the RFCOMM channel of its serial port."""

    address: str  # six pairs of capital hexadecimal digits
    channel: int = SERIAL_CHANNEL

    def __str__(self) -> str:
        channel = "" if self.channel == SERIAL_CHANNEL else f"/{self.channel}"
        return f"{PORT_PREFIX}{self.address}{channel}"


def parse_port(text: str) -> RfcommPort:
    """The module of an address, with or without `bluetooth:` in front. Raises UsageError."""
    words = text.strip().removeprefix(PORT_PREFIX).upper().replace("-", ":")
    found = PORT.match(words)
    if found is None:
        raise _wrong(text, f"'{text}' is no Bluetooth address")
    channel = SERIAL_CHANNEL if found[2] is None else int(found[2])
    if channel not in CHANNELS:
        raise _wrong(text, f"there is no channel {channel}: 1 to 30")
    return RfcommPort(found[1], channel)


def _wrong(text: str, cause: str) -> UsageError:
    fix = "write bluetooth:98:D3:31:FC:12:34; `diffbotctl bluetooth scan` lists those in reach"
    return UsageError(Problem("E-BLUETOOTH-ADDRESS", f"port {text}", cause, fix))


ADAPTER, DEVICE = "org.bluez.Adapter1", "org.bluez.Device1"
MANAGER, AGENT = "org.bluez.AgentManager1", "/org/diffbotctl/agent"
SERIAL_PORT = "00001101-0000-1000-8000-00805f9b34fb"  # the profile of a serial port
SERIAL_MODULE_NAMES = (
    "HC-05",
    "HC-06",
    "HC05",
    "HC06",
    "linvor",
    "JDY-31",
    "SPP-C",
    "BT04",
    "H-C-2010",
)
PIN = "1234"  # of an HC-05 as it is sold
PAIR_TIMEOUT_S = 60.0  # s; the service gives up by itself before
POLL_PERIOD_S = 0.5  # s between two looks at what was found
HINT_TIMEOUT_S = (
    2.0  # s for what is only a hint: a service that must be started first may take longer
)


class NearbyModule(NamedTuple):
    """A Bluetooth device that answered, or is known from before."""

    address: str
    name: str
    strength: int | None  # dBm; None for one that did not answer now
    paired: bool
    serial: bool  # it is a serial port, by its profile or its name
    path: str


class BluezService:
    """BlueZ, through the first radio there is."""

    def __init__(self) -> None:
        """Raises RunError: no library, no bus, no service, no radio."""
        self.pin = PIN
        self.asked = False  # whether the module's number was wanted
        self._bus = Bus(self._answer)
        try:
            self._radio = self._find_radio()
        except BaseException:
            self._bus.close()
            raise

    def close(self) -> None:
        """Leave the bus."""
        self._bus.close()

    def __enter__(self) -> BluezService:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def scan(self, seconds: float) -> Iterator[NearbyModule]:
        """Each device once, as soon as it answers within so many seconds. Raises RunError."""
        seen = set()
        with self._discovering():
            until = time.monotonic() + seconds
            while True:
                for found in self.known():
                    if found.strength is not None and found.address not in seen:
                        seen.add(found.address)
                        yield found
                left = until - time.monotonic()
                if left <= 0:
                    return
                time.sleep(min(POLL_PERIOD_S, left))

    def known(self) -> list[NearbyModule]:
        """What the service knows of, in reach or not. Raises RunError."""
        with _words():
            objects = self._bus.objects()
        return [
            _found(path, device)
            for path, interfaces in objects.items()
            if (device := interfaces.get(DEVICE)) and path.startswith(self._radio)
        ]

    def find(self, address: str, seconds: float) -> NearbyModule:
        """One device, looked for if need be. Raises RunError."""
        for found in self.known():
            if found.address == address:
                return found
        for found in self.scan(seconds):
            if found.address == address:
                return found
        raise not_found(address)

    def pair(self, found: NearbyModule, pin: str, wait: float = PAIR_TIMEOUT_S) -> None:
        """Pair with the module's number, and trust it. Raises RunError."""
        self.pin, self.asked = pin, False
        with _words():
            self._bus.call("/org/bluez", MANAGER, "RegisterAgent", "os", (AGENT, "KeyboardOnly"))
            self._bus.call("/org/bluez", MANAGER, "RequestDefaultAgent", "o", (AGENT,))
            try:
                self._bus.call(found.path, DEVICE, "Pair", wait=wait)
            except BusError as error:
                if not error.name.endswith(".AlreadyExists"):
                    raise not_paired(found.address, error, self.asked) from error
            self._bus.set(found.path, DEVICE, "Trusted", "b", True)
            self._bus.call("/org/bluez", MANAGER, "UnregisterAgent", "o", (AGENT,))

    def forget(self, found: NearbyModule) -> None:
        """Remove a device with its pairing. Raises RunError."""
        with _words():
            self._bus.call(self._radio, ADAPTER, "RemoveDevice", "o", (found.path,))

    def _find_radio(self) -> str:
        with _words():
            objects = self._bus.objects()
            radios = [path for path, interfaces in objects.items() if ADAPTER in interfaces]
            if not radios:
                raise no_radio()
            radio = min(radios)
            if not objects[radio][ADAPTER].get("Powered"):
                self._bus.set(radio, ADAPTER, "Powered", "b", True)
            return radio

    @contextmanager
    def _discovering(self) -> Iterator[None]:
        with _words():
            with suppress(BusError):  # a radio too old for filters finds more, that is all
                self._bus.call(
                    self._radio,
                    ADAPTER,
                    "SetDiscoveryFilter",
                    "a{sv}",
                    ({"Transport": ("s", "bredr")},),
                )
            self._bus.call(self._radio, ADAPTER, "StartDiscovery")
        try:
            yield
        finally:
            with suppress(BusError):
                self._bus.call(self._radio, ADAPTER, "StopDiscovery")

    def _answer(self, question: DBusCall) -> tuple[str, tuple[Any, ...]]:
        """What the service asks while it pairs."""
        if question.method == "RequestPinCode":
            self.asked = True
            return "s", (self.pin,)
        if question.method == "RequestPasskey" and self.pin.isdigit():
            self.asked = True
            return "u", (int(self.pin),)
        if question.method in ("Release", "Cancel", "DisplayPinCode", "DisplayPasskey"):
            return "", ()
        if question.method in ("RequestConfirmation", "RequestAuthorization", "AuthorizeService"):
            return "", ()  # the person has just asked for this pairing
        return _reject(question)


def paired_modules() -> list[NearbyModule]:
    """The serial modules that are paired, in reach or not; none where nobody can be asked.

    Only looks: a radio that is off stays off.
    """
    try:
        with closing(Bus(_reject)) as bus:
            objects = bus.objects(HINT_TIMEOUT_S)
    except (RunError, BusError):
        return []
    found = [
        _found(path, interfaces[DEVICE])
        for path, interfaces in objects.items()
        if DEVICE in interfaces
    ]
    return sorted((each for each in found if each.paired and each.serial), key=_address)


def _address(found: NearbyModule) -> str:
    return found.address


def _reject(question: DBusCall) -> tuple[str, tuple[Any, ...]]:
    raise BusError("org.bluez.Error.Rejected", question.method)


@contextmanager
def _words() -> Iterator[None]:
    """Errors of the service as words for a person."""
    try:
        yield
    except BusError as error:
        raise refused(error) from error


def _found(path: str, device: dict[str, Any]) -> NearbyModule:
    name = str(device.get("Alias") or device.get("Name") or "")
    profiles = [str(each).lower() for each in device.get("UUIDs", ())]
    serial = SERIAL_PORT in profiles or name.upper().startswith(
        tuple(map(str.upper, SERIAL_MODULE_NAMES))
    )
    strength = device.get("RSSI")
    return NearbyModule(
        str(device.get("Address", "")), name, strength, bool(device.get("Paired")), serial, path
    )
