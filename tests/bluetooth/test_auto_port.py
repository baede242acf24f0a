"""`--port auto` where nothing is plugged in and a module is paired, on a real message bus."""

import pytest

from diffbotctl.bluetooth.bluez import paired_modules
from diffbotctl.cli.choose_port import command_over
from tests.bluez_double import Module, bluez, bus
from tests.support.virtual_board import diffbotctl, flat

ROBOT = "98:D3:31:FC:12:34"
OTHER = "98:D3:31:FC:00:01"


@pytest.fixture
def own_bus(tmp_path):
    with bus(tmp_path):
        yield


def known(address, **what):
    return Module(address, found=True, **{"paired": True, **what})


def test_a_paired_module_is_listed_with_its_command(own_bus):
    with bluez(known(ROBOT, answers=False), powered=False) as service:
        code, output = diffbotctl("run", "goal", "--port", "auto")
        assert not service.powered  # it only looks
    assert code == 1 and f"paired over Bluetooth: HC-05 {ROBOT}" in flat(output)
    assert f"`diffbotctl run goal --port bluetooth:{ROBOT}`" in flat(output)


def test_each_of_two_modules_is_listed_with_its_command(own_bus):
    with bluez(known(ROBOT), known(OTHER)):
        code, output = diffbotctl("blink")
    assert code == 1
    assert (
        f"`diffbotctl blink --port bluetooth:{OTHER}` or "
        f"`diffbotctl blink --port bluetooth:{ROBOT}`"
    ) in flat(output)


@pytest.mark.parametrize(
    ("module", "words"),
    [
        (known(ROBOT, paired=False), ("run", "goal", "--port", "auto")),
        (known(ROBOT, name="a phone", serial=False), ("run", "goal", "--port", "auto")),
        (known(ROBOT), ("flash", "firmware")),  # the bootloader does not listen on the radio
    ],
)
def test_a_device_without_serial_port_is_not_listed(own_bus, module, words):
    with bluez(module):
        code, output = diffbotctl(*words)
    assert code == 1 and "E-NO-BOARD" in output and ROBOT not in output


def test_without_the_service_nothing_is_listed(own_bus):
    assert paired_modules() == []


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["run", "goal", "--port", "auto", "--seed", "2"], "run goal --port X --seed 2"),
        (["run", "my robot.yaml", "--port=auto"], "run 'my robot.yaml' --port=X"),
        (["blink"], "blink --port X"),  # auto is what it means by itself
    ],
)
def test_the_command_is_the_one_that_was_typed(words, line):
    assert command_over(words, "X") == f"diffbotctl {line}"
