"""One run that judges a learner's files: a pipeline whose block `judge` states its finding."""

from __future__ import annotations

import random
import runpy
import subprocess
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Literal, NamedTuple, get_args, get_origin

from diffbotctl.config import consents
from diffbotctl.config.code_files import CodeFile
from diffbotctl.config.configuration import Configuration
from diffbotctl.config.load import load
from diffbotctl.errors import ConfigurationError, Problem, UserError
from diffbotctl.graph import LOG, Sink
from diffbotctl.learn.lesson import Draw, RunEntry
from diffbotctl.messages import LogLine, Text, fields
from diffbotctl.params import declared
from diffbotctl.programs.driver import ProgramsDriver
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.runs.options import RunOptions, RunResult
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND

JUDGE = "judge.finding"  # the wire with the finding
PASSED = "passed"
ERROR, SILENT = "error", "silent"
SHOWN_PROBLEMS_MAX = 2
BUILD_TIME_MAX_S = 60.0


class LessonFinding(NamedTuple):
    """What a run found: `code` names it for the lesson's advice, `seen` is what was seen."""

    code: str
    seen: str = ""

    @classmethod
    def of(cls, text: str) -> LessonFinding:
        """From `passed`, or `code: what was seen`."""
        code, _, seen = text.partition(":")
        return cls(code.strip(), seen.strip())


def drawn_sets(draws: Mapping[str, Draw], seed: int) -> list[str]:
    """Values for --set, the same ones for the same seed."""
    rng = random.Random(f"lesson {seed}")
    sets = []
    for path, draw in draws.items():
        value = rng.uniform(draw.low, draw.high)
        text = str(round(value)) if draw.whole else f"{value:.4f}"
        sets.append(f"{path}={text} {draw.unit}".rstrip())
    return sets


class LessonRunFinding(NamedTuple):
    """The finding of the run with `seed`, the values drawn for it, and whether it has a robot."""

    finding: LessonFinding
    seed: int = 0
    sets: tuple[str, ...] = ()
    has_robot: bool = False


def judge(
    entry: RunEntry, folder: Path, names: Sequence[str], first: int, failures: int
) -> list[LessonRunFinding]:
    """The findings of the runs of `entry` in `folder`, which is the present folder.

    `names`: the learner's files in it; errors in others are those of the lesson's pipeline.
    `first`: seed of the first run. It ends when more than `failures` runs have failed.
    """
    for path in folder.glob("*.py"):
        consents.allow_here(CodeFile(path.name, path, path.read_bytes()).consent_key)
    built = build(entry, folder)
    if built is not None:
        return [LessonRunFinding(built, first, ())] * (failures + 1)
    found: list[LessonRunFinding] = []
    for seed in range(first, first + entry.count):
        sets = (*entry.settings, *drawn_sets(entry.draw, seed))
        finding = _judged(entry, folder, names, sets, seed)
        has_robot = finding.code != ERROR and _has_robot(entry, sets)
        found.append(LessonRunFinding(finding, seed, sets, has_robot))
        if sum(each.finding.code != PASSED for each in found) > failures:
            break
    return found


def _judged(
    entry: RunEntry, folder: Path, names: Sequence[str], sets: tuple[str, ...], seed: int
) -> LessonFinding:
    try:
        if entry.recording:
            return _recorded(entry, folder)
        return _accepted(entry, sets) or _run(entry, sets, seed)
    except UserError as error:
        return LessonFinding(ERROR, _problems_text(error, names))


def build(entry: RunEntry, folder: Path) -> LessonFinding | None:
    """Run the command that builds a program; the finding when it fails."""
    if not entry.build:
        return None
    try:
        done = subprocess.run(
            entry.build, shell=True, cwd=folder, capture_output=True, timeout=BUILD_TIME_MAX_S
        )
    except subprocess.TimeoutExpired:
        return LessonFinding(ERROR, f"`{entry.build}` did not end within {BUILD_TIME_MAX_S:.0f} s")
    if done.returncode == 0:
        return None
    text = (done.stderr or done.stdout).decode(errors="replace").strip()
    return LessonFinding(ERROR, f"`{entry.build}`: {text[:1000]}")


def _recorded(entry: RunEntry, folder: Path) -> LessonFinding:
    """The finding of the function `judged` in the lesson's judge.py. Raises RunError."""
    judged = runpy.run_path(str(folder / "judge.py"))["judged"]
    return LessonFinding.of(judged(RecordingReader(Path(entry.recording)).messages()))


def _accepted(entry: RunEntry, sets: Sequence[str]) -> LessonFinding | None:
    """The finding when a value is accepted that has to be refused, or refused in place of it."""
    for value in entry.accepted:
        try:
            load(f"./{entry.pipeline}", None, [*sets, value])
        except ConfigurationError:
            load(f"./{entry.pipeline}", None, sets)
            return LessonFinding("refused", value)
    for refused in entry.refused:
        with suppress(ConfigurationError):
            load(f"./{entry.pipeline}", None, [*sets, refused])
            return LessonFinding("accepted", refused)
    return None


