"""Two robots and an operator, each in a network of its own, over a link with delay, loss and cut.

Needs root.
"""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

from tests.support.command_process import start_in_pipe
from tests.support.far_host import ssh_path, start_server
from tests.support.lossy_network import LossyNetwork
from tests.support.running import PlainClient, command, moves, running
from tests.support.wheel_watcher import WheelWatcher

OPERATOR, ROBOTS = "operator", ("left", "right")
ADDRESSES = {OPERATOR: "10.77.0.1", "left": "10.77.0.2", "right": "10.77.0.3"}
DELAY_S, LOSS = 0.05, 0.05  # each way
CUT_S = 5.0
ATTEMPTS = 10  # to drive both: a lost packet may stop a robot before the cut


class CutOutcome(NamedTuple):
    """What was seen.

    `found` are the engines that the operator's list has, `listed_s` how long it took. `stop_s` is
    the time from the cut to the last command to move, the worse of both. `moved_after` names the
    events after which a robot moved by itself. `drives_again`: both obey a new command.
    """

    found: tuple[str, ...]
    listed_s: float
    stop_s: float
    causes: tuple[str, ...]
    moved_after: tuple[str, ...]
    drives_again: bool


class FarRobots:
    """The operator's computer, and both robots' computers with an engine and an ssh server."""

    def __init__(self, folder: Path, network: LossyNetwork, path: str) -> None:
        self.folder, self.network, self.path = folder, network, path
        self.clients = {name: PlainClient(folder / name, name) for name in ROBOTS}
        self.watchers = {name: WheelWatcher(folder / name, name) for name in ROBOTS}

    def start(self, *words: str) -> subprocess.Popen[str]:
        """`diffbotctl words` on the operator's computer."""
        line, environment = command(self.folder / OPERATOR, *words)
        environment = {**environment, "PATH": self.path}
        return start_in_pipe([*self.network.inside(OPERATOR), *line], env=environment)

    def drive_both(self) -> list[subprocess.Popen[str]]:
        """Drive both robots until they move at the same time; the operator's programs."""
        for _ in range(ATTEMPTS):
            drivers = [
                self.start("drive", "--speed", "0.1", "--for", "60s", "--at", name)
                for name in ROBOTS
            ]
            while all(driver.poll() is None for driver in drivers):
                if all(moves(client.request("status")) for client in self.clients.values()):
                    return drivers
            end(drivers)
            self.resume()
        raise AssertionError("both robots were never driven at once")

    def resume(self) -> None:
        """Somebody beside each robot allows motion again."""
        for client in self.clients.values():
            client.request("resume")

    def moved_since(self, begin: float) -> bool:
        """Whether a robot was commanded to move after the monotonic time `begin`."""
        return any(watcher.moved_at > begin for watcher in self.watchers.values())


def end(drivers: list[subprocess.Popen[str]]) -> None:
    """End the operator's programs."""
    for driver in drivers:
        driver.kill()
        driver.communicate()


@contextmanager
def two_robots(folder: Path, seed: int) -> Iterator[FarRobots]:
    """Both robots, running, and the operator."""
    with ExitStack() as stack:
        network = stack.enter_context(LossyNetwork(ADDRESSES, DELAY_S, LOSS, seed))
        (folder / OPERATOR).mkdir()
        servers = {}
        for name in ROBOTS:
            runtime = folder / name
            runtime.mkdir()
            place = folder / f"ssh_{name}"
            inside = network.inside(name)
            servers[place] = start_server(place, runtime, name, ADDRESSES[name], inside)
            stack.callback(servers[place].kill)
            words = ("standby", "--stay", "--seed", str(seed))
            stack.enter_context(running(runtime, *words, name=name, prefix=inside))
        yield FarRobots(folder, network, ssh_path(folder, servers))


def cut_trial(folder: Path, seed: int, observed_s: float) -> CutOutcome:
    """Find both, drive both, cut the link for CUT_S, resume, and drive again.

    `observed_s`: after the link works again, and after `resume`.
    """
    with two_robots(folder, seed) as far:
        began = time.monotonic()
        words = ("engines", "--json", "--at", "left", "--at", "right")
        rows = [json.loads(line) for line in far.start(*words).communicate()[0].splitlines()]
        listed_s = time.monotonic() - began
        found = tuple(row["engine"] for row in rows if row["at"] == row["engine"])
        drivers = far.drive_both()
        cut_at = time.monotonic()
        far.network.cut = frozenset({OPERATOR})
        time.sleep(CUT_S)
        last_motion = max(watcher.moved_at for watcher in far.watchers.values())
        statuses = [client.request("status") for client in far.clients.values()]
        moved_after = []
        healed_at = time.monotonic()
        far.network.cut = frozenset()
        time.sleep(observed_s)
        if far.moved_since(healed_at):
            moved_after.append("the link works again")
        resumed_at = time.monotonic()
        far.resume()
        time.sleep(observed_s)
        if far.moved_since(resumed_at):
            moved_after.append("resume")
        end(drivers)
        again = far.drive_both()
        end(again)
    causes = tuple(str(status["held"] and status["held"]["code"]) for status in statuses)
    return CutOutcome(
        found, listed_s, last_motion - cut_at, causes, tuple(moved_after), bool(again)
    )
