"""Sensors that a source of the pipeline reads, not the board; and blocks that are left out."""

import pytest

from diffbotctl.config.load import check, load, load_robot
from diffbotctl.drivers.robot_link import board_settings
from diffbotctl.errors import ConfigurationError
from diffbotctl.geometry.lidars import LIDARS
from tests.pico_robot import PICO

SCAN = "scan: {type: lds01, pin: none, at: {x: 0 mm}}"
SONAR = "front: {type: hc_sr04, trigger: none, echo: none, at: {x: 80 mm}}"
LIDAR = "sources: {laser: {driver: lidar, with: {device: /dev/ttyUSB1, model: lds01}}}"
RANGES = "inputs: {sonar: {type: Range}}"


@pytest.fixture
def write(tmp_path):
    """Writes a robot with these sensors, and a pipeline with these sections that includes `goal`.

    What it returns are the arguments of `load` and `check`.
    """

    def write_files(sensors, *sections):
        robot, pipeline = tmp_path / "bot.yaml", tmp_path / "mine.yaml"
        shipped = load_robot("book_2wd").file.read_text()
        start = shipped.index("sensors:")
        end = shipped.index("\n\n", start)
        shipped = shipped[:start] + f"sensors: {{{sensors}}}" + shipped[end:]
        robot.write_text(
            shipped.replace("sensors: {front: {noise: 10 mV, offset: 0 V}}", "sensors: {}")
        )
        pipeline.write_text("\n".join(["format: 1", "kind: pipeline", "include: goal", *sections]))
        return str(pipeline), str(robot)

    return write_files


def errors(arguments, **options):
    return [each for each in check(*arguments, **options) if each.severity == "error"]


def wires(configuration):
    return {use.name: use.wires for use in configuration.blocks}


@pytest.mark.parametrize("sets", [[], [f"{each}" for each in PICO]])
@pytest.mark.parametrize("real", [False, True])
def test_a_lidar_that_a_source_reads_guards_a_robot_with_a_board(write, sets, real):
    files = write(SCAN, LIDAR, "blocks: {scan_guard: {in: {scan: laser.scan}}}")
    sets = [*sets, "robot.drive.encoder.channels=2"] if sets else []
    loaded = load(*files, sets, real=real)
    assert wires(loaded)["scan_guard"]["scan"] == "laser.scan"
    assert [(each.name, each.needs) for each in loaded.omissions] == [
        ("range", "Volts"),
        ("guard", "Volts"),
    ]
    assert board_settings(loaded.robot).range_channel is None  # the firmware knows nothing of it


def test_a_lidar_without_its_place_is_refused_not_left_out(write):
    files = write("", LIDAR, "blocks: {scan_guard: {in: {scan: laser.scan}}}")
    [problem] = errors(files)
    assert (
        problem.code == "E-SENSOR-UNKNOWN" and "`sensors: {scan: {type: lds01, at: " in problem.fix
    )


def test_a_guard_that_is_not_wired_to_its_source_is_refused(write):
    [problem] = errors(write(SCAN, LIDAR), real=True)
    assert problem.code == "E-BOARD-SENSOR"
    assert problem.fix.startswith("state its serial port: `scan: {device: /dev/ttyUSB1}`")
    assert problem.fix.endswith("or wire 'scan_guard' to laser.scan")
    [warning] = [each for each in check(*write(SCAN, LIDAR)) if each.code == "W-BOARD-SENSOR"]
    assert "in the simulator only" in warning.cause
    problems = {each.code: each for each in errors(write("", LIDAR))}
    assert problems["E-WIRE-OUTPUT"].fix == "wire 'scan_guard' from laser.scan"


@pytest.mark.parametrize("sensors", [SCAN, f"{SCAN}, front: {{type: sharp_gp2y0a41sk0f, pin: A0}}"])
def test_a_declared_scanner_without_a_source_is_no_reason_to_drive_unguarded(write, sensors):
    [problem] = errors(write(sensors), real=True)
    assert problem.code == "E-BOARD-SENSOR" and "'scan_guard' would have no data" in problem.cause