@cache
def _loaded(pipeline: str, sets: tuple[str, ...]) -> Configuration:
    return load(f"./{pipeline}", None, sets)


def _has_robot(entry: RunEntry, sets: tuple[str, ...]) -> bool:
    with suppress(ConfigurationError):
        return bool(entry.pipeline) and _loaded(entry.pipeline, sets).robot is not None
    return False


def _run(entry: RunEntry, sets: tuple[str, ...], seed: int) -> LessonFinding:
    configuration = _loaded(entry.pipeline, sets)
    options = RunOptions(
        rehearses=True,
        seed=seed,
        fast=not entry.programs,
        duration=entry.time,
        stay=True,
        programs=ProgramsDriver if entry.programs else None,
    )
    run = LessonRun(configuration, options)
    for wire, type_text in entry.types.items():
        kind = run.assembly.graph.kinds.get(wire, type(None))
        found = _type_text(kind)
        if found != type_text:
            return LessonFinding("type", f"{wire} has the type {found}")
    for number, change in enumerate(entry.changes):
        value = random.Random(f"change {number} {seed}").uniform(
            change.value.low, change.value.high
        )
        for parameter in change.parameters:
            unfit = run.change_at(round(change.at * SECOND), parameter, value)
            if unfit is not None:
                return unfit
    run.reset_at = round(entry.reset_at * SECOND)
    result = run.go()
    return run.finding or _without_finding(result, entry, run.complaint)


def _type_text(kind: type) -> str:
    """Name and fields of a message, each with its unit or choices: `Door(time ns, angle rad)`."""
    texts = []
    for name, (hint, field) in fields(kind).items() if hasattr(kind, "_fields") else ():
        choices = sorted(get_args(hint)) if get_origin(hint) is Literal else []
        texts.append(f"{name} {field.unit or ' | '.join(map(str, choices))}".rstrip())
    return f"{kind.__name__}({', '.join(texts)})"


def _without_finding(result: RunResult, entry: RunEntry, complaint: str) -> LessonFinding:
    """Of a run that ended before its judge had seen enough; `complaint`: an error in its log."""
    if result.failure is not None:
        raise result.failure
    if result.ending.cause.startswith("time limit"):
        seen = f"nothing more happened until {entry.time:g} s"
        return LessonFinding(SILENT, f"{seen}: {complaint}" if complaint else seen)
    return LessonFinding(SILENT, f"the run ended: {result.ending.cause}")


def _problems_text(error: UserError, names: Sequence[str]) -> str:
    errors = (problem for problem in error.problems if problem.severity == "error")
    texts = dict.fromkeys(_problem_text(problem, names) for problem in errors)
    return "\n".join(list(texts)[:SHOWN_PROBLEMS_MAX])


def _problem_text(problem: Problem, names: Sequence[str]) -> str:
    """A problem in the learner's files, without the judge in its fix; else what they lack."""
    if problem.file in names:
        return replace(problem, fix="" if JUDGE in problem.fix else problem.fix).render()
    return f"{', '.join(names)}: {problem.cause}"


class _Change(NamedTuple):
    """A live parameter that gets a value at a time (ns)."""

    time: int
    block: str
    name: str
    value: float


class LessonRun(Run):
    """A run that ends as soon as its judge states a finding.

    `complaint`: the first error in its log, such as why a program was ended.
    """

    finding: LessonFinding | None = None
    complaint = ""
    reset_at = 0  # ns

    def __init__(self, configuration: Configuration, options: RunOptions) -> None:
        self._changes: list[_Change] = []
        super().__init__(configuration, options, tell=lambda text: None)

    def change_at(self, time: int, path: str, value: float) -> LessonFinding | None:
        """Set the parameter `path` to `value` at `time` (ns); the finding when it is not live."""
        name, _, key = path.partition(".")
        for node in self.assembly.graph.nodes:
            for attribute, declaration in declared(type(node.block)).items():
                if (node.name, declaration.key) == (name, key) and declaration.live:
                    self._changes.append(_Change(time, name, attribute, value))
                    return None
        return LessonFinding("fixed", f"{path} cannot change while it runs")

    def _sinks(self) -> dict[str, list[Sink]]:
        sinks = super()._sinks()
        sinks[JUDGE].append(self._on_finding)
        sinks[LOG].append(self._on_log)
        return sinks

    def _idle(self) -> Callable[[], None]:
        idle = super()._idle()

        def make_changes() -> None:
            if idle is not None:
                idle()
            self._make_changes()

        return make_changes

    def _on_finding(self, now: int, text: Text) -> None:
        if self.finding is None:
            self.finding = LessonFinding.of(text.text)
            self.engine.end(0, "judged")

    def _on_log(self, now: int, line: LogLine) -> None:
        if line.level == "error" and not self.complaint:
            self.complaint = line.text

    def _make_changes(self) -> None:
        now = self.engine.last_instant
        if 0 < self.reset_at <= now:
            self.reset_at = 0
            for node in self.assembly.graph.nodes:
                node.block.reset()
        for change in [each for each in self._changes if each.time <= now]:
            self._changes.remove(change)
            self.operator.set_number(now, change.block, change.name, change.value)
