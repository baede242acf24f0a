"""Running a recording again, from nothing but the file: configuration, version and inputs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl import __version__
from diffbotctl.config.configuration import Configuration
from diffbotctl.engine.clock import Clock, ScaledClock, VirtualClock
from diffbotctl.engine.live_changes import LiveChanges
from diffbotctl.engine.loop import Engine, RunOutcome
from diffbotctl.errors import Problem, RunError
from diffbotctl.graph import Graph, Sink
from diffbotctl.params import declared
from diffbotctl.processes import screen
from diffbotctl.processes.screen import RunSnapshot, ScreenFeed
from diffbotctl.recording import snapshot
from diffbotctl.recording.digest import Digest
from diffbotctl.recording.mcap_file import RecordingReader
from diffbotctl.recording.metrics import Metrics, MetricsAccumulator, recorded_truth
from diffbotctl.recording.replay_driver import Checker, Difference, Replay
from diffbotctl.replay import source
from diffbotctl.replay.source import RecordedRun
from diffbotctl.runs import recording
from diffbotctl.runs.build_graph import Assembly, assemble
from diffbotctl.runs.control_socket import RunControlSocket, SocketOptions
from diffbotctl.time import NEVER

Show = Callable[[Iterator[RunSnapshot]], None]
Record = Callable[[tuple[Any, ...]], object]


class ReplayOptions(NamedTuple):
    """How to replay. Times are ns of the recorded run.

    `speed` is times real time, None as fast as it goes. Before `begin` it always goes as fast as it
    can, so that all is known that was known then; the metrics count from there. `sets` change the
    recorded configuration. `record` writes the replay out as a recording. `show` draws it; with
    `dash` it is the dashboard, at a control socket of the replay's own.
    """

    check: bool = False
    speed: float | None = None
    begin: int = 0
    until: int = NEVER
    sets: tuple[str, ...] = ()
    record: Path | None = None
    show: Show | None = None
    dash: bool = False


class ReplayResult(NamedTuple):
    """What a replay came to. `compared` counts messages; `difference` is the first one, or None.

    `left_out` counts the messages on wires that the recording does not have, `text_differences`
    those in which another version worded a log line or a cause differently.
    """

    ending: RunOutcome
    digest: str
    compared: int
    difference: Difference | None
    version: str
    metrics: Metrics
    begins: str
    left_out: Mapping[str, int] = {}
    text_differences: int = 0


def replay(path: Path, check: bool = False) -> ReplayResult:
    """Replay the recording at `path`; `check` compares every message with the recorded one.

    Raises RunError for a file that is no recording, or one that is incomplete and to be checked.
    """
    return replay_as(source.read_run(path), ReplayOptions(check=check))


def replay_as(run: RecordedRun, wanted: ReplayOptions) -> ReplayResult:
    """Replay with the recorded motion: the drivers deliver what they did, the blocks react anew.

    Raises RunError when it cannot be checked or begun, ConfigurationError for a wrong `sets`.
    """
    if wanted.check:
        _refuse_check(run)
    with source.recorded_configuration(run, wanted.sets) as configuration:
        return _ReplayRun(run, wanted, configuration).go()


class _ReplayRun:
    """One replay, wired."""

    def __init__(
        self, run: RecordedRun, wanted: ReplayOptions, configuration: Configuration
    ) -> None:
        self.run, self.wanted = run, wanted
        self.assembly: Assembly = assemble(configuration, run.real)
        graph = self.graph = self.assembly.graph
        self.digest = Digest(graph.kinds)
        self.checker = Checker(
            graph.kinds,
            run.wires,
            RecordingReader(run.path).messages(),
            texts_may_differ=run.about.get("version") != __version__,
        )
        self.measure = MetricsAccumulator()
        self.latest: ScreenFeed | None = None
        self.children: list[int] = []
        if wanted.show is not None:
            channel, pid = screen.start(wanted.show, wanted.dash)
            self.children.append(pid)
            self.latest = ScreenFeed(channel, lambda: (len(self.measure.reached), len(run.goals())))
        self.recorder = None
        if wanted.record is not None:
            facts = {**run.about, "replayed": str(run.path), **_sets(configuration)}
            facts.pop("flight", None)  # what is written now holds the blocks' messages too
            self.recorder, pid = recording.start_run_recorder(
                wanted.record, configuration, self.assembly, facts, True, _loud
            )
            self.children.append(pid)
        self.station: RunControlSocket | None = None
        if wanted.dash:
            port = run.about["port"]
            self.station = RunControlSocket(
                SocketOptions(), configuration, self.assembly, port, is_replay=True
            )
        self.engine = Engine(
            graph,
            [Replay(_after(run))],
            self._clock(),
            sinks=self._sinks(),
            record=self._record,
            idle=self._idle,
        )
        if run.state is not None:
            _begin_in(run, self.engine, wanted.sets)

    def go(self) -> ReplayResult:
        """Replay to the end."""
        until = min(self.run.last + 1, self.wanted.until, NEVER)
        ending = self.engine.run(until)
        if self.wanted.check:
            self.checker.finish()
        self._close(ending)
        whole = self.wanted.until > self.run.last
        return ReplayResult(
            ending,
            self.digest.text(),
            self.checker.compared,
            self.checker.difference,
            self.run.about.get("version", ""),
            self.measure.metrics(recorded_truth(self.run.end) if whole else None),
            self.run.begins,
            self.checker.left_out,
            self.checker.text_differences,
        )

    def _clock(self) -> Clock:
        if self.wanted.speed is None:
            return VirtualClock()
        return ScaledClock(self.wanted.speed, max(self.wanted.begin, self._first()))

    def _first(self) -> int:
        return 0 if self.run.state is None else self.run.state[0]

    def _sinks(self) -> dict[str, list[Sink]]:
        sinks = {wire: [sink] for wire, sink in LiveChanges(self.graph, {}).sinks().items()}
        if self.latest is not None:
            for wire in self.graph.wires:
                sinks.setdefault(wire, []).append(self.latest.sink(wire))
        return sinks

    def _record(self, instant: tuple[Any, ...]) -> None:
        self.digest.record(instant)
        if self.wanted.check:
            self.checker.record(instant)
        if self.recorder is not None:
            self.recorder.record(instant)
        if self.station is not None:
            self.station.channel.record(instant)
        for wire, message in zip(self.graph.wires, instant[1:], strict=True):
            if message is not None:
                self.measure.take(instant[0], wire, message)
        if instant[0] < self.wanted.begin:
            self.measure.forget()

    def _idle(self) -> None:
        if self.recorder is not None:
            self.recorder.drain()
        if self.station is not None:
            self.station.channel.flush()
        if self.latest is not None and self.engine.last >= self.wanted.begin:
            self.latest.idle(self.engine.last)

    def _close(self, ending: RunOutcome) -> None:
        if self.latest is not None:
            self.latest.finish(max(self.engine.last, 0))
        if self.recorder is not None:
            end = {**(self.run.end or {}), "last": str(self.engine.last)}
            end.update({"code": str(ending.code), "digest": self.digest.text()})
            self.recorder.close(end)
        self.engine.clock.close()
        if self.station is not None:
            self.station.channel.close()
            self.station.end()
        for pid in self.children:
            os.waitpid(pid, 0)


def _after(run: RecordedRun) -> Iterator[Any]:
    """What was recorded after the state in which the replay begins."""
    first = -1 if run.state is None else run.state[0]
    return (item for item in RecordingReader(run.path).messages() if item.time > first)


def _begin_in(run: RecordedRun, engine: Engine, sets: tuple[str, ...]) -> None:
    """Begin with the state in the recording; what was set stays set."""
    assert run.state is not None
    chosen = _chosen(engine.graph, sets)
    try:
        snapshot.restore_snapshot(run.state[1], engine)
    except snapshot.StateError as error:
        cause = f"the state in which it begins cannot be read: {error}"
        raise RunError(Problem("E-RECORDING", str(run.path), cause)) from error
    for block, name, value in chosen:
        if not declared(type(block))[name].live:
            cause = f"{name} of {type(block).__name__} shapes a run from its start, and this "
            cause += "recording begins in the midst of one"
            raise RunError(Problem("E-RECORDING", str(run.path), cause, "set a live parameter"))
        setattr(block, name, value)
        block.changed(name)
    engine.last = run.state[0]


def _chosen(graph: Graph, sets: tuple[str, ...]) -> list[tuple[Any, str, Any]]:
    """(block, parameter, value) for each of `sets` that names a block's."""
    blocks = {node.name: node.block for node in graph.nodes}
    found = []
    for text in sets:
        first, _, rest = text.partition("=")[0].strip().partition(".")
        block = blocks.get(first)
        for name, about in declared(type(block)).items() if block is not None else ():
            if rest == (about.key or name):
                found.append((block, name, getattr(block, name)))
    return found


def _refuse_check(run: RecordedRun) -> None:
    if run.is_flight:
        cause = "a flight holds what came in, and nothing that the blocks made of it to compare"
        raise RunError(Problem("E-RECORDING", str(run.path), cause, "replay it without --check"))
    if run.end is None:
        cause = "the recording is incomplete: it was cut, or the disk was full"
        fix = "replay it without --check, up to where it ends"
        raise RunError(Problem("E-RECORDING-CUT", str(run.path), cause, fix))


def _sets(configuration: Configuration) -> dict[str, str]:
    import json

    return {"sets": json.dumps(configuration.settings)}


def _loud(text: str) -> None:
    """A recorder that fails ends the replay: nothing drives that would have to go on."""
    raise RunError(Problem("E-RECORD", "replay", text))
