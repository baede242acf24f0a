"""A lesson: a folder with a text, files to start from, a solution, and runs that judge them."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import diffbotctl
from diffbotctl.config import lookup, yaml_reader
from diffbotctl.config.section_reader import read_section
from diffbotctl.errors import ConfigurationError, Problem
from diffbotctl.params import Param, Section

CHECK_FILE = "check.yaml"
HEADER = "diffbot_program.h"
TEMPLATES = Path(diffbotctl.__file__).parent / "templates"


class Draw(Section):
    """A value that is drawn for each run, uniformly between two bounds."""

    low = Param(float, key="from", help="Smallest value.")
    high = Param(float, key="to", help="Largest value.")
    unit = Param(str, default="", help="Unit of both.")
    whole = Param(bool, default=False, help="Whether it is a whole number.")


class LiveChange(Section):
    """A change of live parameters while the run goes on."""

    parameters = Param(list[str], help="Each as block.parameter; all get the same value.")
    at = Param(float, unit="s", above=0.0, help="Simulated time of the change.")
    value = Param(Draw, help="The value.")


class RunEntry(Section):
    """Simulated runs of one pipeline, each with other values."""

    pipeline = Param(str, default="", help="Pipeline file in the lesson's folder `check`.")
    recording = Param(str, default="", help="In its place: a recording of the learner's.")
    count = Param(int, default=3, minimum=1, maximum=1000, help="How many runs.")
    time = Param(float, unit="s", default=60.0, above=0.0, help="Simulated time of each at most.")
    draw = Param(dict[str, Draw], default={}, help="Values that are drawn, as --set names them.")
    changes = Param(list[LiveChange], default=[], help="Changes while it runs.")
    reset_at = Param(
        float, unit="s", default=0.0, help="When all blocks are reset, as before a run; 0: never."
    )
    refused = Param(list[str], default=[], help="Values, as --set states them, to be refused.")
    accepted = Param(list[str], default=[], help="Values, as --set states them, to be accepted.")
    types = Param(
        dict[str, str],
        default={},
        help="Types of wires, such as {sensor.door: 'Door(time ns, angle rad)'}.",
    )
    settings = Param(list[str], key="set", default=[], help="Values, as --set states them.")
    programs = Param(bool, default=False, help="Whether programs run, in real time.")
    build = Param(str, default="", help="Command before the runs, such as a compiler.")


class CheckSection(Section):
    """The file check.yaml of a lesson."""

    format = Param(int, choices=(1,), help="Version of the file format.")
    kind = Param(str, choices=("lesson",), help="Kind of file.")
    title = Param(str, help="What the learner does, in a few words.")
    files = Param(list[str], help="Files of the learner, below the lesson's folder.")
    header = Param(bool, default=False, help="Whether diffbot_program.h lies beside them.")
    runs = Param(list[RunEntry], help="The runs that judge them.")
    failures = Param(int, default=0, minimum=0, help="Runs that may fail.")
    findings = Param(
        dict[str, str], default={}, help="Advice for each finding; {seen} is what was seen."
    )
    hints = Param(list[str], default=[], help="Hints, from the first to the most direct.")


class Lesson:
    """A lesson in `folder`, whose name is that of the lesson."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.name = folder.name

    @cached_property
    def section(self) -> CheckSection:
        """What check.yaml states. Raises ConfigurationError."""
        path = self.folder / CHECK_FILE
        problems: list[Problem] = []
        tree = yaml_reader.read(str(path), lookup.display_path(path))
        section = read_section(tree, CheckSection, "the lesson", problems)
        if problems:
            raise ConfigurationError(problems)
        return section

    @property
    def text(self) -> str:
        """The text of the lesson, in Markdown."""
        return (self.folder / "lesson.md").read_text()

    def start_files(self) -> dict[str, Path]:
        """What a learner starts from: the names of the files, and where they come from."""
        start = self.source("start")
        files = {str(path.relative_to(start)): path for path in start.rglob("*") if path.is_file()}
        return {**files, **self.extra_files()}

    def extra_files(self) -> dict[str, Path]:
        """Files that lie beside the learner's, and where they come from."""
        return {HEADER: TEMPLATES / f"{HEADER}.tmpl"} if self.section.header else {}

    def source(self, kind: str) -> Path:
        """The folder `start`, `solution` or `check`."""
        return self.folder / kind
