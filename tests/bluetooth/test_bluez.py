"""Scanning and pairing, against a double of BlueZ on a real message bus; as commands and calls."""

import os

import pytest

from diffbotctl.bluetooth.bluez import BluezService
from diffbotctl.errors import RunError
from tests.bluez_double import ERROR, Module, bluez, bus
from tests.support.virtual_board import diffbotctl, flat

ROBOT = "98:D3:31:FC:12:34"


@pytest.fixture
def own_bus(tmp_path):
    with bus(tmp_path):
        yield


def code_of(error):
    return error.value.problems[0].code


def test_scan_lists_modules_and_leaves_out_phones(own_bus):
    phone = Module("40:4E:36:00:00:01", "a phone", serial=False)
    with bluez(Module(ROBOT), phone) as service:
        code, output = diffbotctl("bluetooth", "scan", "--for", 1)
    assert code == 0
    assert f"{ROBOT} HC-05 -55 dBm serial port not paired" in flat(output)
    assert "a phone" not in output
    assert service.calls[-1] == "StopDiscovery"


def test_scan_all_lists_phones_too(own_bus):
    with bluez(Module("40:4E:36:00:00:01", "a phone", serial=False)):
        code, output = diffbotctl("bluetooth", "scan", "--for", 1, "--all")
    assert code == 0 and "a phone" in output


def test_a_module_is_known_by_its_name_before_its_profile_is(own_bus):
    """Profiles are read at pairing; till then an HC-05 is only a name."""
    with bluez(Module(ROBOT, serial=False)), BluezService() as service:
        (found,) = service.scan(0.1)
    assert found.is_serial


def test_a_scan_without_result_lists_what_to_check(own_bus):
    with bluez():
        code, output = diffbotctl("bluetooth", "scan", "--for", 1)
    assert code == 1 and "Is it powered" in output


def test_pair_with_the_pin_of_an_hc05(own_bus):
    with bluez(Module(ROBOT)) as service:
        code, output = diffbotctl("bluetooth", "pair", ROBOT.lower())
        assert code == 0, output
        assert f"diffbotctl run goal --port bluetooth:{ROBOT}" in output
        assert service.modules[0].paired and service.trusted == [service.modules[0].path]
        assert service.agent is None  # the desktop's own agent is asked again from now on
        code, output = diffbotctl("bluetooth", "pair", f"bluetooth:{ROBOT}")
        assert code == 0 and "paired already" in output


def test_pair_with_another_pin(own_bus):
    with bluez(Module(ROBOT, pin="0000")):
        code, output = diffbotctl("bluetooth", "pair", ROBOT)
        assert code == 1
        assert "E-BLUETOOTH-PAIR" in output and "--pin 0000" in output
        code, output = diffbotctl("bluetooth", "pair", ROBOT, "--pin", "0000")
        assert code == 0, output


def test_pair_again_forgets_first(own_bus):
    with bluez(Module(ROBOT, paired=True, found=True)) as service:
        code, output = diffbotctl("bluetooth", "pair", ROBOT, "--again")
        assert code == 0, output
        assert "forgotten" in output and service.modules[0].paired
        assert service.calls.index("RemoveDevice") < service.calls.index("Pair")


def test_a_module_that_is_off_is_distinguished_from_a_wrong_pin(own_bus):
    # Known from before, but its page has no answer.
    with bluez(Module(ROBOT, answers=False, found=True)):
        code, output = diffbotctl("bluetooth", "pair", ROBOT)
    assert code == 1 and "E-BLUETOOTH-ABSENT" in output


def test_an_unknown_module_that_never_answers(own_bus):
    with bluez(), BluezService() as service, pytest.raises(RunError) as error:
        service.find(ROBOT, 0.1)
    assert code_of(error) == "E-BLUETOOTH-ABSENT"


def test_a_radio_that_is_off_is_switched_on(own_bus):
    with bluez(Module(ROBOT), powered=False) as service, BluezService() as ours:
        assert [each.address for each in ours.scan(0.1)] == [ROBOT]
        assert service.powered


@pytest.mark.parametrize(
    ("how", "code"),
    [
        ({"radio": False}, "E-BLUETOOTH-ADAPTER"),
        # What rfkill leads to: the radio may not be switched on.
        ({"powered": False, "refuses": {"Set": ERROR + "Blocked"}}, "E-BLUETOOTH-BLOCKED"),
        (
            {"refuses": {"GetManagedObjects": "org.freedesktop.DBus.Error.AccessDenied"}},
            "E-BLUETOOTH-SERVICE",
        ),
        ({"refuses": {"StartDiscovery": ERROR + "NotReady"}}, "E-BLUETOOTH-BLOCKED"),
    ],
)
def test_problems_of_the_radio(own_bus, how, code):
    with bluez(**how), pytest.raises(RunError) as error, BluezService() as service:
        list(service.scan(0.1))
    assert code_of(error) == code


def test_without_the_service_its_package_is_named(own_bus):
    code, output = diffbotctl("bluetooth", "scan", "--for", 1)
    assert code == 1
    assert "E-BLUETOOTH-SERVICE" in output and "apt-get install bluez" in flat(output)


def test_without_a_bus(tmp_path, monkeypatch):
    monkeypatch.setitem(os.environ, "DBUS_SYSTEM_BUS_ADDRESS", f"unix:path={tmp_path}/none")
    with pytest.raises(RunError) as error:
        BluezService()
    assert code_of(error) == "E-BLUETOOTH-SERVICE"
