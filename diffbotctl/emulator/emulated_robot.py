"""The emulated robot behind the node `robot`: the real firmware in lockstep with the plant.

The board runs its binary in the emulator, its wheels and sensors are the plant's, and the bytes
between board and host take the time of wire and radio. Everything is virtual time: equal inputs
give equal runs.
"""

from __future__ import annotations

from collections import deque
from math import degrees

from diffbotctl.config.configuration import Configuration
from diffbotctl.config.motor_drivers import driver_facts
from diffbotctl.config.robot import Robot
from diffbotctl.drivers.robot_link import board_settings
from diffbotctl.drivers.simulated_robot import OperatorFaults
from diffbotctl.emulator.process import (
    FIRST_GYRO,
    FIRST_SONAR,
    GYRO_ACCELERATION,
    GYRO_FAULT,
    GYRO_ONE_G,
    GYRO_RATE_UNIT,
    SHORTING,
    Emulator,
    GyroFault,
    MotorPins,
    PinTransition,
    SonarPins,
)
from diffbotctl.engine.driver import Delivery
from diffbotctl.errors import Problem, RunError
from diffbotctl.links.diffbot_frames import PIN_NONE, DriverCode
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.links.diffbot_settings import BoardSettings, RangeInput
from diffbotctl.messages import Duty, Wheels
from diffbotctl.plant.simulated_board import RADIO_DELAY
from diffbotctl.plant.simulated_robot import CapturedEdge, SimulatedRobot, draw_robot
from diffbotctl.plant.world import World, build_world

STEP = 1_000_000  # ns; the longest delay from a change of a motor's duty to the plant
MILLIVOLTS = 1000
GYRO_PERIOD = 10_000_000  # ns between two measurements
GYRO_FAULTS = {
    "plain": GyroFault.NONE,
    "silent": GyroFault.SILENT,
    "bus_held": GyroFault.BUS_HELD,
    "stuck": GyroFault.STUCK,
}


