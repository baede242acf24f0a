"""Round trips from a program or a client through the engine and back, and through bare pipes.

The program publishes a text 200 times a second, a block answers it, and the program times the
answer. The bare echo is the same program at the other end of two pipes from one that only sends the
lines back, in the same language.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import NamedTuple

from tests.support.command_process import children_of, command_line, processor_s
from tests.support.running import PlainClient

RATE = 200.0
START_S = 0.5  # of an interpreter, which is no round trip
# Arguments: the number of round trips, and the file for their times in ns.
PYTHON_SENDER = """
import json, sys, time
times = []
due = time.monotonic()
for number in range(int(sys.argv[1])):
    due += 0.005
    time.sleep(max(due - time.monotonic(), 0.0))
    text = f"hello world {number}"
    begin = time.monotonic_ns()
    print(json.dumps({"report": {"text": text}}), flush=True)
    while True:
        message = json.loads(sys.stdin.readline())
        if any(key in ("answer", "report") for key in message):
            break
    times.append(time.monotonic_ns() - begin)
with open(sys.argv[2], "w") as file:
    file.write("\\n".join(map(str, times)))
sys.stdin.read()
"""
C_SENDER = r"""
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
static long long now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}
int main(int count, char **words) {
    static char line[70000];
    const int trips = count > 2 ? atoi(words[1]) : 0;
    long long *times = calloc((size_t)trips + 1, sizeof *times), due = now();
    for (int number = 0; number < trips; number++) {
        due += 5000000;
        const long long wait = due - now();
        if (wait > 0) {
            const struct timespec t = {wait / 1000000000, wait % 1000000000};
            nanosleep(&t, NULL);
        }
        const long long begin = now();
        printf("{\"report\": {\"text\": \"hello world %d\"}}\n", number);
        fflush(stdout);
        do {
            if (fgets(line, sizeof line, stdin) == NULL) {
                return 1;
            }
        } while (strncmp(line, "{\"answer\"", 9) != 0 && strncmp(line, "{\"report\"", 9) != 0);
        times[number] = now() - begin;
    }
    FILE *file = fopen(words[2], "w");
    for (int number = 0; number < trips; number++) {
        fprintf(file, "%lld\n", times[number]);
    }
    fclose(file);
    while (fgets(line, sizeof line, stdin) != NULL) {
    }
    return 0;
}
"""
PYTHON_ECHO = "import sys\nfor line in sys.stdin:\n    print(line, end='', flush=True)\n"
C_ECHO = r"""
#include <stdio.h>
int main(void) {
    static char line[70000];
    while (fgets(line, sizeof line, stdin) != NULL) {
        fputs(line, stdout);
        fflush(stdout);
    }
    return 0;
}
"""
# What no engine in Python can be faster than: it waits, parses and formats JSON.
JSON_ECHO = """
import json, os, select
poller, rest = select.epoll(), b""
poller.register(0, select.EPOLLIN)
while True:
    poller.poll()
    data = os.read(0, 65536)
    if not data:
        break
    *lines, rest = (rest + data).split(b"\\n")
    for line in lines:
        os.write(1, json.dumps(json.loads(line)).encode() + b"\\n")
"""
PIPELINE = """
format: 1
kind: pipeline
blocks:
  listener: {{block: listener, in: {{text: {wire}}}}}
{rest}
"""
WITH_PROGRAM = """
programs:
  sender: {{run: {run}, in: {{answer: listener.heard}}, out: {{report: Text}}}}
"""
WITH_INPUT = "inputs: {back: {type: Text}}"


class RoundTrips(NamedTuple):
    """Sorted round trips (s), and the share of a core that the engine, or the echo, used.

    `recording`: of the run, without which there is none.
    """

    times: list[float]
    engine: float = 0.0
    recording: Path | None = None

    @property
    def median(self) -> float:
        return median(self.times)

    def figure(self, floor: RoundTrips) -> str:
        """The median beside the floor's, and the processor time of the engine."""
        p99 = self.times[int(0.99 * len(self.times))]
        ratio = self.median / floor.median
        return (
            f"p50 {self.median * 1e3:.2f} ms ({ratio:.1f}x bare), p99 {p99 * 1e3:.2f} ms "
            f"of {len(self.times)}; engine {100 * self.engine:.1f} % of a core"
        )


def senders(folder: Path) -> dict[str, tuple[str, list[str]]]:
    """By language: the command of the sender, and the words of the bare echo."""
    (folder / "sender.py").write_text(PYTHON_SENDER)
    (folder / "echo.py").write_text(PYTHON_ECHO)
    for name, text in (("sender", C_SENDER), ("echo", C_ECHO)):
        (folder / f"{name}.c").write_text(text)
        subprocess.run(["cc", "-O2", "-o", name, f"{name}.c"], cwd=folder, check=True)
    return {
        "C": (str(folder / "sender"), [str(folder / "echo")]),
        "Python": (
            f"{sys.executable} {folder / 'sender.py'}",
            [sys.executable, str(folder / "echo.py")],
        ),
    }


