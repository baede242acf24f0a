"""What no field of a file accepts: other digits, control characters, lists of a wrong length; and
the start of a simulated robot, and slots, that cannot be."""

import pytest

from diffbotctl.config.load import check

ONE_ERROR = "[0.01]"
TWENTY = "[" + ", ".join(["0.01"] * 20) + "]"


def errors(folder, robot="", pipeline=""):
    """The errors of the book's robot and the goal pipeline with these lines."""
    file = folder / "robot.yaml"
    file.write_text(f"format: 1\nkind: robot\ninclude: book_2wd\n{robot}\n")
    task = "goal"
    if pipeline:
        task = str(folder / "task.yaml")
        (folder / "task.yaml").write_text(f"format: 1\nkind: pipeline\ninclude: goal\n{pipeline}\n")
    return [each for each in check(task, str(file), ()) if each.severity == "error"]


@pytest.mark.parametrize(
    ("line", "fix"),
    [
        ("drive: {encoder: {slots: \u0662\u0660}}", "write 20"),  # Arabic
        ("drive: {encoder: {slots: \u096a\u0966}}", "write 40"),  # Devanagari
        ("drive: {encoder: {slots: \uff12\uff10}}", "write 20"),  # full width
        ("drive: {track: 0.\u0661\u0665}", "write 0.15"),
        ("sensors: {front: {at: [\u0660.\u0661, 0]}}", "write 0.1"),
        ("board: {stop_button: \u0664\u0664}", "write 44"),
        ("link: {baud: \u0669600}", "write 9600"),
        ("drive: {track: \u0661\u0665 cm}", "write 15 cm"),
        ("body: {width: \uff11\uff15cm}", "write 15cm"),
    ],
)
def test_digits_of_another_script_are_refused(tmp_path, line, fix):
    (problem,) = errors(tmp_path, line)
    assert fix in f"{problem.cause} {problem.fix}"
    assert problem.place.column > 1 and "^" in problem.render()


@pytest.mark.parametrize("quoted", ["'\u0662\u0660'", '"\u0662\u0660"'])
def test_quotes_do_not_make_them_a_number(tmp_path, quoted):
    (problem,) = errors(tmp_path, f"drive: {{encoder: {{slots: {quoted}}}}}")
    assert "not a whole number" in problem.cause


@pytest.mark.parametrize(
    "pipeline",
    [
        'sources: {scanner: {driver: lidar, with: {port: "/dev/tty\\0"}}}',
        'blocks: {mine: {program: "python3 a\\0b.py"}}',
        'blocks: {"mi\\0ne": {block: command_mux}}',
        'title: "a bell \\a"',
        'title: "\\e[2J"',
        'title: "next line \\N"',
    ],
)
def test_a_control_character_is_refused_wherever_it_is(tmp_path, pipeline):
    found = errors(tmp_path, pipeline=pipeline)
    assert found[0].code == "E-YAML-CONTROL" and "U+00" in found[0].cause
    assert found[0].place.line == 4 and "^" in found[0].render()


def test_a_tab_and_a_line_break_are_no_control_characters(tmp_path):
    assert "E-YAML-CONTROL" not in {each.code for each in errors(tmp_path, 'name: "a\\tb\\nc"')}


@pytest.mark.parametrize(
    ("world", "start", "is_refused"),
    [
        ("obstacles: [{at: [0, 0], radius: 10 cm}]", "", True),
        ("obstacles: [{at: [5 cm, 0], radius: 1 cm}]", "", True),
        ("obstacles: [{at: [1 m, 0], radius: 20 cm}]", "", False),
        ("obstacles: [{at: [1 m, 0], radius: 20 cm}]", "{x: 1 m}", True),
        ("walls: [{from: [-1 m, 2 cm], to: [1 m, 2 cm]}]", "", True),
        ("walls: [{from: [1 m, -1 m], to: [1 m, 1 m]}]", "", False),
        (
            "walls: [{from: [1 m, -1 m], to: [1 m, 1 m]}]",
            "{x: 1 m, y: 50 cm, heading: 90 deg}",
            True,
        ),
    ],
)
def test_a_start_inside_a_wall_or_obstacle_is_refused(tmp_path, world, start, is_refused):
    robot = f"simulation: {{start: {start}}}" if start else ""
    empty = ", ".join(f"{key}: []" for key in ("walls", "obstacles") if key not in world)
    found = errors(tmp_path, robot, f"world: {{{world}, {empty}}}\ngoals: []")
    assert [each.code for each in found] == (["E-START-WALL"] if is_refused else [])
    assert all("^" in each.render() for each in found)


TWO_CHANNELS = {
    "mega2560": (
        "board: {type: mega2560}",
        "left: {encoder: {pin: 2, pin_b: 22}}, right: {encoder: {pin: 3, pin_b: 23}}",
    ),
    "pico": (
        "board: {type: pico, supply: usb}\nlink: {uart: 0, radio: cable}\nsensors: {front: none}",
        "left: {encoder: {pin: 10, pin_b: 11}, motor: {enable: 2, in1: 3, in2: 4}}, "
        "right: {encoder: {pin: 12, pin_b: 13}, motor: {enable: 5, in1: 6, in2: 7}}",
    ),
}


@pytest.mark.parametrize(
    ("board", "slots", "rpm", "code", "figure"),
    [
        ("mega2560", 4254, 100, None, ""),
        ("mega2560", 6569, 100, None, ""),
        ("mega2560", 7300, 100, "E-ENCODER-FAST", "more than the 12,000 that a Mega 2560 counts"),
        ("mega2560", 65535, 10, None, ""),
        ("mega2560", 65536, 10, "E-BOUNDS", "at most 65535: the board keeps the counts per turn"),
        ("pico", 4254, 100, None, ""),
        ("pico", 6569, 100, None, ""),
        ("pico", 12100, 100, "E-ENCODER-FAST", "more than the 20,000 that a Pico counts"),
        ("pico", 16383, 50, None, ""),
        ("pico", 16384, 50, "E-ENCODER-FAST", "at most 65,535 counts per turn"),
    ],
)
def test_slots_are_bounded_by_what_the_board_counts(tmp_path, board, slots, rpm, code, figure):
    lines, sides = TWO_CHANNELS[board]
    drive = f"encoder: {{channels: 2, slots: {slots}}}, motor: {{rated: {rpm} rpm}}, {sides}"
    found = errors(tmp_path, f"{lines}\ndrive: {{{drive}}}")
    bounds = [each for each in found if each.code.startswith(("E-ENCODER", "E-BOUNDS"))]
    assert [each.code for each in bounds] == ([code] if code else [])
    assert all(figure in each.cause for each in bounds)
