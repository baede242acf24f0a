"""Programs of a pipeline that fail in every way while they drive, and what the engine does then."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from diffbotctl.messages import Stop, Wheels
from diffbotctl.processes.real_time import ENGINE_PRIORITY, prefer
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.replay.replay import replay
from diffbotctl.time import SECOND
from tests.support.command_process import command_line, processor_s

TIMEOUT_S = 0.3
DRIVEN_LINES = 12  # that the program sends before it fails, 20 a second
# It fails the first time only: started again it drives as if nothing had happened.
FAILING = """
import os, signal, sys, time

kind, marker = sys.argv[1], sys.argv[2]
GOOD = b'{"lead": {"linear": 0.1, "angular": 0.0}}\\n'
WRONG = {
    "garbage": b"\\x00\\xff\\xfe garbage\\n",
    "wrong_type": b'{"lead": {"linear": "fast", "angular": 0}}\\n',
    "wrong_field": b'{"lead": {"speed": 1.0}}\\n',
    "wrong_output": b'{"follow": {"linear": 0.1, "angular": 0}}\\n',
    "not_a_number": b'{"lead": {"linear": NaN, "angular": 0}}\\n',
    "nan_as_text": b'{"lead": {"linear": "nan", "angular": 0}}\\n',
    "list": b"[1, 2, 3]\\n",
    "nested": b"[" * 30000 + b"\\n",
    "long_line": b" " * 200000 + b"\\n",
}


def send(data):
    while data:
        data = data[os.write(1, data):]


first = is_first = not os.path.exists(marker)
open(marker, "w").close()
sent = 0
while True:
    send(GOOD)
    sent += 1
    if not is_first and sent == 10:
        open(marker + "_back", "w").close()
    time.sleep(0.05)
    if not first or sent < int(sys.argv[3]):
        continue
    first = False
    if kind in WRONG:
        send(WRONG[kind])
    elif kind == "raise":
        raise KeyError("no one is there")
    elif kind == "exit":
        sys.exit(0)
    elif kind == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    elif kind == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    elif kind == "half_line":
        send(GOOD[:20])
        time.sleep(60)
    elif kind == "hang":
        time.sleep(60)
    elif kind == "suspended":
        os.kill(os.getpid(), signal.SIGSTOP)
    elif kind == "closes":
        os.close(0)
        os.close(1)
        time.sleep(60)
    elif kind == "flood":
        while True:
            send(GOOD * 1000)
    elif kind == "flood_of_empty":
        while True:
            send(b"{}\\n" * 10000)
"""
CAUSES = {  # what the cause of the stop must contain, beside the program's name
    "raise": "ended with code 1: KeyError",
    "exit": "ended with code 0",
    "crash": "SIGSEGV",
    "killed": "SIGKILL",
    "garbage": "not JSON",
    "wrong_type": "linear must be a number",
    "wrong_field": "no field 'speed'",
    "wrong_output": "no output 'follow'",
    "not_a_number": "NaN",
    "nan_as_text": "must be a number",
    "list": "not a JSON object",
    "nested": "",
    "long_line": "bytes",
    "half_line": "nothing on nose.lead for",
    "hang": "nothing on nose.lead for",
    "suspended": "nothing on nose.lead for",
    "closes": "closed its output",
    "flood": "in a second",
    "flood_of_empty": "in a second",
}
MARGIN_S = 0.15  # beyond the timeout: a telemetry period, and a closed socket
BACK_TIMEOUT_S = 60  # a busy machine starts it late
PIPELINE = """
format: 1
kind: pipeline
include: goal
goals: []
world: {{walls: []}}
programs:
  nose:
    run: {python} failing.py {kind} marker {lines}
    in: {{odometry: odometry.odometry}}
    out: {{lead: Twist}}
    timeout: {timeout} s
blocks:
  mux: {{in: {{autonomous: nose.lead}}}}
"""


class FailureOutcome(NamedTuple):
    """What a failing program came to. Times in s.

    `silence`: from its last valid message to the stop. `came_back`: messages
    of the program that was started again. `moved`: whether a wheel was commanded to turn after the
    stop. `is_equal`: a replay without the program is the same. `load`: share of a core that the
    engine used, from the program's first start on.
    """

    kind: str
    silence: float
    latched: bool
    cause: str
    came_back: int
    moved: bool
    is_equal: bool
    load: float = 0.0

    @property
    def is_right(self) -> bool:
        """Whether the robot was stopped, with the cause, and stayed stopped."""
        named = "nose" in self.cause and CAUSES[self.kind] in self.cause
        return named and self.latched and self.came_back > 0 and not self.moved

    @property
    def is_in_time(self) -> bool:
        """Whether the stop came within the timeout."""
        return 0.0 <= self.silence <= TIMEOUT_S + MARGIN_S


def fail(
    folder: Path, kind: str, lines: int = DRIVEN_LINES, timeout: float = TIMEOUT_S
) -> FailureOutcome:
    """Run a program that fails as `kind` after `lines` messages, and is started again.

    `timeout`: of what it publishes (s).
    """
    (folder / "failing.py").write_text(FAILING)
    pipeline, recording = folder / "failing.yaml", folder / "failing.mcap"
    pipeline.write_text(
        PIPELINE.format(python=sys.executable, kind=kind, lines=lines, timeout=timeout)
    )
    words = ["run", str(pipeline), "--stay", "--quiet", "--allow-programs"]
    words += ["--record", str(recording), "--no-socket"]
    process = subprocess.Popen(
        command_line(*words),
        env={**os.environ, "XDG_STATE_HOME": str(folder / "state")},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    # Without a processor for half a second the engine stops the robot that much later.
    prefer(process.pid, ENGINE_PRIORITY)
    _wait_for(folder / "marker", process)
    used, begun = processor_s(process.pid), time.monotonic()
    _wait_for(folder / "marker_back", process)
    load = (processor_s(process.pid) - used) / (time.monotonic() - begun)
    process.send_signal(signal.SIGTERM)
    _, complaints = process.communicate(timeout=60)
    if not recording.exists():
        return FailureOutcome(kind, -1.0, False, complaints.decode(), 0, True, False)
    return _outcome(kind, recording)._replace(load=load)


def _wait_for(file: Path, process: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + BACK_TIMEOUT_S
    while not file.exists() and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.02)


def _outcome(kind: str, recording: Path) -> FailureOutcome:
    stop: Stop | None = None
    last = stopped = came_back = 0
    moved = False
    for item in RecordingReader(recording).messages():
        if item.wire == "gate.stop" and isinstance(item.message, Stop):
            # A busy machine may delay the telemetry, which is another stop, and ends by itself.
            if stop is None and item.message.code == "input_stale":
                stop, stopped = item.message, item.time
        elif item.wire == "nose.lead" and stop is None:
            last = item.time
        elif item.wire == "nose.lead":
            came_back += 1
        elif item.wire == "gate.wheels" and stop is not None and isinstance(item.message, Wheels):
            moved = moved or item.message.left != 0 or item.message.right != 0
    is_equal = replay(recording, check=True).difference is None
    silence = (stopped - last) / SECOND if stop else -1.0
    cause, latched = (stop.cause, stop.latched) if stop else ("it was not stopped", False)
    return FailureOutcome(kind, silence, latched, cause, came_back, moved, is_equal)
