"""Motor drivers of each kind: the robot file, the firmware on each board, and their checks."""

import pytest

from diffbotctl.config.board_pins import BOARDS
from diffbotctl.config.load import check, load_robot
from diffbotctl.config.motor_drivers import MOTOR_DRIVERS
from diffbotctl.drivers.robot_link import board_settings
from diffbotctl.emulator.emulated_robot import EmulatedRobotDriver, emulated_board
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.messages import Duty, Encoders
from diffbotctl.render.harness import harness, notes
from diffbotctl.render.wiring_svg import wiring_svg
from diffbotctl.time import MILLISECOND, SECOND
from tests.sampling import by_day, each_once
from tests.support.board_bench import BoardBench, speed
from tests.support.virtual_board import diffbotctl, flat

# Pins with PWM on both boards: 5, 6, 9 and 10.
PINS = {
    "enable_in1_in2": ("{enable: 5, in1: 7, in2: 8}", "{enable: 6, in1: 9, in2: 10}"),
    "enable_direction": ("{enable: 5, in1: 7, in2: none}", "{enable: 6, in1: 9, in2: none}"),
    "two_pwm": ("{enable: none, in1: 5, in2: 6}", "{enable: none, in1: 9, in2: 10}"),
}

# A driver of each kind that the firmware distinguishes.
KINDS = ["l298n", "tb6612", "drv8838", "drv8833"]


def robot(folder, driver, board="uno", standby="none", idle=""):
    """The book's robot with another driver."""
    facts = MOTOR_DRIVERS[driver]
    left, right = PINS[facts.mode]
    idle = idle or facts.rests[0]
    supply = ", supply: usb" if board == "pico" else ""  # it takes no battery
    uart = "{uart: 1}" if board == "mega2560" else "{uart: 0}"
    file = folder / f"{driver}.yaml"
    file.write_text(
        "format: 1\nkind: robot\ninclude: book_2wd\n"
        f"board: {{type: {board}{supply}}}\nlink: {uart}\n"
        f"drive:\n  motor: {{driver: {driver}, idle: {idle}, standby: {standby}}}\n"
        f"  left: {{motor: {left}}}\n  right: {{motor: {right}}}\n"
    )
    return file


def standby_of(driver):
    return "4" if MOTOR_DRIVERS[driver].standby else "none"


@pytest.mark.parametrize(
    ("driver", "board"),
    by_day(
        2, [("drv8838", "mega2560"), ("drv8833", "uno"), ("tb6612", "uno"), ("bts7960", "mega2560")]
    ),
)
def test_a_goal_on_the_emulated_board(tmp_path, driver, board):
    file = robot(tmp_path, driver, board, standby_of(driver))
    code, output = diffbotctl(
        "run", "goal", "--robot", file, "--port", "emulated", "--fast", "--quiet"
    )
    assert code == 0, output
    assert "goals 1 of 1 reached" in flat(output), output


@each_once(board=[name for name in BOARDS if name != "nano"], driver=KINDS)
def test_directions_rest_and_restart(tmp_path, driver, board):
    """Forward, backward and stopped, by the truth table of the data sheet."""
    facts = MOTOR_DRIVERS[driver]
    file = robot(tmp_path, driver, board, standby_of(driver))
    settings = board_settings(load_robot(str(file)).robot)
    with BoardBench(settings=settings) as bench:
        bench.ready()
        for number, (left, right) in enumerate(
            [(0.5, 0.7), (-0.4, -1.0), (0.3, -0.2), (-0.6, 1.0)]
        ):
            one = frames.DUTY_ONE
            bench.send(1, frames.DutyFrame(number, round(left * one), round(right * one)))
            bench.wait(25)
            assert bench.duty == pytest.approx([left, right], abs=1 / 255)
        bench.send(1, frames.StopFrame(1))
        bench.wait(40)
        assert bench.duty == [0.0, 0.0]
        always = facts.rests == ("brake",)
        brakes = settings.driver is frames.DriverCode.PULSED_INPUTS or always
        assert {change.motor: change.shorted for change in bench.changes} == {0: brakes, 1: brakes}
        bench.wait(400)  # at rest for 0.3 s
        assert {change.motor: change.shorted for change in bench.changes} == {0: always, 1: always}
        bench.claim()  # the dead-man's time has passed
        bench.send(1, frames.DutyFrame(5, 20_000, 20_000))
        bench.wait(40)
        assert all(bench.duty)
        bench.emulator.reset()
        bench.wait(20)
        assert bench.duty == [0.0, 0.0]


@pytest.mark.parametrize("driver", [d for d in KINDS if len(MOTOR_DRIVERS[d].rests) == 2])
def test_brake_at_rest(tmp_path, driver):
    """`idle: brake` shorts the motor on each driver that can also coast."""
    file = robot(tmp_path, driver, "mega2560", standby_of(driver), idle="brake")
    with BoardBench(settings=board_settings(load_robot(str(file)).robot)) as bench:
        bench.ready()
        bench.send(1, speed(1, 5, 5))
        bench.wait(40)
        bench.changes.clear()
        bench.send(1, frames.StopFrame(2))
        bench.wait(40)
        assert {change.motor: (change.duty, change.shorted) for change in bench.changes} == {
            0: (0.0, 1.0),
            1: (0.0, 1.0),
        }


