"""The wiring of a simulated robot, with faults."""

from __future__ import annotations

from random import Random

from diffbotctl.config.simulation import WiringTruth
from diffbotctl.plant.encoder_disc import LevelChange
from diffbotctl.plant.faults import ActiveFaults
from diffbotctl.plant.robot_parameters import PlantParameters

MAINS_PERIOD = 20_000_000  # ns; 50 Hz
MAINS_HIGH_TIME = MAINS_PERIOD // 4  # ns; the pin's threshold lies above the middle of the sine
MAINS_JITTER = 1_000_000  # ns, standard deviation

MotorRow = tuple[float, float]


class MainsPickup:
    """50 Hz mains pick-up on a floating encoder input; no change at all when `rng` is None.

    The firmware's inputs have no pull-up, so an unconnected wire picks up the mains; a dead light
    barrier keeps its level.
    """

    def __init__(self, rng: Random | None) -> None:
        self._rng = rng
        self._rise = 0 if rng is None else rng.randrange(MAINS_PERIOD)
        self._fall: int | None = None

    def changes(self, until: int) -> list[LevelChange]:
        """The pin's changes since the last call, until `until`."""
        changes: list[LevelChange] = []
        if self._rng is None:
            return changes
        while True:
            if self._fall is not None:
                if self._fall > until:
                    return changes
                changes.append(LevelChange(self._fall, 0))
                self._fall = None
            if self._rise > until:
                return changes
            changes.append(LevelChange(self._rise, 1))
            self._fall = self._rise + MAINS_HIGH_TIME
            period = MAINS_PERIOD + int(self._rng.gauss(0.0, MAINS_JITTER))
            self._rise += max(period, MAINS_PERIOD // 2)


class PlantWiring:
    """The wires between board, driver, motors and encoders.

    `outputs`: 2x2 matrix from the board's motor outputs (columns) to the motors (rows): 1, -1 or 0.
    `pins`: the side of the board to which the encoder of each wheel is connected, None for neither;
    `wheels_at`: the other way round.
    `pickups`: by wheel, the signal on the wire of an encoder that does not work.
    """

    __slots__ = (
        "_built_pickups",
        "_faults",
        "_parameters",
        "_wiring",
        "outputs",
        "pickups",
        "pins",
        "wheels_at",
    )

    def __init__(self, wiring: WiringTruth, parameters: PlantParameters, rng: Random) -> None:
        self._wiring, self._faults = wiring, ActiveFaults()
        self.pickups = self._built_pickups = _pickups(wiring, rng)
        self.set_board(parameters)

    def set_faults(self, now: int, faults: ActiveFaults) -> None:
        """What is wrong from `now` (ns) on, beside the wires as they were built."""
        self._faults = faults
        pickups = dict(self._built_pickups)
        for wheel in (0, 1):
            kept = self.pickups.get(wheel)
            for kind, rng in (
                ("encoder_dead", None),
                ("encoder_floating", Random(f"pickup {wheel}")),
            ):
                if faults.has(kind, wheel):
                    pickups[wheel] = kept or MainsPickup(rng)
                    pickups[wheel].changes(now)  # what was before has not been picked up
        self.pickups = pickups
        self.set_board(self._parameters)

    def set_board(self, parameters: PlantParameters) -> None:
        """Update what depends on the board's settings; the wires stay."""
        self._parameters = parameters
        self.outputs = _with_faults(_outputs(self._wiring, parameters), self._faults)
        self.pins = (self._pin(0, parameters), self._pin(1, parameters))
        self.wheels_at = tuple(
            next((wheel for wheel in (0, 1) if self.pins[wheel] == side), None) for side in (0, 1)
        )

    def socket(self, wheel: int) -> int:
        """The socket that the encoder of `wheel` is plugged into: 0 stated for left, 1 right."""
        is_crossed = self._wiring.encoders == "swapped"
        return 1 - wheel if is_crossed != self._faults.has("encoders_exchanged") else wheel

    def channel(self, wheel: int, channel: int) -> int:
        """The input (0 for A, 1 for B) that this channel of a wheel's encoder is connected to."""
        return 1 - channel if self._exchanged(wheel) else channel

    def counts_down(self, wheel: int, side: int) -> bool:
        """Whether the board counts this wheel's two channels down going forward, on its `side`."""
        return self._exchanged(wheel) != self._parameters.encoder_reversed[side]

    def _exchanged(self, wheel: int) -> bool:
        wiring = self._wiring.right_encoder if wheel else self._wiring.left_encoder
        return (wiring == "exchanged") != self._faults.has("encoder_reversed", wheel)

    def _pin(self, wheel: int, parameters: PlantParameters) -> int | None:
        socket = self.socket(wheel)
        return next((side for side in (0, 1) if parameters.sockets[side] == socket), None)


def _outputs(wiring: WiringTruth, parameters: PlantParameters) -> tuple[MotorRow, MotorRow]:
    """The matrix `outputs`: the setting `reversed` undoes leads that are soldered reversed."""
    matrix = [[0.0, 0.0], [0.0, 0.0]]
    for motor, fault in enumerate((wiring.left, wiring.right)):
        if fault == "dead":
            continue
        output = 1 - motor if fault == "swapped" else motor
        sign = -1.0 if fault == "reversed" else 1.0
        side = parameters.channels[output]
        matrix[motor][output] = -sign if parameters.reversed[side] else sign
    return (matrix[0][0], matrix[0][1]), (matrix[1][0], matrix[1][1])


def _with_faults(
    outputs: tuple[MotorRow, MotorRow], faults: ActiveFaults
) -> tuple[MotorRow, MotorRow]:
    """The matrix with motors that are dead, reversed or exchanged."""
    rows = list(outputs)
    if faults.has("motors_exchanged"):
        rows.reverse()
    for motor, (left, right) in enumerate(rows):
        factor = -1.0 if faults.has("motor_reversed", motor) else 1.0
        factor *= not faults.has("motor_dead", motor)
        rows[motor] = (factor * left, factor * right)
    return rows[0], rows[1]


def _pickups(wiring: WiringTruth, rng: Random) -> dict[int, MainsPickup]:
    pickups = {}
    for wheel, (motor, encoder) in enumerate(
        ((wiring.left, wiring.left_encoder), (wiring.right, wiring.right_encoder))
    ):
        if encoder == "dead":
            pickups[wheel] = MainsPickup(None)
        elif "floating" in (motor, encoder):
            pickups[wheel] = MainsPickup(Random(rng.getrandbits(64)))
    return pickups
