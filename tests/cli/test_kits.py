"""Every kit's file is checked, wired and driven, in simulation and on the emulated board."""

import pytest
from click.testing import CliRunner

from diffbotctl.cli import new
from diffbotctl.cli.kits import KITS
from diffbotctl.config.harness import harness
from diffbotctl.config.load import check, load, load_robot
from diffbotctl.errors import UserError
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.testing.virtual_board import diffbotctl, flat

# What is inherent in the kit, and said: no obstacle sensor; HC-05 and USB on one port.
WARNINGS = {"W-UNGUARDED", "W-WIRING-SHARED", "W-SKID-STEER"}
# Goals behind a turn, before the track of four wheels is calibrated.
UNSURE = {"four_wheels"}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)


def new_robot(*words):
    result = CliRunner().invoke(new.command, ["robot", *words], standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    return result.output


def test_kit_without_a_name_lists_them():
    output = new_robot("--kit")
    for name, kit in KITS.items():
        assert name in output and kit.title in output
    assert "xrp" in output and "board is not supported" in output


@pytest.mark.parametrize(
    ("written", "meant"),
    [("romi", "romi_32u4"), ("XRP", "xrp"), ("uno-tb6612", "uno_tb6612"), ("roscar", "ros_car")],
)
def test_a_typing_error_is_answered_with_the_closest_kit(written, meant):
    with pytest.raises(UserError) as raised:
        new_robot("--kit", written)
    (problem,) = raised.value.problems
    assert (problem.code, problem.fix) == ("E-KIT", f"did you mean {meant}?")


def test_a_name_like_no_kit_is_answered_with_all_of_them():
    with pytest.raises(UserError) as raised:
        new_robot("--kit", "qqqq")
    assert all(name in raised.value.problems[0].fix for name in KITS)


def test_a_robot_needs_a_name_or_a_kit():
    with pytest.raises(UserError) as raised:
        new_robot()
    assert raised.value.problems[0].code == "E-NAME"


def test_a_kit_s_robot_may_have_a_name_of_its_own():
    assert "robots/crawler.yaml" in new_robot("crawler", "--kit", "xrp")
    assert load_robot("crawler").robot.drive.track == pytest.approx(0.155)


@pytest.mark.parametrize("name", [name for name, kit in KITS.items() if kit.unsupported])
def test_what_is_not_supported_is_said(name):
    assert f"note: {KITS[name].unsupported}" in new_robot("--kit", name)


@pytest.mark.parametrize("name", KITS)
def test_a_kit_passes_check_wiring_and_simulation(name):
    new_robot("--kit", name)
    problems = check("goal", name, ())
    assert {problem.code for problem in problems} <= WARNINGS
    robot = load_robot(name).robot
    wires = harness(robot)
    assert {wire.start.part for wire in wires.wires} >= {"battery", "driver", "board"}
    run = Run(load("goal", name), RunOptions(seed=1, fast=True))
    result = run.go()
    assert (result.reached, run.operator.reached_unsure) == ((0, 1) if name in UNSURE else (1, 0))


@pytest.mark.parametrize("name", KITS)
def test_a_kit_flies_in_the_emulator(name):
    """The file's own board, with its real firmware, also where it stands in for another board."""
    new_robot("--kit", name)
    code, said = diffbotctl("run", "goal", "--robot", name, "--port", "emulated", "--quiet")
    if name in UNSURE:
        assert code == 1 and "goal 1 reached, but the position is known to" in flat(said), said
    else:
        assert code == 0 and "goals 1 of 1 reached" in flat(said), said
    assert "0 damaged, 0 lost" in flat(said), said


@pytest.mark.parametrize("seed", range(8))
def test_four_wheels_never_claim_a_goal_behind_a_turn(seed):
    """Their track is known to a fifth; straight on it does not matter."""
    new_robot("--kit", "four_wheels")
    turned = Run(load("goal", "four_wheels"), RunOptions(seed=seed, fast=True))
    assert turned.go().reached == 0
    straight = Run(load("distance", "four_wheels"), RunOptions(seed=seed, fast=True))
    assert straight.go().reached == 1


def test_a_calibrated_track_of_four_wheels_is_believed():
    new_robot("--kit", "four_wheels")
    file = load_robot("four_wheels").file
    values = "calibration: {drive.track: {value: 240 mm, sd: 1 mm}}"
    file.write_text(file.read_text().replace("calibration: {}", values))
    assert not {"W-SKID-STEER"} & {problem.code for problem in check("goal", str(file), ())}
