"""A proof: sections one after the other, their rows printed and compared with the last time.

Each row is a line on stdout, `MET section: what: figure (target)`, and a line of a table that is
kept from proof to proof. Instead of MET it may begin with MISSED; with RAN, where a brief sample
has too few trials for the target; with NO DATA, where it needs what does not ship; and with BROKEN
OFF, where the section failed and its other rows are not measured.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

from diffbotctl.emulator.program import cache
from tests.support.trials.progress import SectionTimes, with_progress
from tests.support.trials.row import BrokenOff, Row, Unjudged
from tests.support.trials.section import Section


class KeptRow(NamedTuple):
    """A row as a line of the table: without tabs and line breaks."""

    verdict: str
    section: str
    what: str
    figure: str
    target: str

    @staticmethod
    def of(section: str, row: Row) -> KeptRow:
        """The row of a section."""
        texts = (row.verdict, section, row.what, row.figure, row.target)
        return KeptRow(*(" ".join(text.split()) for text in texts))

    def line(self) -> str:
        """As it is printed."""
        return f"{self.verdict:<6} {self.section}: {self.what}: {self.figure} ({self.target})"


class KeptRows:
    """The rows of the last proof, by section, in a file of lines with tabs."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.sections: dict[str, list[KeptRow]] = {}
        with suppress(OSError, ValueError, TypeError):  # none yet, or not written by this
            for line in file.read_text(encoding="utf-8").splitlines():
                row = KeptRow(*line.split("\t"))
                self.sections.setdefault(row.section, []).append(row)

    def replace(self, section: str, rows: list[KeptRow]) -> Iterator[str]:
        """Keep the rows of a section. Yields a line for each that was met and is missed, or the
        other way round; a file that cannot be written costs only this comparison."""
        former = {row.what: row for row in self.sections.get(section, [])}
        self.sections[section] = rows
        with suppress(OSError):
            self.file.parent.mkdir(parents=True, exist_ok=True)
            lines = ("\t".join(row) for each in self.sections.values() for row in each)
            self.file.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
        for row in rows:
            before = former.get(row.what, row)
            if {before.verdict, row.verdict} == {"MET", "MISSED"}:
                yield f"{row.line()}; it was {before.verdict} with {before.figure}"


def arguments(prog: str, description: str | None, names: Sequence[str]) -> argparse.ArgumentParser:
    """The options that every proof has."""
    parser = argparse.ArgumentParser(prog=prog, description=description)
    parser.add_argument("--brief", action="store_true", help="the smallest sample of each section")
    parser.add_argument("--scale", type=float, default=1.0, help="factor of all sizes in full")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--section",
        nargs="+",
        action="extend",
        choices=names,
        metavar="NAME",
        help="only these; --list names them",
    )
    parser.add_argument("--list", action="store_true", help="print the sections and their sizes")
    return parser


def listed(sections: Sequence[Section]) -> Iterator[str]:
    """A line for each section, with its sizes."""
    for section in sections:
        brief = section.brief
        text = f"no: {brief}" if isinstance(brief, str) else _text(dict(brief))
        yield f"{section.name}\tfull {_text(dict(section.full))}\tbrief {text}"


def _text(sizes: dict[str, float | bool]) -> str:
    return ", ".join(f"{name}={size:g}" for name, size in sizes.items()) or "as it is"


def prove(name: str, sections: Sequence[Section], options: argparse.Namespace) -> int:
    """Measure the sections that `options` choose, and print their rows.

    Returns the exit code: 0 when all are met, 1 when a row is missed, 2 when a section broke off.
    """
    if options.list:
        print("\n".join(listed(sections)))
        return 0
    chosen = [each for each in sections if not options.section or each.name in options.section]
    if options.brief:
        for section in chosen:
            if isinstance(section.brief, str):
                print(f"ONLY IN FULL {section.name}: {section.brief}")
        chosen = [each for each in chosen if not isinstance(each.brief, str)]
    files = f"{name}_brief" if options.brief else name
    kept = KeptRows(cache() / f"{files}.tsv")
    changed: list[str] = []
    missed = broken = 0
    times = SectionTimes(cache() / f"{files}_times.json")
    unjudged = {each.name for each in chosen if options.brief and each.is_statistical}
    todo = [
        (each.name, each.measured(options.brief, options.seed, options.scale)) for each in chosen
    ]
    for section, rows in groupby(with_progress(todo, times), key=itemgetter(0)):
        found: list[KeptRow] = []
        for _, measured in rows:
            row = Unjudged(*measured) if section in unjudged and type(measured) is Row else measured
            found.append(KeptRow.of(section, row))
            print(found[-1].line(), flush=True)
            missed += row.verdict == "MISSED"
            broken += isinstance(row, BrokenOff)
        changed += kept.replace(section, found)
    for line in changed:
        print(f"CHANGED {line}")
    print(f"{name}: {missed} rows missed, {broken} sections broken off")
    return 2 if broken else int(missed > 0)
