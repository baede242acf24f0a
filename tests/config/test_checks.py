"""The calculations of the checks, with expected values worked out by hand."""

import pytest

from diffbotctl.config.board_pins import BOARDS
from diffbotctl.config.checks import graph
from diffbotctl.config.checks.drive import resolution
from diffbotctl.config.checks.pins import pins_for
from diffbotctl.config.load import check, load
from diffbotctl.links import link_protocol
from diffbotctl.links.diffbot_codec import WIRE_BYTES
from diffbotctl.links.diffbot_frames import CountsFrame, StateFrame


@pytest.mark.parametrize(
    "baud, divider, bytes_a_second",
    [
        (9600, 208, 961.5),  # 16 MHz / 8 / 208 = 9615 baud, a tenth of it in bytes
        (19200, 104, 1923.1),
        (57600, 35, 5714.3),  # 57143 baud
        (115200, 17, 11764.7),  # 117647 baud: the divider gives 2 % too much
    ],
)
def test_capacity_of_a_line(baud, divider, bytes_a_second):
    assert 16e6 / 8 / divider / 10 == pytest.approx(bytes_a_second, abs=0.1)
    assert link_protocol.capacity(baud) == pytest.approx(bytes_a_second, abs=0.1)


@pytest.mark.parametrize(
    "protocol, has_edge_times, size",
    [
        ("diffbot", True, WIRE_BYTES[StateFrame]),
        ("diffbot", False, WIRE_BYTES[CountsFrame]),
        ("rosserial", False, 36),  # three messages of 12
    ],
)
def test_bytes_of_a_frame(protocol, has_edge_times, size):
    assert link_protocol.frame_bytes(protocol, has_edge_times) == size


TWO = """\
format: 1
kind: robot
include: %s
sensors: {rear: {type: sharp_gp2y0a41sk0f, pin: A1}}
"""


@pytest.mark.parametrize("include", ["book_2wd", "book_2wd_counts"])
@pytest.mark.parametrize("real", [False, True])
def test_our_firmware_reads_four_distance_sensors(tmp_path, include, real):
    (tmp_path / "two.yaml").write_text(TWO % include + "board: {telemetry: 30 Hz}\n")
    problems = check("goal", str(tmp_path / "two.yaml"), [], real=real)
    assert [problem.code for problem in problems if problem.severity == "error"] == []
    five = "".join(f"  s{pin}: {{type: sharp_gp2y0a21yk0f, pin: A{pin}}}\n" for pin in range(1, 5))
    (tmp_path / "five.yaml").write_text(
        f"format: 1\nkind: robot\ninclude: {include}\nboard: {{telemetry: 30 Hz}}\nsensors:\n{five}"
    )
    problems = check("goal", str(tmp_path / "five.yaml"), [], real=real)
    errors = [problem for problem in problems if problem.severity == "error"]
    assert [problem.code for problem in errors] == ["E-BOARD-SENSOR"]
    assert "'s4' is one more" in errors[0].cause


@pytest.mark.parametrize("include", ["book_2wd_stock"])
@pytest.mark.parametrize(
    ("real", "listens", "refused", "warned"),
    [
        (False, True, [], ["W-BOARD-SENSOR"]),  # the simulator has it
        (True, False, [], ["W-BOARD-SENSOR"]),  # no wire from it
        (True, True, ["E-BOARD-SENSOR"], []),
    ],
)
def test_a_second_distance_sensor_on_a_board(tmp_path, include, real, listens, refused, warned):
    (tmp_path / "two.yaml").write_text(TWO % include)
    file = tmp_path / "mine.yaml"
    file.write_text(
        "format: 1\nkind: pipeline\ninclude: goal\nblocks:\n"
        f"  range: {{in: {{volts: robot.{'rear' if listens else 'front'}}}}}\n"
    )
    problems = check(str(file), str(tmp_path / "two.yaml"), [], real=real)
    errors = [problem for problem in problems if problem.severity == "error"]
    assert [problem.code for problem in errors] == refused
    assert [
        problem.code for problem in problems if "BOARD-SENSOR" in problem.code
    ] == refused + warned
    if refused:
        assert errors[0].line == 5 and "'range' uses the sensor 'rear'" in errors[0].cause