def test_a_hung_program_releases_two_pwm_inputs(tmp_path):
    """After 100 ms from an interrupt; one that hangs in an interrupt, by the watchdog."""
    file = robot(tmp_path, "drv8833")
    with BoardBench(settings=board_settings(load_robot(str(file)).robot)) as bench:
        bench.ready()
        bench.send(1, speed(1, 5, 5))
        bench.wait(40.4)
        assert all(bench.duty)
        bench.emulator.hang()
        bench.wait(150)
        assert bench.duty == [0.0, 0.0]


@pytest.mark.parametrize(
    ("driver", "standby", "rest", "cause"),
    [
        ("drv8833", "none", "  left: {motor: {enable: 4}}", "two PWM inputs"),
        ("tb6612", "none", "  left: {motor: {in2: none}}", "can omit this pin"),
        ("drv8838", "none", "  right: {motor: {in2: 4}}", "a direction input"),
        ("l298n", "4", "", "no standby input"),
        ("drv8838", "none", "  motor: {idle: coast}", "shorts the motors at rest"),
        ("l298p", "none", "  motor: {idle: brake}", "it cannot brake"),
        ("tb6612", "4", "board: {supply: regulator}", "no 5 V regulator"),
        ("drv8833", "none", "  right: {motor: {driver: tb6612, enable: 3, idle: coast}}", "driver"),
        ("drv8833", "none", "  left: {motor: {in1: 7}}", "no PWM"),
    ],
)
def test_what_does_not_suit_the_driver(tmp_path, driver, standby, rest, cause):
    base = robot(tmp_path, driver, standby=standby)
    file = tmp_path / "wrong.yaml"
    section = rest if rest.startswith("board") else f"drive:\n{rest}" if rest else ""
    file.write_text(f"format: 1\nkind: robot\ninclude: {base}\n{section}\n")
    causes = [p.cause for p in check("goal", str(file), ()) if p.severity == "error"]
    assert any(cause in each for each in causes), causes


@pytest.mark.parametrize("driver", MOTOR_DRIVERS)
def test_the_wiring_names_every_input(tmp_path, driver):
    facts = MOTOR_DRIVERS[driver]
    robot_file = load_robot(str(robot(tmp_path, driver, standby=standby_of(driver)))).robot
    wires = harness(robot_file)
    names = {pin.name for wire in wires.wires for pin in (wire.start, wire.end)}
    for half in (facts.left, facts.right):
        assert set(filter(None, half)) <= names
    assert (facts.standby is None) or facts.standby in names
    assert facts.title in " ".join(notes(robot_file))
    assert facts.title in wiring_svg(wires, notes(robot_file), driver)


@pytest.mark.parametrize("driver", MOTOR_DRIVERS)
def test_a_row_is_complete(tmp_path, driver):
    """Figures within reason, a state for each input, and a robot file without an error."""
    facts = MOTOR_DRIVERS[driver]
    low, high = facts.supply
    assert 0 < low < high <= 45 and 0 < facts.current <= 43 and 0 < facts.bridge.drop(1.0) <= 3.2
    expected = {
        "enable_in1_in2": {"enable_low", "both_low", "both_high"},
        "enable_direction": {"enable_low"},
        "two_pwm": {"both_low", "both_high"},
    }
    assert facts.states.keys() == expected[facts.mode]
    assert set(facts.states.values()) <= {"open", "shorted"}
    for half in (facts.left, facts.right):
        absent = {"enable", "in1", "in2"} - set(facts.inputs())
        assert {name for name in absent if getattr(half, name) is None} == absent
    file = robot(tmp_path, driver, standby=standby_of(driver))
    assert [p.cause for p in check("goal", str(file), ()) if p.severity == "error"] == []


def test_an_emulated_board_brakes_and_coasts_in_the_plant(tmp_path):
    """The bridge that the firmware switches decides how far the wheels roll on."""
    rolled = {}
    for idle in ("coast", "brake"):
        (tmp_path / idle).mkdir()
        base = robot(tmp_path / idle, "tb6612", "mega2560", "4", idle=idle)
        text = base.read_text() + "simulation: {equations: torque}\n"
        base.write_text(text)
        loaded = load_robot(str(base)).robot
        board = emulated_board(loaded, 1)
        try:
            board.plant._shorted = (idle != "brake", idle != "brake")  # the board reports otherwise
            rolled[idle] = _roll_on(board)
        finally:
            board.emulator.close()
    assert rolled["brake"] < 0.7 * rolled["coast"], rolled


def _roll_on(board):
    """Angle (rad) of the left wheel after its drive of half a second has ended."""
    driver = EmulatedRobotDriver(board, DiffbotHost(board.settings))
    ended = start = None
    for now in range(0, 5 * SECOND, 25 * MILLISECOND):
        delivered = driver.deliver(now)
        if start is None and any(isinstance(d.message, Encoders) for d in delivered):
            start = now
        if start is None:
            continue
        if now < start + SECOND:
            driver.command(now, Duty(now, 0.8, 0.8))
        elif ended is None:
            driver.command(now, Duty(now, 0.0, 0.0))
            ended = board.plant.truth().left_angle
            until = now + 2 * SECOND
        elif now > until:
            return abs(board.plant.truth().left_angle - ended)
    raise AssertionError("the board did not come up")