@pytest.mark.parametrize("kind", LIDARS)
def test_a_lidar_with_a_device_needs_no_source(write, kind):
    """The hint of the error above: on a real robot its driver delivers, else the plant."""
    stated = f"scan: {{type: {kind}, device: /dev/ttyUSB1, upside_down: true}}"
    simulated, real = (load(*write(stated), real=real) for real in (False, True))
    assert simulated.sources == ()
    [source] = real.sources
    assert source.values == {"device": "/dev/ttyUSB1", "model": kind, "upside_down": True}
    assert (source.what, source.wire("scan"), source.timeout) == (
        "sensor",
        "robot.scan",
        max(0.5, 3 / LIDARS[kind].rate),
    )
    for loaded in (simulated, real):
        assert wires(loaded)["scan_guard"]["scan"] == "robot.scan"
        [use] = [use for use in loaded.inputs if use.wire == "robot.scan"]
        assert use.feeds_motion and use.is_of_robot
        assert not [each for each in loaded.warnings if "SENSOR" in each.code]


@pytest.mark.parametrize("sensors", ["", SONAR])
def test_distances_that_a_source_gives(write, sensors):
    guard = "guard: {in: {range: input.sonar}, with: {reaction: 0.5 s}}"
    files = write(sensors, RANGES, f"blocks: {{{guard}}}")
    loaded = load(*files, ["robot.limits.speed=0.1"], real=True)
    assert wires(loaded)["guard"]["range"] == "input.sonar"
    assert "range" not in wires(loaded)
    assert "W-UNGUARDED" not in [each.code for each in loaded.warnings]


def test_a_guard_of_a_source_states_its_reaction(write):
    [problem] = errors(write(SONAR, RANGES, "blocks: {guard: {in: {range: input.sonar}}}"))
    assert problem.code == "E-STOP-REACH" and "come from input.sonar" in problem.cause


def test_a_guard_stays_while_a_source_could_feed_it(write):
    """Its wire leads to a block that was left out; that is an error, not one guard less."""
    [problem] = errors(write("", RANGES))
    assert problem.code == "E-WIRE-NODE" and "left out: range" in problem.cause
    assert problem.fix == "wire 'guard' from input.sonar"


def test_a_misspelt_source_is_no_reason_to_leave_out_its_guard(write):
    found = errors(write("", "blocks: {scan_guard: {in: {scan: lasr.scan}}}"))
    assert {each.code for each in found} == {"E-WIRE-NODE", "E-SENSOR-UNKNOWN"}


def test_a_robot_without_sensors_is_warned_of_and_what_is_left_out_is_named(write):
    loaded = load(*write(""))
    assert [each.name for each in loaded.omissions] == ["range", "guard", "scan_guard"]
    assert "W-UNGUARDED" in [each.code for each in loaded.warnings]
    assert loaded.omissions[-1].text() == (
        "left out: scan_guard (no sensor of the robot and no source gives a scan)"
    )


@pytest.mark.parametrize(
    ("sensors", "code", "words"),
    [
        ("scan: {type: lds01, pin: A1}", "E-SENSOR-KEY", "lds01, which has no pin"),
        ("eye: {type: overhead_camera, pin: A1}", "E-SENSOR-KEY", "has no pin"),
        ("front: {type: hc_sr04, device: /dev/x}", "E-SENSOR-KEY", "only a lidar has device"),
        ("front: {type: hc_sr04, trigger: 40, echo: none}", "E-BOARD-PIN", "its echo has none"),
    ],
)
def test_pins_that_a_sensor_does_not_have(write, sensors, code, words):
    with pytest.raises(ConfigurationError) as caught:
        load_robot(write(sensors)[1])
    [problem] = [each for each in caught.value.problems if each.code == code]
    assert words in problem.cause


def test_the_first_distance_sensor_is_that_of_the_guard(write):
    """Also where a scanner is declared before it."""
    files = write(f"{SCAN}, front: {{type: sharp_gp2y0a41sk0f, pin: A0, at: {{x: 80 mm}}}}")
    assert errors(files) == []
