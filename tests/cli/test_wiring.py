"""The wiring pictures agree with the robot file, pin for pin, and so does the table."""

import re
from xml.etree import ElementTree

import pytest
from rich.console import Console

from diffbotctl.cli import new, wiring
from diffbotctl.cli.new import kits
from diffbotctl.config import lookup
from diffbotctl.config.board_pins import BOARDS
from diffbotctl.config.load import load_robot
from diffbotctl.config.motor_drivers import MOTOR_DRIVERS
from diffbotctl.errors import UserError
from diffbotctl.render.harness import BOARD, DRIVER, IMU, MEANINGS, RADIO, RAILED, harness, notes
from diffbotctl.render.wiring_svg import BOXES, PAINTS, wiring_svg
from diffbotctl.render.wiring_terminal import STYLES, wiring_text
from tests.command_result import invoke

# Written by hand from robots/book_2wd.yaml: pin of the Mega 2560, part, its pin, colour.
BOOK = {
    ("5", "L298N", "ENA", "orange"),
    ("6", "L298N", "IN1", "green"),
    ("7", "L298N", "IN2", "blue"),
    ("8", "L298N", "ENB", "orange"),
    ("9", "L298N", "IN3", "green"),
    ("10", "L298N", "IN4", "blue"),
    ("VIN", "L298N", "12V", "red"),
    ("GND", "L298N", "GND", "black"),
    ("5V", "HC-05", "VCC", "red"),
    ("GND", "HC-05", "GND", "black"),
    ("19", "HC-05", "TXD", "grey"),  # uart: 1 is RX1 on 19 and TX1 on 18 (pinout of the Mega)
    ("18", "HC-05", "RXD", "brown"),
    ("5V", "left encoder", "VCC", "red"),
    ("GND", "left encoder", "GND", "black"),
    ("2", "left encoder", "OUT", "purple"),
    ("5V", "right encoder", "VCC", "red"),
    ("GND", "right encoder", "GND", "black"),
    ("3", "right encoder", "OUT", "purple"),
    ("5V", "front: Sharp", "VCC", "red"),
    ("GND", "front: Sharp", "GND", "black"),
    ("A0", "front: Sharp", "Vo", "yellow"),
}
# Robots that put parts where book_2wd has none.
OTHERS = {
    "button, two sensors, other port and sides": """
board: {stop_button: 22, supply: regulator}
link: {uart: 0, radio: hc05}
sensors:
  front: {pin: A3}
  rear_of_the_robot: {type: sharp_gp2y0a41sk0f, pin: 55}
drive:
  left: {motor: {enable: 46, in1: 30, in2: 31}, encoder: {pin: 20}}
  right: {motor: {enable: 45}, encoder: {pin: 21}}
""",
    "encoders where another robot's radio sits": """
board: {edge_times: false, telemetry: 16 Hz}
link: {protocol: rosserial, uart: 2, command_delay: 100 ms}
drive: {left: {encoder: {pin: 18}}, right: {encoder: {pin: 19}}}
limits: {speed: 0.25 m/s, acceleration: 0.4 m/s2, braking: 0.4 m/s2}
""",
    "cable, no divider needed": "link: {uart: 0}\nboard: {supply: usb}\n",
    "Nano": """
board: {type: nano, edge_times: false, telemetry: 16 Hz}
link: {protocol: rosserial, uart: 0, radio: hc05, baud: 57600}
drive:
  left: {motor: {enable: 10, in1: 6, in2: 7}, encoder: {pin: 2}}
  right: {motor: {enable: 9, in1: 8, in2: 11}, encoder: {pin: 3}}
""",
}


def has_board(name):
    """Whether a shipped robot has a board, and does not live in the simulator alone."""
    return load_robot(name).robot.board.type in BOARDS


@pytest.fixture(params=[*filter(has_board, lookup.names("robots")), *OTHERS])
def robot(request, tmp_path):
    """Every shipped robot, and those above."""
    if request.param not in OTHERS:
        return load_robot(request.param).robot
    file = tmp_path / "robot.yaml"
    file.write_text("format: 1\nkind: robot\ninclude: book_2wd\n" + OTHERS[request.param])
    return load_robot(str(file)).robot


