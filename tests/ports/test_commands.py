"""`ports` and `doctor` as processes, as the present user and as one without permissions."""

import configparser
import os
import re
import shlex
import tempfile
from pathlib import Path

import pytest
from click.testing import CliRunner

from diffbotctl.bluetooth.errors import adapter_status
from diffbotctl.cli.main import program
from diffbotctl.cli.options import VIRTUAL_PORTS
from diffbotctl.diagnostics.doctor import REQUIRED_PACKAGES, Verdict, doctor_findings
from diffbotctl.drivers import robot_ports
from diffbotctl.drivers.serial_port import open_port
from diffbotctl.errors import RunError
from diffbotctl.ports.access import SystemUser
from diffbotctl.ports.diagnosis import survey_ports
from tests.support.book_board import BookBoardPort
from tests.support.confined import run_command
from tests.support.fake_machine import CH340, MEGA, FakeMachine

NOBODY = 65534


def run(*words):
    """Exit code, and the output with line breaks folded."""
    done = run_command(*words)
    assert "Traceback" not in done.complaints
    return done.code, " ".join(done.output.split())


def run_without_rights(*words):
    """The same by a process that may do nothing special. Root gives its rights up for it.

    It forks rather than starts an interpreter, which may lie where only root can read; what
    the command imports is imported by a first run, with rights.
    """
    if os.geteuid() != 0:
        return run(*words)
    _main(words)
    code, printed = without_rights(lambda: _main(words))
    assert "Traceback" not in printed
    return code, " ".join(printed.split())


def without_rights(act):
    """What `act` returns, an exit code and a text, in a process without rights."""
    ours, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        code, printed = 99, "the act itself failed"
        try:
            if os.geteuid() == 0:
                os.setgroups([])
                os.setgid(NOBODY)
                os.setuid(NOBODY)
            code, printed = act()
        finally:
            os.write(theirs, printed.encode())
            os._exit(code)
    os.close(theirs)
    with open(ours) as pipe:
        printed = pipe.read()
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), printed


def _main(words):
    """The command in this process: its exit code and output."""
    caught = CliRunner().invoke(program, list(map(str, words)), standalone_mode=False)
    if caught.exception:
        return 1, caught.output + str(caught.exception)
    return caught.return_value, caught.output


@pytest.fixture
def machine(tmp_path):
    for folder in (tmp_path, *tmp_path.parents):  # pytest keeps its folders from other users
        if folder.is_relative_to(tempfile.gettempdir()) and folder != Path(tempfile.gettempdir()):
            folder.chmod(0o755)
    return FakeMachine(tmp_path / "machine")


def test_a_free_board_is_listed(machine):
    machine.port("ttyACM0", MEGA, product="Mega 2560", by_id="usb-Arduino-if00")
    code, printed = run("ports", "--root", machine.root)
    assert code == 0
    assert "/dev/ttyACM0 Arduino Mega 2560" in printed
    assert "stable name /dev/serial/by-id/usb-Arduino-if00" in printed
    assert "free, and you may use it" in printed


def test_without_permission_the_group_is_named(machine):
    # Mode 000 keeps out an owner who is not root; root becomes nobody, whose group owns nothing.
    device = machine.port("ttyUSB0", CH340, mode=0o060 if os.geteuid() == 0 else 0)
    code, printed = run_without_rights("ports", device, "--root", machine.root)
    assert code == 1
    assert "E-PORT-R" in printed and "has no permission" in printed
    assert "Never chmod 777" in printed
    assert "free" not in printed


def test_with_permission_the_port_is_free(machine):
    device = machine.port("ttyUSB0", CH340, mode=0o666)
    code, printed = run_without_rights("ports", device, "--root", machine.root)
    assert code == 0
    assert "free, and you may use it" in printed


def test_a_real_port_refuses_a_user_without_permission():
    """A pseudo-terminal of this machine, and the very function with which a run opens ports."""
    master, slave = os.openpty()
    os.fchmod(slave, 0)

    def act():
        try:
            open_port(os.ttyname(slave), 9600).close()
        except RunError as error:
            return 1, error.problems[0].code
        return 0, ""

    assert without_rights(act) == (1, "E-PORT-RIGHTS")
    os.fchmod(slave, 0o666)
    assert without_rights(act) == (0, "")
    os.close(master)
    os.close(slave)


ON_A_PORT = (
    ("run", "goal"),
    ("run", "goal", "--dash"),
    ("flash", "firmware"),
    ("blink",),
    ("calibrate", "encoders"),
    ("bluetooth", "baud", "9600"),
    ("start",),
)


@pytest.mark.parametrize("words", ON_A_PORT, ids=" ".join)
@pytest.mark.parametrize(
    ("port", "fix"),
    [("/dev/ttyUSB987", "connect"), ("/dev/rfcomm98", "use --port bluetooth:ADDRESS")],
)
def test_a_port_that_is_not_there_is_two_lines(words, port, fix):
    done = run_command(*words, "--port", port)
    head, reason, *more = done.complaints.splitlines()
    assert not more and not done.printed and done.code == 1
    assert head == f"error: port {port}  E-PORT-OPEN"
    assert len(reason) <= 80 and fix in reason


