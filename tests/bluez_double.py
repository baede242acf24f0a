"""A double of the system's Bluetooth service, on a message bus of its own: `org.bluez` for tests.

The bus is a real dbus-daemon, and what is tested reaches it as it would the system's. The double
behaves as BlueZ 5 does: a module is known once it was found, pairing asks the agent for the
module's number, and errors have BlueZ's names.
"""

import os
import re
import subprocess
import threading
from contextlib import contextmanager
from dataclasses import dataclass

from jeepney import HeaderFields, MessageType, new_error, new_method_call, new_method_return
from jeepney.bus_messages import message_bus
from jeepney.io.blocking import open_dbus_connection
from jeepney.wrappers import DBusAddress

RADIO = "/org/bluez/hci0"
SERIAL_PORT = "00001101-0000-1000-8000-00805f9b34fb"
ERROR = "org.bluez.Error."
CONFIG = """<!DOCTYPE busconfig PUBLIC "-//freedesktop//DTD D-Bus Bus Configuration 1.0//EN"
 "http://www.freedesktop.org/standards/dbus/1.0/busconfig.dtd">
<busconfig><type>system</type><listen>unix:path={path}</listen><auth>EXTERNAL</auth>
<policy context="default"><allow send_destination="*"/><allow receive_sender="*"/>
<allow own="*"/><allow user="*"/></policy></busconfig>
"""


def snake(name):
    """A method of the bus, as Python would write it."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


@dataclass
class Module:
    """A Bluetooth device within reach of the double."""

    address: str
    name: str = "HC-05"
    pin: str = "1234"
    strength: int = -55
    serial: bool = True
    paired: bool = False
    found: bool = False  # known to the service
    answers: bool = True  # it is switched on

    @property
    def path(self):
        return f"{RADIO}/dev_{self.address.replace(':', '_')}"

    def properties(self):
        found = {
            "Address": ("s", self.address),
            "Alias": ("s", self.name),
            "Paired": ("b", self.paired),
            "UUIDs": ("as", [SERIAL_PORT] if self.serial else []),
        }
        if self.answers:
            found["RSSI"] = ("n", self.strength)
        return found


class Bluez:
    """The service: answers until its connection is closed."""

    def __init__(self, modules, radio=True, powered=True, refuses=()):
        """`refuses`: method -> name of the error it fails with."""
        self.modules, self.radio, self.powered = list(modules), radio, powered
        self.refuses = dict(refuses)
        self.agent = self.pending = None
        self.trusted, self.calls = [], []
        self.ended = threading.Event()
        self.connection = open_dbus_connection(bus="SYSTEM")
        self.connection.send_and_get_reply(message_bus.RequestName("org.bluez"))
        self.thread = threading.Thread(target=self._serve)
        self.thread.start()

    def close(self):
        self.ended.set()
        self.thread.join()
        self.connection.close()

    def _serve(self):
        while not self.ended.is_set():
            try:
                message = self.connection.receive(timeout=0.05)
            except TimeoutError:
                continue
            kind = message.header.message_type
            if kind is MessageType.method_call:
                self._obey(message)
            elif kind in (MessageType.method_return, MessageType.error) and self.pending:
                self._end_confirmation(message)

    def _obey(self, message):
        fields = message.header.fields
        name, path = fields[HeaderFields.member], fields[HeaderFields.path]
        self.calls.append(name)
        if name in self.refuses:
            self.connection.send(new_error(message, self.refuses[name], "s", ("as requested",)))
            return
        answer = getattr(self, snake(name))(message, path, message.body)
        if answer is not None:
            self.connection.send(new_method_return(message, *answer))

    def get_managed_objects(self, message, path, body):
        objects = {}
        if self.radio:
            objects[RADIO] = {"org.bluez.Adapter1": {"Powered": ("b", self.powered)}}
        for each in self.modules:
            if each.found:
                objects[each.path] = {"org.bluez.Device1": each.properties()}
        return "a{oa{sa{sv}}}", (objects,)

    def set_discovery_filter(self, message, path, body):
        assert body == ({"Transport": ("s", "bredr")},)
        return ()

    def start_discovery(self, message, path, body):
        if not self.powered:
            self.connection.send(new_error(message, ERROR + "NotReady"))
            return None
        for each in self.modules:
            each.found = each.found or each.answers
        return ()

    def stop_discovery(self, message, path, body):
        return ()

    def register_agent(self, message, path, body):
        self.agent = (message.header.fields[HeaderFields.sender], body[0])
        return ()

    def request_default_agent(self, message, path, body):
        assert body[0] == self.agent[1]
        return ()

    def unregister_agent(self, message, path, body):
        self.agent = None
        return ()

    def remove_device(self, message, path, body):
        (module,) = (each for each in self.modules if each.path == body[0])
        module.paired = module.found = False
        return ()

    def set(self, message, path, body):
        interface, name, (_, value) = body
        if (interface, name) == ("org.bluez.Adapter1", "Powered"):
            self.powered = value
        elif (interface, name) == ("org.bluez.Device1", "Trusted"):
            self.trusted.append(path)
        return ()

    def pair(self, message, path, body):
        (module,) = (each for each in self.modules if each.path == path)
        if module.paired:
            self.connection.send(new_error(message, ERROR + "AlreadyExists"))
        elif not module.answers:
            error = new_error(message, ERROR + "ConnectionAttemptFailed", "s", ("Page Timeout",))
            self.connection.send(error)
        else:
            owner, agent = self.agent
            address = DBusAddress(agent, owner, "org.bluez.Agent1")
            question = new_method_call(address, "RequestPinCode", "o", (path,))
            serial = next(self.connection.outgoing_serial)
            self.pending = (serial, message, module)
            self.connection.send(question, serial=serial)

    def _end_confirmation(self, message):
        serial, asked, module = self.pending
        if message.header.fields.get(HeaderFields.reply_serial) != serial:
            return
        self.pending = None
        if message.header.message_type is MessageType.method_return and message.body == (
            module.pin,
        ):
            module.paired = True
            self.connection.send(new_method_return(asked))
        else:
            self.connection.send(new_error(asked, ERROR + "AuthenticationFailed"))


@contextmanager
def bus(folder):
    """A message bus that passes for the system's."""
    path, config = folder / "bus", folder / "bus.conf"
    config.write_text(CONFIG.format(path=path))
    words = ["dbus-daemon", f"--config-file={config}", "--nofork", "--print-address"]
    daemon = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert daemon.stdout.readline().startswith("unix:")
    before = os.environ.get("DBUS_SYSTEM_BUS_ADDRESS")
    os.environ["DBUS_SYSTEM_BUS_ADDRESS"] = f"unix:path={path}"
    try:
        yield
    finally:
        if before is None:
            del os.environ["DBUS_SYSTEM_BUS_ADDRESS"]
        else:
            os.environ["DBUS_SYSTEM_BUS_ADDRESS"] = before
        daemon.terminate()
        daemon.wait()
        daemon.stdout.close()


@contextmanager
def bluez(*modules, **how):
    """The service on the bus, with these modules in reach."""
    service = Bluez(modules, **how)
    try:
        yield service
    finally:
        service.close()