# 65 mm wheel, 20 slots: pitch pi * 65 / 20 = 10.21 mm, / sqrt(12) = 2.947 mm.
@pytest.mark.parametrize(
    "has_edge_times, protocol, millimetres",
    [
        (True, "diffbot", 1.474),
        (False, "diffbot", 2.947),
        (False, "rosserial", 6.910),  # hypot(2.947, 0.25 m/s * 25 ms = 6.25 mm)
    ],
)
def test_resolution_of_odometry(has_edge_times, protocol, millimetres):
    stddev = resolution(0.065, 20, 0.25, has_edge_times, protocol)
    assert stddev * 1000 == pytest.approx(millimetres, abs=0.001)


@pytest.mark.parametrize(
    "robot, warnings",
    [("book_2wd", []), ("book_2wd_counts", []), ("book_2wd_stock", ["W-TOLERANCE"])],
)
def test_ten_millimetres_warn_only_on_the_stock_board(robot, warnings):
    assert [warning.code for warning in load("goal", robot).warnings] == warnings


@pytest.mark.parametrize(
    "sources, expected",
    [
        ({}, []),
        ({"a": []}, []),
        ({"a": ["b"], "b": []}, []),
        ({"a": ["a"]}, [["a"]]),
        ({"a": ["b"], "b": ["a"]}, [["a", "b"]]),
        ({"a": ["b", "c"], "b": ["c"], "c": []}, []),  # a diamond is no loop
        ({"a": ["nowhere"]}, []),
        ({"x": ["a"], "a": ["b"], "b": ["a"]}, [["a", "b"]]),  # x is not in the loop
        ({"a": ["a"], "b": ["c"], "c": ["b"]}, [["a"], ["b", "c"]]),
        (
            {"a": ["b", "c"], "b": ["a"], "c": ["a"]},
            [["a", "b"]],
        ),
    ],
)
def test_loops(sources, expected):
    assert [sorted(loop) for loop in graph.loops(sources)] == expected


@pytest.mark.parametrize(
    "board, role, protocol, pins",
    [
        (BOARDS["mega2560"], "interrupt", "diffbot", "2 3 18 19 20 21"),
        # The clock of our firmware is timer 1 (11, 12), that of the Arduino core timer 0 (4, 13).
        (BOARDS["mega2560"], "pwm", "diffbot", "2 3 4 5 6 7 8 9 10 13 44 45 46"),
        (BOARDS["mega2560"], "pwm", "rosserial", "2 3 5 6 7 8 9 10 11 12 44 45 46"),
        (BOARDS["nano"], "interrupt", "rosserial", "2 3"),
        (BOARDS["nano"], "pwm", "rosserial", "3 9 10 11"),  # 5 and 6 use the timer of the clock
        (BOARDS["nano"], "pwm", "diffbot", "5 6 9 10"),  # 3 and 11 use the timer of the clock
        (BOARDS["nano"], "analog", "rosserial", "A0 A1 A2 A3 A4 A5 A6 A7"),
    ],
)
def test_pins_for_each_role(board, role, protocol, pins):
    assert pins_for(board, role, protocol) == pins.split()


@pytest.mark.parametrize("board", BOARDS.values(), ids=BOARDS)
def test_the_tables_contain_only_pins_of_the_board(board):
    for pin in (*board.pwm, *board.interrupts, *board.analog_only):
        assert board.has(pin)
    for pins in board.uarts.values():
        assert all(board.has(pin) for pin in pins)
    if not board.shares_pwm:  # the clock of a Pico is none of its PWM units
        assert set(board.clock_timer.values()) <= set(board.pwm.values())
    assert all(set(ports) <= set(board.uarts) for ports in board.links.values())


@pytest.mark.parametrize(
    "board, number, name",
    [
        (BOARDS["mega2560"], "54", "A0"),
        (BOARDS["mega2560"], "69", "A15"),
        (BOARDS["mega2560"], "70", "70"),
        (BOARDS["mega2560"], "A3", "A3"),
        (BOARDS["nano"], "14", "A0"),
        (BOARDS["nano"], "13", "13"),
    ],
)
def test_analog_pins_have_two_names(board, number, name):
    assert board.named(number) == name


@pytest.mark.parametrize(
    ("standby", "codes"), [("", ["W-DRIVER-STANDBY"]), (", standby: none", [])]
)
def test_a_tb6612_needs_its_standby_input_stated(tmp_path, standby, codes):
    file = tmp_path / "kit.yaml"
    motor = f"drive: {{motor: {{driver: tb6612, idle: coast{standby}}}}}"
    file.write_text(f"format: 1\nkind: robot\ninclude: book_2wd\n{motor}\nboard: {{supply: usb}}\n")
    found = [problem for problem in check("goal", str(file), ()) if "STANDBY" in problem.code]
    assert [problem.code for problem in found] == codes
    assert all("standby: none" in problem.fix for problem in found)
