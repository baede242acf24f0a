"""Ports that are sockets: names, data transfer, errors, and reconnection."""

import errno
import os
import select
import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.bluetooth.bluez import RfcommPort, parse_port
from diffbotctl.drivers.board_ports import RadioPortError, is_usb, refuse_radio
from diffbotctl.drivers.serial_port import open_port, reopen_port
from diffbotctl.drivers.socket_port import SocketPort, unreachable
from diffbotctl.errors import RunError, UsageError

ADDRESS = "98:D3:31:FC:12:34"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (ADDRESS, RfcommPort(ADDRESS)),
        (f"bluetooth:{ADDRESS.lower()}", RfcommPort(ADDRESS)),
        ("98-d3-31-fc-12-34", RfcommPort(ADDRESS)),  # as Windows writes it
        (f"bluetooth:{ADDRESS}/2", RfcommPort(ADDRESS, 2)),
    ],
)
def test_addresses(text, expected):
    assert parse_port(text) == expected
    assert parse_port(str(expected)) == expected


@pytest.mark.parametrize(
    "text",
    [
        "",
        "98:D3:31:FC:12",
        "HC-05",
        f"{ADDRESS}/0",
        f"{ADDRESS}/31",
        f"{ADDRESS}:00",
        "9G:D3:31:FC:12:34",
        f"{ADDRESS}\n/1",
    ],
)
def test_invalid_addresses(text):
    with pytest.raises(UsageError) as error:
        parse_port(text)
    assert error.value.problems[0].code == "E-BLUETOOTH-ADDRESS"


@given(st.text())
def test_any_text_is_an_address_or_a_usage_error(text):
    try:
        assert parse_port(text).channel in range(1, 31)
    except UsageError as error:
        assert error.problems[0].code == "E-BLUETOOTH-ADDRESS"


@pytest.fixture
def server(tmp_path):
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(tmp_path / "s"))
        listening.listen(1)
        yield listening


def test_bytes_go_both_ways_and_a_hang_up_is_reported(server):
    port = open_port(f"socket:{server.getsockname()}", 9600)
    module_end, _ = server.accept()
    assert port.read() == b""
    module_end.send(b"hello")
    assert port.read() == b"hello"
    assert port.write(b"there") == 5
    assert module_end.recv(10) == b"there"
    module_end.close()
    with pytest.raises(OSError):
        port.read()
    with pytest.raises(OSError):
        port.write(b"x")
    port.close()


def test_bytes_that_the_kernel_does_not_accept_are_kept(server):
    port = open_port(f"socket:{server.getsockname()}", 9600)
    module_end, _ = server.accept()
    sent = 0
    while taken := port.write(b"x" * 4096):
        sent += taken
    assert 0 < sent < 1 << 20  # what waits in the kernel is bounded
    module_end.close()
    port.close()


def test_closing_hangs_up_though_another_process_holds_the_socket(server):
    """The guardian holds a copy; the module takes one caller only, so the call must end."""
    port = open_port(f"socket:{server.getsockname()}", 9600)
    copy = os.dup(port.fd)
    module_end, _ = server.accept()
    port.close()
    module_end.settimeout(60)
    assert module_end.recv(1) == b""
    os.close(copy)


def test_a_socket_without_server(tmp_path):
    with pytest.raises(RunError) as error:
        open_port(f"socket:{tmp_path}/none", 9600)
    assert error.value.problems[0].code == "E-BLUETOOTH-CONNECT"


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.ECONNREFUSED, "connected to another machine"),
        (errno.EHOSTDOWN, "switched on"),
        (errno.EACCES, f"bluetooth pair {ADDRESS}"),
        (errno.EBUSY, "other program"),
        (errno.ENODEV, "doctor"),
        (errno.EIO, "off and on"),
    ],
)
def test_each_refusal_has_its_fix(number, words):
    problem = unreachable(f"bluetooth:{ADDRESS}", OSError(number, os.strerror(number))).problems[0]
    assert problem.code == "E-BLUETOOTH-CONNECT"
    assert words in problem.fix


def test_a_module_is_reached_or_the_cause_is_reported():
    """On a machine without Bluetooth, or a Python without, or with no such module near."""
    with pytest.raises(RunError) as error:
        open_port("bluetooth:00:00:00:00:00:00", 9600)
    assert error.value.problems[0].code in ("E-BLUETOOTH-PYTHON", "E-BLUETOOTH-CONNECT")


def call_over_tcp(address):
    """A call that takes a moment, as one over the radio does; TCP is as slow as one likes."""
    made = socket.socket()
    port = SocketPort("socket:slow", 9600, made, address)
    assert port._connecting
    return port


def test_reopening_does_not_wait_and_loses_nothing():
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen(1)
        port = call_over_tcp(listening.getsockname())
        module_end, _ = listening.accept()
        module_end.send(b"hello")
        select.select([port.fd], [], [])
        assert port.read() == b"hello"
        assert port.write(b"x") == 1
        port.close()
        module_end.close()


def test_a_call_that_is_refused_later_fails_at_reading_and_writing():
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))  # bound, but not listening: refused
        for use in (lambda port: port.read(), lambda port: port.write(b"x")):
            port = call_over_tcp(bound.getsockname())
            select.select([port.fd], [], [])
            with pytest.raises(OSError) as error:
                use(port)
            assert error.value.errno == errno.ECONNREFUSED
            port.close()


def test_a_module_is_no_usb_port_and_cannot_be_flashed():
    assert not is_usb(f"bluetooth:{ADDRESS}")
    with pytest.raises(RadioPortError):
        refuse_radio(f"bluetooth:{ADDRESS}")


def test_reopening_a_socket_that_is_not_there_is_an_os_error(tmp_path):
    with pytest.raises(OSError):
        reopen_port(f"socket:{tmp_path}/none", 9600)