def expected(robot):
    """Every wire at the board's pins as the robot file's own fields say it."""
    board = BOARDS[robot.board.type]
    found = {("GND", "L298N", "GND", "black")}
    if robot.board.supply != "usb":
        pins = {"vin": ("VIN", "12V"), "regulator": ("5V", "5V")}[robot.board.supply]
        found.add((pins[0], "L298N", pins[1], "red"))
    supplied = []
    for side, names in (("left", ("ENA", "IN1", "IN2")), ("right", ("ENB", "IN3", "IN4"))):
        motor = getattr(robot.drive, side).motor
        colours = ("orange", "green", "blue")
        pins = zip((motor.enable, motor.in1, motor.in2), names, colours, strict=True)
        found |= {(board.named(str(pin)), "L298N", name, colour) for pin, name, colour in pins}
        encoder = getattr(robot.drive, side).encoder
        found.add((board.named(str(encoder.pin)), f"{side} encoder", "OUT", "purple"))
        supplied.append(f"{side} encoder")
    for name, sensor in robot.sensors.items():
        found.add((board.named(str(sensor.pin)), f"{name}: Sharp", "Vo", "yellow"))
        supplied.append(f"{name}: Sharp")
    if robot.link.uart or robot.link.radio == "hc05":
        receive, transmit = board.uarts[robot.link.uart]
        found |= {(receive, "HC-05", "TXD", "grey"), (transmit, "HC-05", "RXD", "brown")}
        supplied.append("HC-05")
    if robot.board.stop_button:
        found.add((board.named(str(robot.board.stop_button)), "stop button", "1", "white"))
        found.add(("GND", "stop button", "2", "black"))
    for part in supplied:
        found |= {("5V", part, "VCC", "red"), ("GND", part, "GND", "black")}
    return found


def test_the_book_s_robot_by_hand():
    assert expected(load_robot("book_2wd").robot) == BOOK


def bare(label):
    """`TX1 18` is pin 18."""
    return re.sub(r"^[RT]X\d? ", "", label)


# The SVG: a wire's two ends lie on two pins, whose names stand beside them.


def drawn(svg):
    """(board pin, part, its pin, colour) of every drawn wire that ends at the board."""
    names = {paint: colour for colour, paint in PAINTS.items()}
    pins, boards = {}, {}
    part = None
    for element in ElementTree.fromstring(svg):
        tag, kind = element.tag.rpartition("}")[2], element.get("class")
        if tag == "text" and kind == "part":
            part = element.text
        elif tag == "circle" and element.get("stroke"):
            at = float(element.get("cx")), float(element.get("cy"))
        elif tag == "text" and kind == "pin":
            assert abs(float(element.get("y")) - at[1]) <= 6
            assert abs(float(element.get("x")) - at[0]) <= 15
            pins[at] = (part, element.text)
    for element in ElementTree.fromstring(svg):
        if element.get("class") == "wire" and "h" not in element.get("d"):
            x, start, turns, last = re.fullmatch(
                r"M(\d+) (\d+)((?: H\d+ V\d+)?) H(\d+)", element.get("d")
            ).groups()
            end = turns.split("V")[-1] if turns else start
            ends = pins[float(x), float(start)], pins[float(last), float(end)]
            colour = names[element.get("stroke")]
            boards.setdefault(colour, []).append(ends)
    for colour, wires in boards.items():
        for one, other in wires:
            if one[0] in TITLES:
                yield (bare(one[1]), *other, colour)
            elif other[0] in TITLES:
                yield (bare(other[1]), *one, colour)


TITLES = {board.title for board in BOARDS.values()}


def test_the_svg_shows_every_wire_and_no_other(robot):
    assert sorted(drawn(wiring_svg(harness(robot), notes(robot), "it"))) == sorted(expected(robot))


def test_the_svg_stays_on_its_paper(robot):
    root = ElementTree.fromstring(wiring_svg(harness(robot), notes(robot), "<a> & b"))
    width, height = float(root.get("width")), float(root.get("height"))
    for element in root:
        for name, most in (("x", width), ("cx", width), ("y", height), ("cy", height)):
            assert 0 <= float(element.get(name, 0)) < most
    assert root[2].text == "<a> & b"


# The terminal: lines are followed from the board's pins to wherever they lead.

OPEN = {
    "─": "EW",
    "│": "NS",
    "┼": "NESW",
    "╰": "NE",
    "╯": "NW",
    "├": "E",
    "┤": "W",
    "1": "EW",
    "k": "EW",
}
STEPS = {"N": (0, -1), "S": (0, 1), "E": (1, 0), "W": (-1, 0)}
BACK = {"N": "S", "S": "N", "E": "W", "W": "E"}


def lines_of(robot):
    console = Console(width=80, force_terminal=False, record=False)
    with console.capture() as capture:
        console.print(wiring_text(harness(robot)))
    return capture.get().splitlines()


