"""Trials as text and as records: one table of the cases, the failed runs, the totals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from shlex import join
from statistics import median
from typing import Any
from xml.etree import ElementTree

from diffbotctl.errors import WIDTH
from diffbotctl.printable import fold_words
from diffbotctl.trials.statistics import proven_share
from diffbotctl.trials.verdict import JudgedRun

FAILED_SHOWN_MAX, OF_A_CASE_MAX = 10, 2
CASE_WIDTH_MAX = 20
MM = 1000.0
MINUTE_S, HOUR_S = 60.0, 3600.0


def duration_text(seconds: float) -> str:
    """`8 s`, `3 min`, `2 h 5 min`."""
    if seconds < 2 * MINUTE_S:
        return f"{seconds:.0f} s"
    if seconds < HOUR_S:
        return f"{seconds / MINUTE_S:.0f} min"
    hours, rest = divmod(round(seconds / MINUTE_S), 60)
    return f"{hours} h {rest} min"


def watch_command(file: Path, name: str) -> str:
    """The command that shows one run on the dashboard."""
    return join(["diffbotctl", "trials", str(file), "--only", name, "--watch"])


def case_rows(judged: Sequence[JudgedRun]) -> list[list[str]]:
    """A table of the cases in the order of the file, its titles first."""
    rows = [["case", "runs", "passed", "proven", "reached", "stops", "error", "worst", "time"]]
    for name in dict.fromkeys(each.result.case for each in judged):
        group = [each for each in judged if each.result.case == name]
        found = [each.result for each in group]
        passed = sum(each.passed for each in group)
        errors = [each.error * MM for each in found if each.error is not None and each.is_claimed]
        times = [each.time for each in found if each.outcome != "crashed"]
        rows.append(
            [
                name,
                str(len(group)),
                str(passed),
                f"{100.0 * proven_share(passed, len(group)):.0f} %",
                str(sum(each.is_claimed for each in found)),
                str(sum(bool(each.stops) for each in found)),
                f"{median(errors):.0f} mm" if errors else "-",
                f"{max(errors):.0f} mm" if errors else "-",
                f"{median(times):.1f} s" if times else "-",
            ]
        )
    return rows


def case_lines(judged: Sequence[JudgedRun]) -> Iterator[str]:
    """The table as text; of a long name the beginning."""
    rows = [[row[0][:CASE_WIDTH_MAX], *row[1:]] for row in case_rows(judged)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        cells = (f"{cell:>{width}}" for cell, width in zip(row[1:], widths[1:], strict=True))
        yield f"{row[0]:{widths[0]}}  {'  '.join(cells)}"


def failed_lines(file: Path, verdicts: Sequence[JudgedRun]) -> Iterator[str]:
    """The failed runs, worst first, each with its seed and the command that shows it."""
    failed = worst_first([verdict for verdict in verdicts if not verdict.passed])
    of_case: Counter[str] = Counter()
    chosen = []
    for verdict in failed:
        of_case[verdict.result.case] += 1
        if of_case[verdict.result.case] <= OF_A_CASE_MAX:
            chosen.append(verdict)
    chosen = chosen[:FAILED_SHOWN_MAX]
    for verdict in chosen:
        found = verdict.result
        text = f"FAILED {found.name} (seed {found.seed}): {'; '.join(verdict.unmet)}"
        first, *others = fold_words(text, WIDTH - 2)
        yield first
        yield from (f"  {line}" for line in others)
        yield f"  {watch_command(file, found.name)}"
    if len(failed) > len(chosen):
        yield f"and {len(failed) - len(chosen)} more; --json lists all runs, --report shows them"


def unbegun_lines(verdicts: Sequence[JudgedRun]) -> Iterator[str]:
    """Each fault that did not begin, and in how many runs of its case."""
    found = [each.result for each in verdicts]
    runs = Counter((each.case, kind) for each in found for kind in dict.fromkeys(each.unbegun))
    for (case, kind), count in runs.items():
        yield f"{case}: {count} ended before {kind} began: choose an earlier `at`"


def worst_first(verdicts: Sequence[JudgedRun]) -> list[JudgedRun]:
    """By the score; equal ones in the order of their runs."""
    return sorted(verdicts, key=lambda verdict: verdict.score, reverse=True)


def record(verdict: JudgedRun) -> dict[str, Any]:
    """A run as JSON has it. Equal runs have equal records, whatever the machine."""
    found = verdict.result._asdict()
    found["stops"] = [stop._asdict() for stop in verdict.result.stops]
    return {"run": found.pop("name"), "passed": verdict.passed, "unmet": verdict.unmet, **found}


def junit(name: str, verdicts: Sequence[JudgedRun]) -> str:
    """The runs as a JUnit file: one suite, a case for each run; times are simulated ones."""
    failed = [verdict for verdict in verdicts if not verdict.passed]
    crashed = [verdict for verdict in failed if verdict.result.outcome == "crashed"]
    suite = ElementTree.Element(
        "testsuite",
        name=name,
        tests=str(len(verdicts)),
        failures=str(len(failed) - len(crashed)),
        errors=str(len(crashed)),
        time=f"{sum(verdict.result.time for verdict in verdicts):.3f}",
    )
    for verdict in verdicts:
        found = verdict.result
        facts = {"classname": f"{name}.{found.case}", "name": found.name}
        case = ElementTree.SubElement(suite, "testcase", facts, time=f"{found.time:.3f}")
        if not verdict.passed:
            kind = "error" if found.outcome == "crashed" else "failure"
            text = "; ".join(verdict.unmet)
            ElementTree.SubElement(case, kind, message=text, type=found.outcome)
    whole = ElementTree.Element("testsuites")
    whole.append(suite)
    ElementTree.indent(whole)
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(whole, "unicode") + "\n"
    )