def test_a_near_word_is_suggested_in_place_of_a_missing_port():
    code, printed = run("run", "goal", "--port", "emulate")
    assert code == 1 and printed.endswith("there is no such port; did you mean emulated?")


@pytest.mark.parametrize("port", VIRTUAL_PORTS)
def test_a_command_for_boards_refuses_a_simulated_robot(port):
    code, printed = run("blink", "--port", port)
    assert code == 2 and "this command needs a board" in printed


def test_the_virtual_ports_of_the_command_line_are_those_of_the_drivers():
    assert tuple(robot_ports.VIRTUAL_PORTS) == VIRTUAL_PORTS


def test_a_service_may_name_a_port_that_appears_later():
    code, printed = run("service", "--port", "/dev/ttyUSB987", "--user", "root")
    assert code == 0 and "--port /dev/ttyUSB987" in printed


def test_what_fix_prints_are_whole_commands(machine):
    machine.port("ttyUSB0", CH340, mode=0o600 if os.geteuid() == 0 else 0)
    code, printed = run_without_rights("doctor", "--fix", "--root", machine.root)
    assert code == 0
    assert 'ATTRS{idVendor}=="1a86", ATTRS{idProduct}=="7523"' in printed
    assert printed.endswith("sudo udevadm control --reload && sudo udevadm trigger")
    words = shlex.split(printed)
    assert words[0] == "echo" and words[1].startswith('SUBSYSTEM=="tty"')


def doctor(machine, user=NOBODY, groups=frozenset()):
    """The findings about a machine, for a user."""
    person = SystemUser("ana", user, groups)
    return list(doctor_findings(machine.root, person, survey_ports(machine.root, person)))


def about(found, topic):
    return [(each.verdict, each.text, each.fix) for each in found if each.topic == topic]


def test_doctor_names_the_group_to_join(machine):
    found = doctor(machine)
    assert about(found, "groups") == [
        (
            Verdict.NOTE,
            "ana is in no group that owns serial ports",
            "sudo usermod -aG dialout ana, then log out and in again",
        ),
    ]


def test_doctor_detects_a_session_older_than_the_group(machine):
    machine.group("dialout", "ana")
    assert about(doctor(machine), "groups")[0][0] == Verdict.BAD
    assert about(doctor(machine, groups={os.getgid()}), "groups")[0][0] == Verdict.OK


def test_doctor_asks_for_the_packages_that_pip_installs():
    setup = configparser.ConfigParser()
    assert setup.read(Path(__file__).parents[2] / "setup.cfg")
    lines = setup["options"]["install_requires"].split()
    assert sorted(REQUIRED_PACKAGES) == [re.split("[<>=]", line)[0] for line in lines]


def test_doctor_lists_the_optional_packages_that_are_installed(machine):
    machine.write("usr/bin/avrdude", "")
    found = doctor(machine)
    assert about(found, "avrdude") == [(Verdict.OK, "installed", "")]
    (verdict, words, fix) = about(found, "gcc-avr")[0]
    assert verdict == Verdict.NOTE and "needed only for building the firmware" in words
    assert fix == "sudo apt-get install gcc-avr"


def test_doctor_reports_a_console_on_a_pi_as_a_note(machine):
    machine.port("ttyAMA0", None)
    machine.write("proc/cmdline", "console=ttyAMA0,115200")
    found = doctor(machine, groups={os.getgid()})
    assert [each.verdict for each in found if each.topic == "E-PORT-CONSOLE"] == [Verdict.NOTE]


@pytest.mark.parametrize(
    ("files", "code"),
    [
        ({}, "E-BLUETOOTH-ADAPTER"),
        ({"sys/class/bluetooth/hci0/x": ""}, "E-BLUETOOTH-SERVICE"),
        ({"sys/class/bluetooth/hci0/x": "", "proc/9/comm": "bluetoothd"}, None),
        # hci0:1 is a connection, no radio.
        ({"sys/class/bluetooth/hci0:1/x": ""}, "E-BLUETOOTH-ADAPTER"),
        (
            {
                "sys/class/bluetooth/hci0/x": "",
                "proc/9/comm": "bluetoothd",
                "sys/class/rfkill/rfkill0/type": "bluetooth",
                "sys/class/rfkill/rfkill0/soft": "1",
            },
            "E-BLUETOOTH-BLOCKED",
        ),
        # Only the wireless network is off.
        (
            {
                "sys/class/bluetooth/hci0/x": "",
                "proc/9/comm": "bluetoothd",
                "sys/class/rfkill/rfkill0/type": "wlan",
                "sys/class/rfkill/rfkill0/soft": "1",
            },
            None,
        ),
    ],
)
def test_the_state_of_the_radio(machine, files, code):
    for path, content in files.items():
        machine.write(path, content)
    trouble = adapter_status(machine.root).problem
    assert (trouble.code if trouble else None) == code


def test_ask_reports_the_board(tmp_path):
    stock = BookBoardPort()
    port = tmp_path / "rfcomm0"
    port.symlink_to(stock.name)
    code, printed = run("ports", str(port), "--ask", "--robot", "book_2wd")
    stock.close()
    assert code == 1
    assert "a pseudo-terminal" in printed and "E-BOARD-ROSSERIAL" in printed
