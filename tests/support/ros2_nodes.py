"""The bridge to ROS 2 and nodes beside it, as processes of the Python that has rclpy."""

import json
import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty, Queue
from typing import Any
from zlib import crc32

from diffbotctl.ros2.find_python import PYTHON_VARIABLE, ros_environment
from tests.support.running import command

ROOT = Path(__file__).resolve().parents[2]
ENVIRONMENT = ROOT / ".venv-ros2" / "bin" / "python"  # made by `make ros2`
LINE_TIMEOUT_S = 60  # that a test waits for what must come
COMMANDED_NODE = Path(__file__).parent / "ros2_commanded_node.py"
TWIST = "geometry_msgs/msg/Twist"
# Published by rosidl for tf2_msgs/msg/TFMessage; equal hashes let nodes of other builds connect.
TF_HASH = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
EXIT_TIMEOUT_S = 3  # for each way to end a process
DOMAINS = 100  # a run in another folder has another one: their nodes do not see each other


def ros_python() -> str | None:
    """The Python with rclpy for tests; None where there is none."""
    named = os.environ.get(PYTHON_VARIABLE)
    if named:
        return named
    return str(ENVIRONMENT) if ENVIRONMENT.exists() else None


def environment(folder: Path, peers: Sequence[str] = ()) -> dict[str, str]:
    """The environment of all processes of a test; `peers` are further computers with nodes."""
    return {
        **ros_environment(peers),
        "XDG_RUNTIME_DIR": str(folder),
        "ROS_DOMAIN_ID": str(crc32(str(folder).encode()) % DOMAINS + 1),
        "ROS_LOG_DIR": str(folder),
        PYTHON_VARIABLE: ros_python() or "",
    }


class LineProcess:
    """A process whose lines come through a queue, so that waiting for them ends."""

    def __init__(self, line: Sequence[object], variables: Mapping[str, str]) -> None:
        self.process = subprocess.Popen(
            [str(word) for word in line],
            env=variables,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.lines: Queue[str] = Queue()
        self.printed: list[str] = []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.printed.append(line)
            self.lines.put(line)

    def until(self, expected: Callable[[str], object]) -> str:
        """The first line for which `expected` is true; fails with the output."""
        deadline = time.monotonic() + LINE_TIMEOUT_S
        while True:
            try:
                line = self.lines.get(timeout=max(deadline - time.monotonic(), 0.001))
            except Empty:
                raise AssertionError(f"it never came: {''.join(self.printed)}") from None
            if expected(line):
                return line

    def send(self, text: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(text + "\n")
        self.process.stdin.flush()

    def end(self) -> None:
        """End it in order: DDS knows a publisher that was killed for 20 s more."""
        assert self.process.stdin is not None
        with suppress(OSError):
            self.process.stdin.close()
        for stop in (None, self.process.terminate, self.process.kill):
            if stop is not None:
                stop()
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(EXIT_TIMEOUT_S)
                return


@contextmanager
def bridge(
    folder: Path,
    *words: object,
    name: str = "test",
    prefix: Sequence[str] = (),
    common: Path | None = None,
) -> Iterator[LineProcess]:
    """`diffbotctl ros2 words` on the engine `name`, once its node exists.

    `common` is the folder of the nodes that it finds, if that is not the one of the engine.
    """
    line, _ = command(folder, "ros2", "--engine", name, *words)
    variables = {**environment(common or folder), "XDG_RUNTIME_DIR": str(folder)}
    running = LineProcess([*prefix, *line], variables)
    try:
        running.until(lambda line: "is the node" in line)
        yield running
    finally:
        running.end()


class RosNode(LineProcess):
    """A node of another process, which follows commands: see ros2_commanded_node.py."""

    def __init__(
        self,
        folder: Path,
        script: Path,
        *words: object,
        prefix: Sequence[str] = (),
        peers: Sequence[str] = (),
    ) -> None:
        line = [*prefix, ros_python(), str(script), *words]
        super().__init__(line, environment(folder, peers))

    def reply(self, key: str, condition: Callable[[Any], object] = lambda value: True) -> Any:
        """The value of the first line of JSON with `key` for which `condition` is true."""
        value = {}

        def matches(line: str) -> bool:
            if line.startswith("{"):
                record = json.loads(line)
                if key in record and condition(record[key]):
                    value["found"] = record[key]
            return "found" in value

        self.until(matches)
        return value["found"]

    def command(self, **fields: Any) -> None:
        self.send(json.dumps(fields))


@contextmanager
def ros_node(folder: Path, script: Path, *words: object, **options: Any) -> Iterator[RosNode]:
    """A node, once it has reported that it is ready."""
    node = RosNode(folder, script, *words, **options)
    try:
        node.reply("ready")
        yield node
    finally:
        node.end()
