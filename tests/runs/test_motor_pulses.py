"""Pulses on enable and on the inputs: firmware, emulated boards and both plants agree."""

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.config.motor_drivers import MOTOR_DRIVERS
from diffbotctl.config.motor_pulses import driver_code
from diffbotctl.drivers.robot_link import board_settings
from diffbotctl.emulator.emulated_robot import emulated_board
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import encode
from diffbotctl.messages import Duty
from diffbotctl.plant.robot_parameters import firmware_levels, pulse_shares
from diffbotctl.plant.simulated_robot import draw_robot
from diffbotctl.time import MILLISECOND
from tests.sampling import each_once
from tests.support.board_bench import BoardBench

# A driver of each kind: open or shorted between the pulses on enable, a direction, two PWM inputs
# that short or open with both low. The firmware sees no other difference.
KINDS = ("l298n", "tb6612", "drv8838", "l298p", "drv8833", "l9110")
WIRES = {
    "enable_in1_in2": ("{enable: 5, in1: 6, in2: 7}", "{enable: 8, in1: 9, in2: 10}"),
    "enable_direction": ("{enable: 5, in1: 6, in2: none}", "{enable: 8, in1: 9, in2: none}"),
    "two_pwm": ("{enable: none, in1: 6, in2: 7}", "{enable: none, in1: 9, in2: 10}"),
}
MODES = [(driver, "none") for driver in KINDS] + [("l298n", "enable")]


def robot(folder, driver, pulses="none", board="mega2560", equations="torque", more=""):
    """The book's robot with another driver; simulated motors without a spread."""
    facts = MOTOR_DRIVERS[driver]
    left, right = WIRES[facts.mode]
    supply = ", supply: usb" if board == "pico" else ""
    uart = "{uart: 1}" if board == "mega2560" else "{uart: 0}"
    file = folder / "robot.yaml"
    file.write_text(
        "format: 1\nkind: robot\ninclude: book_2wd\n"
        f"board: {{type: {board}{supply}}}\nlink: {uart}\n"
        f"drive:\n  motor: {{driver: {driver}, pulses: {pulses}, idle: {facts.rests[0]}{more}}}\n"
        f"  left: {{motor: {left}}}\n  right: {{motor: {right}}}\n"
        f"simulation: {{equations: {equations}}}\n"
    )
    return load_robot(str(file)).robot


@each_once(mode=MODES, board=["mega2560", "pico"])
def test_the_pins_of_the_board_do_what_the_plant_assumes(tmp_path, mode, board):
    driver, pulses = mode
    made = robot(tmp_path, driver, pulses, board)
    facts, code = MOTOR_DRIVERS[driver], driver_code(made)
    with BoardBench(settings=board_settings(made)) as bench:
        bench.emulator.close()
        board_with_driver = emulated_board(made, 1)
        bench.emulator = board_with_driver.emulator
        bench.ready()
        for number, (left, right) in enumerate([(0.5, 0.25), (-0.75, 0.1), (1.0, -1.0)]):
            one = frames.DUTY_ONE
            bench.send(1, frames.DutyFrame(number, round(left * one), round(right * one)))
            bench.wait(25)
            last = {change.motor: change for change in bench.changes}
            for motor, duty, side in (
                (0, left, bench.settings.left),
                (1, right, bench.settings.right),
            ):
                levels = firmware_levels(code, -duty if side.reversed else duty, True)
                expected = pulse_shares(facts.states, levels)
                assert (last[motor].duty, last[motor].shorted) == pytest.approx(
                    expected, abs=1 / 255
                )


@each_once(mode=MODES, equations=["exponential", "torque"])
def test_the_emulated_board_turns_the_wheels_as_the_simulated_one(tmp_path, mode, equations):
    """Speeds at the end of a drive of two seconds."""
    driver, pulses = mode
    made = robot(tmp_path, driver, pulses, equations=equations)
    simulated, emulated = draw_robot(made, made, 1), emulated_board(made, 1)
    settings, one = board_settings(made), frames.DUTY_ONE
    emulated.advance(50 * MILLISECOND)
    for frame in (frames.AskFrame(frames.VERSION), settings.frame(), frames.StopFrame(15)):
        emulated.send(emulated.now, settings.uart, b"\0" + encode(frame))
        emulated.advance(emulated.now + 120 * MILLISECOND)
    for number in range(100):
        simulated.command(simulated.now, Duty(simulated.now, 0.5, 0.4))
        simulated.advance(simulated.now + 20 * MILLISECOND)
        frame = frames.DutyFrame(number & 15, round(0.5 * one), round(0.4 * one))
        emulated.send(emulated.now, settings.uart, encode(frame))
        emulated.advance(emulated.now + 20 * MILLISECOND)
    emulated.emulator.close()
    expected, found = simulated.truth(), emulated.plant.truth()
    assert expected.left_speed > 2.0
    assert found.left_speed == pytest.approx(expected.left_speed, rel=0.02)
    assert found.right_speed == pytest.approx(expected.right_speed, rel=0.02)
