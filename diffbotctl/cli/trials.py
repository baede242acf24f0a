"""`diffbotctl trials`: many simulated runs of a pipeline, with faults, and their verdicts."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.command import command, option
from diffbotctl.cli.contradictions import exclusive
from diffbotctl.cli.options import FORCE, JSON, SETS, YES
from diffbotctl.cli.output import check_output, open_output, print_json
from diffbotctl.cli.program_consent import allowed_programs, with_code_consent
from diffbotctl.errors import Problem, RunError, UsageError
from diffbotctl.printable import write_raw

if TYPE_CHECKING:
    from collections.abc import Sequence

    from diffbotctl.programs.driver import ProgramsDriver
    from diffbotctl.trials.comparison import Comparison
    from diffbotctl.trials.plan import Trial, TrialsPlan
    from diffbotctl.trials.verdict import JudgedRun
    from diffbotctl.trials.workers import TrialOutcome

# Trials that take longer, or are more, are begun only after a question.
ASKED_S, ASKED_RUNS = 600.0, 2000
PROBES = 6  # trials from which that time is estimated
PROGRESS_PERIOD_S = 10.0  # between two lines where standard error is no terminal
OUTPUTS = ("--json", "--junit", "--report", "--against")
BASELINE_ENDINGS = (".json", ".jsonl")


@command("Run", 2, "; judge many runs")
@exclusive("--watch", OUTPUTS, "what is watched is not judged")
def trials(
    file: str,
    patterns: tuple[str, ...] = option(
        "--only", "Only this run or case; a * stands for any text. Repeatable.", metavar="RUN"
    ),
    sets: tuple[str, ...] = SETS,
    workers: int | None = option(
        "Runs at a time; default: one for each processor.", type=click.IntRange(1, 256)
    ),
    junit: Path | None = option("Write a JUnit file: FILE.xml."),
    force: bool = FORCE,
    report: Path | None = option("Write a report with all paths: FILE.html."),
    against: str | None = option(
        "Compare with the same runs of another pipeline or robot, with BLOCK.PARAM=VALUE, or with "
        "what --json once printed: FILE.json.",
        metavar="OTHER",
    ),
    watch: bool = option("Show one run after another on the dashboard."),
    allow_programs: bool = option("Run the pipeline's programs and files of code, unasked."),
    yes: bool = YES,
    as_json: bool = JSON,
) -> int:
    """Run the trials of FILE, and judge each run by what the file expects.

    FILE is a file of `kind: trials`, or the name of one in ./trials. All runs are simulated.

    Exit code: 0 all runs are as expected, 1 not all, or they are worse than those of --against,
    2 wrong files or usage, 130 interrupted.
    """
    from diffbotctl.trials.comparison import ComparedRun, compare, other_plan, read_baseline
    from diffbotctl.trials.plan import read_plan

    _check_outputs(junit, report, force)
    plan = with_code_consent(lambda: read_plan(file, sets), allow_programs)
    for warning in plan.warnings:
        click.echo(warning.render(), err=True)
    programs = _allowed_programs(plan, allow_programs)
    places = list(range(len(plan.trials)))
    if patterns:
        plan, places = plan.only(patterns)
    if watch:
        return _watch(plan, programs)
    count = workers or len(os.sched_getaffinity(0))
    other, before = None, list[ComparedRun]()
    if against is not None and against.endswith(BASELINE_ENDINGS):
        before = read_baseline(Path(against), {trial.name for trial in plan.trials})
    elif against is not None:
        found = against
        other = with_code_consent(lambda: other_plan(file, found, sets), allow_programs)
        _allowed_programs(other, allow_programs)
        other = other.partners(plan, places)
    verdicts, seconds = _run_and_judge(plan, count, yes)
    try:
        _write_outputs(plan, verdicts, seconds, junit, report, force)
    finally:
        if as_json:
            _print_records(verdicts)
        else:
            _print_summary(plan, verdicts)
    if other is not None:
        judged, _ = _run_and_judge(other, count, yes)
        before = [ComparedRun.of(each) for each in judged]
    after = [ComparedRun.of(each) for each in verdicts]
    is_worse = against is not None and _print_comparison(
        compare(against, before, after, by_name=other is None), as_json
    )
    return 0 if all(verdict.passed for verdict in verdicts) and not is_worse else 1


def _allowed_programs(plan: TrialsPlan, is_given: bool) -> type[ProgramsDriver] | None:
    """As `allowed_programs`; raises UsageError without consent, since nothing has run yet."""
    try:
        return allowed_programs(plan.trials[0].configuration, is_given)
    except RunError as error:
        raise UsageError(error.problems) from None


def _check_outputs(junit: Path | None, report: Path | None, force: bool) -> None:
    for file, suffix in ((junit, ".xml"), (report, ".html")):
        if file is not None:
            check_output(file, (suffix,), force)


def _run_and_judge(plan: TrialsPlan, workers: int, yes: bool) -> tuple[list[JudgedRun], float]:
    """All runs of a plan, judged, and the time that they took (s); prints the times."""
    began = time.monotonic()
    outcomes = _Session(plan, workers, yes).run()
    seconds = time.monotonic() - began
    _print_times(outcomes, seconds, workers)
    return _verdicts(plan, outcomes), seconds


def _write_outputs(
    plan: TrialsPlan,
    judged: Sequence[JudgedRun],
    seconds: float,
    junit: Path | None,
    report: Path | None,
    force: bool,
) -> None:
    if junit is not None:
        from diffbotctl.trials.summary import junit as junit_text

        with open_output(junit, (".xml",), force) as output:
            output.write(junit_text(plan.file.stem, judged))
    if report is not None:
        from diffbotctl.trials.report import html

        with open_output(report, (".html",), force) as output:
            output.write(html(plan, judged, seconds))


def _print_comparison(comparison: Comparison, as_json: bool) -> bool:
    """Print it; whether the runs are worse."""
    if as_json:
        counts = {"pairs": len(comparison.pairs), "unpaired": comparison.unpaired}
        record = {"against": comparison.name, "regression": comparison.is_regression, **counts}
        print_json({**record, "lost": comparison.lost, "gained": comparison.gained})
    else:
        for line in comparison.lines():
            click.echo(line)
    return comparison.is_regression


def _verdicts(plan: TrialsPlan, outcomes: Sequence[TrialOutcome]) -> list[JudgedRun]:
    from diffbotctl.trials.verdict import judge

    return [
        judge(outcome.result, trial.expect)
        for trial, outcome in zip(plan.trials, outcomes, strict=True)
    ]


class _Session:
    """All runs of a plan, with their progress on standard error."""

    def __init__(self, plan: TrialsPlan, workers: int, yes: bool) -> None:
        self.plan, self.workers, self.yes = plan, workers, yes
        self.done = self.failed = 0
        self.began = self.shown = time.monotonic()
        self.processor = 0.0
        self.is_terminal = sys.stderr.isatty()

    def run(self) -> list[TrialOutcome]:
        """The outcomes in the order of the plan. Raises UsageError without a consent that it needs.

        Trials that are many begin with a few of all kinds, from which the time of the rest follows.
        """
        from diffbotctl.trials.workers import run_trials

        trials = self.plan.trials
        limit = self.plan.section.processor_time
        step = max(len(trials) // PROBES, 1)
        first = list(range(0, len(trials), step)) if len(trials) > 4 * PROBES else []
        found: dict[int, TrialOutcome] = {}
        rest = [number for number in range(len(trials)) if number not in set(first)]
        for numbers in (first, rest):
            if numbers is rest and first:
                self._ask(self.processor / len(first) * len(rest) / self.workers)
            chosen = [trials[number] for number in numbers]
            outcomes = run_trials(chosen, self.workers, limit, self._notify(chosen))
            found.update(zip(numbers, outcomes, strict=True))
        self._show_progress(is_last=True)
        return [found[number] for number in range(len(trials))]

    def _notify(self, trials: Sequence[Trial]) -> Any:
        from diffbotctl.trials.verdict import judge

        def notify(number: int, outcome: TrialOutcome) -> None:
            self.done += 1
            self.processor += outcome.processor
            self.failed += not judge(outcome.result, trials[number].expect).passed
            self._show_progress()

        return notify

    def _ask(self, seconds: float) -> None:
        """Ask before trials that take long. Raises UsageError without a terminal to ask on."""
        from diffbotctl.trials.summary import duration_text

        is_short = seconds < ASKED_S and len(self.plan.trials) < ASKED_RUNS
        if is_short or self.yes:
            return
        self._show_progress(is_last=True)
        cause = f"{len(self.plan.trials)} runs take about {duration_text(seconds)}"
        if not sys.stdin.isatty():
            fix = "give --yes, fewer seeds, or --only for some of the runs"
            raise UsageError(Problem("E-TRIALS-LONG", str(self.plan.file), cause, fix))
        click.confirm(f"{cause} on {self.workers} processors. Begin?", abort=True, err=True)
        self.began = time.monotonic()

    def _show_progress(self, is_last: bool = False) -> None:
        from diffbotctl.trials.summary import duration_text

        now, total = time.monotonic(), len(self.plan.trials)
        period = 0.2 if self.is_terminal else PROGRESS_PERIOD_S
        if now - self.shown < period and not is_last:
            return
        self.shown, elapsed = now, now - self.began
        left = elapsed * (total - self.done) / max(self.done, 1)
        text = (
            f"{self.done} of {total} runs, {self.failed} failed, {duration_text(elapsed)} so far, "
            f"about {duration_text(left)} left"
        )
        if self.is_terminal:
            text = "\r\x1b[K" if is_last else f"\r\x1b[K{text[:79]}"
            write_raw(sys.stderr, text)
            sys.stderr.flush()
        elif not is_last:
            print(text, file=sys.stderr, flush=True)


def _print_summary(plan: TrialsPlan, verdicts: Sequence[JudgedRun]) -> None:
    from diffbotctl.trials.sections import Expectation
    from diffbotctl.trials.statistics import proven_share
    from diffbotctl.trials.summary import case_lines, failed_lines, unbegun_lines

    robots = dict.fromkeys(trial.robot for trial in plan.trials)
    click.echo(f"robots: {', '.join(robots)}")
    for line in (*case_lines(verdicts), *failed_lines(plan.file, verdicts)):
        click.echo(line)
    passed, runs = sum(verdict.passed for verdict in verdicts), len(verdicts)
    share = 100.0 * proven_share(passed, runs)
    click.echo(f"{passed} of {runs} runs as expected; this proves {share:.0f} % (95 % confidence)")
    for line in unbegun_lines(verdicts):
        click.echo(line)
    if all(vars(trial.expect) == vars(Expectation()) for trial in plan.trials):
        click.echo(
            "nothing is expected of them but no contact: `expect: {reach: 20 s}` asks for more"
        )


def _print_records(verdicts: Sequence[JudgedRun]) -> None:
    from diffbotctl.trials.summary import record

    for verdict in verdicts:
        print_json(record(verdict))


def _print_times(outcomes: Sequence[TrialOutcome], seconds: float, workers: int) -> None:
    processor = sum(outcome.processor for outcome in outcomes)
    click.echo(
        f"{seconds:.1f} s with {workers} at a time; the runs took {processor:.1f} s of a processor",
        err=True,
    )


def _watch(plan: TrialsPlan, programs: type[ProgramsDriver] | None) -> int:
    """Show the runs one after another on the dashboard, in real time; closing it ends a run."""
    from diffbotctl.cli.run import run_with_dashboard
    from diffbotctl.runs.options import RunOptions, SocketOptions
    from diffbotctl.runs.signals import Signals

    total = len(plan.trials)
    for number, trial in enumerate(plan.trials, 1):
        click.echo(f"{number} of {total}: {trial.name} (seed {trial.seed})")
        options = RunOptions(
            trial.port,
            trial.goals,
            trial.seed,
            socket=SocketOptions("trials"),
            rehearses=True,
            stay=True,
            dash=True,
            programs=programs,
        )
        run_with_dashboard(trial.configuration, options, Signals(), None)
        if number < total and not click.confirm("Show the next one?", default=True):
            break
    return 0
