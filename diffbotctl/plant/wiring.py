"""An encoder's wire that tells nothing of its wheel: a dead light barrier, or a wire that is off.

The firmware's inputs have no pull-up, so a wire that hangs in the air picks up the mains.

How a simulated robot was soldered together: motors to the driver, encoders to the board.
"""

from __future__ import annotations

from random import Random

from diffbotctl.config.simulation import WiringTruth
from diffbotctl.plant.robot_parameters import PlantParameters
from diffbotctl.plant.wheel import LevelChange

MAINS = 20_000_000  # ns; one period of 50 Hz
HIGH = MAINS // 4  # ns that the pin is high in each: its threshold lies above the middle
TREMBLE = 1_000_000  # ns, standard deviation: no pick-up is quite regular


class MainsPickup:
    """What a pin does without any wheel; nothing at all when `chance` is None."""

    def __init__(self, chance: Random | None) -> None:
        self._chance = chance
        self._rise = 0 if chance is None else chance.randrange(MAINS)
        self._fall: int | None = None

    def changes(self, until: int) -> list[LevelChange]:
        """All that the pin did since the last call, until `until`."""
        found: list[LevelChange] = []
        if self._chance is None:
            return found
        while True:
            if self._fall is not None:
                if self._fall > until:
                    return found
                found.append(LevelChange(self._fall, 0))
                self._fall = None
            if self._rise > until:
                return found
            found.append(LevelChange(self._rise, 1))
            self._fall = self._rise + HIGH
            wait = MAINS + int(self._chance.gauss(0.0, TREMBLE))
            self._rise += max(wait, MAINS // 2)


Row = tuple[float, float]


class PlantWiring:
    """The wires between board, driver, motors and encoders.

    `outputs`: how each motor (row) follows each driver output (column): 1, -1, or 0 for not at all.
    `pins`: which side of the board hears the encoder of each wheel, None for neither. `hums`: by
    wheel, what its encoder's wire carries that tells nothing of it.
    """

    __slots__ = ("_wiring", "hums", "outputs", "pins")

    def __init__(self, wiring: WiringTruth, machine: PlantParameters, chance: Random) -> None:
        self._wiring = wiring
        self.hums = _hums(wiring, chance)
        self.tell(machine)

    def tell(self, machine: PlantParameters) -> None:
        """The board is told other settings; the wires stay."""
        self.outputs = _outputs(self._wiring, machine)
        self.pins = (self._pin(0, machine), self._pin(1, machine))

    def socket(self, wheel: int) -> int:
        """The socket that the encoder of `wheel` is plugged into: 0 stated for left, 1 right."""
        return 1 - wheel if self._wiring.encoders == "swapped" else wheel

    def _pin(self, wheel: int, machine: PlantParameters) -> int | None:
        socket = self.socket(wheel)
        return next((side for side in (0, 1) if machine.sockets[side] == socket), None)


def _outputs(wiring: WiringTruth, machine: PlantParameters) -> tuple[Row, Row]:
    """What the board is told as `reversed` undoes leads that are soldered the other way round."""
    table = [[0.0, 0.0], [0.0, 0.0]]
    for motor, way in enumerate((wiring.left, wiring.right)):
        if way == "dead":
            continue
        output = 1 - motor if way == "swapped" else motor
        leads = -1.0 if way == "reversed" else 1.0
        side = machine.channels[output]
        table[motor][output] = -leads if machine.reversed[side] else leads
    return (table[0][0], table[0][1]), (table[1][0], table[1][1])


def _hums(wiring: WiringTruth, chance: Random) -> dict[int, MainsPickup]:
    found = {}
    for wheel, (motor, encoder) in enumerate(
        ((wiring.left, wiring.left_encoder), (wiring.right, wiring.right_encoder))
    ):
        if encoder == "dead":
            found[wheel] = MainsPickup(None)
        elif "floating" in (motor, encoder):
            found[wheel] = MainsPickup(Random(chance.getrandbits(64)))
    return found