def json_echo(folder: Path) -> list[str]:
    """The words of an echo in Python that parses and formats each line."""
    (folder / "json_echo.py").write_text(JSON_ECHO)
    return [sys.executable, str(folder / "json_echo.py")]


def bare(folder: Path, run: str, echo: list[str], seconds: float) -> RoundTrips:
    """Round trips of the sender through two pipes to the bare echo."""
    result = folder / "bare.txt"
    result.unlink(missing_ok=True)
    there, back = os.pipe(), os.pipe()
    words = [*run.split(), str(round(seconds * RATE)), str(result)]
    sender = subprocess.Popen(words, stdin=back[0], stdout=there[1])
    other = subprocess.Popen(echo, stdin=there[0], stdout=back[1])
    for end in (*there, *back):
        os.close(end)
    time.sleep(START_S)
    load = _share(other.pid, seconds - 2 * START_S)
    _wait_for(result)
    for process in (sender, other):
        process.kill()
        process.wait()
    return RoundTrips(_times(result), load)


def through_program(folder: Path, run: str, seconds: float) -> RoundTrips:
    """Round trips of the sender as a program of a pipeline, with a block that answers."""
    result, pipeline = folder / "program.txt", folder / "program.yaml"
    result.unlink(missing_ok=True)
    line = f"{run} {round(seconds * RATE)} {result}"
    pipeline.write_text(PIPELINE.format(wire="sender.report", rest=WITH_PROGRAM.format(run=line)))
    with _engine(folder, pipeline, "--no-socket", "--allow-programs") as process:
        _wait_for_program(process.pid)
        engine = _share(process.pid, seconds - 1.0)
        _wait_for(result)
    return RoundTrips(_times(result), engine, pipeline.with_suffix(".mcap"))


def through_client(folder: Path, seconds: float) -> RoundTrips:
    """Round trips of a client of the control socket that publishes on an input."""
    pipeline = folder / "input.yaml"
    pipeline.write_text(PIPELINE.format(wire="input.back", rest=WITH_INPUT))
    times: list[float] = []
    with _engine(folder, pipeline, "--name", "test") as process:
        client = _connect(folder)
        client.request("subscribe", topic="listener.heard")
        used, begin = processor_s(process.pid), time.monotonic()
        due = begin
        for number in range(round(seconds * RATE)):
            due += 1.0 / RATE
            time.sleep(max(due - time.monotonic(), 0.0))
            fields = {"topic": "input.back", "message": {"text": f"hello world {number}"}}
            sent = time.monotonic()
            client.send(json.dumps({"method": "publish", **fields}))
            while "message" not in client.read():
                pass  # the reply to the request
            times.append(time.monotonic() - sent)
        engine = (processor_s(process.pid) - used) / (time.monotonic() - begin)
        client.close()
    return RoundTrips(sorted(times), engine, pipeline.with_suffix(".mcap"))


def _connect(folder: Path) -> PlainClient:
    deadline = time.monotonic() + 30
    while True:
        try:
            return PlainClient(folder)
        except OSError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.05)


@contextmanager
def _engine(folder: Path, pipeline: Path, *words: str) -> Iterator[subprocess.Popen[bytes]]:
    """A recorded run of the pipeline."""
    path = folder / f"{pipeline.stem}.mcap"
    line = command_line("run", pipeline, "--quiet", "--stay", *words)
    process = subprocess.Popen(
        [*line, "--record", str(path), "--force"],
        env={**os.environ, "XDG_RUNTIME_DIR": str(folder)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=60)


def _share(pid: int, seconds: float) -> float:
    """Share of a core that a process uses over that time."""
    used = processor_s(pid)
    time.sleep(seconds)
    return (processor_s(pid) - used) / seconds


def _wait_for_program(engine: int) -> None:
    """Wait until the engine has started its program, which is a child of its supervisor."""
    deadline = time.monotonic() + 60
    while not any(children_of(child) for child in children_of(engine)):
        if time.monotonic() > deadline:
            raise TimeoutError("the engine started no program")
        time.sleep(0.05)


def _wait_for(result: Path) -> None:
    deadline = time.monotonic() + 60
    while not (result.exists() and result.read_text()):
        if time.monotonic() > deadline:
            raise TimeoutError(f"{result} was never written")
        time.sleep(0.05)
    time.sleep(0.2)  # the rest of it


def _times(result: Path) -> list[float]:
    return sorted(int(line) / 1e9 for line in result.read_text().split())
