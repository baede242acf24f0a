"""`doctor --bundle`: what it packs, and that nothing private is in it."""

import json
import zipfile
from io import BytesIO

import pytest
from click.testing import CliRunner
from mcap.reader import make_reader
from mcap.writer import Writer

from diffbotctl.cli.main import program
from diffbotctl.diagnostics.bundle import FILE_MAX_BYTES, FOLDER
from diffbotctl.diagnostics.bundle_recording import share_recording
from diffbotctl.diagnostics.private_text import PrivateText
from diffbotctl.errors import UserError
from tests.support.fake_machine import CH340, FakeMachine

PASSWD = """\
root:x:0:0:root:/root:/bin/bash
anna:x:1000:1000:Anna Katharina Lindqvist,,,:/home/anna:/bin/bash
pi:x:1001:1001::/home/pi:/bin/bash
"""
LOG = """\
Open this link; it works once, for one device:
  https://192.168.1.23:8642/#kZ8vQ2sLr0pXw7TfYbN4Ag
  ws://127.0.0.1:8765/f00xgl0vet0ken
drive of anna.lindqvist@lindlaptop at /home/bertil/robots, module 98:D3:31:F5:B2:7C
AT+ADDR? answered 98d3:31:f5b27c; dev_98_D3_31_F5_B2_7C; fe80::a00:27ff:fe4e:66a1
/dev/serial/by-id/usb-1a86_USB2.0-Ser_Q7RK21PX-if00 and usb-Arduino_Mega_75833353035-if00
Annas robot and anna2 and robot_of_anna; lindlaptop.local; C:\\Users\\x
"""
PLANTED = [
    *("anna", "katharina", "lindqvist", "lindlaptop", "bertil", "98:d3:31", "98_d3_31", "98d3:31"),
    *("192.168.1.23", "fe80::a00", "kz8vq2slr0pxw7tfybn4ag", "f00xgl0vet0ken", "q7rk21px"),
    *("75833353035", "0f3c9aa0b1b24b0c", "hunter2envsecret"),
]
KEPT = ["127.0.0.1:8765", "https://", "robot", "AT+ADDR?"]


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """The machine of Anna, with her last flight; her home folder is the current one."""
    machine = FakeMachine(tmp_path / "machine")
    machine.write("etc/passwd", PASSWD)
    machine.write("etc/hostname", "lindlaptop\n")
    machine.write("etc/machine-id", "0f3c9aa0b1b24b0c\n")
    machine.write("etc/os-release", 'PRETTY_NAME="Debian GNU/Linux 12"\n')
    machine.port(
        "ttyUSB0", CH340, product="USB2.0-Ser", serial="Q7RK21PX", by_id="usb-1a86_Q7RK21PX-if00"
    )
    home = tmp_path / "home" / "anna"
    home.mkdir(parents=True)
    monkeypatch.chdir(home)
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("USER", "anna")
    monkeypatch.setenv("DIFFBOT_PASSWORD", "hunter2envsecret")
    monkeypatch.setenv("XDG_STATE_HOME", str(home / "state"))
    return machine


def run(*words):
    """Exit code, and what is printed."""
    done = CliRunner().invoke(program, [*map(str, words)], standalone_mode=False)
    if isinstance(done.exception, UserError):
        return done.exception.exit_code, str(done.exception)
    assert done.exception is None, done.exception
    return done.return_value or 0, done.output


def contents(path):
    """The files of a bundle by name; of recordings everything in them as text."""
    with zipfile.ZipFile(path) as file:
        files = {name.removeprefix(FOLDER): file.read(name) for name in file.namelist()}
    for name, data in files.items():
        if name.endswith(".mcap"):
            files[name] = recorded(data)
    return files


def recorded(data):
    reader = make_reader(BytesIO(data))
    parts = [f"{each.name} {each.metadata}".encode() for each in reader.iter_metadata()]
    parts += [each.data for each in reader.iter_attachments()]
    for schema, channel, message in reader.iter_messages():
        parts += [f"{schema} {channel}".encode(), message.data]
    return b"\n".join(parts)


def assert_nothing_private(files):
    for name, data in files.items():
        text = f"{name}\n".encode() + data
        for planted in PLANTED:
            place = text.lower().find(planted.encode())
            assert place < 0, f"{planted} in {name}: {text[max(place - 60, 0) : place + 60]!r}"


def test_a_bundle_has_what_helps_and_nothing_private(machine, tmp_path):
    code, _ = run("new", "robot", "robot_of_anna")
    assert code == 0
    robot = next(machine.root.parent.glob("home/anna/**/robot_of_anna.yaml"))
    robot.write_text(f"# The robot of Anna Lindqvist, {robot}\n{robot.read_text()}")
    flight = tmp_path / "home/anna/state/diffbotctl/flights/goal-1.mcap"
    flight.parent.mkdir(parents=True)
    words = ("--robot", robot, "--fast", "--for", "2s", "--record", flight)
    run("run", "goal", *words)
    assert b"anna" in recorded(flight.read_bytes())
    (tmp_path / "anna.log").write_text(LOG)
    output = tmp_path / "bundle.zip"
    code, printed = run(
        "doctor", "--root", machine.root, "--bundle", output, "--with", tmp_path / "anna.log"
    )
    assert code == 0, printed
    files = contents(output)
    assert_nothing_private(files)
    for name in files:
        assert name in printed
    assert {"doctor.txt", "system.json", "packages.json", "ports.json", "flight.mcap"} <= set(files)
    assert b"CH340" in files["ports.json"] and b"/dev/ttyUSB0" in files["ports.json"]
    assert json.loads(files["system.json"])["system"] == "Debian GNU/Linux 12"
    texts = [data for name, data in files.items() if name.startswith("flight_files/")]
    assert len(texts) == 2 and any(b"pipeline" in text or b"blocks" in text for text in texts)
    assert all(each.encode() in files["added/(name).log"] for each in KEPT)
    with zipfile.ZipFile(output) as file:
        (tmp_path / "flight.mcap").write_bytes(file.read(f"{FOLDER}flight.mcap"))
    code, printed = run("replay", tmp_path / "flight.mcap", "--check")
    assert code == 0, printed


