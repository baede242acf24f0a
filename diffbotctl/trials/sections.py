"""The sections of a file of trials: which runs, with which faults, and what is expected of them."""

from __future__ import annotations

from typing import Literal, get_args

from diffbotctl.config.configuration import GoalEntry, WorldEntry
from diffbotctl.config.faults import FaultEntry
from diffbotctl.messages import GoalEnd, StopCode
from diffbotctl.params import REQUIRED, Choice, Count, Number, Param, Section

TrialPort = Literal["sim", "emulated"]
Unsure = Literal["never", "allowed", "required"]
CLEARANCE_MAX = 1.0  # m; what is farther away is not searched
STOP_CODES = tuple(code for code in (*get_args(StopCode), *get_args(GoalEnd)) if code)


class StopExpectation(Section):
    """The robot stops by itself, and states why."""

    code: str | None = Param(
        str,
        none=True,
        default=None,
        choices=STOP_CODES,
        help="Code of the stop, or how the goal ends; none: any.",
    )
    cause = Param(str, default="", help="A part of the text of the cause.")
    within = Number("s", "(0, inf)", 2.0, "Time from the first fault to the stop.")


class Expectation(Section):
    """What is expected of a run; what is not stated is not judged."""

    reach = Number("s", "(0, inf)", None, "All goals are reached within this time.")
    unsure: Unsure = Choice(
        Unsure,
        "never",
        "Whether a goal may, or has to, be reached with a warning that the pose is uncertain.",
    )
    stop: StopExpectation | None = Param(
        StopExpectation, none=True, default=None, help="The robot stops, and states why."
    )
    time = Number("s", "(0, inf)", None, "The run ends within this time.")
    error = Number("m", "(0, inf)", None, "Largest true distance from the last goal at the end.")
    heading_error = Number("rad", "(0, inf)", None, "Largest true error of the heading at the end.")
    farther = Number(
        "m",
        "(0, inf)",
        None,
        "The robot is never farther from its goal than at the start by more than this.",
    )
    clearance = Number(
        "m",
        f"(0, {CLEARANCE_MAX}]",
        None,
        "The outline is never nearer to a wall or an obstacle. Contact always fails.",
    )


class CaseEntry(Section):
    """One case: what goes wrong, and what is then expected."""

    faults = Param(list[FaultEntry], default=[], help="What goes wrong.")
    expect: Expectation | None = Param(
        Expectation, none=True, default=None, help="In place of `expect` of the file."
    )


class RandomRobots(Section):
    """Robots drawn at random: sizes, encoders, motors and limits of kits and shops.

    Those that `check` refuses for this pipeline are left out. They are not calibrated.
    """

    count = Count("[1, 1000]", REQUIRED, "How many.")
    seed = Count("[0, inf)", 1, "Another seed draws other robots.")


class Trials(Section):
    """Simulated runs of one pipeline: each robot, world, goal, case and seed with each other."""

    format = Param(int, choices=(1,), help="Version of the file format.")
    kind = Param(str, choices=("trials",), help="Kind of file.")
    pipeline = Param(str, help="Name or path of the pipeline.")
    settings = Param(
        list[str], key="set", default=[], help="Changes of the files, as those of --set."
    )
    port: TrialPort = Choice(TrialPort, "sim", "Simulated robot, or one with an emulated board.")
    robots = Param(
        list[str], default=[], help="Names or paths of robots; without any, that of the pipeline."
    )
    random_robots: RandomRobots | None = Param(
        RandomRobots, none=True, default=None, help="Further robots, drawn at random."
    )
    worlds = Param(
        dict[str, WorldEntry], default={}, help="Worlds by name; none: that of the pipeline."
    )
    goals = Param(
        list[GoalEntry],
        default=[],
        help="Each is the goal of a run; none: all goals of the pipeline are driven to in a run.",
    )
    seeds = Count("[1, 100000]", 10, "Runs of each robot, world and goal.")
    first_seed = Count("[0, inf)", 0, "Seed of the first of them.")
    time_limit = Number("s", "(0, 3600]", 120.0, "Simulated time after which a run is ended.")
    processor_time = Number(
        "s",
        "[1, inf)",
        60.0,
        "Time of a processor after which a run is ended: one of its blocks does not return.",
    )
    expect = Param(Expectation, default=Expectation(), help="What is expected of every run.")
    cases = Param(dict[str, CaseEntry], default={}, help="Cases by name; none: one without faults.")
