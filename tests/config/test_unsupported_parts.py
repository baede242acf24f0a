"""Parts that a robot file cannot name: each is answered with what comes nearest."""

import pytest

from diffbotctl.config.load import check
from diffbotctl.config.unsupported_parts import PARTS, unsupported_part


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
        ("drive: {motor: {driver: TB6612FNG}}", "allowed values", "did you mean tb6612?"),
        ("drive: {motor: {driver: TB6621}}", "allowed values", "did you mean tb6612?"),
        ("drive: {motor: {driver: L293D}}", "0.6 A", "driver: l298n"),
        ("drive: {motor: {driver: l289n}}", "allowed values", "did you mean l298n?"),
        ("drive: {right: {encoder: none}}", "one wheel has an encoder", "the other one"),
        ("sensors: {front: {type: GP2Y0A21YK0F}}", "allowed values", "sharp_gp2y0a21yk0f"),
        ("sensors: {front: {type: HC-SR04}}", "allowed values", "did you mean hc_sr04?"),
        (
            "sensors: {front: {type: rplidar a1}}",
            "only the place of a laser scanner",
            "driver: lidar",
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
