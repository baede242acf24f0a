"""Parts that a robot file cannot name: each is answered with what comes nearest."""

import pytest

from diffbotctl.config.load import check
from diffbotctl.config.motor_drivers import MODE_TEXT, MOTOR_DRIVERS, unknown_driver
from diffbotctl.config.unsupported_parts import unsupported_part, unsupported_parts


def problems(folder, line):
    file = folder / "kit.yaml"
    file.write_text(f"format: 1\nkind: robot\ninclude: book_2wd\n{line}\n")
    return [p for p in check("goal", str(file), ()) if p.severity == "error"]


@pytest.mark.parametrize(
    ("line", "cause", "fix"),
    [
        ("board: {type: ESP32}", "does not run on an ESP32", "Mega 2560, Uno, Nano or Pico"),
        ("board: {type: pico_w}", "allowed values", "did you mean pico?"),
        ("board: {type: Pico 2}", "RP2350", "Mega 2560, Uno, Nano or Pico"),
        ("board: {type: RP2040}", "the chip of a Pico", "type: pico"),
        ("board: {type: Raspberry Pi 4}", "the computer that runs", "mega2560, uno, nano or pico"),
        ("drive: {type: skid_steer}", "four that are switched in pairs", "wheelbase: the distance"),
        ("drive: {right: {encoder: none}}", "one wheel has an encoder", "the other one"),
        ("sensors: {front: {type: GP2Y0A21YK0F}}", "allowed values", "sharp_gp2y0a21yk0f"),
        ("sensors: {front: {type: HC-SR04}}", "allowed values", "did you mean hc_sr04?"),
        (
            "sensors: {front: {type: rplidar a2}}",
            "only A1 and C1 are supported",
            "type: rplidar_a1",
        ),
        ("sensors: {front: {type: sharp_gp2y0a41}}", "allowed values", "did you mean sharp"),
        ("imu: {type: GY-521}", "the gyro of a GY-521 is that of an MPU6050", "write mpu6050"),
        ("imu: {type: lsm6ds33}", "that of an LSM6DS3", "write lsm6ds3"),
        ("imu: {type: BNO055}", "other registers", "lsm6dso"),
        ("board: {type: mega}", "allowed values", "did you mean mega2560?"),
    ],
)
def test_a_part_is_answered_with_what_to_write(tmp_path, line, cause, fix):
    (problem,) = problems(tmp_path, line)
    assert cause in problem.cause
    assert fix in problem.fix


PARTS = unsupported_parts()


@pytest.mark.parametrize("field", PARTS)
def test_each_is_found_by_its_name_and_a_transposed_one(field):
    """Two neighbouring letters exchanged, in each place of names of at least six letters."""
    for name, part in PARTS[field].items():
        assert unsupported_part(field, name.upper(), ["l298n", "none"]) is part
        for at in range(len(name) - 1 if len(name) >= 6 else 0):
            swapped = name[:at] + name[at + 1] + name[at] + name[at + 2 :]
            assert unsupported_part(field, swapped, []) in PARTS[field].values(), swapped


@pytest.mark.parametrize("word", ["", "x", "!!", "zzzzzz", "l298n"])
def test_other_words_name_no_part(word):
    for field in PARTS:
        assert unsupported_part(field, word, ["l298n", "none"]) is None


def supported(driver):
    """The drivers with the same inputs, as the fix lists them."""
    mode = MOTOR_DRIVERS[driver].mode
    same = ", ".join(name for name, facts in MOTOR_DRIVERS.items() if facts.mode == mode)
    text = MODE_TEXT[mode]
    return f"{text[0].upper()}{text[1:]}: {same}"


