"""The table of USB identities, and the ports that it does not have."""

import re

import pytest

from diffbotctl.drivers.board_ports import NoBoardError, board_of, candidates
from diffbotctl.links.diffbot_frames import BoardCode
from diffbotctl.ports.access import SystemUser, current_user
from diffbotctl.ports.diagnosis import diagnose_name, survey_ports, unlisted_ports
from diffbotctl.ports.sysfs import serial_ports
from diffbotctl.ports.usb_ids import PortRole, lookup_usb_id, usb_rows
from tests.support.fake_machine import MEGA, FakeMachine


def survey(machine):
    return survey_ports(machine.root, current_user())


def test_each_identity_is_listed_once_with_its_source():
    listed = []
    for row in usb_rows():
        assert row["source"] and PortRole(row["role"])
        identities = [each for ids in row.get("ids", {}).values() for each in ids]
        assert all(re.fullmatch("[0-9a-f]{4}:[0-9a-f]{4}", each) for each in identities)
        vendors = list(row.get("vendors", {}).values())
        assert all(re.fullmatch("[0-9a-f]{4}", each) for each in vendors)
        listed += identities + vendors
    assert len(set(listed)) == len(listed) > 150


@pytest.mark.parametrize(
    ("vendor", "product", "board"),
    [
        (0x2341, 0x0243, BoardCode.ATMEGA328P),
        (0x2341, 0x006A, BoardCode.ATMEGA328P),
        (0x2341, 0x0062, BoardCode.ATMEGA328P),
        (0x2A03, 0x0043, BoardCode.ATMEGA328P),
        (0x2341, 0x0242, BoardCode.MEGA2560),
        (0x2E8A, 0x000A, BoardCode.RP2040),
        (0x2E8A, 0xF00A, BoardCode.RP2040),
        (0x2341, 0x8036, None),
        (0x0403, 0x6015, None),
    ],
)
def test_a_listed_board_is_known(tmp_path, vendor, product, board):
    machine = FakeMachine(tmp_path)
    machine.port("ttyACM0", (vendor, product))
    assert board_of(serial_ports(machine.root)[0]) is board


@pytest.mark.parametrize(
    ("vendor", "product", "title"),
    [
        (0x0403, 0x6015, "FT230X"),
        (0x1A86, 0x55D3, "CH343"),
        (0x1A86, 0x7522, "CH340"),
        (0x10C4, 0xEA70, "CP2105"),
        (0x067B, 0x2303, "PL2303"),
        (0x04D8, 0x00DD, "MCP2221"),
    ],
)
def test_the_serial_chip_of_a_clone_is_a_candidate(tmp_path, vendor, product, title):
    machine = FakeMachine(tmp_path)
    machine.port("ttyUSB0", (vendor, product))
    assert [port.device for port in candidates(root=machine.root)] == ["/dev/ttyUSB0"]
    chip = lookup_usb_id(vendor, product)
    assert chip is not None and title in chip.title
    assert [problem.code for problem in survey(machine).problems] == []


@pytest.mark.parametrize(
    ("identity", "product", "words"),
    [
        ((0x2341, 0x0999), "Arduino Dos", "Arduino Dos (Arduino board) 2341:0999"),
        ((0x239A, 0x80F2), "Feather RP2040", "Feather RP2040 (Adafruit board) 239a:80f2"),
        ((0x1D50, 0x6089), "My Board", "My Board 1d50:6089"),
        ((0x1D50, 0x6089), "", "USB device 1d50:6089"),
        ((0x2341, 0x8036), "Arduino Leonardo", "Arduino Leonardo"),
        ((0x2E8A, 0x000B), "Pico", "Raspberry Pi Pico with CircuitPython"),
    ],
)
def test_another_serial_port_is_offered_by_name(tmp_path, identity, product, words):
    machine = FakeMachine(tmp_path)
    machine.port("ttyACM3", identity, product=product, by_id="usb-it-if00")
    (problem,) = survey(machine).problems
    error = NoBoardError(True, unlisted_ports(serial_ports(machine.root))).problems[0]
    for each, code in ((problem, "W-PORT-NONE"), (error, "E-NO-BOARD")):
        assert each.code == code
        assert f"/dev/ttyACM3 is {words}" in each.cause
        assert "--port /dev/serial/by-id/usb-it-if00" in each.fix
        assert "cable" not in each.fix
    assert candidates(root=machine.root) == []


def test_a_modem_is_not_offered(tmp_path):
    machine = FakeMachine(tmp_path)
    machine.port("ttyUSB0", (0x12D1, 0x1001), product="HUAWEI Mobile")
    assert unlisted_ports(serial_ports(machine.root)) == []


def test_a_device_of_a_vendor_without_a_port_is_no_problem(tmp_path):
    """A keyboard of Adafruit or a camera of Espressif has no serial port, and needs none."""
    machine = FakeMachine(tmp_path)
    machine.port("ttyACM0", MEGA)
    machine.usb("1-3", (0x239A, 0x80F2), "keypad")
    assert survey(machine).problems == ()


def test_a_port_without_permission_is_not_called_a_cable(tmp_path):
    machine = FakeMachine(tmp_path)
    machine.port("ttyACM0", MEGA, mode=0)
    stranger = SystemUser("ana", 12345, frozenset({12345}))
    problem = diagnose_name(machine.root, survey_ports(machine.root, stranger), "/dev/ttyS9")
    assert "`diffbotctl ports` names what /dev/ttyACM0 needs" in problem.fix
