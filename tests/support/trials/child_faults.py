"""Children of a run that are killed or suspended while it drives, and a cable that is pulled.

Real processes, in real time, with the book's board on a pseudo-terminal. A run goes on without its
hub, recorder, log writer or screen, and ends on request; without its watchdog it ends by
itself. Nothing is left behind: no process, no socket; the motors are off.
"""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from random import Random
from typing import NamedTuple

from diffbotctl.processes.real_time import ENGINE_PRIORITY, prefer
from diffbotctl.processes.screen import PACED_NICENESS
from diffbotctl.recording.reader import recording_info
from tests.support.book_board import STOCK, BookBoard, BookBoardPort
from tests.support.command_process import children_of
from tests.support.running import cli, command
from tests.support.serial_wire import SerialWire
from tests.support.trials.leftovers import leftovers, processes_of
from tests.support.trials.row import Row
from tests.support.trials.section import drawn

CHILDREN = ("hub", "recorder", "log", "screen", "watchdog")
EMULATOR = "emulator"
SIGNALS = {"killed": signal.SIGKILL, "suspended": signal.SIGSTOP}
START_TIMEOUT_S = 60.0
END_TIMEOUT_S = 60.0  # also on a busy machine; a run that hangs does not end at all
DRIVE_TIME_MAX_S = 1.5  # before the fault
OUTPUT_POLL_PERIOD_S = 0.05
AFTER_S = 1.5  # of the board's time, during which the run has to go on driving
UNPLUGGED_S = (0.5, 3.0)
HOST_FROZEN, FROZEN_MAX = "STOP host_frozen", 2
LINK_UP = "robot: link up"
FAR = ("--goal", "30 0", "--set", "world.walls=[]")


class SensingBoard(BookBoard):
    """A board whose distance is never the same twice: a sensor without any change is faulty."""

    def report(self) -> None:
        """Report counts and distance."""
        self.distance = 24.0 + 37.0 * self.now % 2.0
        super().report()


class FaultOutcome(NamedTuple):
    """`faults`: what was not as it should be; `output` of the run."""

    faults: list[str]
    output: str


class DrivingRun:
    """One run on the book's board, with all children, in a folder of its own."""

    def __init__(self, folder: Path, port: str, robot: tuple[str, ...] = STOCK) -> None:
        self.folder = folder
        self.recording, self.log = folder / "run.mcap", folder / "run.log"
        self.output_file = folder / "output.txt"
        line, environment = command(folder, "run", "goal", "--port", port, *robot, *FAR)
        line += ["--record", str(self.recording), "--log", str(self.log), "--name", "trial"]
        with open(self.output_file, "w") as output:  # a pipe would need a reader
            self.process = subprocess.Popen(
                line, env=environment, stdout=output, stderr=subprocess.STDOUT
            )
        prefer(self.process.pid, ENGINE_PRIORITY)  # a host without a processor stops the robot

    @property
    def output(self) -> str:
        """What it has printed."""
        return self.output_file.read_text()

    def child(self, kind: str) -> int:
        """The pid of one of CHILDREN, found by what only this child has."""
        for pid in children_of(self.process.pid):
            if kind == _kind(pid, self.recording, self.log):
                return pid
        raise AssertionError(f"there is no child {kind}")

    def end(self, number: int = signal.SIGTERM) -> int | None:
        """Send a signal and wait; the exit code, None if it does not end."""
        self.process.send_signal(number)
        return self.wait()

    def wait(self) -> int | None:
        """The exit code; None if it does not end."""
        try:
            return self.process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return None

    def kill(self) -> None:
        """Kill what is left of it."""
        for pid in processes_of(self.folder):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.process.wait()


def _kind(pid: int, recording: Path, log: Path) -> str:
    if os.getsid(pid) == pid:
        return "watchdog"
    if b"/emulator-" in Path(f"/proc/{pid}/cmdline").read_bytes():
        return EMULATOR
    if os.getpriority(os.PRIO_PROCESS, pid) == PACED_NICENESS:
        return "screen"
    files = {_target(link) for link in Path(f"/proc/{pid}/fd").iterdir()}
    if str(recording) in files:
        return "recorder"
    return "log" if str(log) in files else "hub"


def _target(link: Path) -> str:
    try:
        return str(link.readlink())
    except OSError:
        return ""


def moves(board: BookBoard) -> bool:
    """Whether both motors are on."""
    return board.pwm["left"] > 0 and board.pwm["right"] > 0


def is_off(board: BookBoard) -> bool:
    """Whether the last commands were zero."""
    return board.pwm == {"left": 0, "right": 0}


def child_fault(kind: str, number: int, seed: int) -> FaultOutcome:
    """A signal to one child of a run that drives.

    Repeated, twice at most, when the computer did not run the engine: then the robot stands until a
    person resumes it, which needs the hub, and the run reports nothing about the child.
    """
    outcome = _child_fault(kind, number, seed)
    for _ in range(FROZEN_MAX):
        if not outcome.faults or HOST_FROZEN not in outcome.output:
            break
        outcome = _child_fault(kind, number, seed)
    return outcome


def _child_fault(kind: str, number: int, seed: int) -> FaultOutcome:
    with tempfile.TemporaryDirectory() as name, BookBoardPort(SensingBoard()) as port:
        run = DrivingRun(Path(name), port.name)
        try:
            _drive(port, Random(seed))
            os.kill(run.child(kind), number)
            goes_on = kind != "watchdog"
            if goes_on:
                _drive(port, None)
            code = run.end() if goes_on else run.wait()
            faults = _ending_faults(run, port.board, code, 130 if goes_on else 1)
            faults += _file_faults(run, "" if number == signal.SIGSTOP else kind)
            return FaultOutcome(faults, run.output)
        except AssertionError as error:
            return FaultOutcome([str(error)], run.output)
        finally:
            run.kill()


