"""The steps range and battery on a simulated robot that is other than stated."""

from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner

from diffbotctl.blocks.range_sensor import distance_at
from diffbotctl.calibrate.steps.battery import CHEMISTRIES, cell_range, divider_finding
from diffbotctl.cli.calibrate import calibrate as command
from diffbotctl.config.load import load, load_robot
from diffbotctl.config.lookup import simulated_copy_of
from diffbotctl.errors import RunError
from diffbotctl.plant.range_sensors import CURVE

SHIPPED = Path(__file__).parent.parent.parent / "robots" / "book_2wd.yaml"
ANSWERS = {
    "range.distance": {"measure": "ruler", "noise": "0.2 mm"},
    "battery.volts": {"measure": "meter"},
    "battery.chemistry": "lipo",
    "battery.cells": 2,
}


@pytest.fixture
def robot(tmp_path, monkeypatch):
    """A robot with a sensor 0.12 V off and a divider 6 % off; the battery is measured on A1."""
    monkeypatch.chdir(tmp_path)
    text = SHIPPED.read_text()
    for old, new in (
        ("offset: 0 V", "offset: 0.12 V"),
        ("\nlimits:", "\nbattery: {pin: A1, divider: 3}\nlimits:"),
        ("\n  slip:", "\n  battery: {divider_error: 0.06}\n  slip:"),
    ):
        assert old in text
        text = text.replace(old, new)
    Path("mine.yaml").write_text(text)
    return tmp_path / "mine.yaml"


def calibrated(robot):
    """The robot with the results of its simulated one."""
    return load_robot(str(simulated_copy_of(robot))).robot


def calibrate(step: str, answers=ANSWERS, *more: str):
    Path("answers.yaml").write_text(yaml.safe_dump(answers))
    words = [step, "--robot", "./mine.yaml", "--port", "sim", "--answers", "answers.yaml", "--yes"]
    return CliRunner().invoke(command, [*words, *more])


def test_the_sensor_s_block_reads_what_was_found(robot):
    before = robot.read_bytes()
    result = calibrate("range")
    assert result.exit_code == 0, result.output
    curve = calibrated(robot).sensors["front"].curve
    # The card stands where the rule shows it, to 0.2 mm; 3 mm to 20 cm, 2 % beyond, and that
    for place, volts in CURVE:
        if 0.04 <= place <= 0.30:
            distance = distance_at(volts + 0.12, curve.a, curve.b, curve.c)
            assert distance == pytest.approx(place, abs=max(0.003, 0.02 * place) + 0.0004)
    use = next(
        use for use in load("goal", str(simulated_copy_of(robot))).blocks if use.name == "range"
    )
    block = use.cls(**use.values)
    block.reset()
    assert block.curve == (curve.a, curve.b, curve.c)
    assert CliRunner().invoke(command, ["undo", "--robot", "./mine.simulated.yaml"]).exit_code == 0
    assert robot.read_bytes() == before and not calibrated(robot).calibration


def test_a_card_in_the_fold_is_named(robot):
    """The card stands at 7 cm instead of 4 cm, and the other way round: the voltage rises."""
    placed = {**ANSWERS, "range.distance": ["7 cm", "4 cm", "10 cm", "16 cm", "25 cm", "30 cm"]}
    result = calibrate("range", placed)
    assert isinstance(result.exception, RunError)
    assert "falls again" in str(result.exception.problems[0].cause)
    assert not calibrated(robot).calibration


def test_a_misread_distance_is_named_and_measured_again(robot):
    """12 cm typed for 10: without it the others fit."""
    typed = ["4 cm", "7 cm", "12 cm", "16 cm", "25 cm", "30 cm"]
    result = calibrate("range", {"range.distance": typed})
    assert result.exit_code == 0, result.output
    printed = " ".join(result.output.split())
    assert "Without the point at 10 cm the others fit, and by these the card stood at" in printed
    assert "not at 12 cm. Measure this point again." in printed
    assert "Put the card 10 cm from the sensor's front." in printed
    curve = calibrated(robot).sensors["front"].curve
    volts = dict(CURVE)[0.10] + 0.12
    assert distance_at(volts, curve.a, curve.b, curve.c) == pytest.approx(0.10, abs=0.003)


def test_a_distance_that_is_misread_again_is_refused_by_its_name(robot):
    typed = ["4 cm", "7 cm", "12 cm", "16 cm", "25 cm", "30 cm"]
    result = calibrate("range", {"range.distance": typed, "range.repeated_distance": "12 cm"})
    assert isinstance(result.exception, RunError)
    assert "without the point at 10 cm the others fit" in result.exception.problems[0].cause
    assert not calibrated(robot).calibration


