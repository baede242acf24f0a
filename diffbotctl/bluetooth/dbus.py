"""The system's message bus, for the Bluetooth service: outgoing calls, incoming requests."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from diffbotctl.errors import Problem, RunError

SERVICE = "org.bluez"
PLACE = "Bluetooth"
START_FIX = "sudo apt-get install bluez; sudo systemctl enable --now bluetooth"
CALL_TIMEOUT_S = 10.0  # for a call that the service answers itself
CONNECT_TIMEOUT_S = 2.0  # the bus is on this machine


class DBusCall(NamedTuple):
    """A call of the service to this program."""

    method: str
    arguments: tuple[Any, ...]


class BusError(Exception):
    """The service answered with an error."""

    def __init__(self, name: str, text: str) -> None:
        super().__init__(f"{name}: {text}")
        self.name, self.text = name, text


# Answers a call of the service: D-Bus signature and values. Raises BusError to refuse it.
DBusReply = Callable[[DBusCall], tuple[str, tuple[Any, ...]]]


class Bus:
    """A connection to the system bus. `answer` handles the calls of the service."""

    def __init__(self, answer: DBusReply) -> None:
        """Raises RunError when there is no bus, or no library for it."""
        self._answer = answer
        self._jeepney, self._connection = _open_connection()

    def close(self) -> None:
        """Disconnect; the service removes what was registered."""
        self._connection.close()

    def call(
        self,
        path: str,
        interface: str,
        method: str,
        signature: str = "",
        arguments: tuple[Any, ...] = (),
        timeout: float = CALL_TIMEOUT_S,
    ) -> tuple[Any, ...]:
        """Call the service, and answer its calls meanwhile.

        Raises BusError, with the name `timeout` when no answer came within `timeout` seconds.
        """
        address = self._jeepney.DBusAddress(path, SERVICE, interface)
        serial = next(self._connection.outgoing_serial)
        self._send(
            self._jeepney.new_method_call(address, method, signature or None, arguments), serial
        )
        deadline = time.monotonic() + timeout
        while (remaining := deadline - time.monotonic()) > 0:
            message = self._receive(remaining)
            if message is None:
                break
            kind, fields = message.header.message_type, message.header.fields
            if kind is self._jeepney.MessageType.method_call:
                self._reply(message)
            elif fields.get(self._jeepney.HeaderFields.reply_serial) == serial:
                if kind is self._jeepney.MessageType.error:
                    text = str(message.body[0]) if message.body else ""
                    raise BusError(fields[self._jeepney.HeaderFields.error_name], text)
                return tuple(message.body)
        raise BusError("timeout", f"no answer to {method}")

    def set(self, path: str, interface: str, name: str, signature: str, value: Any) -> None:
        """Set a property. Raises BusError."""
        arguments = (interface, name, (signature, value))
        self.call(path, "org.freedesktop.DBus.Properties", "Set", "ssv", arguments)

    def objects(self, timeout: float = CALL_TIMEOUT_S) -> dict[str, dict[str, dict[str, Any]]]:
        """Every object of the service: path, interface, property, value. Raises BusError."""
        interface = "org.freedesktop.DBus.ObjectManager"
        (objects,) = self.call("/", interface, "GetManagedObjects", timeout=timeout)
        return {
            path: {
                interface: {name: value for name, (_, value) in properties.items()}
                for interface, properties in interfaces.items()
            }
            for path, interfaces in objects.items()
        }

    def _send(self, message: Any, serial: int | None = None) -> None:
        try:
            self._connection.send(message, serial=serial)
        except OSError as error:
            raise _no_bus("the connection to it was lost") from error

    def _receive(self, timeout: float) -> Any:
        try:
            return self._connection.receive(timeout=timeout)
        except TimeoutError:
            return None
        except OSError as error:
            raise _no_bus("the connection to it was lost") from error

    def _reply(self, message: Any) -> None:
        call = DBusCall(
            message.header.fields[self._jeepney.HeaderFields.member], tuple(message.body)
        )
        try:
            signature, values = self._answer(call)
        except BusError as error:
            self._send(self._jeepney.new_error(message, error.name))
            return
        self._send(self._jeepney.new_method_return(message, signature or None, values))


def _open_connection() -> tuple[Any, Any]:
    try:
        # An optional dependency, needed for Bluetooth only.
        import jeepney.io.blocking
    except ImportError as error:
        cause = "the package jeepney is not installed"
        fix = "pip install 'diffbotctl[bluetooth]', or pip install jeepney"
        raise RunError(Problem("E-BLUETOOTH-LIBRARY", PLACE, cause, fix)) from error
    try:
        connection = jeepney.io.blocking.open_dbus_connection(
            bus="SYSTEM", auth_timeout=CONNECT_TIMEOUT_S
        )
        return jeepney, connection
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise _no_bus("it cannot be reached") from error


def _no_bus(cause: str) -> RunError:
    cause = f"this system has no message bus, or {cause}"
    fix = "sudo apt-get install dbus bluez; sudo systemctl enable --now bluetooth"
    return RunError(Problem("E-BLUETOOTH-SERVICE", PLACE, cause, fix))