def emulator_fault(number: int, seed: int) -> FaultOutcome:
    """A signal to the emulator of a run in real time: the run ends, and reports the cause."""
    with tempfile.TemporaryDirectory() as name:
        run = DrivingRun(Path(name), "emulated", ("--robot", "book_2wd"))
        try:
            _wait_for_text(run, "driving")
            time.sleep(Random(seed).uniform(0.0, DRIVE_TIME_MAX_S))
            os.kill(run.child(EMULATOR), number)
            code = run.wait()
            faults = [] if code == 1 else [f"exit code {code}, not 1"]
            faults += [] if "E-EMULATOR" in run.output else ["no E-EMULATOR"]
            return FaultOutcome(faults + leftovers(run.folder) + _file_faults(run, ""), run.output)
        except AssertionError as error:
            return FaultOutcome([str(error)], run.output)
        finally:
            run.kill()


def _wait_for_text(run: DrivingRun, text: str, times: int = 1) -> None:
    deadline = time.monotonic() + START_TIMEOUT_S
    while run.output.count(text) < times:
        assert time.monotonic() < deadline, f"it never printed '{text}'"
        time.sleep(OUTPUT_POLL_PERIOD_S)


def unplugged(seed: int) -> FaultOutcome:
    """The port vanishes and comes back: zeros alone, until `resume`; then it drives on."""
    rng = Random(seed)
    with (
        tempfile.TemporaryDirectory() as name,
        BookBoardPort(SensingBoard()) as port,
        SerialWire(port.name, Path(name) / "ttyUSB0") as wire,
    ):
        run = DrivingRun(Path(name), str(wire.name))
        try:
            _drive(port, rng)
            wire.pull()
            with port.changed:
                at = port.board.now
            # What the wire carried before it was pulled is read in the board's next step.
            port.wait_for(lambda board: board.now > at, START_TIMEOUT_S)
            before = len(port.board.commands)
            pause = rng.uniform(*UNPLUGGED_S)
            port.wait_for(lambda board: board.now > at + pause, START_TIMEOUT_S)
            wire.plug()
            port.wait_for(lambda board: len(board.commands) > before + 20, START_TIMEOUT_S)
            values = {value for _, _, value in port.board.commands[before:]}
            faults = [] if values == {0} else [f"commands before resume: {values}"]
            _wait_for_text(run, LINK_UP, 2)  # until then `resume` fails with an error
            code, text, complaint = cli(Path(name), "resume")
            faults += [] if code == 0 else [f"resume failed: {text} {complaint}"]
            _drive(port, None)
            faults += _ending_faults(run, port.board, run.end(), 130)
            return FaultOutcome(faults + _file_faults(run, ""), run.output)
        except AssertionError as error:
            return FaultOutcome([str(error)], run.output)
        finally:
            run.kill()


def _drive(port: BookBoardPort, rng: Random | None) -> None:
    """Wait until it has driven, for a random time at first and AFTER_S later on."""
    with port.changed:
        begin = port.board.now
    if rng is None:
        port.wait_for(lambda board: board.now > begin + AFTER_S and moves(board), START_TIMEOUT_S)
        return
    port.wait_for(moves, START_TIMEOUT_S)
    time.sleep(rng.uniform(0.0, DRIVE_TIME_MAX_S))
    port.wait_for(moves, START_TIMEOUT_S)


def _ending_faults(run: DrivingRun, board: BookBoard, code: int | None, expected: int) -> list[str]:
    faults = []
    if code is None:
        faults.append("it did not end")
    elif code != expected:
        faults.append(f"exit code {code}, not {expected}")
    if not is_off(board):
        faults.append(f"the motors are on: {board.pwm}")
    if "final stop confirmed" not in run.output:
        faults.append("no confirmed stop")
    return faults + leftovers(run.folder)


def _file_faults(run: DrivingRun, killed: str) -> list[str]:
    """Recording and log are whole, but for those whose writer was killed."""
    faults = []
    info = recording_info(run.recording)
    if info.complete == (killed == "recorder"):
        faults.append(f"the recording is {'' if info.complete else 'in'}complete")
    if (killed == "recorder") != ("RECORDING STOPPED" in run.output):
        faults.append("the loss of the recording is not reported, or reported without one")
    if (killed == "log") == ('"ended: ' in run.log.read_text()):
        faults.append("the log has not the end that it should have")
    return faults


def rows(seed: int, trials: int, kinds: int = 100) -> Iterator[Row]:
    """One row for each child and signal, and one for the cable; `trials` of each.

    `kinds`: at most as many of them.
    """
    rng = Random(seed)
    cases: list[tuple[str, Callable[[int], FaultOutcome]]] = [
        (f"{kind} {how}", partial(child_fault, kind, number))
        for kind in CHILDREN
        for how, number in SIGNALS.items()
    ]
    for how, number in SIGNALS.items():
        cases.append((f"{EMULATOR} {how}", partial(emulator_fault, number)))
    cases.append(("cable unplugged and replugged", unplugged))
    for name, case in drawn(cases, kinds, seed):
        outcomes = [case(rng.getrandbits(31)) for _ in range(trials)]
        for outcome in outcomes:
            for fault in outcome.faults:
                print(f"        {name}: {fault}\n{outcome.output[-1500:]}")
        good = sum(not outcome.faults for outcome in outcomes)
        yield Row.counted(f"F {name}: goes on or ends, nothing is left", good, trials)
