"""Driver of the lidars in parts/lidars.yaml: requests, motor, spin-up, and who else answers."""

from __future__ import annotations

import fcntl
import struct
import termios
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from math import inf

from diffbotctl.block import Out
from diffbotctl.device import DeviceDriver, DeviceError, Reading
from diffbotctl.drivers.serial_port import SerialPortDevice
from diffbotctl.errors import RunError, join_words
from diffbotctl.geometry.lidars import LIDARS, LidarModel, LidarProtocol
from diffbotctl.links.lidar_packets import (
    LdrobotDecoder,
    Lds01Decoder,
    Lds02Decoder,
    YdlidarDecoder,
)
from diffbotctl.links.lidar_samples import RplidarDecoder
from diffbotctl.links.lidar_turns import SURE_PACKETS, Distances, LidarAnswers, LidarDecoder
from diffbotctl.messages import Scan
from diffbotctl.params import Param
from diffbotctl.time import MILLISECOND, SECOND

DECODERS: dict[LidarProtocol, Callable[[int], LidarDecoder]] = {
    "lds01": Lds01Decoder,
    "lds02": Lds02Decoder,
    "ldrobot": LdrobotDecoder,
    "rplidar": RplidarDecoder,
    "ydlidar": YdlidarDecoder,
}
START_DELAY = 20 * MILLISECOND  # the RPLIDAR wants 1 ms between two requests
HEALTH_DELAY = 100 * MILLISECOND  # for its answer, before the request to start
START_PERIOD = SECOND  # between two requests to start, until the lidar answers
ANSWERED_PERIOD = 4 * SECOND  # the same once it has: its motor comes to speed
OWN_RATE_TIME = 5 * SECOND // 2  # for the declared model to be recognized
OTHER_MODEL_TIME = SECOND  # for others to be recognized, at each baud rate
START_MAX = 23 * SECOND // 2  # for the first turn; from cold, the motor needs up to 8 s
KEPT_BYTES = 4096  # of what comes before the lidar is recognized
GARBAGE_BYTES = 64  # unrecognized, which are reported
PERIODS_AVERAGED = 8  # turns, over which the delays of USB and of the engine even out
STATUS_WARNING, STATUS_FAULT = 1, 2