def test_points_of_no_curve_are_reported_with_their_errors(robot):
    """Each of three is wrong; the curve's own deviation would be larger than half of it."""
    typed = ["4 cm", "9 cm", "9.5 cm", "20 cm", "22 cm", "40 cm"]
    result = calibrate("range", {"range.distance": typed})
    assert isinstance(result.exception, RunError), result.output
    assert "no curve of such a sensor fits these points" in result.exception.problems[0].cause


def test_a_distance_that_no_rule_shows_is_refused(robot):
    result = calibrate("range", {"range.distance": "4 m"})
    assert isinstance(result.exception, RunError)
    assert "is the unit cm?" in result.exception.problems[0].cause


def test_the_divider_follows_from_the_meter_s_reading(robot):
    """3 is stated, 3.18 true: the board sees less at its pin than it should."""
    result = calibrate("battery")
    assert result.exit_code == 0, result.output
    found = calibrated(robot)
    assert found.battery.divider == pytest.approx(3.18, rel=0.005)
    assert found.battery.low == pytest.approx(2 * 3.3)
    assert found.calibration["battery.divider"].volts == "7.6 V"


@pytest.mark.parametrize(
    "answers, words",
    [
        # 7.6 V at rest: two cells of at most 4.25 V, and of at least 3.3 V
        (
            {"battery.cells": 3},
            "3 is not 2: lipo cells have 3.3 to 4.25 V each, and the meter shows 7.60 V",
        ),
        ({"battery.cells": "2.5"}, "2.5 is not a whole number"),
        ({"battery.cells": 0}, "0 is not 2"),
        ({"battery.volts": "76 V"}, "76 V is not between 3 V and 30 V"),
    ],
)
def test_cells_that_contradict_the_meter_are_refused(robot, answers, words):
    result = calibrate("battery", ANSWERS | answers)
    assert isinstance(result.exception, RunError)
    assert words in result.exception.problems[0].cause
    assert not calibrated(robot).calibration


def test_a_meter_that_contradicts_the_board_is_reported_with_both_figures(robot):
    """7.6 V in truth are 7.17 V by the stated divider; 9.1 V are 27 % more."""
    result = calibrate("battery", ANSWERS | {"battery.volts": "9.1 V"}, "--dry-run")
    printed = " ".join(result.output.split())
    assert "The board reports 7.17 V" in printed and "9.10 V differ from that by +27 %" in printed


def test_an_empty_battery_gets_no_low_limit_above_its_voltage(robot):
    """One LiPo cell has at most 4.25 V, and two have 6.6 V or more unless they are empty."""
    result = calibrate("battery", ANSWERS | {"battery.volts": "6.5 V"})
    assert result.exit_code == 0, result.output
    printed = " ".join(result.output.split())
    assert "no number of lipo cells, of 3.3 to 4.25 V each, has 6.50 V" in printed
    assert calibrated(robot).battery.low == 0.0  # none


def test_other_steps_note_the_voltage_where_the_board_measures_it(robot):
    """7.6 V in truth are 7.17 V by the stated divider."""
    assert calibrate("range").exit_code == 0
    volts = calibrated(robot).calibration["sensors.front.curve.a"].volts
    assert float(volts.split()[0]) == pytest.approx(7.17, abs=0.02)


def test_without_a_pin_there_is_nothing_to_calibrate(robot):
    robot.write_text(robot.read_text().replace("pin: A1, ", ""))
    result = calibrate("battery", {})
    assert result.exit_code == 0
    assert "Chemistry" not in result.output
    assert "does not measure its battery" in result.output
    assert "saved: " not in result.output  # a recording of nothing
    assert not calibrated(robot).calibration


@pytest.mark.parametrize(
    "board_volts, meter, word",
    [
        ([0.1, 0.1], 7.6, "is it connected"),  # 0.03 V at the pin
        ([15.0, 15.0], 20.0, "5 V or more"),  # 5 V at the pin: the converter's end
    ],
)
def test_a_divider_that_cannot_be_is_refused(board_volts, meter, word):
    with pytest.raises(RunError, match=word):
        divider_finding(board_volts, meter, 3.0)


@pytest.mark.parametrize(
    "volts, kind, cells",
    [
        (8.4, "lipo", (2, 2)),  # one cell has 4.25 V at most; three of 2.8 V would be empty
        (7.2, "nimh", (5, 7)),  # 4.8 cells of 1.5 V; 7.2 of 1.0 V
        (6.0, "alkaline", (4, 6)),  # 3.6 of 1.65 V; 6.7 of 0.9 V
        (12.4, "li-ion", (3, 4)),  # 2.9 of 4.25 V; 4 of 3.1 V
        (3.2, "lipo", (1, 0)),  # one empty cell: no low limit below what it has now
    ],
)
def test_how_many_cells_a_voltage_allows(volts, kind, cells):
    assert cell_range(volts, CHEMISTRIES[kind]) == cells
