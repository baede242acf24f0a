"""The learner's folder: a folder for each lesson begun, and the progress."""

from __future__ import annotations

import json
import os
import shutil
import time
from pathlib import Path
from typing import NamedTuple

from diffbotctl.file_replacement import replace_file
from diffbotctl.learn.course import FOLDER, PROGRESS, home, lessons
from diffbotctl.learn.lesson import Lesson

CHECKED = "checked"  # below the learner's folder


class LessonProgress(NamedTuple):
    """How far a learner is with one lesson: the day on which it passed, and the hints shown."""

    passed: str = ""
    hints: int = 0


class LearnerFolder:
    """The lessons of one learner in `root`; None: in the nearest folder upwards that has them."""

    def __init__(self, root: Path | None = None) -> None:
        self.root = root or Path(os.path.relpath(home() / FOLDER))

    def of(self, lesson: Lesson) -> Path:
        """The learner's folder of a lesson."""
        return self.root / lesson.name

    def checked(self, lesson: Lesson) -> Path:
        """Where the files of a run that failed are kept."""
        return self.root / CHECKED / lesson.name

    def has_begun(self, lesson: Lesson) -> bool:
        """Whether the lesson's folder is there."""
        return self.of(lesson).is_dir()

    def begin(self, lesson: Lesson) -> Path:
        """Write the files to start from; those that are there stay as they are."""
        for name, source in lesson.start_files().items():
            path = self.of(lesson) / name
            if not path.exists():
                path.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source, path)
        self.note(lesson, self.progress(lesson))  # by which the folder is found from below
        return self.of(lesson)

    def changed(self, lesson: Lesson) -> set[str]:
        """Names of the files to start from that are no longer as they were written, or are gone."""
        here = self.of(lesson)
        return {
            name
            for name, source in lesson.start_files().items()
            if not (here / name).is_file() or (here / name).read_bytes() != source.read_bytes()
        }

    def reset(self, lesson: Lesson) -> Path | None:
        """Start again; where the files were put that were there, None for none."""
        backup = None
        if self.has_begun(lesson):
            stamp = time.strftime("%Y%m%d-%H%M%S")
            backup = self.root / "backups" / f"{lesson.name}-{stamp}"
            number = 1
            while backup.exists():
                number += 1
                backup = backup.with_name(f"{lesson.name}-{stamp}-{number}")
            backup.parent.mkdir(parents=True, exist_ok=True)
            self.of(lesson).rename(backup)
        self.begin(lesson)
        return backup

    def progress(self, lesson: Lesson) -> LessonProgress:
        """How far the learner is with a lesson."""
        found = self._read().get(lesson.name)
        if not isinstance(found, dict):
            return LessonProgress()
        passed, hints = found.get("passed", ""), found.get("hints", 0)
        return LessonProgress(str(passed), hints if isinstance(hints, int) else 0)

    def note(self, lesson: Lesson, progress: LessonProgress) -> None:
        """Keep how far the learner is."""
        kept = {**self._read(), lesson.name: progress._asdict()}
        self.root.mkdir(parents=True, exist_ok=True)
        replace_file(self.root / PROGRESS, f"{json.dumps(kept, indent=2)}\n".encode())

    def _read(self) -> dict[str, object]:
        try:
            found = json.loads((self.root / PROGRESS).read_text())
        except (OSError, ValueError):
            return {}
        return found if isinstance(found, dict) else {}


def lesson_in(folder: Path) -> Lesson | None:
    """The lesson whose files a learner has in `folder`; None for any other folder."""
    folder = folder.resolve()
    if folder.parent.name not in (FOLDER.name, CHECKED):
        return None
    return next((lesson for lesson in lessons() if lesson.name == folder.name), None)
