"""`ports` and `doctor` as processes, as the one who runs this and as a user without rights."""

import os
import shlex
import subprocess
import sys

import pytest

from tests.fake_machine import CH340, MEGA, FakeMachine

MAIN = "from diffbotctl.cli.main import main; main()"
NOBODY = 65534


def run(*words, unprivileged=False):
    """(exit code, what was said, line breaks folded). Root gives up its rights when asked to."""
    command = [sys.executable, "-c", MAIN, *map(str, words)]
    if unprivileged and os.geteuid() == 0:
        person = ["--reuid", str(NOBODY), "--regid", str(NOBODY), "--clear-groups"]
        command = ["setpriv", *person, *command]
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": os.getcwd()}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert "Traceback" not in done.stderr
    return done.returncode, " ".join((done.stdout + done.stderr).split())


@pytest.fixture
def machine(tmp_path):
    for folder in (tmp_path, *tmp_path.parents[:2]):
        folder.chmod(0o755)  # pytest keeps its folders from other users
    return FakeMachine(tmp_path / "machine")


def test_a_free_board_is_listed(machine):
    machine.port("ttyACM0", MEGA, product="Mega 2560", by_id="usb-Arduino-if00")
    code, said = run("ports", "--root", machine.root)
    assert code == 0
    assert "/dev/ttyACM0 Arduino Mega 2560" in said
    assert "always called /dev/serial/by-id/usb-Arduino-if00" in said
    assert "free, and you may use it" in said


def test_one_without_rights_is_told_which_group(machine):
    # Mode 000 keeps out an owner who is not root; root becomes nobody, whose group owns nothing.
    device = machine.port("ttyUSB0", CH340, mode=0o060 if os.geteuid() == 0 else 0)
    code, said = run("ports", device, "--root", machine.root, unprivileged=True)
    assert code == 1
    assert "E-PORT-R" in said and "may not open it" in said
    assert "Never chmod 777" in said
    assert "free" not in said


def test_one_with_rights_is_told_so(machine):
    device = machine.port("ttyUSB0", CH340, mode=0o666)
    code, said = run("ports", device, "--root", machine.root, unprivileged=True)
    assert code == 0
    assert "free, and you may use it" in said


def test_the_real_port_refuses_whom_the_verdict_refuses(tmp_path):
    """A pseudo-terminal of this machine, opened by `run`'s own code, as a user without rights."""
    master, slave = os.openpty()
    os.fchmod(slave, 0)
    code, said = run("blink", "--port", os.ttyname(slave), "--robot", "book_2wd", unprivileged=True)
    os.close(master)
    os.close(slave)
    assert code == 1
    assert "E-PORT-RIGHTS" in said


def test_what_fix_prints_are_whole_commands(machine):
    machine.port("ttyUSB0", CH340, mode=0o600 if os.geteuid() == 0 else 0)
    code, said = run("doctor", "--fix", "--root", machine.root, unprivileged=True)
    assert code == 0
    assert 'ATTRS{idVendor}=="1a86", ATTRS{idProduct}=="7523"' in said
    assert said.endswith("sudo udevadm control --reload && sudo udevadm trigger")
    words = shlex.split(said)
    assert words[0] == "echo" and words[1].startswith('SUBSYSTEM=="tty"')