def leads(lines, x, y, heading):
    """Every place where the line that leaves (x, y) ends at a part's wall."""
    seen, open_ends = set(), [(x, y, heading)]
    while open_ends:
        x, y, heading = open_ends.pop()
        x, y = x + STEPS[heading][0], y + STEPS[heading][1]
        sign = lines[y][x] if x < len(lines[y]) else " "
        if (x, y, heading) in seen or sign == "2":  # a resistor to ground is no way on
            continue
        seen.add((x, y, heading))
        if sign in "├┤":
            yield x, y
            continue
        ways = "NESW" if sign == "●" else OPEN.get(sign, "")
        if BACK[heading] not in ways:
            continue  # something else that passes by
        if sign in "┼1k":
            ways = heading  # straight on
        open_ends += [(x, y, way) for way in ways if way != BACK[heading]]


def part_at(lines, x, y, right):
    """Title of the box whose wall stands at (x, y), and the pin's name there."""
    first, last = next(box for box in BOXES_OF_TERMINAL if x in box)
    inside = lines[y][first + 1 : last].strip()
    halves = re.split(r"\s{2,}", inside)
    name = halves[-1] if right else halves[0]
    top = next(row for row in range(y, -1, -1) if lines[row][first] == "╭")
    return lines[top][first + 1 : last].strip("─ "), name


BOXES_OF_TERMINAL = ((0, 12), (15, 34), (38, 51), (64, 79))


def followed(lines):
    """(board pin, part, its pin) for all that the board's walls lead to."""
    first, last = BOXES_OF_TERMINAL[2]
    for y, line in enumerate(lines):
        for x, sign, heading in ((first, "┤", "W"), (last, "├", "E")):
            if line[x : x + 1] == sign:
                _, pin = part_at(lines, x, y, right=heading == "E")
                for end in leads(lines, x, y, heading):
                    yield (bare(pin), *part_at(lines, *end, right=heading == "W"))


def test_the_lines_in_the_terminal_lead_where_the_file_states(robot):
    lines = lines_of(robot)
    target = {(pin, shortened(part), name) for pin, part, name, _ in expected(robot)}
    assert set(followed(lines)) == target
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize("name", kits())
@pytest.mark.usefixtures("empty_folder")
def test_the_lines_in_the_terminal_lead_where_a_kit_s_harness_does(name):
    invoke(new.new, "robot", "--kit", name)
    robot = load_robot(name).robot
    wires = harness(robot)
    target = set()
    for wire in wires.of(*wires.parts):
        for board, other in ((wire.start, wire.end), (wire.end, wire.start)):
            if board.part == BOARD and wire.colour not in RAILED:
                pin = bare(wires.printed.get(board.name, board.name))
                target.add((pin, shortened(wires.parts[other.part].title), other.name))
    lines = lines_of(robot)
    assert set(followed(lines)) >= target
    assert max(map(len, lines)) <= 80


def test_each_colour_of_a_wire_can_be_drawn():
    assert MEANINGS.keys() == STYLES.keys() == PAINTS.keys()


@pytest.mark.parametrize(
    ("driver", "pin"),
    [("drv8833", "nSLEEP"), ("drv8835", "MODE"), ("bts7960", "R_EN, L_EN")],
)
def test_an_input_that_must_be_high_is_wired(tmp_path, driver, pin):
    """Without it the driver is asleep, or takes its inputs for those of another mode."""
    two_pwm = MOTOR_DRIVERS[driver].mode == "two_pwm"
    inputs = ("in1: 7, in2: 8, enable: none", "in1: 9, in2: 10, enable: none")
    left, right = inputs if two_pwm else ("enable: 7, in1: 22, in2: none", "enable: 8, in2: none")
    file = tmp_path / "robot.yaml"
    file.write_text(
        "format: 1\nkind: robot\ninclude: book_2wd\nbattery: {full: 8.4 V}\n"
        f"drive:\n  motor: {{driver: {driver}, idle: brake}}\n"
        f"  left: {{motor: {{{left}}}}}\n  right: {{motor: {{{right}}}}}\n"
    )
    wires = harness(load_robot(str(file)).robot).wires
    assert {wire.start for wire in wires if wire.end == (DRIVER, pin)} == {(BOARD, "5V")}


def shortened(title):
    """As it fits the 14 columns of a box on the right."""
    return title if len(title) <= 14 else title[:13] + "…"


