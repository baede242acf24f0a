"""BlueZ, the system's Bluetooth service: modules in range, and pairing with a PIN.

Also the names of RFCOMM ports, such as `bluetooth:98:D3:31:FC:12:34`. Interfaces of BlueZ 5:
org.bluez.Adapter1, Device1, AgentManager1, Agent1.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from typing import Any, NamedTuple

from diffbotctl.bluetooth.dbus import Bus, BusError, DBusCall
from diffbotctl.bluetooth.errors import NO_ADAPTER, not_found, not_paired, refused
from diffbotctl.errors import Problem, RunError, UsageError

PORT_PREFIX = "bluetooth:"
ADDRESS = re.compile(r"((?:[0-9A-F]{2}:){5}[0-9A-F]{2})(?:/(\d{1,2}))?\Z")
SERIAL_CHANNEL = 1  # the only channel of an HC-05, for its serial port profile
CHANNELS = range(1, 31)  # of RFCOMM: five bits, of which 0 and 31 are reserved


class RfcommPort(NamedTuple):
    """A Bluetooth module and the RFCOMM channel of its serial port."""

    address: str  # six pairs of capital hexadecimal digits
    channel: int = SERIAL_CHANNEL

    def __str__(self) -> str:
        channel = "" if self.channel == SERIAL_CHANNEL else f"/{self.channel}"
        return f"{PORT_PREFIX}{self.address}{channel}"


def parse_port(text: str) -> RfcommPort:
    """The port of an address, with or without `bluetooth:` in front. Raises UsageError."""
    match = ADDRESS.match(text.strip().removeprefix(PORT_PREFIX).upper().replace("-", ":"))
    if match is None:
        raise _bad_address(text, f"'{text}' is not a Bluetooth address")
    channel = SERIAL_CHANNEL if match[2] is None else int(match[2])
    if channel not in CHANNELS:
        raise _bad_address(text, f"there is no channel {channel}; channels are 1 to 30")
    return RfcommPort(match[1], channel)


def _bad_address(text: str, cause: str) -> UsageError:
    fix = (
        "write bluetooth:98:D3:31:FC:12:34; `diffbotctl bluetooth scan` lists the modules in range"
    )
    return UsageError(Problem("E-BLUETOOTH-ADDRESS", f"port {text}", cause, fix))


ADAPTER, DEVICE = "org.bluez.Adapter1", "org.bluez.Device1"
AGENT_MANAGER, AGENT_PATH = "org.bluez.AgentManager1", "/org/diffbotctl/agent"
SERIAL_PORT_PROFILE = "00001101-0000-1000-8000-00805f9b34fb"
SERIAL_NAMES = ("HC-05", "HC-06", "HC05", "HC06", "LINVOR", "JDY-31", "SPP-C", "BT04", "H-C-2010")
DEFAULT_PIN = "1234"  # of a new HC-05
PAIR_TIMEOUT_S = 60.0  # the service gives up before
POLL_PERIOD_S = 0.5
HINT_TIMEOUT_S = 2.0  # for what is only a hint: a service that must be started first takes longer


class NearbyModule(NamedTuple):
    """A Bluetooth device in range, or one that the service remembers."""

    address: str
    name: str
    strength: int | None  # dBm; None for one that is not in range
    is_paired: bool
    is_serial: bool  # it is a serial port, by its profile or its name
    path: str


class BluezService:
    """BlueZ, with the first radio of the machine."""

    def __init__(self) -> None:
        """Raises RunError: no library, no bus, no service, no radio."""
        self.pin = DEFAULT_PIN
        self.pin_requested = False
        self._bus = Bus(self._answer)
        try:
            self._radio = self._find_radio()
        except BaseException:
            self._bus.close()
            raise

    def close(self) -> None:
        self._bus.close()

    def __enter__(self) -> BluezService:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def scan(self, seconds: float) -> Iterator[NearbyModule]:
        """Each device in range once, as soon as it answers within `seconds`. Raises RunError."""
        yielded = set()
        with self._discovering():
            deadline = time.monotonic() + seconds
            while True:
                for module in self.modules():
                    if module.strength is not None and module.address not in yielded:
                        yielded.add(module.address)
                        yield module
                remaining = deadline - time.monotonic()
                if remaining <= 0:
                    return
                time.sleep(min(POLL_PERIOD_S, remaining))

    def modules(self) -> list[NearbyModule]:
        """What the service knows, in range or not. Raises RunError."""
        with _as_run_errors():
            return _modules(self._bus.objects(), self._radio)

    def find(self, address: str, seconds: float) -> NearbyModule:
        """One device; scans for `seconds` if the service does not know it. Raises RunError."""
        for source in (self.modules(), self.scan(seconds)):
            for module in source:
                if module.address == address:
                    return module
        raise not_found(address)

    def pair(self, module: NearbyModule, pin: str, timeout: float = PAIR_TIMEOUT_S) -> None:
        """Pair with the module's PIN, and trust it. Raises RunError."""
        self.pin, self.pin_requested = pin, False
        with _as_run_errors():
            self._agent_call("RegisterAgent", "os", "KeyboardOnly")
            self._agent_call("RequestDefaultAgent", "o")
            try:
                self._bus.call(module.path, DEVICE, "Pair", timeout=timeout)
            except BusError as error:
                if not error.name.endswith(".AlreadyExists"):
                    raise not_paired(module.address, error, self.pin_requested) from error
            self._bus.set(module.path, DEVICE, "Trusted", "b", True)
            self._agent_call("UnregisterAgent", "o")

    def forget(self, module: NearbyModule) -> None:
        """Remove a device with its pairing. Raises RunError."""
        with _as_run_errors():
            self._bus.call(self._radio, ADAPTER, "RemoveDevice", "o", (module.path,))

    def _agent_call(self, method: str, signature: str, *arguments: str) -> None:
        self._bus.call("/org/bluez", AGENT_MANAGER, method, signature, (AGENT_PATH, *arguments))

    def _find_radio(self) -> str:
        with _as_run_errors():
            objects = self._bus.objects()
            radios = [path for path, interfaces in objects.items() if ADAPTER in interfaces]
            if not radios:
                raise RunError(NO_ADAPTER)
            radio = min(radios)
            if not objects[radio][ADAPTER].get("Powered"):
                self._bus.set(radio, ADAPTER, "Powered", "b", True)
            return radio

    @contextmanager
    def _discovering(self) -> Iterator[None]:
        with _as_run_errors():
            classic_only = ({"Transport": ("s", "bredr")},)
            with suppress(BusError):  # a radio too old for filters finds other devices too
                self._bus.call(self._radio, ADAPTER, "SetDiscoveryFilter", "a{sv}", classic_only)
            self._bus.call(self._radio, ADAPTER, "StartDiscovery")
        try:
            yield
        finally:
            with suppress(BusError):
                self._bus.call(self._radio, ADAPTER, "StopDiscovery")

    def _answer(self, call: DBusCall) -> tuple[str, tuple[Any, ...]]:
        """Answer a call of the service while it pairs."""
        match call.method:
            case "RequestPinCode":
                self.pin_requested = True
                return "s", (self.pin,)
            case "RequestPasskey" if self.pin.isdigit():
                self.pin_requested = True
                return "u", (int(self.pin),)
            case "Release" | "Cancel" | "DisplayPinCode" | "DisplayPasskey":
                return "", ()
            case "RequestConfirmation" | "RequestAuthorization" | "AuthorizeService":
                return "", ()  # the user has just started this pairing
        return _reject(call)