def test_a_bundle_without_a_flight_states_it_and_is_not_overwritten_by_accident(machine, tmp_path):
    output = tmp_path / "bundle.zip"
    words = ("doctor", "--root", machine.root, "--bundle", output)
    code, printed = run(*words)
    assert code == 0 and "There is no flight recording" in printed
    assert run(*words)[0] == 0  # diffbotctl wrote it
    with zipfile.ZipFile(output, "w") as file:
        file.writestr("thesis.txt", "years of work")
    code, printed = run(*words)
    assert code == 2 and "E-OUTPUT" in printed
    assert run(*words, "--force")[0] == 0


@pytest.mark.parametrize(
    "name, content, expected",
    [
        ("missing.yaml", None, "E-FILE-READ"),
        ("image.png", b"\x89PNG\xff\xfe", "E-FILE-ENCODING"),
        ("huge.txt", b"x" * (FILE_MAX_BYTES + 1), "E-FILE-SIZE"),
        ("other.mcap", b"no recording", "E-RECORDING"),
    ],
)
def test_a_file_that_cannot_be_packed_is_named(machine, tmp_path, name, content, expected):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    output = tmp_path / "bundle.zip"
    code, printed = run(
        "doctor", "--root", machine.root, "--bundle", output, "--with", tmp_path / name
    )
    assert code != 0 and expected in printed and not output.exists()


ANNA = PrivateText(["anna", "lindlaptop", "pi"], ["/srv/people/anna"], ["Q7RK21PX"])


@pytest.mark.parametrize(
    "text, shared",
    [
        ("anna's robot at lindlaptop", "(name)'s robot at (name)"),
        ("ANNA, Anna_2, xanna, annals", "(name), (name)_2, xanna, annals"),
        ("/srv/people/anna/a.yaml /home/bertil/b.yaml", "~/a.yaml ~/b.yaml"),
        ("the pi of /home/pi", "the pi of ~"),
        ("x: 10.25, y: 1.5; 0.2.0 at 127.0.0.1", "x: 10.25, y: 1.5; 0.2.0 at 127.0.0.1"),
        ("10:20:30 in the morning of 2026-11-23", "10:20:30 in the morning of 2026-11-23"),
        ("http://robot:8642/#code and http://a.example/x", "http://robot:8642/(removed) and "
         "http://a.example/(removed)"),
        ("bluetooth:98:D3:31:F5:B2:7C", "bluetooth:(address)"),
        ("# Serial number: 85736323838351F0E1E0", "# Serial number: (serial)"),
        ("my Mega, serial no. A1234567", "my Mega, serial no. (serial)"),
        ("a serial port at 115200, serial ttyUSB0", "a serial port at 115200, serial ttyUSB0"),
    ],
)  # fmt: skip
def test_texts_lose_what_is_private_and_keep_the_rest(text, shared):
    assert ANNA.without(text) == shared
    assert ANNA.without(shared) == shared


def recording(path, state):
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(library="diffbotctl")
        files = json.dumps({"/home/anna/a.yaml": "# of\nanna\nwheels: 2\n"})
        writer.add_metadata("run", {"epoch": "0", "files": files, "pipeline": "/home/anna/a.yaml"})
        schema = writer.register_schema("LogLine", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel("log", "json", schema)
        other = writer.register_channel("camera", "protobuf", schema)
        text = {"time": 0, "text": "first\nanna drives", "numbers": [0.1, "nan"]}
        writer.add_message(channel, 0, json.dumps(text).encode(), 0)
        writer.add_message(other, 0, b"anna", 0)
        writer.add_attachment(0, 0, "state", "application/octet-stream", state)
        writer.finish()
    return path


@pytest.mark.parametrize(
    "state, is_kept", [(b"\x80\x05\x8c\x04anna\x94.", False), (b"\x80\x05\x8c\x04left\x94.", True)]
)
def test_a_recording_is_copied_without_what_is_private(tmp_path, state, is_kept):
    shared = share_recording(recording(tmp_path / "a.mcap", state), ANNA)
    text = recorded(shared.data)
    assert b"anna" not in text and b"first\\n(name) drives" in text and b'0.1, "nan"' in text
    assert shared.files == {"~/a.yaml": "# of\n(name)\nwheels: 2\n"}
    assert (state in text) == is_kept
    assert any("cannot be replayed" in note for note in shared.notes) != is_kept
    assert any("camera" in note for note in shared.notes)


def test_a_flight_that_cannot_be_read_is_named(machine, tmp_path):
    flight = tmp_path / "home/anna/state/diffbotctl/flights/goal-1.mcap"
    flight.parent.mkdir(parents=True)
    flight.write_bytes(b"nothing of a recording")
    output = tmp_path / "bundle.zip"
    assert run("doctor", "--root", machine.root, "--bundle", output)[0] == 0
    files = contents(output)
    assert b"E-RECORDING" in files["flight.txt"]
    assert_nothing_private(files)


def test_a_cut_recording_is_packed_as_far_as_it_can_be_read(tmp_path):
    path = recording(tmp_path / "a.mcap", b"")
    path.write_bytes(path.read_bytes()[:-200])
    shared = share_recording(path, ANNA)
    assert any("damaged" in note for note in shared.notes) and b"anna" not in recorded(shared.data)