def test_the_divider_is_drawn_where_there_is_one(tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text("format: 1\nkind: robot\ninclude: book_2wd\nlink: {level: direct}\n")
    assert sum("─1k─●──┤ RXD" in line for line in lines_of(load_robot("book_2wd").robot)) == 1
    assert sum("●─2k─╯" in line for line in lines_of(load_robot("book_2wd").robot)) == 1
    assert not any("k" in line[52:64] for line in lines_of(load_robot(str(file)).robot))


def test_a_divided_wire_shows_its_divider(robot):
    wire = [wire for wire in harness(robot).wires if wire.end == (RADIO, "RXD")]
    assert all(each.start.part == BOARD and each.through.series == "1k" for each in wire)
    assert len(wire) == bool(robot.link.uart or robot.link.radio)


@pytest.mark.parametrize(
    ("battery", "series"),
    [
        # full / 5 V x 1.1 - 1 = 0.848, and the next larger value of E24 for 10 kOhm below
        ("{pin: A1, full: 8.4 V}", "9k1"),
        ("{pin: A1, divider: 3.02}", "20k"),
        ("{pin: A1}", "18k"),  # 12.6 V: 1.77
    ],
)
def test_the_divider_of_the_battery_is_drawn(tmp_path, battery, series):
    file = tmp_path / "robot.yaml"
    file.write_text(f"format: 1\nkind: robot\ninclude: book_2wd\nbattery: {battery}\n")
    robot = load_robot(str(file)).robot
    lines = lines_of(robot)
    above = next(i for i, line in enumerate(lines) if f"●{series}┤ +" in line)
    assert "A1 ├" in lines[above] and "●10k╯" in lines[above + 1]
    assert any(f"{series} from the battery's + to A1" in note for note in notes(robot))


# The command.


def run(*words):
    return invoke(wiring.wiring, *words)[1]


def test_the_command_fits_eighty_columns_and_names_every_wire():
    output = run("book_2wd")
    assert max(map(len, output.splitlines())) <= 80
    table = output[output.index("from  ") :]
    for pin, part, name, colour in BOOK:
        ends = {f"Mega 2560 {pin}", f"{part} {name}"}
        rows = [set(re.split(r"\s{2,}", line)[:3]) for line in table.splitlines()]
        assert ends | {colour} in rows


@pytest.mark.parametrize(
    "words",
    [
        "Remove the jumpers ENA and ENB from",
        "Connect the grounds of battery",
        "at most 35 V",
        "2 kOhm",
    ],
)
def test_what_no_wire_shows_is_noted(words):
    assert words in run("book_2wd")


def test_it_warns_as_check_does(tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text("format: 1\nkind: robot\ninclude: book_2wd\nbattery: {full: 14.8 V}\n")
    assert "W-WIRING-SUPPLY" in run(str(file), "--table")


def test_each_shipped_robot_has_a_picture_or_states_why_not(tmp_path):
    for name in lookup.names("robots"):
        if has_board(name):
            assert "common ground" in run(name)
        else:
            with pytest.raises(UserError, match="has no wires"):
                run(name)


def test_the_svg_is_written(tmp_path):
    path = tmp_path / "wiring.svg"
    assert run("book_2wd", "--output", str(path)) == f"written: {path}\n"
    assert {row[:3] for row in drawn(path.read_text())} == {row[:3] for row in BOOK}
    with pytest.raises(UserError) as raised:
        run("book_2wd", "--output", str(tmp_path / "no" / "wiring.svg"))
    assert raised.value.problems[0].code == "E-OUTPUT"


def test_the_columns_of_the_drawing_do_not_touch():
    edges = [edge for box in BOXES for edge in box]
    assert edges == sorted(set(edges))


@pytest.mark.parametrize(
    ("imu", "wires"),
    [
        ("{type: mpu6050}", {("5V", "VCC"), ("GND", "GND"), ("20", "SDA"), ("21", "SCL")}),
        (
            "{type: mpu6050, address: 105}",
            {("5V", "VCC"), ("GND", "GND"), ("20", "SDA"), ("21", "SCL"), ("3.3V", "AD0")},
        ),
        (
            "{type: lsm6dso}",
            {("5V", "VIN"), ("GND", "GND"), ("20", "SDA"), ("21", "SCL"), ("GND", "SA0")},
        ),
        (
            "{type: lsm6ds3, address: 107}",
            {("5V", "VIN"), ("GND", "GND"), ("20", "SDA"), ("21", "SCL"), ("3.3V", "SA0")},
        ),
    ],
)
def test_the_wires_of_an_imu(tmp_path, imu, wires):
    """Modules with an LSM6 differ in the level of SA0, so it is always wired."""
    file = tmp_path / "robot.yaml"
    text = "format: 1\nkind: robot\ninclude: book_2wd\nboard: {telemetry: 35 Hz}\n"
    file.write_text(f"{text}imu: {imu}\n")
    ends = [(wire.start, wire.end) for wire in harness(load_robot(str(file)).robot).wires]
    found = set()
    for pair in ends:
        pins = dict(pair)
        if IMU in pins and BOARD in pins:
            found.add((pins[BOARD], pins[IMU]))
    assert found == wires
