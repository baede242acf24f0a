"""The system's message bus, as far as the Bluetooth service needs it: calls out, questions in."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from diffbotctl.errors import Problem, RunError

SERVICE = "org.bluez"
CALL_TIMEOUT_S = 10.0  # s; what the service answers by itself
CONNECT_TIMEOUT_S = 2.0  # s; the bus is on this machine


class DBusCall(NamedTuple):
    """A call that the service makes to us."""

    method: str
    arguments: tuple[Any, ...]


class BusError(Exception):
    """The service answered with an error."""

    def __init__(self, name: str, text: str) -> None:
        super().__init__(f"{name}: {text}")
        self.name, self.text = name, text


DBusReply = Callable[
    [DBusCall], tuple[str, tuple[Any, ...]]
]  # D-Bus signature and values; BusError


class Bus:
    """A connection to the system bus. `answer` is asked whatever the service wants of us."""

    def __init__(self, answer: DBusReply) -> None:
        """Raises RunError when there is no bus, or no library for it."""
        self._answer = answer
        self._connection = _connection()

    def close(self) -> None:
        """Leave the bus; the service forgets what was registered."""
        self._connection.close()

    def call(
        self,
        path: str,
        interface: str,
        method: str,
        signature: str = "",
        arguments: tuple[Any, ...] = (),
        wait: float = CALL_TIMEOUT_S,
    ) -> tuple[Any, ...]:
        """Call the service, answering its questions meanwhile.

        Raises BusError, with the name `timeout` when no answer came within `wait` seconds.
        """
        from jeepney import DBusAddress, HeaderFields, MessageType, new_method_call

        address = DBusAddress(path, SERVICE, interface)
        message = new_method_call(address, method, signature or None, arguments)
        serial = next(self._connection.outgoing_serial)
        self._send(message, serial)
        until = time.monotonic() + wait
        while (left := until - time.monotonic()) > 0:
            heard = self._receive(left)
            if heard is None:
                break
            kind = heard.header.message_type
            if kind is MessageType.method_call:
                self._reply(heard)
            elif heard.header.fields.get(HeaderFields.reply_serial) == serial:
                if kind is MessageType.error:
                    name = heard.header.fields[HeaderFields.error_name]
                    raise BusError(name, str(heard.body[0]) if heard.body else "")
                return tuple(heard.body)
        raise BusError("timeout", f"no answer to {method}")

    def set(self, path: str, interface: str, name: str, signature: str, value: Any) -> None:
        """Set a property. Raises BusError."""
        self.call(
            path,
            "org.freedesktop.DBus.Properties",
            "Set",
            "ssv",
            (interface, name, (signature, value)),
        )

    def objects(self, wait: float = CALL_TIMEOUT_S) -> dict[str, dict[str, dict[str, Any]]]:
        """Everything the service knows: path, interface, property, value. Raises BusError."""
        (found,) = self.call(
            "/", "org.freedesktop.DBus.ObjectManager", "GetManagedObjects", wait=wait
        )
        return {
            path: {
                interface: {name: value for name, (_, value) in properties.items()}
                for interface, properties in interfaces.items()
            }
            for path, interfaces in found.items()
        }

    def _send(self, message: Any, serial: int | None = None) -> None:
        try:
            self._connection.send(message, serial=serial)
        except OSError as error:
            raise _no_bus("the connection to it broke") from error

    def _receive(self, wait: float) -> Any:
        try:
            return self._connection.receive(timeout=wait)
        except TimeoutError:
            return None
        except OSError as error:
            raise _no_bus("the connection to it broke") from error

    def _reply(self, message: Any) -> None:
        """Answer a question of the service's."""
        from jeepney import HeaderFields, new_error, new_method_return

        question = DBusCall(message.header.fields[HeaderFields.member], tuple(message.body))
        try:
            signature, values = self._answer(question)
        except BusError as error:
            self._send(new_error(message, error.name))
            return
        self._send(new_method_return(message, signature or None, values))


def _connection() -> Any:
    try:
        from jeepney.io.blocking import open_dbus_connection
    except ImportError as error:
        raise RunError(
            Problem(
                "E-BLUETOOTH-LIBRARY",
                "Bluetooth",
                "the package jeepney is not installed",
                "pip install 'diffbotctl[bluetooth]', or pip install jeepney",
            )
        ) from error
    try:
        return open_dbus_connection(bus="SYSTEM", auth_timeout=CONNECT_TIMEOUT_S)
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise _no_bus("it cannot be reached") from error


def _no_bus(cause: str) -> RunError:
    return RunError(
        Problem(
            "E-BLUETOOTH-SERVICE",
            "Bluetooth",
            f"this system has no message bus, or {cause}",
            "sudo apt-get install dbus bluez; sudo systemctl enable --now bluetooth",
        )
    )
