"""Drivers of devices: what they may return, and what happens when they fail."""

import os
from pathlib import Path

import pytest

from diffbotctl.block import In, Out
from diffbotctl.config.configuration import InputUse, SourceUse
from diffbotctl.config.load import check, load
from diffbotctl.device import DeviceDriver, DeviceError, Reading
from diffbotctl.drivers.device_sources import DeviceSource, DeviceSourcesDriver
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.drivers.input_leases import InputLeases
from diffbotctl.errors import RunError
from diffbotctl.messages import Text, Twist
from diffbotctl.params import Param
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import NEVER
from diffbotctl.time import SECOND as S

PIPELINE = """
format: 1
kind: pipeline
include: teleop
sources:
  {sources}
blocks:
  mux: {{in: {{teleop: joystick.twist}}}}
"""


class Scripted(DeviceDriver):
    """Returns what a test puts into `script`: readings, or an error to raise."""

    twist = Out(Twist)
    speed = Param(float, default=0.1, unit="m/s", help="Speed.")
    poll_period = 0.1
    start_timeout = 3.0

    def __init__(self, **values):
        super().__init__(**values)
        self.script = []
        self.refusal = None
        self.opened = 0

    def device_name(self):
        return "a script"

    def open(self):
        if self.refusal is not None:
            raise self.refusal
        self.opened += 1

    def read(self, now):
        item = self.script.pop(0) if self.script else []
        if isinstance(item, Exception):
            raise item
        return [
            Reading(port, message if message is None else message._replace(time=now))
            if port == "twist"
            else (port, message)
            for port, message in item
        ]


@pytest.fixture
def system():
    operator = Operator([], lambda code, cause: None)
    wire = {"device.twist": Twist}
    use = SourceUse("device", Scripted, {}, wire, 0.5, "test.yaml:1:1")
    inputs = InputLeases([InputUse("device.twist", Twist, 0.5, None, True)], operator)
    return DeviceSourcesDriver([use], inputs, operator), inputs, operator


def texts(operator):
    return [message.text for wire, message in operator.outbox if wire == "operator.log"]


GOOD = ("twist", Twist(0, 0.1, 0.0))


def test_messages_renew_the_lease_and_its_release_stops_nothing(system):
    driver, inputs, _ = system
    driver.sources[0].driver.script = [[GOOD], [("twist", None)]]
    assert driver.deliver(S) == [("device.twist", Twist(S, 0.1, 0.0))]
    assert inputs.due() == S + S // 2
    assert driver.deliver(2 * S) == []
    assert inputs.due() == NEVER


