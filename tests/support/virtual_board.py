"""A virtual board in this process, and diffbotctl's commands as processes of their own.

The board runs the real firmware behind real pseudo-terminals, and keeps pace with real time in a
thread; a command is what a person types at a prompt.
"""

import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from diffbotctl.config.load import load_robot
from diffbotctl.emulator.virtual_board import VirtualBoard, virtual_board
from diffbotctl.processes.real_time import ENGINE_PRIORITY, prefer
from tests.support.command_process import command_line, start_in_pipe
from tests.support.confined import run_command

LONGEST = 600  # s; everything that is waited for takes a few, up to thirty, on an idle machine
# To the questions of `calibrate encoders`, and all of `start`, about a robot that is wired rightly.
ENCODER_ANSWERS = """\
encoders.wheel: [left forward, right forward]
encoders.proof: both forward
encoders.motion: yes
"""
START_ANSWERS = f"""\
kit: book_2wd
lifted: yes
{ENCODER_ANSWERS}measure: later
metre: yes
goal: yes
"""
RESUME_AFTER_S = 20  # s, after which a person looks whether the robot waits
# Stops that a computer causes which does not run for a while, or the emulated board on it.
STALLS = ("host_frozen", "block_overrun", "link_lost", "reconnect")


@contextmanager
def board(
    image: Path | Literal["ours"] | None = "ours", robot: Path | str = "book_2wd"
) -> Iterator[VirtualBoard]:
    """A board with this program on it, in this robot; with None, nothing but its bootloader."""
    ends, end = os.pipe()
    failures: list[BaseException] = []
    try:
        with virtual_board(load_robot(str(robot)).robot, seed=3, image=image) as virtual:
            virtual.seen = []  # type: ignore[attr-defined]  # reports of its wheels

            def serve() -> None:
                try:
                    virtual.serve(ends, virtual.seen.append)  # type: ignore[attr-defined]
                except BaseException as error:  # a thread would drop it
                    failures.append(error)

            pace = threading.Thread(target=serve)
            pace.start()
            try:
                yield virtual
            finally:
                os.write(end, b"x")
                pace.join()
    finally:
        os.close(ends)
        os.close(end)
    if failures:
        raise failures[0]


def start(*words: object, **options: Any) -> subprocess.Popen[str]:
    """Start a command; both its outputs are one pipe.

    A host that waits too long for a processor stops its robot until a person resumes. This is about
    what it does on a computer that is not overloaded, so it is preferred where that is permitted.
    """
    process = start_in_pipe(command_line(*words), stdin=subprocess.DEVNULL, **options)
    prefer(process.pid, ENGINE_PRIORITY)
    return process


def diffbotctl(*words: object, **options: Any) -> tuple[int, str]:
    """Run a command to its end; (exit code, output)."""
    return outcome(start(*words, **options), **options)


def outcome(process: subprocess.Popen[str], **options: Any) -> tuple[int, str]:
    """Exit code and output of a command that was started.

    A computer that gives a run no processor for 0.3 s, or its board none for a second, has the
    robot wait for a person: the caller.
    """
    until = time.monotonic() + LONGEST
    output = None
    try:
        while output is None:
            try:
                output, _ = process.communicate(timeout=RESUME_AFTER_S)
            except subprocess.TimeoutExpired as expired:
                why = _ask("why", options)
                if time.monotonic() > until:
                    text = (expired.stdout or b"").decode(errors="replace")
                    raise AssertionError(
                        f"no end within {LONGEST} s; output:\n{text}\n{why}"
                    ) from None
                if any(code in why for code in STALLS):
                    _ask("resume", options)
    finally:
        process.kill()  # a run that is left behind would slow down all tests after it
        process.wait()
    return process.returncode, output


def _ask(command: str, options: dict[str, Any]) -> str:
    """What a command prints about the only run."""
    folder, environment = options.get("cwd"), options.get("env")
    return run_command(command, folder=folder, environment=environment).printed


def flat(output: str) -> str:
    """The output without the line breaks that fold it."""
    return " ".join(output.split())


def run(port: str, *words: object) -> tuple[object, ...]:
    """The words of a run of the book's robot on a port."""
    return ("run", "goal", "--robot", "book_2wd", "--port", port, "--quiet", *words)


def flash(virtual: VirtualBoard, *words: object) -> tuple[int, str]:
    """Flash our firmware onto the board."""
    return diffbotctl(
        "flash", "firmware", "--port", virtual.usb, "--robot", "book_2wd", "--yes", *words
    )


def wait_until(holds: Callable[[], object]) -> None:
    """Wait until it holds; fail when it never does."""
    until = time.monotonic() + LONGEST
    while not holds():
        assert time.monotonic() < until, "it never came to that"
        time.sleep(0.005)


def moving(virtual: VirtualBoard) -> bool:
    """Whether the board gives its motors power."""
    return max(virtual.board.duty) > 0.1
