"""The lessons in their order: of diffbotctl, of other packages, and of the learner's home."""

from __future__ import annotations

from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

from diffbotctl.config import lookup
from diffbotctl.errors import Problem, UsageError, closest_match
from diffbotctl.learn.lesson import CHECK_FILE, Lesson

ENTRY_POINTS = "diffbotctl.lessons"
LESSONS = Path("lessons")  # the shipped folder, and that of a teacher in the present folder
FOLDER = Path("learn")  # of a learner
PROGRESS = "progress.json"  # in it
ORDER = (
    "talker",
    "parameters",
    "turtle_keys",
    "turtle_square",
    "one_metre",
    "counter",
    "counter_cpp",
    "own_message",
    "wiring",
    "wheel_speeds",
    "odometry",
    "scan_stop",
    "calibration",
    "why",
)


def home() -> Path:
    """The nearest folder upwards that has a learner's folder; the present one for none."""
    here = Path.cwd()
    above = (each for each in (here, *here.parents) if (each / FOLDER / PROGRESS).exists())
    return next(above, here)


def lessons() -> list[Lesson]:
    """All lessons in order."""
    found = [Lesson(lookup.folder(LESSONS.name) / name) for name in ORDER]
    for entry in sorted(entry_points(group=ENTRY_POINTS)):
        spec = find_spec(entry.value)
        for folder in spec.submodule_search_locations or () if spec else ():
            found += _lessons_in(Path(folder))
    for taught in (LESSONS, home() / LESSONS):
        known = {lesson.name for lesson in found}
        found += [lesson for lesson in _lessons_in(taught) if lesson.name not in known]
    return found


def _lessons_in(folder: Path) -> list[Lesson]:
    return [Lesson(path.parent) for path in sorted(folder.glob(f"*/{CHECK_FILE}"))]


def find_lesson(text: str) -> Lesson:
    """The lesson with the name or number `text`. Raises UsageError."""
    known = lessons()
    for number, lesson in enumerate(known, 1):
        if text in (lesson.name, str(number)):
            return lesson
    near = closest_match(text, [lesson.name for lesson in known])
    fix = f"did you mean {near}?" if near else "`diffbotctl learn` lists the lessons"
    raise UsageError(Problem("E-LESSON", text, "there is no such lesson", fix))
