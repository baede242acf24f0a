"""Every board type runs its real firmware: goals on the emulated board, and refusals."""

import re

import pytest

from diffbotctl.config.board_pins import BOARDS
from diffbotctl.config.load import load_robot
from diffbotctl.drivers.robot_link import board_settings
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import encode
from diffbotctl.links.diffbot_host import DiffbotHost
from tests.sampling import by_day
from tests.support.virtual_board import diffbotctl, flat

# The analog inputs and the button have other numbers than a Mega's.
UNO = """\
format: 1
kind: robot
include: book_2wd
board: {{type: {board}, stop_button: A2}}
link: {{uart: 0, radio: {radio}}}
drive:
  left: {{motor: {{enable: {left}, in1: 7, in2: 8}}}}
  right: {{motor: {{enable: {right}, in1: 12, in2: 4}}}}
sensors: {{front: {{pin: {sensor}}}}}
"""


def robot(folder, board="uno", left=5, right=6, radio="cable", sensor="A1"):
    """A robot file with an Uno, a Nano or a Pico, which takes no battery at its supply."""
    file = folder / f"{board}.yaml"
    kind = f"{board}, supply: usb" if board == "pico" else board
    file.write_text(UNO.format(board=kind, left=left, right=right, radio=radio, sensor=sensor))
    return file


@pytest.mark.parametrize(
    ("board", "left", "right", "radio"),
    by_day(1, [("nano", 6, 9, "hc05"), ("uno", 5, 6, "cable"), ("uno", 10, 9, "hc05")]),
)
def test_a_goal_on_the_emulated_board(tmp_path, board, left, right, radio):
    file = robot(tmp_path, board, left, right, radio, "A1" if board == "uno" else "A7")
    code, output = diffbotctl(
        "run", "goal", "--robot", file, "--port", "emulated", "--fast", "--quiet"
    )
    assert code == 0, output
    assert "goals 1 of 1 reached" in flat(output), output
    assert "0 damaged, 0 lost" in flat(output), output
    assert "final stop confirmed" in flat(output), output


@pytest.mark.parametrize(
    ("board", "left", "right", "sensor", "codes"),
    [
        ("uno", 3, 6, "A1", ["E-PIN-TAKEN", "E-PIN-TIMER"]),  # 3 is the right encoder's too
        ("uno", 11, 6, "A1", ["E-PIN-TIMER"]),
        ("uno", 5, 6, "A7", ["E-PIN-UNKNOWN"]),  # a Nano has A7
        ("nano", 5, 13, "A7", ["E-PIN-PWM"]),
    ],
)
def test_pins_that_the_board_does_not_have(tmp_path, board, left, right, sensor, codes):
    file = robot(tmp_path, board, left, right, sensor=sensor)
    code, output = diffbotctl("check", "goal", "--robot", file)
    assert code == 2, output
    assert sorted(set(re.findall("E-PIN-[A-Z]+", output))) == codes, output


def test_the_check_and_the_board_agree_on_the_line_s_rate(tmp_path):
    cable = board_settings(load_robot(str(robot(tmp_path))).robot)
    radio = board_settings(load_robot(str(robot(tmp_path, radio="hc05"))).robot)
    assert (cable.uart, cable.baud) == (0, 115200)
    assert (radio.uart, radio.baud) == (0, 9600)


def hello(board):
    """What a board of this type answers."""
    return frames.HelloFrame(
        boot=1,
        version=frames.VERSION,
        major=0,
        minor=2,
        patch=0,
        board=board,
        reset=1,
        mode=0,
        uart=0,
        settings=0,
        receive=96,
        settings_size=45,
        capabilities=0,
    )


@pytest.mark.parametrize("answering", list(frames.BoardCode))
@pytest.mark.parametrize("stated", BOARDS)
def test_another_board_gets_no_settings(tmp_path, stated, answering):
    """Its pins would be wrong: the host refuses it, and sends it neither settings nor commands."""
    name = "book_2wd" if stated == "mega2560" else str(robot(tmp_path, stated))
    settings = board_settings(load_robot(name).robot)
    host = DiffbotHost(settings)
    host.opened(0)
    now, sent = 0, b""
    for _ in range(200):
        sent += host.send(now)
        now += 10_000_000
    host.receive(now, b"\0" + encode(hello(answering)))
    for _ in range(200):
        sent += host.send(now)
        now += 10_000_000
    is_other = answering is not settings.board
    assert (host.refusal is not None) == is_other
    assert (encode(settings.frame()) in sent) == (not is_other)
    if host.refusal is not None:
        assert host.refusal.code == "E-BOARD-KIND"
