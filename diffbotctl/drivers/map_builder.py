"""The source `map`: the engine's end of the process that builds the map.

The process alone imports numpy. It gets one packet for each scan and request, and answers each with
one packet. The engine never waits for it, but in a simulation (drivers/virtual_sources.py).
"""

from __future__ import annotations

import json
import os
import pickle
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from typing import Any

from diffbotctl.block import In, Out
from diffbotctl.device import DeviceDriver, DeviceError, Reading
from diffbotctl.messages import MapRequest, MapUpdate, ScanPoints
from diffbotctl.params import Param, declared
from diffbotctl.time import SECOND

PACKET_MAX_BYTES = 1 << 19
UNANSWERED_MAX = 3  # scans; a process that is slower gets no more until it has answered
ANSWER_TIMEOUT = 10 * SECOND
EXIT_TIMEOUT_S = 5.0  # it saves the map at its end
START_TIMEOUT_S = 30.0
VIRTUAL_DELAY = SECOND // 10
ONE_THREAD = {
    name: "1"
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")
}


class MapSource(DeviceDriver):
    """Build a map of scans, in a process of its own, or find the robot in a saved map.

    Block `slam` sends the scans and takes the answers. In a simulation each answer comes 100 ms
    after its scan, in the time of the simulation.

    sources:
      map: {driver: map_builder, in: {scan: slam.points, request: slam.request}, timeout: 10 s}
    """

    load = Param(str, default="", help="Name of a saved map, in which the robot is searched for.")
    resolution = Param(
        float, unit="m", default=0.05, minimum=0.02, maximum=0.5, help="Side of a cell of the map."
    )
    range_max = Param(
        float,
        unit="m",
        default=12.0,
        minimum=0.5,
        maximum=100.0,
        help="Distance up to which points are used.",
    )
    autosave = Param(
        bool,
        default=True,
        help="Save the map as `autosave` twice a minute and at the end of the run.",
    )

    scan = In(ScanPoints, help="The corrected scan.")
    request = In(MapRequest, help="What to do with the map.")
    update = Out(MapUpdate, help="The answer to each scan and request.")

    is_on_demand = True
    poll_period = 1.0
    virtual_delay = VIRTUAL_DELAY

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        self.channel: socket.socket | None = None
        self.process: subprocess.Popen[bytes] | None = None
        self.unanswered: list[int] = []  # times at which packets were sent, ns
        self.dropped = 0
        self.last: MapUpdate | None = None

    def device_name(self) -> str:
        return f"process {self.process.pid}" if self.process is not None else "its process"

    def open(self) -> int:
        """Start the process; after its death with the map that was saved last."""
        self.close()
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        for end in (ours, theirs):
            end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, PACKET_MAX_BYTES)
        facts = {name: getattr(self, name) for name in declared(type(self))}
        if self.last is not None:
            facts["resume"] = [self.last.x, self.last.y, self.last.heading]
            facts["map"] = self.last.map + 1
            facts["grows"] = self.last.state == "mapping"
        words = ["-m", "diffbotctl.drivers.map_process", str(theirs.fileno()), json.dumps(facts)]
        self.process = subprocess.Popen(
            [sys.executable, *words],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **ONE_THREAD},
            start_new_session=True,
        )
        theirs.close()
        ours.setblocking(False)
        self.channel, self.unanswered = ours, []
        return ours.fileno()

    def write(self, now: int, port: str, message: Any) -> None:
        """Send a scan or a request; a scan is left out while the process is behind."""
        if self.channel is None:
            return
        if port == "scan" and len(self.unanswered) >= UNANSWERED_MAX:
            self.dropped += 1
            return
        try:
            self.channel.send(pickle.dumps((port, tuple(message))))
        except BlockingIOError:
            self.dropped += 1
        except OSError as error:
            raise DeviceError(self._end_text(), "it is started again") from error
        else:
            self.unanswered.append(now)

    def read(self, now: int) -> list[Reading]:
        """The answers that have come."""
        readings = []
        while (update := self._receive()) is not None:
            readings.append(Reading("update", update))
        if self.unanswered and now - self.unanswered[0] > ANSWER_TIMEOUT:
            cause = f"it has not answered for {ANSWER_TIMEOUT // SECOND} s"
            raise DeviceError(cause, "it is started again")
        return readings

    def answer(self) -> MapUpdate:
        """Wait for the next answer. Raises DeviceError."""
        assert self.channel is not None
        self.channel.settimeout(START_TIMEOUT_S)
        try:
            update = self._receive()
        finally:
            self.channel.setblocking(False)
        if update is None:
            raise DeviceError(f"it has not answered for {START_TIMEOUT_S:g} s", "look at `top`")
        return update

    def _receive(self) -> MapUpdate | None:
        """The next answer; None when there is none yet. Raises DeviceError."""
        if self.channel is None:
            return None
        try:
            data = self.channel.recv(PACKET_MAX_BYTES)
        except (BlockingIOError, TimeoutError):
            return None
        except OSError:
            data = b""
        if not data:
            raise DeviceError(self._end_text(), "it is started again")
        kind, values = pickle.loads(data)
        if kind == "failed":
            raise DeviceError(f"it failed: {values}", "report this; it is started again")
        if self.unanswered:
            self.unanswered.pop(0)
        self.last = MapUpdate(*values)
        return self.last

    def _end_text(self) -> str:
        code = None
        if self.process is not None:
            with suppress(subprocess.TimeoutExpired):
                code = self.process.wait(0.1)
        if code is not None and code < 0:
            return f"it was ended by {signal.Signals(-code).name}"
        return f"it ended with code {code}"

    def close(self) -> None:
        """Close the channel, so that the process saves the map and ends."""
        if self.channel is not None:
            self.channel.close()
            self.channel = None
        if self.process is not None:
            try:
                self.process.wait(EXIT_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
            self.process = None
