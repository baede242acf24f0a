"""Steps on the floor, on simulated robots whose truth is known here and hidden from the steps."""

import pytest

from diffbotctl.calibrate.runner import make_step, open_session, run_step
from diffbotctl.config.load import load_robot
from diffbotctl.drivers.robot_ports import wheel_command
from diffbotctl.messages import Duty, Wheels
from diffbotctl.prompts.answers_file import AnswersFile
from tests.sampling import by_day

ANSWERS = """\
distance.reading: {measure: tape, noise: 1 mm}
geometry: {measure: tape, noise: 1 mm}
geometry.facing: {measure: protractor, noise: 1 deg}
"""
WRONG = "geometry: {track_spread: 0.03, diameter_spread: 0.005}"


class Quiet:
    def say(self, text): ...
    def progress(self, progress): ...
    def draw(self, drawing): ...


@pytest.fixture
def prepared(tmp_path):
    """A robot whose motors are calibrated, and its prompter."""

    def prepare(base="book_2wd", seed=3):
        robot, answers = tmp_path / "mine.yaml", tmp_path / "answers.yaml"
        robot.write_text(
            f"format: 1\nkind: robot\ninclude: {base}\nsimulation: {{{WRONG}}}\n"
            "drive: {polarity: checked_by_hand}\n"
        )
        answers.write_text(ANSWERS)
        converted, truths = open_session(load_robot(str(robot)), "sim", seed)
        prompter = AnswersFile(answers, truths)
        run_step(make_step("motors"), converted, prompter, Quiet())
        return converted, prompter, truths._plant.chassis

    return prepare


@pytest.mark.nightly
def test_a_spin_shows_the_track_that_goes_with_the_wheels_as_stated(prepared):
    converted, prompter, body = prepared()
    run_step(make_step("geometry", how="spin", repeats=1), converted, prompter, Quiet())
    # It turns by way over track: with the stated diameter the track is off by as much as that.
    true = body.track * 0.065 / (body.left_radius + body.right_radius)
    assert converted.file.robot.drive.track == pytest.approx(true, rel=0.003)
    assert abs(true / 0.125 - 1) > 0.01  # there was something to find


@pytest.mark.parametrize("how", by_day(1, ["spin", "straight"]))
def test_what_is_measured_in_diameters_is_no_surer_than_these(prepared, how):
    converted, prompter, _ = prepared()
    distance = run_step(make_step("distance", repeats=3), converted, prompter, Quiet())
    (right, *_) = (each for each in distance.findings if "diameter" in each.field)
    # A tyre may differ from the mean of both by 0.3 %, the rest is the error of the mean.
    scale_sd = ((right.sd / right.value) ** 2 - 0.003**2) ** 0.5
    outcome = run_step(make_step("geometry", how=how, repeats=2), converted, prompter, Quiet())
    for each in outcome.findings:
        assert each.sd / each.value >= 0.99 * scale_sd > 0.0


@pytest.mark.nightly
@pytest.mark.parametrize("how", by_day(1, ["straight", "squares", "spin"]))
def test_a_scale_that_was_not_measured_is_known_to_2_percent(prepared, how):
    """Each length states it, and what is known of its ratio to the others."""
    converted, prompter, _ = prepared()
    # Of 16 robots, two runs of squares alone leave 0.1 to 0.6 % of the track, which would show.
    more = {"runs": 4} if how == "squares" else {"repeats": 2}
    outcome = run_step(make_step("geometry", how=how, **more), converted, prompter, Quiet())
    lengths = [each for each in outcome.findings if each.field != "drive.slip"]
    assert len(lengths) == {"squares": 3, "spin": 1, "straight": 2}[how]
    for each in lengths:
        assert each.sd / each.value == pytest.approx(0.02, rel=0.02)
        assert 0.0 < each.own_sd < 0.2 * each.sd
    assert "was not measured" in outcome.report[-1]
    run_step(make_step("distance", repeats=3), converted, prompter, Quiet())
    for each in lengths:
        entry = converted.file.robot.calibration[each.field]
        assert float(str(entry.sd).split()[0]) < 0.005 * each.value


@pytest.mark.nightly
def test_a_track_states_that_distance_scaled_it_and_did_not_find_it(prepared):
    converted, prompter, _ = prepared()
    run_step(make_step("geometry", how="spin", repeats=1), converted, prompter, Quiet())
    for _ in range(2):
        outcome = run_step(make_step("distance", repeats=1), converted, prompter, Quiet())
    track = next(each for each in outcome.findings if each.field == "drive.track")
    assert track.method == "trial+distance"  # a written one: spin+distance


def test_straight_runs_tell_the_ratio_and_keep_the_mean(prepared):
    converted, prompter, body = prepared()
    run_step(make_step("geometry", how="straight"), converted, prompter, Quiet())
    drive = converted.file.robot.drive
    ratio = drive.right.wheel.diameter / drive.left.wheel.diameter
    assert ratio == pytest.approx(body.right_radius / body.left_radius, abs=0.0015)
    assert drive.right.wheel.diameter + drive.left.wheel.diameter == pytest.approx(0.13)


def test_a_distance_scales_both_wheels_and_a_track_that_was_found_by_turning(prepared):
    converted, prompter, body = prepared()
    run_step(make_step("geometry", how="spin", repeats=1), converted, prompter, Quiet())
    outcome = run_step(make_step("distance", repeats=3), converted, prompter, Quiet())
    drive = converted.file.robot.drive
    assert drive.left.wheel.diameter == drive.right.wheel.diameter
    assert drive.left.wheel.diameter == pytest.approx(
        body.left_radius + body.right_radius, rel=0.003
    )
    assert drive.track == pytest.approx(body.track, rel=0.005)
    assert {each.field for each in outcome.findings} >= {"drive.track"}


@pytest.mark.nightly
def test_squares_on_a_board_with_the_books_firmware(prepared):
    converted, prompter, body = prepared("book_2wd_stock")
    run_step(make_step("geometry", runs=3, side=0.8), converted, prompter, Quiet())
    drive = converted.file.robot.drive
    ratio = drive.right.wheel.diameter / drive.left.wheel.diameter
    assert ratio == pytest.approx(body.right_radius / body.left_radius, abs=0.003)


@pytest.mark.parametrize(
    "base, command",
    [
        ("book_2wd", Wheels(0, 5.0, -5.0)),
        # 0.1 of static duty, and the rest of it for the 10.47 rad/s of 100 rpm
        ("book_2wd_stock", Duty(0, 0.1 + 5 * 0.9 / 10.472, -0.1 - 5 * 0.9 / 10.472)),
    ],
)
def test_speeds_go_out_as_the_board_takes_them(base, command):
    converted = wheel_command(load_robot(base).robot, 5.0, -5.0)
    assert type(converted) is type(command)
    assert (converted.left, converted.right) == pytest.approx(
        (command.left, command.right), rel=1e-4
    )