@pytest.mark.parametrize(
    ("item", "cause"),
    [
        (OSError(19, ""), "it has disconnected"),
        (DeviceError("its lamp is out", "change it"), "its lamp is out"),
        (ZeroDivisionError("1 / 0"), "its driver raised ZeroDivisionError: 1 / 0"),
        ([("nothing", None)], "its driver has no output 'nothing'; it has twist"),
        ([("twist", Text(0, ""))], "instead of a Twist"),
        ([("twist", Twist(0, float("nan"), 0.0))], "not a finite number"),
        ([GOOD] * 1001, "more than 1000 messages came in a second"),
        ([GOOD[0]], "its driver raised ValueError"),
    ],
)
def test_every_failure_expires_the_wire_and_names_the_device(system, item, cause):
    driver, inputs, operator = system
    driver.sources[0].driver.script = [[GOOD], item]
    driver.deliver(S)
    assert driver.deliver(S + S // 10) == []
    [stop] = inputs.deliver(S + S // 10 + 1)
    assert stop.wire == "operator.halt" and stop.message.code == "input_stale"
    assert stop.message.cause.startswith("source device (a script): ")
    assert cause in stop.message.cause
    assert any(cause in text for text in texts(operator))
    assert driver.files() == [] and not driver.sources[0].is_open


def test_a_lost_device_is_opened_again_after_a_growing_time(system):
    driver, _inputs, operator = system
    device = driver.sources[0].driver
    device.script, device.refusal = [OSError(5, "")], OSError(2, "")
    driver.deliver(S)
    waits = []
    for _ in range(6):
        waits.append(driver.due())
        driver.deliver(driver.due())
    gaps = [(later - earlier) / S for earlier, later in zip([S, *waits], waits, strict=False)]
    assert gaps == [0.5, 1.0, 2.0, 4.0, 4.0, 4.0]
    assert sum("No such file" in text for text in texts(operator)) == 1  # not each time
    device.refusal, device.script = None, [[GOOD]]
    now = driver.due()
    assert len(driver.deliver(now)) == 1 and device.opened == 2
    assert "opened again" in texts(operator)[-1]


def waits(deliveries):
    return [item.message for item in deliveries if item.wire == "operator.wait"]


def test_the_robot_waits_as_long_as_its_device_starts(system):
    driver, _inputs, _ = system
    assert driver.due() == 0
    [stop] = waits(driver.deliver(0))
    assert (stop.code, stop.latched) == ("source_starting", False)
    assert stop.cause == "source device (a script) starts, and has sent nothing yet"
    assert driver.deliver(S) == [] and driver.deliver(2 * S) == []
    driver.sources[0].driver.script = [[GOOD]]
    message, end = driver.deliver(2 * S + S // 2)
    assert message.wire == "device.twist" and end.message.code == ""
    # One that is lost stops the robot otherwise; opened again, it starts again.
    driver.sources[0].driver.script = [OSError(5, "")]
    assert waits(driver.deliver(3 * S)) == []
    [again] = waits(driver.deliver(driver.due()))
    assert again.code == "source_starting"


def test_a_device_that_never_starts_is_lost(system):
    driver, inputs, _ = system
    driver.deliver(0)
    [end] = waits(driver.deliver(3 * S))
    assert end.code == ""
    [stop] = inputs.deliver(3 * S + 1)
    assert stop.message.code == "input_stale" and stop.message.latched


def test_silence_is_named_and_the_device_opened_again(system):
    driver, _inputs, operator = system
    device = driver.sources[0].driver
    driver.deliver(3 * S)
    assert any("nothing comes from it; check its plug" in text for text in texts(operator))
    device.script = [[GOOD]]
    driver.deliver(driver.due())
    driver.deliver(driver.due() + 3 * S)
    assert sum("nothing comes from it" in text for text in texts(operator)) == 2


def test_a_time_in_the_future_is_refused(system):
    driver, _inputs, operator = system
    driver.sources[0].driver.read = lambda now: [Reading("twist", Twist(now + 1, 0.0, 0.0))]
    driver.deliver(S)
    assert any("is not between 0 and" in text for text in texts(operator))


def test_a_slow_read_is_reported_three_times(system):
    import time

    driver, _inputs, operator = system

    def read(now):
        time.sleep(0.03)
        return [Reading("twist", Twist(now, 0.0, 0.0))]

    driver.sources[0].driver.read = read
    for number in range(1, 6):
        driver.deliver(number * S)
    assert sum("it must not wait" in text for text in texts(operator)) == 3


@pytest.mark.parametrize("path", ["/", "/dev/null", "/dev/full", __file__])
def test_a_file_that_sends_nothing_is_refused_when_it_is_opened(path):
    class Opened(Scripted):
        def open(self):
            return os.open(path, os.O_RDONLY)

    use = SourceUse("device", Opened, {}, {"device.twist": Twist}, 0.5, "test.yaml:1:1")
    source = DeviceSource(use, {})
    with pytest.raises(DeviceError, match="no device that sends data"):
        source.open(0)
    assert source.file is None


def test_a_driver_without_outputs_or_with_inputs_is_refused():
    with pytest.raises(TypeError, match="no output"):
        type("Mute", (DeviceDriver,), {})
    with pytest.raises(TypeError, match="define write"):
        type("Fed", (DeviceDriver,), {"twist": In(Twist), "safe": Out(Twist)})


def pipeline(tmp_path, sources):
    path = tmp_path / "pad.yaml"
    path.write_text(PIPELINE.format(sources=sources))
    return str(path)


@pytest.mark.parametrize(
    ("sources", "code", "words"),
    [
        ("joystick: {driver: joistick}", "E-SOURCE", "did you mean joystick?"),
        ("joystick: {driver: joystick, with: {sped: 1}}", "E-KEY-UNKNOWN", "did you mean 'speed'?"),
        ("joystick: {driver: joystick, timeout: 5 s}", "E-INPUT", "set at most 1 s"),
        ("mux: {driver: joystick}", "E-NAME", "another node is called 'mux'"),
        ("Pad: {driver: joystick}", "E-NAME", "not a valid source name"),
        ("joystick: {driver: lidar, with: {device: x, model: lds01}}", "E-WIRE-OUTPUT", "twist"),
        ("joystick: {driver: lidar, with: {device: x}}", "E-KEY-MISSING", "model"),
    ],
)
def test_what_is_declared_wrong_is_shown_with_its_fix(tmp_path, sources, code, words):
    problems = check(pipeline(tmp_path, sources))
    text = "\n".join(problem.render() for problem in problems)
    assert code in [problem.code for problem in problems], text
    assert words in text


def test_parameters_are_set_on_the_command_line(tmp_path):
    path = pipeline(tmp_path, "joystick: {driver: joystick}")
    [use] = load(path, sets=["joystick.speed=10 cm/s"]).sources
    assert use.values["speed"] == 0.1


def test_a_device_needs_real_time(tmp_path):
    configuration = load(pipeline(tmp_path, "joystick: {driver: joystick}"))
    with pytest.raises(RunError, match="without --fast"):
        Run(configuration, RunOptions(fast=True))


def test_a_device_of_others_is_refused_with_its_place(tmp_path):
    """The error of `open` decides; the run does not begin."""
    missing = tmp_path / "pad"
    device = f"joystick: {{driver: joystick, with: {{device: {missing}}}}}"
    configuration = load(pipeline(tmp_path, device))
    with pytest.raises(RunError) as raised:
        Run(configuration, RunOptions())
    [problem] = raised.value.problems
    assert problem.code == "E-DEVICE" and "pad.yaml:6:3" in str(problem.place)
    assert str(missing) in problem.cause and "plug it in" in problem.fix
    assert not Path(missing).exists() and os.getpid()