class EmulatedBoard:
    """Board and plant together, stepped in virtual time; no host.

    `received` holds (arrival in ns, uart, bytes) of what the board has sent, until it is taken.
    """

    def __init__(self, plant: SimulatedRobot, settings: BoardSettings, emulator: Emulator) -> None:
        """`settings` state the pins; the board itself receives them over a link."""
        self.plant = plant
        self.emulator = emulator
        self.settings = settings
        self.sides = (settings.left, settings.right)
        self.duty = [0.0, 0.0]
        self.shorted = [0.0, 0.0]  # share of each pulse for which the driver shorts the motor
        self.changed = [0, 0]  # ns at which each motor's duty last changed
        self.received: deque[tuple[int, int, bytes]] = deque()
        self.in_bootsel = False  # a Pico that waits for a program
        self._outgoing: deque[tuple[int, int, bytes]] = deque()
        plant.capture(True)
        self._first_levels = self._transitions(plant.encoder_levels())
        self._button_pressed: bool | None = None  # as the pin has it
        self._gyro_due = 0

    @property
    def now(self) -> int:
        """Virtual time, ns."""
        return self.plant.now

    def send(self, at: int, uart: int, data: bytes) -> None:
        """Bytes begin to reach the board's UART at `at`; call in order of time."""
        self._outgoing.append((at, uart, data))

    def advance(self, until: int) -> None:
        """Let board and plant run until `until`."""
        while self.plant.now < until:
            self._step(min(until, self.plant.now + STEP))

    def _step(self, until: int) -> None:
        arriving = [b"", b""]
        while self._outgoing and self._outgoing[0][0] <= self.plant.now:
            _, uart, data = self._outgoing.popleft()
            arriving[uart] += data
        transitions, self._first_levels = self._first_levels, []
        edges = self.plant.advance_with_duties(
            until, self.duty[0], self.duty[1], (self.shorted[0], self.shorted[1])
        )
        transitions += self._transitions(edges) + self._button_changes()
        millivolts = self._millivolts()
        result = self.emulator.step(until, transitions, millivolts, (arriving[0], arriving[1]))
        self.in_bootsel = result.in_bootsel
        for change in result.changes:
            sign = -1.0 if self.sides[change.motor].reversed else 1.0
            self.duty[change.motor] = sign * change.duty
            self.shorted[change.motor] = change.shorted
            self.changed[change.motor] = change.time
        for sent in result.sent:
            self.received.append((sent.time, sent.uart, bytes((sent.byte,))))

    def _transitions(self, edges: list[CapturedEdge]) -> list[PinTransition]:
        transitions = []
        for time, side, level, channel in edges:
            pins = self.sides[side]
            pin = pins.encoder_b if channel else pins.encoder
            if pin is not None:
                transitions.append(PinTransition(time, pin, level))
        return transitions

    def _button_changes(self) -> list[PinTransition]:
        """The stop button's change; it pulls its pin to ground, or opens a contact to ground."""
        button, pressed = self.settings.button, self.plant.button_pressed
        if button is None or pressed is self._button_pressed:
            return []
        self._button_pressed = pressed
        return [PinTransition(self.plant.now, button, int(pressed == self.settings.button_high))]

    def _millivolts(self) -> dict[int, int]:
        """Voltages at the analog channels, in mV; echoes of the ultrasonic sensors, in us."""
        settings, millivolts = self.settings, {}
        if settings.battery_channel is not None:
            voltage = self.plant.battery_pin_voltage()
            millivolts[settings.battery_channel] = round(voltage * MILLIVOLTS)
        volts = self.plant.sensor_volts()
        channels = {settings.range_name: settings.range_channel} | {
            sensor.name: sensor.pin for sensor in settings.further_ranges if sensor.trigger is None
        }
        for name, channel in channels.items():
            if channel is not None and name in volts:
                millivolts[channel] = round(volts[name] * MILLIVOLTS)
        for number, sensor in enumerate(_sonars(settings)):
            millivolts[FIRST_SONAR + number] = self.plant.echo_us(sensor.name)
        return millivolts | self._gyro_inputs()

    def _gyro_inputs(self) -> dict[int, int]:
        """Rates, accelerations and the fault of the gyro, as often as it measures."""
        gyro, axes = self.plant.gyro, self.plant.parameters.gyro_axes
        if gyro is None or axes is None or self.plant.now < self._gyro_due:
            return {}
        self._gyro_due = self.plant.now + GYRO_PERIOD
        rate = gyro.measure(self.plant.now, self.plant.chassis)
        rates = [degrees(gyro.across(GYRO_PERIOD * 1e-9, axis)) for axis in axes]
        for number, axis in enumerate(axes):
            if axis.up:
                rates[number] = axis.up * degrees(rate)
        inputs = {FIRST_GYRO + number: round(rates[number] / GYRO_RATE_UNIT) for number in range(3)}
        gravity = {
            GYRO_ACCELERATION + number: axis.up * GYRO_ONE_G for number, axis in enumerate(axes)
        }
        return inputs | gravity | {GYRO_FAULT: GYRO_FAULTS[gyro.fault_kind]}


class EmulatedRobotDriver:
    """A robot driver: the host's link protocol, connected to an emulated board."""

    def __init__(self, board: EmulatedBoard, host: DiffbotHost, radio: int = RADIO_DELAY) -> None:
        """`radio`: ns that each direction takes besides the wire."""
        self.board = board
        self.robot = board.plant
        self.host = host
        self.radio = radio
        self._sent_until = self._received_until = 0  # times of arrival of the last bytes
        self.uart = host.settings.uart
        self._operator = OperatorFaults(board.plant)
        self._resets = [
            fault.start for fault in board.plant.faults.faults if fault.kind == "board_reset"
        ]
        host.opened(board.now)

    def due(self) -> int:
        """The next step of the board."""
        return self.board.now + STEP

    def files(self) -> list[int]:
        """None."""
        return []

    def deliver(self, now: int) -> list[Delivery]:
        """Let board and plant run until `now`; the messages that the host has received by then.

        Raises RunError, once, when the board cannot use the robot's settings.
        """
        refusal, self.host.refusal = self.host.refusal, None
        if refusal is not None:
            raise RunError(Problem(refusal.code, "emulated board", refusal.cause, refusal.fix))
        deliveries: list[Delivery] = []
        while self.board.now < now:
            self._send(self.board.now)
            if self._resets and self.board.now >= min(self._resets):
                self._resets.remove(min(self._resets))
                self.board.emulator.reset()
            self.board.advance(min(now, self.board.now + STEP))
            deliveries += self._receive(self.board.now)
        # What no board reads: scans.
        for port, scan in self.board.plant.deliver():
            deliveries.append(Delivery(f"robot.{port}", scan))
        return deliveries + self._operator.deliver(now)

    def command(self, now: int, command: Wheels | Duty) -> None:
        self.host.command(now, command)
        self._send(now)

    def stop(self, now: int) -> None:
        """Stop, repeated until telemetry shows it."""
        self.host.stop(now)
        self._send(now)

    @property
    def stopped(self) -> bool:
        """True when the board's telemetry shows it."""
        return self.host.stopped

    def close(self) -> None:
        self.board.emulator.close()

    def _send(self, now: int) -> None:
        if self.host.due() <= now:
            data = self.host.send(now)
            if data and not self.robot.faults.loses():
                # Bytes do not overtake each other when a delay ends.
                self._sent_until = max(
                    now + self.radio + self.robot.faults.delay(), self._sent_until
                )
                self.board.send(self._sent_until, self.uart, self._damaged(data))

    def _damaged(self, data: bytes) -> bytes:
        """`data` with the bytes that the link damages."""
        faults = self.robot.faults
        share = faults.active.largest("link_damage")
        if not share:
            return data
        rng = faults.rng
        return bytes(
            each ^ (1 << rng.randrange(8)) if rng.random() < share else each for each in data
        )

    def _receive(self, now: int) -> list[Delivery]:
        messages = []
        waiting, faults = self.board.received, self.robot.faults
        radio = self.radio + faults.delay()
        while waiting and waiting[0][0] + radio <= now:
            time, uart, data = waiting.popleft()
            if uart == self.uart and not faults.loses():
                self._received_until = max(time + radio, self._received_until)
                messages += self.host.receive(self._received_until, self._damaged(data))
        messages += self.host.on_time(now)
        return [Delivery(f"robot.{port}", message) for port, message in messages]