@pytest.mark.parametrize(
    ("written", "driver"),
    [
        ("TB6612FNG", "tb6612"),
        ("DRV8871DDA", "drv8871"),
        ("A4950", "a4950"),
        ("AT8870", "drv8870"),
        ("HG7881", "l9110"),
        ("L9110S", "l9110"),
        ("IBT-2", "bts7960"),
        ("Monster Moto", "vnh2sp30"),
        ("MD10C R3", "mdd10a"),
        ("L298N mini", "mx1508"),
        ("L298N red mini module", "mx1508"),
        ("L298N MX1508", "mx1508"),
        ("L298N H-bridge dual motor driver 2A", "l298n"),
        ("Adafruit TB6612 breakout", "tb6612"),
        ("VNH5019A-E carrier", "vnh5019"),
        ("BTS7960 43A x2", "bts7960"),
        ("L298P shield", "l298p"),
        ("HR8833", "drv8833"),
    ],
)
def test_a_driver_by_another_name_is_answered_with_its_inputs(tmp_path, written, driver):
    (problem,) = problems(tmp_path, f"drive: {{motor: {{driver: {written}}}}}")
    inputs = MODE_TEXT[MOTOR_DRIVERS[driver].mode]
    assert problem.fix == f"did you mean {driver}? It has {inputs}"


@pytest.mark.parametrize(
    "written",
    [
        "DRV8842",
        "l289n",
        "TB6621",
        "drv883",
        "A4940",
        "x",
        "HW-230",
        "8833",
        "DRV8876 PH/EN",
        "DRV8876PHEN",
        "TB6612 shield",
        "Grove L298N",
        "ZK-BM10",
        "SLF8833",
    ],
)
def test_an_unknown_driver_is_not_answered_with_a_similar_name(tmp_path, written):
    (problem,) = problems(tmp_path, f"drive: {{motor: {{driver: {written}}}}}")
    assert "did you mean" not in problem.fix
    for driver in ("l298n", "drv8838", "drv8833"):
        assert supported(driver) in problem.fix


@pytest.mark.parametrize("driver", [*MOTOR_DRIVERS, "L298N", "TB6612FNG", "DRV 8833"])
@pytest.mark.parametrize("more", ["{} i3c", "PH/EN {}", "quad {}", "{} 74HC165", "{}-lookalike"])
def test_a_name_with_an_unknown_word_is_not_answered(driver, more):
    assert "did you mean" not in unknown_driver(more.format(driver)).fix


def test_no_number_of_a_family_is_answered_with_another_one():
    """A DRV8838 that is a DRV8837 in truth turns its motor at rest."""
    for number in range(8800, 8900):
        fix = unknown_driver(f"DRV{number}").fix
        suggested = fix.partition("did you mean ")[2].partition("?")[0]
        assert suggested in ("", f"drv{number}", {8872: "drv8871"}.get(number))


@pytest.mark.parametrize("written", ["Cytron", "L298"])
def test_a_name_of_drivers_with_different_inputs_lists_them(written):
    fix = unknown_driver(written).fix
    assert "did you mean" not in fix and fix.count(": ") >= 2


@pytest.mark.parametrize(
    ("written", "cause"),
    [
        ("A4988", "stepper motors"),
        ("DRV8825", "stepper motors"),
        ("PCA9685", "over I2C"),
        ("Adafruit Motor Shield", "over I2C"),
        ("L293D shield", "shift register"),
        ("L293 motor shield", "shift register"),
        ("Adafruit Motor Shield V1", "shift register"),
        ("Adafruit Motor Shield V2", "over I2C"),
        ("tb6612_i2c", "over I2C"),
        ("TB6612 motor featherwing", "over I2C"),
        ("TB6612FNG+PCA9685", "over I2C"),
        ("ULN2003A", "one direction only"),
        ("Sabertooth 2x12", "servo pulses"),
    ],
)
def test_a_driver_that_no_mode_fits_is_refused_with_its_reason(tmp_path, written, cause):
    (problem,) = problems(tmp_path, f"drive: {{motor: {{driver: {written}}}}}")
    assert cause in problem.cause
    assert problem.fix.startswith(("use a driver", "wire "))