def paired_modules() -> list[NearbyModule]:
    """The paired serial modules, in range or not; none where the service cannot be asked.

    Read only: a radio that is off stays off.
    """
    try:
        with closing(Bus(_reject)) as bus:
            modules = _modules(bus.objects(HINT_TIMEOUT_S))
    except (RunError, BusError):
        return []
    paired = [module for module in modules if module.is_paired and module.is_serial]
    return sorted(paired, key=lambda module: module.address)


def _reject(call: DBusCall) -> tuple[str, tuple[Any, ...]]:
    raise BusError("org.bluez.Error.Rejected", call.method)


@contextmanager
def _as_run_errors() -> Iterator[None]:
    try:
        yield
    except BusError as error:
        raise refused(error) from error


def _modules(objects: dict[str, dict[str, dict[str, Any]]], path: str = "") -> list[NearbyModule]:
    """The devices among the objects of the service, below `path`."""
    return [
        _module(place, interfaces[DEVICE])
        for place, interfaces in objects.items()
        if interfaces.get(DEVICE) and place.startswith(path)
    ]


def _module(path: str, device: dict[str, Any]) -> NearbyModule:
    name = str(device.get("Alias") or device.get("Name") or "")
    profiles = [str(profile).lower() for profile in device.get("UUIDs", ())]
    return NearbyModule(
        str(device.get("Address", "")),
        name,
        device.get("RSSI"),
        bool(device.get("Paired")),
        SERIAL_PORT_PROFILE in profiles or name.upper().startswith(SERIAL_NAMES),
        path,
    )
