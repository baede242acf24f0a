"""A joystick through the kernel's events: its dead-man button, its loss, and its replay.

The events come through a pipe, which the driver reads as it reads a device: there is no uinput in
the containers in which these tests run.
"""

import os
import struct

import pytest

from diffbotctl.device import DeviceError
from diffbotctl.drivers.joystick import BUTTONS, EVENT, Joystick, find_joystick
from diffbotctl.messages import Twist
from diffbotctl.time import MILLISECOND as MS
from tests.support.running import PlainClient, cli, moves, running, stands

KEY, ABS, SYN = 1, 3, 0
BUTTON = BUTTONS["left_shoulder"]
LEFT_Y, LEFT_X = 1, 0
PIPELINE = """
format: 1
kind: pipeline
include: teleop
sources:
  joystick: {driver: joystick, timeout: 0.3 s, with: {device: $device, silence_max: 5 s}}
blocks:
  mux: {in: {teleop: joystick.twist}}
"""


class Pad:
    """Writes events to a pipe. It keeps the pipe open until it is unplugged."""

    def __init__(self, folder):
        self.device = folder / "event0"
        os.mkfifo(self.device)
        self.plug()

    def plug(self):
        self.file = os.open(self.device, os.O_RDWR)

    def event(self, kind, code, value):
        os.write(self.file, EVENT.pack(1, 2, kind, code, value) + EVENT.pack(1, 2, SYN, 0, 0))

    def hold(self, value=1):
        self.event(KEY, BUTTON, value)

    def push(self, value=-32768):
        self.event(ABS, LEFT_Y, value)

    def unplug(self):
        os.close(self.file)


@pytest.fixture
def pad(tmp_path):
    return Pad(tmp_path)


@pytest.fixture
def joystick(pad):
    driver = Joystick(device=str(pad.device), dead_zone=0.0)
    driver.open()
    yield driver
    driver.close()


def twists(readings):
    return [message and (message.linear, message.angular) for _, message in readings]


def test_events_are_as_long_as_the_kernel_s():
    assert EVENT.size == 2 * struct.calcsize("l") + 8


def test_nothing_is_published_until_the_button_is_pressed(pad, joystick):
    pad.push()
    assert joystick.read(10 * MS) == []
    pad.hold()
    assert twists(joystick.read(20 * MS)) == [(pytest.approx(0.2), 0.0)]
    pad.hold(0)
    assert twists(joystick.read(30 * MS)) == [(0.0, 0.0), None]
    assert joystick.read(100 * MS) == []


@pytest.mark.parametrize(
    ("axis", "value", "expected"),
    [
        (LEFT_Y, -32768, (0.2, 0.0)),  # pushed away: forward
        (LEFT_Y, 32767, (-0.2, 0.0)),
        (LEFT_X, -32768, (0.0, 1.0)),  # to the left: counter-clockwise
        (LEFT_X, 32767, (0.0, -1.0)),
        (LEFT_Y, 16383, (pytest.approx(-0.1, abs=1e-5), 0.0)),
        (LEFT_Y, -999999, (0.2, 0.0)),  # beyond its range
        (5, 32767, (0.0, 0.0)),  # an axis that means nothing here
    ],
)
def test_directions_and_sizes(pad, joystick, axis, value, expected):
    pad.hold()
    pad.event(ABS, axis, value)
    assert twists(joystick.read(10 * MS)) == [expected]


def test_it_is_published_twenty_times_a_second(pad, joystick):
    pad.hold()
    pad.push()
    times = [time for time in range(0, 1000, 5) if joystick.read(time * MS)]
    assert 18 <= len(times) <= 21


def test_silence_counts_as_release_until_the_button_is_pressed_again(pad, joystick):
    pad.hold()
    pad.push()
    joystick.read(10 * MS)
    assert twists(joystick.read(1020 * MS)) == [(0.0, 0.0), None]
    pad.push(-1000)
    assert joystick.read(1100 * MS) == []
    pad.hold(2)  # the kernel repeats a key that is held
    assert joystick.read(1200 * MS) == []
    pad.hold(1)
    assert len(joystick.read(1300 * MS)) == 1


def test_lost_events_count_as_release(pad, joystick):
    pad.hold()
    joystick.read(10 * MS)
    pad.event(SYN, 3, 0)
    assert twists(joystick.read(20 * MS)) == [(0.0, 0.0), None]


def test_a_small_deflection_is_none(pad):
    driver = Joystick(device=str(pad.device), dead_zone=0.2)
    driver.open()
    pad.hold()
    pad.push(-6000)
    assert driver.read(10 * MS)[0].message == Twist(10 * MS, 0.0, 0.0)
    driver.close()


def test_an_unplugged_joystick_is_an_error(pad, joystick):
    pad.unplug()
    with pytest.raises(OSError, match="19"):
        joystick.read(10 * MS)


@pytest.mark.parametrize("name", ["/", "/dev/null", "/dev/full", "/dev/urandom", "a file"])
def test_what_is_no_input_device_is_refused(tmp_path, name):
    path = tmp_path / "file"
    path.write_bytes(bytes(24))
    joystick = Joystick(device=name if name.startswith("/") else str(path))
    with pytest.raises(DeviceError, match="not an input device"):
        joystick.open()
    joystick.close()


def test_a_joystick_is_found_by_its_udev_name(tmp_path):
    with pytest.raises(DeviceError) as raised:
        find_joystick(tmp_path)
    assert "no joystick" in raised.value.cause
    (tmp_path / "by-id").mkdir()
    (tmp_path / "by-id" / "usb-Pad-event-joystick").touch()
    assert find_joystick(tmp_path).endswith("usb-Pad-event-joystick")


def test_the_button_drives_and_its_loss_stops_and_latches(tmp_path, pad):
    pipeline, recording = tmp_path / "pad.yaml", tmp_path / "pad.mcap"
    pipeline.write_text(PIPELINE.replace("$device", str(pad.device)))
    words = [str(pipeline), "--stay", "--record", str(recording)]
    with running(tmp_path, *words) as process:
        client = PlainClient(tmp_path)
        pad.push()
        begin = client.request("status")["time"]
        status = client.until(lambda status: status["time"] > begin + 300 * MS)
        assert stands(status)
        pad.hold()
        client.until(moves)
        pad.hold(0)
        status = client.until(stands)
        assert status["held"] is None  # released: nothing is latched
        pad.hold()
        client.until(moves)
        pad.unplug()
        held = client.until(lambda status: status["held"] and stands(status))["held"]
        assert (held["code"], held["latched"]) == ("input_stale", True)
        assert f"source joystick ({pad.device}): it has disconnected" in held["cause"]
        pad.plug()
        client.until(lambda status: _has_logged(client, "opened again"))
        pad.push()
        pad.hold()
        rate = {"topic": "joystick.twist"}
        client.until(lambda status: client.request("topic_rate", **rate)["age"] < 0.1)
        assert client.request("status")["held"]["code"] == "input_stale"
        assert client.request("resume")["ok"]
        client.until(moves)
        process.terminate()
        process.wait(timeout=60)
    os.unlink(pad.device)
    code, out, _ = cli(tmp_path, "replay", str(recording), "--check")
    assert code == 0 and "same" in out


def _has_logged(client, text):
    return any(text in line["text"] for line in client.request("read_log")["lines"])
