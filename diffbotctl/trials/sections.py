"""The sections of a file of trials: which runs, with which faults, and what is expected of them."""

from __future__ import annotations

from typing import Literal, get_args

from diffbotctl.config.configuration import GoalEntry, WorldEntry
from diffbotctl.config.faults import FaultEntry
from diffbotctl.messages import GoalEnd, StopCode
from diffbotctl.params import Choice, Param, Section

TrialPort = Literal["sim", "emulated"]
Unsure = Literal["never", "allowed", "required"]
ENDS = ("blocked", "stuck", "given_up")  # of a goal, for which the robot stops
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
    within = Param(
        float, unit="s", above=0.0, default=2.0, help="Time from the first fault to the stop."
    )


class Expectation(Section):
    """What is expected of a run; what is not stated is not judged."""

    reach: float | None = Param(
        float,
        unit="s",
        above=0.0,
        none=True,
        default=None,
        help="All goals are reached within this time.",
    )
    unsure: Unsure = Choice(
        Unsure,
        default="never",
        help="Whether a goal may, or has to, be reached with a warning that the pose is uncertain.",
    )
    stop: StopExpectation | None = Param(
        StopExpectation, none=True, default=None, help="The robot stops, and states why."
    )
    time: float | None = Param(
        float, unit="s", above=0.0, none=True, default=None, help="The run ends within this time."
    )
    error: float | None = Param(
        float,
        unit="m",
        above=0.0,
        none=True,
        default=None,
        help="Largest true distance from the last goal at the end.",
    )
    heading_error: float | None = Param(
        float,
        unit="rad",
        above=0.0,
        none=True,
        default=None,
        help="Largest true error of the heading at the end.",
    )
    farther: float | None = Param(
        float,
        unit="m",
        above=0.0,
        none=True,
        default=None,
        help="The robot is never farther from its goal than at the start by more than this.",
    )
    clearance: float | None = Param(
        float,
        unit="m",
        above=0.0,
        none=True,
        default=None,
        help="The outline is never nearer to a wall or an obstacle. Contact always fails.",
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

    count = Param(int, minimum=1, maximum=1000, help="How many.")
    seed = Param(int, default=1, minimum=0, help="Another seed draws other robots.")


class Trials(Section):
    """Simulated runs of one pipeline: each robot, world, goal, case and seed with each other."""

    format = Param(int, choices=(1,), help="Version of the file format.")
    kind = Param(str, choices=("trials",), help="Kind of file.")
    pipeline = Param(str, help="Name or path of the pipeline.")
    settings = Param(
        list[str], key="set", default=[], help="Changes of the files, as those of --set."
    )
    port: TrialPort = Choice(
        TrialPort, default="sim", help="Simulated robot, or one with an emulated board."
    )
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
    seeds = Param(
        int, default=10, minimum=1, maximum=100_000, help="Runs of each robot, world and goal."
    )
    first_seed = Param(int, default=0, minimum=0, help="Seed of the first of them.")
    time_limit = Param(
        float,
        unit="s",
        default=120.0,
        above=0.0,
        maximum=3600.0,
        help="Simulated time after which a run is ended.",
    )
    processor_time = Param(
        float,
        unit="s",
        default=60.0,
        minimum=1.0,
        help="Time of a processor after which a run is ended: one of its blocks does not return.",
    )
    expect = Param(Expectation, default=Expectation(), help="What is expected of every run.")
    cases = Param(dict[str, CaseEntry], default={}, help="Cases by name; none: one without faults.")
