"""The sketch for an ESP32, compiled and run here against an imitation of the chip's Arduino core.

It shows that the shared modules work behind that interface, and nothing about the chip itself.
"""

import subprocess
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import FrameDecoder, encode, pack
from diffbotctl.links.diffbot_frames import BoardCode, ModeCode, RefusalCode, ResetCode
from diffbotctl.links.diffbot_settings import BoardSettings, GyroInput, RangeInput, WheelSettings

ROOT = Path(__file__).parents[2]
CORE = ROOT / "tests/firmware/arduino_mock"
CHECKS = (
    *("-O1", "-g", "-Wall", "-Wextra", "-Werror", "-DARDUINO=10819"),
    *("-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
)
LEFT, RIGHT = 18, 19  # encoders
TRIGGER, ECHO = 23, 5
SETTINGS = BoardSettings(
    WheelSettings(25, 26, 27, LEFT),
    WheelSettings(32, 33, 14, RIGHT),
    board=BoardCode.ESP32,
    range_channel=4,
    uart=0,
    baud=115200,
    shares_usb=True,
)
MS = 1000  # us, the unit of the script's times
HALF = 16384  # duty


class Change(NamedTuple):
    """A line of the run: what happened to which pin, and its value."""

    time: int
    pin: int
    value: int


class SketchRun:
    """One run: frames from the board, and levels and duties of its pins, with times in us."""

    def __init__(self, lines):
        self.frames, self.duties, self.levels = [], [], []
        self.others = defaultdict(list)
        decoder = FrameDecoder()
        for line in lines:
            time, what, *values = line.split()
            if what == "sent":
                for frame in decoder.feed(bytes.fromhex(values[0])):
                    self.frames.append((int(time), frame))
            elif what in ("duty", "level"):
                changes = self.duties if what == "duty" else self.levels
                changes.append(Change(int(time), *map(int, values)))
            else:
                self.others[what].append((int(time), values[0]))
        self.damaged = decoder.damaged

    def of(self, kind):
        return [frame for _, frame in self.frames if isinstance(frame, kind)]

    def duty(self, pin, time):
        """Duty of a pin at a time."""
        return next((c.value for c in reversed(self.duties) if c.pin == pin and c.time <= time), 0)


@pytest.fixture(scope="module")
def sketch(tmp_path_factory):
    """The compiled sketch, from the folder that a person opens in the Arduino IDE."""
    out = tmp_path_factory.mktemp("esp32")
    folder = out / "diffbot_esp32"
    subprocess.run(
        ["make", "-s", "-C", str(ROOT / "firmware"), "esp32", f"SKETCH={folder}"], check=True
    )
    objects = []
    for source in [*sorted(folder.iterdir()), CORE / "core.cpp"]:
        compiler = {".c": ["gcc", "-std=gnu17"]}.get(source.suffix, ["g++", "-std=gnu++17"])
        if source.suffix not in {".c", ".cpp", ".ino"}:
            continue
        language = ["-x", "c++"] if source.suffix == ".ino" else []
        objects.append(str(out / f"{source.name}.o"))
        words = [*compiler, *CHECKS, f"-I{CORE}", *language, "-c", str(source), "-o", objects[-1]]
        subprocess.run(words, check=True)
    subprocess.run(["g++", *CHECKS, *objects, "-o", str(out / "sketch")], check=True)

    def run(events, end):
        """`events`: (time in us, words or frames)."""
        lines = []
        for time, *what in sorted(events, key=lambda event: event[0]):
            if not isinstance(what[0], str):
                what = ["serial", b"".join(map(encode, what)).hex()]
            lines.append(" ".join(map(str, (time, *what))))
        script = "\n".join([*lines, f"{end} end", ""])
        words = [str(out / "sketch")]
        done = subprocess.run(words, input=script, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout[-200:] + done.stderr
        return SketchRun(done.stdout.splitlines())

    return run


def ready(settings=SETTINGS):
    """A host that greets, sends settings and owns the commands, 100 ms after the start."""
    return [
        (10 * MS, frames.AskFrame(frames.VERSION)),
        (20 * MS, settings.frame()),
        (90 * MS, frames.StopFrame(1)),
    ]


def driving(first, last, duty=HALF):
    """A command in every 50 ms."""
    times = range(first, last + 1, 50 * MS)
    return [(time, frames.DutyFrame(n & 15, duty, duty)) for n, time in enumerate(times)]


def edges(pin, first, count, period):
    return [
        (first + n * period + half * period // 2, "pin", pin, 1 - half)
        for n in range(count)
        for half in range(2)
    ]


def low(*pins):
    return [(0, "pin", pin, 0) for pin in pins]


def test_hello_and_settings(sketch):
    run = sketch([*ready(), (200 * MS, frames.AskFrame(frames.VERSION))], 300 * MS)
    first, *_, last = run.of(frames.HelloFrame)
    assert (first.board, first.reset, first.settings) == (BoardCode.ESP32, ResetCode.POWER, 0)
    assert first.version == frames.VERSION
    assert last.settings == SETTINGS.mark()
    assert [answer.refusal for answer in run.of(frames.AnswerFrame)] == [RefusalCode.NONE]
    assert run.damaged == 0


@pytest.mark.parametrize(
    ("pin", "refusal"),
    [
        (1, RefusalCode.PIN_LINK),
        (6, RefusalCode.PIN_MISSING),  # of the flash memory
        (34, RefusalCode.PIN_MISSING),  # only an input
        (40, RefusalCode.PIN_MISSING),
        (26, RefusalCode.PIN_TWICE),
    ],
)
def test_pins_that_cannot_drive_a_motor_are_refused(sketch, pin, refusal):
    expected = replace(SETTINGS, left=replace(SETTINGS.left, enable=pin))
    (answer,) = sketch(ready(expected), 200 * MS).of(frames.AnswerFrame)
    assert answer.refusal == refusal


def test_settings_are_saved_with_the_motors_off(sketch):
    drives = driving(100 * MS, 400 * MS)
    run = sketch([*ready(), *drives], 1500 * MS)
    saved = [(time, bytes.fromhex(content)) for time, content in run.others["saved"]]
    assert all(run.duty(25, time) == run.duty(32, time) == 0 for time, _ in saved)
    complete = 0xA5  # the mark of a slot that was written to its end (store.c)
    assert [content[128] for _, content in saved][-1] == complete
    assert pack(SETTINGS.frame()) in saved[-1][1]


def test_a_duty_drives_forward_and_the_dead_man_timeout_stops(sketch):
    events = [*low(LEFT, RIGHT), *ready(), *driving(100 * MS, 400 * MS)]
    # The wheels turn, so that no blocked wheel is reported.
    events += [*edges(LEFT, 100 * MS, 30, 20 * MS), *edges(RIGHT, 100 * MS, 30, 20 * MS)]
    run = sketch(events, 1200 * MS)
    for enable, first in ((25, 26), (32, 33)):
        assert run.duty(enable, 300 * MS) == 128
        assert Change(0, first, 1)[1:] in [change[1:] for change in run.levels]
        off = max(change.time for change in run.duties if change.pin == enable)
        assert run.duty(enable, 1200 * MS) == 0
        assert 400 * MS < off <= 400 * MS + 320 * MS
    assert run.of(frames.StateFrame)[-1].mode == ModeCode.EXPIRED


def test_a_stop_frame_stops_at_once(sketch):
    events = [*ready(), *driving(100 * MS, 200 * MS), (230 * MS, frames.StopFrame(7))]
    run = sketch(events, 260 * MS)
    assert run.duty(25, 229 * MS) == 128
    assert run.duty(25, 235 * MS) == run.duty(32, 235 * MS) == 0


def test_edges_are_counted_with_their_direction_of_drive(sketch):
    events = [*low(LEFT, RIGHT), *ready(), *driving(100 * MS, 1100 * MS, duty=-HALF)]
    events += [*edges(LEFT, 150 * MS, 40, 20 * MS), *edges(RIGHT, 150 * MS, 20, 40 * MS)]
    state = sketch(events, 1200 * MS).of(frames.StateFrame)[-1]
    assert (-state.left & 0xFFFF, -state.right & 0xFFFF) == (40, 20)


def test_fast_edges_are_all_counted(sketch):
    """12,000 slots a second of each wheel, with two channels."""
    sides = [replace(SETTINGS.left, encoder_b=16, slots=1320, gain=0.02)]
    sides += [replace(SETTINGS.right, encoder_b=17, slots=1320, gain=0.02)]
    settings = replace(SETTINGS, left=sides[0], right=sides[1], glitch=0)
    events = [*low(LEFT, RIGHT, 16, 17), *ready(settings), *driving(100 * MS, 1100 * MS)]
    for pin, second in ((LEFT, 16), (RIGHT, 17)):
        events += edges(pin, 200 * MS, 6000, 84)
        events += edges(second, 200 * MS + 21, 6000, 84)
    state = sketch(events, 1200 * MS).of(frames.StateFrame)[-1]
    assert (state.left, state.right) == (6000, 6000)


def test_an_analog_sensor_is_read(sketch):
    state = sketch([(0, "millivolts", 36, 2000), *ready()], 400 * MS).of(frames.StateFrame)[-1]
    assert abs(state.range / frames.ANALOG_ONE * 5.0 - 2.0) < 0.01


def test_an_echo_is_measured(sketch):
    settings = replace(SETTINGS, further_ranges=(RangeInput("front", ECHO, TRIGGER),))
    plain = sketch([*low(ECHO), *ready(settings)], 400 * MS)
    triggered = [change.time for change in plain.levels if change.pin == TRIGGER and change.value]
    first = triggered[2]
    echo = [(first + 500, "pin", ECHO, 1), (first + 500 + 5800, "pin", ECHO, 0)]
    run = sketch([*low(ECHO), *ready(settings), *echo], 400 * MS)
    lengths = [frame.value * 4 for frame in run.of(frames.RangeFrame)]
    assert any(abs(length - 5800) <= 8 for length in lengths)


def test_a_gyro_is_summed_and_one_that_is_missing_reported(sketch):
    settings = replace(SETTINGS, gyro=GyroInput(104))
    rates = [
        (time * MS, "register", 0x48, time // 10 % 2 + 16) for time in range(20, 1500, 10)
    ]  # 0x47, 0x48: about z; the noise of a sensor that works
    events = [(0, "device", 104), (0, "register", 0x47, 4), *rates, *ready(settings)]
    frames_with = sketch(events, 1500 * MS).of(frames.InertialFrame)
    assert not frames_with[-1].turn_fault
    early, late = frames_with[-21], frames_with[-1]
    elapsed = (late.time - early.time & 0xFFFF) * 64e-6
    turned = (late.turn - early.turn & 0xFFFF) * frames.TURN_NANODEGREES * 1e-9
    assert turned == pytest.approx((4 * 256 + 16.5) / 65.5 * elapsed, rel=0.03)
    without = sketch(ready(settings), 500 * MS).of(frames.InertialFrame)
    assert without[-1].turn_fault
