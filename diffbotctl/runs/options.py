"""What a run is asked to do, and what it comes to."""

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from diffbotctl.engine.loop import RunOutcome
from diffbotctl.errors import UserError
from diffbotctl.messages import Goal, Link, Odometry, Stop

if TYPE_CHECKING:
    from diffbotctl.plant.simulated_robot import PlantTruth
    from diffbotctl.programs.driver import ProgramsDriver


class SocketOptions(NamedTuple):
    """The control socket: its name, and the group whose members may use it."""

    name: str | None = None  # None: the pipeline's name
    group: str | None = None  # None: only the user who started the run

    def of_robot(self, robot: str) -> "SocketOptions":
        """Those of one robot of several: its socket is called after it."""
        if not robot or self.name is None:
            return self
        return self._replace(name=f"{self.name}-{robot}")


class RunOptions(NamedTuple):
    """Options of a run, as the command line states them."""

    port: str = "sim"
    goals: tuple[Goal, ...] = ()  # in place of the pipeline file's
    seed: int = 0
    fast: bool = False  # simulate without waiting for real time
    duration: float | None = None  # s; None: until the goals are reached
    record: Path | None = None
    digest: bool = False
    socket: SocketOptions | None = None  # None: no control socket
    stay: bool = False  # go on after the last goal
    dash: bool = False  # the screen also sends commands
    log: Path | None = None
    levels: tuple[tuple[str, str], ...] = ()  # (source, level) of the log
    flights: Path | None = None  # folder for the last minutes before a stop; None: not kept
    rehearses: bool = False  # leave the user's files, such as the saved map, as they are
    # The driver of the pipeline's programs, if they may run; without it the run is refused.
    programs: "type[ProgramsDriver] | None" = None


class RunResult(NamedTuple):
    """The result of a run, for the summary and the exit code."""

    ending: RunOutcome
    failure: UserError | None
    reached: int  # goals, surely
    goals: int
    unsure: int  # goals reached with a pose that is known less well than they ask for
    goal: Goal | None  # the one at which the robot ended
    stops: tuple[Stop, ...]
    odometry: Odometry | None  # the last estimate
    # of a simulated robot, its pose in the frame in which the goals were given
    truth: "PlantTruth | None"
    path: float  # m, driven by odometry
    link: Link | None  # the last state of the link
    digest: str | None
    recording: str | None  # why the recording is incomplete
    log: str | None = None  # why the log file is incomplete
