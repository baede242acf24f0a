"""Checks a lesson: its runs, in a copy of the learner's files, until one of them fails."""

from __future__ import annotations

import os
import random
import shutil
import signal
import tempfile
from collections.abc import Iterator
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple, NoReturn

from diffbotctl.learn.lesson import Lesson, RunEntry
from diffbotctl.learn.lesson_run import PASSED, LessonFinding, LessonRunFinding, judge
from diffbotctl.processes.limited_child import ChildEndedError, ChildLimits, LimitedChild

PROCESSOR_MAX_S = 20.0  # of one run
WALL_MAX_S = 120.0
MEMORY_MAX_BYTES = 1 << 30
FILE_BYTES_MAX = 64 << 20  # of a recording; others are small
ENDLESS, MISSING = "endless", "missing"


class LessonVerdict(NamedTuple):
    """The finding of a check; of the run that failed, its pipeline, and the run's finding."""

    finding: LessonFinding
    advice: str = ""
    pipeline: str = ""
    run: LessonRunFinding | None = None

    @property
    def passed(self) -> bool:
        """Whether all runs passed."""
        return self.finding.code == PASSED


def check(
    lesson: Lesson,
    folder: Path,
    seed: int | None = None,
    kept: Path | None = None,
) -> LessonVerdict:
    """Judge the learner's files of a lesson in `folder`.

    `seed`: of the first run; None: drawn. `kept`: a folder for what a run that failed has used, in
    place of what is there. Raises UserError for a lesson that cannot be read.
    """
    section = lesson.section
    with tempfile.TemporaryDirectory(prefix="lesson-") as made:
        copy = Path(made)
        shutil.copytree(lesson.source("check"), copy, dirs_exist_ok=True)
        for name, source in lesson.extra_files().items():
            shutil.copyfile(source, copy / name)
        missing = list(_copied(section.files, folder, copy))
        if missing:
            return _verdict(lesson, LessonRunFinding(LessonFinding(MISSING, "; ".join(missing))))
        first = random.SystemRandom().randrange(1, 1_000_000) if seed is None else seed
        firsts = accumulate((entry.count for entry in section.runs), initial=first)
        children = [
            _begun(entry, copy, section.files, number, section.failures)
            for entry, number in zip(section.runs, firsts, strict=False)
        ]
        try:
            failed = 0
            for entry, child in zip(section.runs, children, strict=True):
                for found in _findings(child, section.failures):
                    failed += found.finding.code != PASSED
                    if failed > section.failures:
                        _keep(copy, kept)
                        return _verdict(lesson, found, entry.pipeline)
        finally:
            for child in children:
                child.close()
    return LessonVerdict(LessonFinding(PASSED))


def _keep(copy: Path, kept: Path | None) -> None:
    """Put what a run has used into the folder `kept`."""
    if kept is not None:
        shutil.rmtree(kept, ignore_errors=True)
        shutil.copytree(copy, kept)


def _copied(names: list[str], folder: Path, copy: Path) -> Iterator[str]:
    """Copy the learner's files; yields what is wrong with those that cannot be copied."""
    for name in names:
        source, target = folder / name, copy / name
        if not source.is_file():
            yield f"{name} is not there"
        elif source.stat().st_size > FILE_BYTES_MAX:
            yield f"{name} is larger than {FILE_BYTES_MAX >> 20} MB"
        else:
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)


def _begun(
    entry: RunEntry, copy: Path, names: list[str], first: int, failures: int
) -> LimitedChild[list[LessonRunFinding]]:
    """A child that judges the runs of `entry`."""

    def run() -> list[LessonRunFinding]:
        os.chdir(copy)
        signal.signal(signal.SIGXCPU, _stop_endless)  # a second before the process is killed
        return judge(entry, copy, names, first, failures)

    wall = entry.time + WALL_MAX_S if entry.programs else WALL_MAX_S
    return LimitedChild(run, ChildLimits(PROCESSOR_MAX_S, wall, MEMORY_MAX_BYTES))


def _stop_endless(number: int, frame: object) -> NoReturn:
    """End the learner's code where it is: the error then names its line."""
    raise TimeoutError(f"it did not return within {PROCESSOR_MAX_S:g} s of processor time")


def _findings(child: LimitedChild[list[LessonRunFinding]], failures: int) -> list[LessonRunFinding]:
    try:
        return child.result()
    except ChildEndedError as error:
        return [LessonRunFinding(LessonFinding(ENDLESS, str(error)))] * (failures + 1)


def _verdict(lesson: Lesson, found: LessonRunFinding, pipeline: str = "") -> LessonVerdict:
    advice = lesson.section.findings.get(found.finding.code, "")
    advice = advice.replace("{seen}", found.finding.seen)
    return LessonVerdict(found.finding, advice, pipeline, found)