def emulated_robot_driver(configuration: Configuration, seed: int) -> EmulatedRobotDriver:
    """The robot of a configuration with the real firmware on an emulated board.

    Raises EmulatorError naming the Debian packages when the emulator cannot be built.
    """
    robot, nominal = configuration.robot, configuration.nominal
    assert robot is not None and nominal is not None
    board = emulated_board(nominal, seed, build_world(configuration.world))
    return EmulatedRobotDriver(board, DiffbotHost(board_settings(robot)))


def emulated_board(
    nominal: Robot, seed: int, world: World | None = None, emulator: Emulator | None = None
) -> EmulatedBoard:
    """A board wired to its plant as the robot file states. Raises EmulatorError."""
    settings = board_settings(nominal)
    plant = draw_robot(nominal, nominal, seed, world)
    driver = nominal.drive.left.motor.driver
    return EmulatedBoard(plant, settings, emulator or board_emulator(settings, driver))


def board_emulator(settings: BoardSettings, driver: str = "") -> Emulator:
    """An emulator with the board and the motors of these settings. Raises EmulatorError."""
    return Emulator(
        motor_pins(settings, driver),
        board=settings.board,
        sonars=sonar_pins(settings),
        gyro=gyro_address(settings),
    )


def gyro_address(settings: BoardSettings) -> int:
    """The I2C address of the gyro, 0 for none."""
    return settings.gyro.address if settings.gyro else 0


def _sonars(settings: BoardSettings) -> list[RangeInput]:
    return [sensor for sensor in settings.further_ranges if sensor.trigger is not None]


def sonar_pins(settings: BoardSettings) -> list[SonarPins]:
    return [SonarPins(_or_none(sensor.trigger), sensor.pin) for sensor in _sonars(settings)]


def motor_pins(settings: BoardSettings, driver: str = "") -> list[MotorPins]:
    """The pins of the left and the right motor, and what their driver does.

    `driver`: its name in robot files; default: a usual one with these inputs.
    """
    states = driver_facts(driver or usual_driver(settings)).states
    shorts = sum(SHORTING[state] for state, effect in states.items() if effect == "shorted")
    return [
        MotorPins(
            _or_none(side.enable),
            side.in1,
            _or_none(side.in2),
            _or_none(settings.standby),
            shorts,
        )
        for side in (settings.left, settings.right)
    ]


def usual_driver(settings: BoardSettings) -> str:
    """A usual driver with the inputs that these settings state."""
    if settings.left.enable is None:
        return "drv8833"
    if settings.driver == DriverCode.ENABLE_DIRECTION:
        return "drv8838"
    return "l298n" if settings.standby is None else "tb6612"


def _or_none(pin: int | None) -> int:
    return PIN_NONE if pin is None else pin
