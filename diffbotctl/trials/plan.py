"""The runs of a file of trials, each with its checked configuration."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from itertools import product
from math import prod
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from diffbotctl.config import lookup, yaml_reader
from diffbotctl.config.checks.faults import emulated_problems, fault_problems
from diffbotctl.config.checks.world import typed_goal_problems
from diffbotctl.config.code_files import CodeConsentError
from diffbotctl.config.configuration import Configuration, GoalEntry, WorldEntry
from diffbotctl.config.faults import FaultEntry, read_sizes
from diffbotctl.config.load import load
from diffbotctl.config.section_reader import read_section
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import (
    ConfigurationError,
    Place,
    Problem,
    UsageError,
    UserError,
    closest_match,
    join_words,
)
from diffbotctl.messages import Goal
from diffbotctl.trials.random_robots import draw_design, yaml_text
from diffbotctl.trials.sections import CaseEntry, Expectation, RandomRobots, Trials

FOLDER = Path("trials")  # in which a name is looked up
TRIES_MAX = 20  # robots that are drawn for each that `check` accepts
NO_CASE = "plain"  # name of the case of a file without cases
RUNS_MAX = 100_000  # some hours of two processors
# In the name of a run / separates its parts, * ? and [ match several in --only, and - begins an
# option.
NAME = re.compile(r"\w[^/*?[]*")


class Trial(NamedTuple):
    """One run: `name` is its case, robot, world, goal and seed, as far as the file states them."""

    name: str
    case: str
    robot: str
    configuration: Configuration
    goals: tuple[Goal, ...]
    seed: int
    port: str
    time_limit: float  # s, simulated
    expect: Expectation


class TrialsPlan(NamedTuple):
    """All runs of a file of trials, in the order of their names in the file.

    `drawn`: the folder with the files of robots that were drawn, which the runs read.
    """

    file: Path
    section: Trials
    trials: tuple[Trial, ...]
    warnings: tuple[Problem, ...]
    drawn: TemporaryDirectory[str] | None = None

    def only(self, patterns: Sequence[str]) -> tuple[TrialsPlan, list[int]]:
        """The runs whose names match one of `patterns`, or of a case called so, and their places.

        Raises UsageError for a pattern without a run.
        """
        names = [trial.name for trial in self.trials]
        cases = {trial.case for trial in self.trials}
        patterns = [f"{each}/*" if each in cases else each for each in patterns]
        for pattern in patterns:
            if not any(fnmatchcase(name, pattern) for name in names):
                near = closest_match(pattern, names) or names[0]
                cause = f"no run is called {pattern}"
                fix = f"did you mean {near}? A * stands for any text: '{names[0][:4]}*'"
                raise UsageError(Problem("E-TRIALS-ONLY", "--only", cause, fix))
        matches = (any(fnmatchcase(name, each) for each in patterns) for name in names)
        chosen = [number for number, is_chosen in enumerate(matches) if is_chosen]
        return self.at(chosen), chosen

    def partners(self, plan: TrialsPlan, places: Sequence[int]) -> TrialsPlan:
        """The runs to compare with those of `plan`, which are at `places` of the same file.

        Raises UsageError for several robots in place of which this plan has one.
        """
        if len({trial.robot for trial in self.trials}) > 1:
            return self.at(places)
        own, names = (
            [t.name.replace(f"/{t.robot}", "", 1) for t in p.trials] for p in (self, plan)
        )
        if len(set(names)) < len(names):
            cause = "the runs have several robots, and one robot is compared with one"
            fix = f"choose one of them: --only '*/{plan.trials[0].robot}/*'"
            raise UsageError(Problem("E-TRIALS", "--against", cause, fix))
        numbers = {name: number for number, name in enumerate(own)}
        return self.at([numbers[name] for name in names])

    def at(self, numbers: Sequence[int]) -> TrialsPlan:
        """Only the runs at these places."""
        return self._replace(trials=tuple(self.trials[number] for number in numbers))


def find_trials(name: str) -> Path:
    """The file of trials meant by `name`: a path, or a name in ./trials. Raises UsageError."""
    path = Path(name) if lookup.is_path(name) else FOLDER / f"{name}.yaml"
    if lookup.is_file(path):
        return path
    known = sorted(each.stem for each in FOLDER.glob("*.yaml"))
    near = closest_match(name, known)
    fix = f"did you mean {near}?" if near else "`diffbotctl new trials NAME` writes one"
    raise UsageError(Problem("E-FILE-READ", name, "there is no such file of trials", fix))


def is_trials(name: str) -> bool:
    """Whether `name` is the path of a file of `kind: trials`."""
    if not lookup.is_path(name):
        return False
    try:
        kind = yaml_reader.read(name).entries.get("kind")
    except (ConfigurationError, OSError, ValueError):
        return False
    return kind is not None and kind.text == "trials"


def read_plan(
    name: str,
    sets: Sequence[str] = (),
    robot: str | None = None,
    pipeline: str | None = None,
) -> TrialsPlan:
    """The runs of the file of trials `name`. `sets` are applied after those of the file.

    `robot` and `pipeline` replace those of the file. Raises ConfigurationError with every problem
    of it, UserError of the files that it names, CodeConsentError for code that is not allowed.
    """
    path = find_trials(name)
    tree = yaml_reader.read(str(path), lookup.display_path(path))
    kind = tree.entries.get("kind")
    if kind is None or kind.text != "trials":
        cause = "a file of trials is required here"
        place = tree.place if kind is None else kind.place
        raise ConfigurationError(Problem("E-KIND", place, cause, "write `kind: trials`"))
    reader = _PlanReader(path, tree, tuple(sets), robot, pipeline)
    return reader.plan()


@dataclass(eq=False, repr=False)
class _PlanReader:
    """Reads one file of trials and collects every problem on the way."""

    path: Path
    tree: Value
    sets: tuple[str, ...]
    robot: str | None
    pipeline: str | None
    problems: list[Problem] = field(default_factory=list)
    drawn: TemporaryDirectory[str] | None = None

    def plan(self) -> TrialsPlan:
        section = read_section(self.tree, Trials, "the file of trials", self.problems)
        for case_name, case in (section.cases or {}).items():
            value = self.tree.at("cases", case_name, "faults")
            if case is not None and value is not None:
                read_sizes(case.faults, value.items, self.problems)
        self._refuse_names()
        self._raise()
        robots = self._configurations(section)
        self._raise()
        for configuration in robots.values():
            self._check(section, configuration)
        self._refuse_too_many(section, len(robots))
        self._raise()
        trials = tuple(self._trials(section, robots))
        found = [problem for each in robots.values() for problem in each.warnings]
        warnings = tuple({problem.render(): problem for problem in found}.values())
        return TrialsPlan(self.path, section, trials, warnings, self.drawn)

    def _raise(self) -> None:
        if any(problem.severity == "error" for problem in self.problems):
            raise ConfigurationError({each.render(): each for each in self.problems}.values())

    def _refuse_names(self) -> None:
        """Refuse names of cases and worlds that --only could not choose."""
        for key in ("cases", "worlds"):
            named = self.tree.at(key)
            for name, value in named.entries.items() if named is not None else ():
                if not NAME.fullmatch(name):
                    cause = f"'{name}' cannot be a name in {key}"
                    fix = "begin it with a letter or digit, and leave out / * ? and ["
                    self.problems.append(Problem("E-NAME", value.name_place, cause, fix))

    def _refuse_too_many(self, section: Trials, robots: int) -> None:
        of_each = [len(each) or 1 for each in (section.cases, section.worlds, section.goals)]
        runs = robots * prod(of_each) * section.seeds
        if runs > RUNS_MAX:
            cause = f"these are {runs:,} runs; at most {RUNS_MAX:,} are possible in a file"
            fix = "write fewer seeds, robots or goals"
            self.problems.append(Problem("E-TRIALS", self.tree.place, cause, fix))

    def _configurations(self, section: Trials) -> dict[str, Configuration]:
        """The pipeline with each robot, by the name of the robot."""
        found: dict[str, Configuration] = {}
        settings = (*section.settings, *self.sets)
        pipeline = self.pipeline or self._beside(section.pipeline)
        place = self.tree.entries["pipeline"].place
        robots: list[str | None] = [self._beside(name) for name in section.robots]
        if not robots and section.random_robots is None:
            robots = [None]
        for robot in robots if self.robot is None else [self.robot]:
            try:
                configuration = load(pipeline, robot, settings)
            except CodeConsentError:
                raise
            except UserError as error:
                self.problems += map(self._with_own_fix, error.problems)
                continue
            self._refuse_unsimulated(configuration, place)
            file = configuration.robot_file
            label = file.stem if file is not None else ""
            found[label if label not in found else str(file)] = configuration
        if section.random_robots is not None and self.robot is None and not self.problems:
            found |= self._drawn(section.random_robots, pipeline, settings)
        return found

    def _with_own_fix(self, problem: Problem) -> Problem:
        """A robot is chosen in the file: the command has no option for it."""
        if problem.code != "E-ROBOT-WHICH":
            return problem
        fix = f"choose some in {lookup.display_path(self.path)}: `robots: [NAME]`"
        return replace(problem, fix=fix)

    def _drawn(
        self, drawn: RandomRobots, pipeline: str, settings: Sequence[str]
    ) -> dict[str, Configuration]:
        """Robots drawn at random that `check` accepts for this pipeline."""
        found: dict[str, Configuration] = {}
        refusal: Sequence[Problem] = ()
        self.drawn = TemporaryDirectory()
        for number in range(TRIES_MAX * drawn.count):
            design = draw_design(drawn.seed, number)
            file = Path(self.drawn.name) / f"random_{number}.yaml"
            file.write_text(yaml_text(design.tree()), encoding="utf-8")
            try:
                found[file.stem] = load(pipeline, str(file), settings)
            except CodeConsentError:
                raise
            except ConfigurationError as error:
                refusal = error.problems
            if len(found) == drawn.count:
                return found
        place = self.tree.entries["random_robots"].place
        cause = f"of {TRIES_MAX * drawn.count} robots that were drawn `check` accepts {len(found)}"
        fix = f"the last one was refused because {refusal[0].cause}" if refusal else ""
        self.problems.append(Problem("E-TRIALS", place, cause, fix))
        return found

    def _beside(self, name: str) -> str:
        """A path counts from the folder of the file of trials."""
        return str(self.path.parent / name) if lookup.is_path(name) else name

    def _refuse_unsimulated(self, configuration: Configuration, place: Place) -> None:
        """Refuse a pipeline that needs anything but a simulated robot."""
        problem = ""
        if configuration.sources:
            names = join_words([use.name for use in configuration.sources], "and")
            problem = f"it reads the devices {names} at real ports"
        elif configuration.robots or configuration.robot is None:
            problem = "it does not have one robot"
        if problem:
            cause = f"trials run the pipeline on a simulated robot alone, and {problem}"
            fix = "name a pipeline without them: trials never use a real port"
            self.problems.append(Problem("E-TRIALS", place, cause, fix))

    def _check(self, section: Trials, configuration: Configuration) -> None:
        """Refuse faults that this robot cannot have, and goals where it cannot stand."""
        robot = configuration.robot
        assert robot is not None
        programs = [use.name for use in configuration.programs]
        for name, case in section.cases.items():
            value = self.tree.at("cases", name, "faults")
            if value is not None:
                self.problems += fault_problems(robot, programs, case.faults, value.items)
                if section.port == "sim":
                    self.problems += emulated_problems(case.faults, value.items)
        goals = self.tree.at("goals")
        for world in section.worlds.values() or [configuration.world]:
            shown = replace(configuration, world=world)
            for goal, value in zip(section.goals, goals.items if goals else (), strict=True):
                self.problems += typed_goal_problems(shown, value.place, goal.x, goal.y, True)
        self._refuse_unjudgeable(section, section.goals or configuration.goals[-1:])

    def _refuse_unjudgeable(self, section: Trials, goals: Sequence[GoalEntry]) -> None:
        """Refuse what is expected at a goal where there is none, or none with a heading."""
        for name, case in (section.cases or {NO_CASE: CaseEntry()}).items():
            steps = ("cases", name) if case.expect else ()
            for key in ("error", "heading_error", "farther"):
                value = self.tree.at(*steps, "expect", key)
                if value is None or getattr(case.expect or section.expect, key) is None:
                    continue
                if not goals:
                    cause, fix = "the runs have no goal", "state `goals`"
                elif key == "heading_error" and any(goal.heading is None for goal in goals):
                    cause, fix = "a goal has no heading", "state the heading of each goal"
                else:
                    continue
                cause, fix = f"{key} cannot be judged: {cause}", f"{fix}, or leave {key} out"
                self.problems.append(Problem("E-TRIALS", value.place, cause, fix))

    def _trials(self, section: Trials, robots: dict[str, Configuration]) -> Iterator[Trial]:
        worlds: dict[str, WorldEntry | None] = {**section.worlds} or {"": None}
        goals: list[tuple[str, tuple[Goal, ...]]] = [
            (str(number), (Goal(0, 0, goal.x, goal.y, goal.heading),))
            for number, goal in enumerate(section.goals, 1)
        ]
        cases = section.cases or {NO_CASE: CaseEntry()}
        seeds = range(section.first_seed, section.first_seed + section.seeds)
        for (case_name, case), (robot, configuration) in product(cases.items(), robots.items()):
            faulty = with_faults(configuration, case.faults)
            rest = section.port, section.time_limit, case.expect or section.expect
            for (world_name, world), (goal_name, goal) in product(
                worlds.items(), goals or [("", ())]
            ):
                placed = faulty if world is None else replace(faulty, world=world)
                for seed in seeds:
                    parts = (case_name, robot, world_name, goal_name, str(seed))
                    name = "/".join(part for part in parts if part)
                    yield Trial(name, case_name, robot, placed, goal, seed, *rest)


def with_faults(configuration: Configuration, faults: Sequence[FaultEntry]) -> Configuration:
    """`configuration` with further faults of its simulated robot."""
    if not faults:
        return configuration
    assert configuration.robot is not None and configuration.nominal is not None
    robots = []
    for robot in (configuration.robot, configuration.nominal):
        changed = copy.copy(robot)
        changed.simulation = copy.copy(robot.simulation)
        changed.simulation.faults = [*robot.simulation.faults, *faults]
        robots.append(changed)
    return replace(configuration, robot=robots[0], nominal=robots[1])
