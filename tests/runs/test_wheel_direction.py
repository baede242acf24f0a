"""Robots with two-channel encoders whose wires are wrong are stopped at once, with the fix."""

import pytest

from diffbotctl.cli import new
from diffbotctl.config.load import load
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND
from tests.command_result import invoke
from tests.pico_robot import PICO

MOTOR_LEFT = "left=plain"  # the kits state motor.reversed for the left motor, which is so
MOTOR_RIGHT = "right=reversed"
ENCODER_LEFT = "left_encoder=exchanged"
ENCODERS = "encoders=swapped"


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


class WatchedRun(Run):
    """A run that notes when a wheel begins to turn, and ends with its first stop."""

    moved = None

    def _sinks(self):
        sinks = super()._sinks()
        sinks["robot.encoders"].append(self._note_motion)
        sinks["gate.stop"].append(lambda now, stop: self.engine.end(1, stop.cause))
        return sinks

    def _note_motion(self, now, encoders):
        if self.moved is None and any(abs(wheel.speed) > 0.3 for wheel in self.plant.wheels):
            self.moved = now


def first_stop(pipeline, robot, sets, port="sim"):
    """The first stop, and the time (s) from the first motion to it."""
    run = WatchedRun(
        load(pipeline, robot, ["world.walls=[]", *sets]),
        RunOptions(port=port, fast=True, seed=4, duration=6.0),
        tell=lambda text: None,
    )
    stop = run.go().stops[0]
    return stop, (stop.time - run.moved) / SECOND


def kit_stop(kit, pipeline, wiring, port="sim"):
    invoke(new.new, "robot", "--kit", kit, "mine")
    sets = [f"robot.simulation.wiring.{wiring}"]
    return first_stop(pipeline, "robots/mine.yaml", sets, port)


@pytest.mark.parametrize(
    ("kit", "wiring", "words"),
    [
        (
            "romi_32u4",
            MOTOR_LEFT,
            ("left motor", "A OUT1 and A OUT2", "drive.left.motor.reversed: false", "pins 2 and 4"),
        ),
        ("romi_32u4", MOTOR_RIGHT, ("right motor", "drive.right.motor.reversed: true")),
        ("romi_32u4", ENCODER_LEFT, ("left encoder", "drive.left.encoder.reversed: true")),
        ("ros_car", MOTOR_RIGHT, ("by the IMU: the right motor", "BO1 and BO2")),
        ("ros_car", ENCODER_LEFT, ("by the IMU: the left encoder", "pins 2 and 22")),
    ],
)
@pytest.mark.parametrize("pipeline", ["goal", "square"])
def test_a_reversed_wheel_stops_the_robot_and_is_named(kit, wiring, words, pipeline):
    stop, seconds = kit_stop(kit, pipeline, wiring)
    assert stop.code == "wheel_direction" and stop.latched
    assert seconds < 1.0
    assert all(word in stop.cause for word in words), stop.cause


@pytest.mark.parametrize(
    ("kit", "words"),
    [
        ("romi_32u4", ("the encoders are exchanged", "pins 2 and 4", "pins 3 and 11")),
        ("ros_car", ("by the IMU: the encoders are exchanged", "drive.right.encoder")),
    ],
)
def test_exchanged_encoders_stop_the_robot_in_its_first_turn(kit, words):
    stop, seconds = kit_stop(kit, "goal", ENCODERS)
    assert stop.code == "wheel_direction" and seconds < 1.0
    assert all(word in stop.cause for word in words), stop.cause


def test_with_one_channel_a_gyro_shows_the_reversed_motor():
    sets = ["robot.imu.type=mpu6050", "robot.board.telemetry=30 Hz", "robot.simulation.wiring."]
    sets[-1] += MOTOR_RIGHT
    stop, seconds = first_stop("square", "book_2wd", sets)
    assert stop.code == "wheel_direction" and seconds < 1.0
    assert "by the IMU: the right motor is reversed" in stop.cause


def test_the_firmware_of_a_mega_stops_with_a_reversed_motor():
    stop, seconds = kit_stop("ros_car", "goal", MOTOR_RIGHT, "emulated")
    assert stop.code == "wheel_direction" and seconds < 1.0
    assert "by the IMU: the right motor is reversed" in stop.cause


def test_the_firmware_of_a_pico_stops_with_a_reversed_encoder():
    channels = "robot.drive.encoder.channels=2"
    fault = "robot.simulation.wiring.left_encoder=exchanged"
    stop, seconds = first_stop("goal", "book_2wd", [*PICO, channels, fault], "emulated")
    assert stop.code == "wheel_direction" and seconds < 1.0
    assert "the left encoder counts backward" in stop.cause