class Lidar(DeviceDriver):
    """Read the scans of a lidar at a USB port or at the UART of a Raspberry Pi.

    A robot file that states the `device` of its lidar needs no source. A turn with damaged or
    missing parts is dropped. These devices report an object that is too near to be measured as free
    space: mount them where the robot itself keeps that distance.

    sources:
      lidar: {driver: lidar, with: {device: /dev/ttyUSB1, model: rplidar_a1}}
    """

    device = Param(str, help="Path of the serial port, best one in /dev/serial/by-id.")
    model = Param(str, choices=tuple(LIDARS), help="Model of the lidar.")
    upside_down = Param(bool, default=False, help="Whether it is mounted upside down.")

    scan = Out(Scan, help="One whole turn, 4 to 13 times a second.")

    poll_period = 0.02  # the first request, and its repetition
    start_timeout = 12.0  # s; longer than START_MAX

    def __init__(self, **values: object) -> None:
        super().__init__(**values)
        self.facts = LIDARS[self.model]
        self.port: SerialPortDevice | None = None
        self.is_faulty = False
        self._restart()

    def _restart(self) -> None:
        self.decoder = new_decoder(self.facts)
        self.answers = LidarAnswers()
        self.reported = 0
        self.opened_at: int | None = None
        self.requests = deque(filter(None, (self.facts.health, self.facts.start)))
        self.request_due = 0
        self.has_turned = False
        self.turned_at: deque[int] = deque(maxlen=PERIODS_AVERAGED + 1)  # since a turn was lost
        self.period = 1.0 / self.facts.rate  # s, by the times at which turns came
        self.kept = b""
        self.garbage = 0  # bytes at the declared rate that no decoder recognized
        # baud rates at which another lidar may answer, from the last one on
        self.rates = sorted({model.baud for model in LIDARS.values()} - {self.facts.baud})
        self.rates.append(self.facts.baud)
        self.rate_until = 0

    def open(self) -> int:
        """Open the port and stop what the device did before; `read` starts it."""
        try:
            self.port = SerialPortDevice(self.device, self.facts.baud)
        except RunError as error:
            problem = error.problems[0]
            raise DeviceError(problem.cause, problem.fix) from error
        self._restart()
        self._set_motor(True)
        self.port.write(bytes.fromhex(self.facts.reset if self.is_faulty else self.facts.stop))
        self.is_faulty = False
        return self.port.fd

    def read(self, now: int) -> list[Reading]:
        """The turn that was completed; of several the last one."""
        assert self.port is not None
        data = self.port.read()
        if self.opened_at is None:
            self.opened_at, self.request_due = now, now + START_DELAY
            self.rate_until = now + OWN_RATE_TIME
        is_own_rate = self.port.baud == self.facts.baud
        turns = self.decoder.receive(data) if is_own_rate else []
        self._note_turns(now, len(turns))
        if turns:
            return [Reading("scan", self._scan(now, turns[-1]))]
        if not self.has_turned:
            self._start(now, data)
        return []

    def close(self) -> None:
        if self.port is None:
            return
        with suppress(OSError):
            self.port.write(bytes.fromhex(self.facts.stop))
            self._set_motor(False)
        self.port.close()
        self.port = None

    def _note_turns(self, now: int, count: int) -> None:
        damaged = self.decoder.turns.damaged
        if damaged > self.reported:
            self.log.warning(f"{damaged - self.reported} damaged turns were dropped")
            self.reported = damaged
            self.turned_at.clear()
        self.turned_at.extend([now] * count)
        self.has_turned = self.has_turned or bool(count)
        if len(self.turned_at) > 1:
            time = self.turned_at[-1] - self.turned_at[0]
            self.period = time / (len(self.turned_at) - 1) / SECOND

    def _scan(self, now: int, turn: Distances) -> Scan:
        near, reach = self.facts.near, self.facts.reach
        distances = tuple(inf if far > reach else 0.0 if far < near else far for far in turn)
        # Clockwise, seen from its own upper side.
        step = self.facts.ray_angle if self.upside_down else -self.facts.ray_angle
        return Scan(now, 0.0, step, distances, self.decoder.period or self.period)

    def _start(self, now: int, data: bytes) -> None:
        """Bring the lidar to its first turn. Raises DeviceError when that fails."""
        assert self.port is not None and self.opened_at is not None
        self.answers.receive(data)
        self._check_health()
        if now >= self.opened_at + START_MAX:
            raise self._failure()
        if self.decoder.packets >= SURE_PACKETS:
            return
        self.kept = (self.kept + data)[:KEPT_BYTES]
        is_own = self.port.baud == self.facts.baud
        if is_own and self.requests and now >= self.request_due:
            self._request(now)
        if now >= self.rate_until and (not self.answers.has_started or self.kept):
            self._try_rates(now)

    def _request(self, now: int) -> None:
        """Send the next request: for the health once, then to start."""
        assert self.port is not None
        request = self.requests[0]
        self.port.write(bytes.fromhex(request))
        if request == self.facts.health:
            self.requests.popleft()
            self.request_due = now + HEALTH_DELAY
        else:
            has_answered = self.answers.has_started
            self.request_due = now + (ANSWERED_PERIOD if has_answered else START_PERIOD)

    def _check_health(self) -> None:
        """Raise DeviceError for a fault that the lidar reports; log a warning."""
        status, code = self.answers.status, f"code 0x{self.answers.code:04x}"
        if status is None:
            return
        self.answers.status = None
        if status == STATUS_WARNING:
            self.log.warning(f"it works, but warns of its state, {code}")
        elif status >= STATUS_FAULT:
            self.is_faulty = True
            cause = f"it reports a fault of its hardware, {code}"
            fix = "check that its rotor turns freely, and switch its power off and on"
            raise DeviceError(cause, fix)

    def _try_rates(self, now: int) -> None:
        """Look for another lidar in what has come; then start those of the next baud rate.

        After the last one the driver waits for the declared lidar. Raises DeviceError.
        """
        assert self.port is not None
        baud = self.port.baud
        if baud == self.facts.baud:
            self.garbage = max(self.garbage, len(self.kept))
        found = recognized(self.kept, baud)
        if found:
            names = join_words(found)
            cause = f"its type is {self.model}, but it sends at {baud} baud what {names} sends"
            raise DeviceError(cause, f"write type: {names} in the robot file")
        self.kept = b""
        is_last = not self.rates
        following = self.facts.baud if is_last else self.rates.pop()
        self.rate_until = now + (START_MAX if is_last else OTHER_MODEL_TIME)
        with suppress(RunError):  # an adapter without this rate
            self.port.change_baud(following)
        for model in LIDARS.values():
            if model.baud == following and not is_last:
                self.port.write(bytes.fromhex(model.start))

    def _failure(self) -> DeviceError:
        """Why there was no turn, by what came instead."""
        title, baud = self.facts.title, self.facts.baud
        if self.decoder.turns.damaged:
            cause = "all its turns come damaged"
            return DeviceError(cause, "check plug and cable; keep it away from the motors' wires")
        if self.decoder.packets >= SURE_PACKETS or self.answers.has_started:
            cause = "it answers, but no whole turn comes: its motor does not reach its speed"
            return DeviceError(cause, "check its supply of 5 V, and that its rotor turns freely")
        if self.garbage >= GARBAGE_BYTES:
            cause = f"what it sends at {baud} baud is of no known lidar, and of no {title}"
            return DeviceError(cause, "check its type, and with `diffbotctl ports` its device")
        return DeviceError("nothing comes from it", "check its plug, cable, power and device")

    def _set_motor(self, runs: bool) -> None:
        """Switch the motor, which some adapters do by the line DTR."""
        assert self.port is not None
        if self.facts.motor == "internal":
            return
        is_low = (self.facts.motor == "dtr_low") == runs
        request = termios.TIOCMBIC if is_low else termios.TIOCMBIS
        with suppress(OSError):  # a pseudo-terminal has no such line
            fcntl.ioctl(self.port.fd, request, struct.pack("I", termios.TIOCM_DTR))


def new_decoder(model: LidarModel) -> LidarDecoder:
    return DECODERS[model.protocol](model.rays)


def recognized(data: bytes, baud: int) -> list[str]:
    """The models that send such bytes at this rate."""
    found = []
    for name, model in LIDARS.items():
        decoder = new_decoder(model)
        decoder.receive(data)
        if model.baud == baud and decoder.packets >= SURE_PACKETS:
            found.append(name)
    return found
