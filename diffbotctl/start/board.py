"""Speaking to the board along the path: does it run our firmware, do its wheels turn rightly."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from diffbotctl.config.load import load_robot
from diffbotctl.drivers.port import gone, opened
from diffbotctl.errors import Problem, RunError
from diffbotctl.flash.visit import Visit
from diffbotctl.runs.real import diffbot_host
from diffbotctl.start.own_file import put
from diffbotctl.start.wheels import judge, turn

if TYPE_CHECKING:
    from diffbotctl.config.robot import Robot

FIRST_FRAMES = 0.3  # s in which a board that was just met tells its counts


@contextmanager
def visiting(device: str, robot: Robot) -> Iterator[Visit]:
    """An open port to the board. Raises RunError: what opening has to say, or that it is gone."""
    host = diffbot_host(robot, device)
    port = opened(device, host.baud)
    try:
        yield Visit(port, host)
    except OSError as error:
        raise gone(device, error) from error
    finally:
        port.close()


def greets(device: str, robot: Robot) -> bool:
    """Whether the board answers as our firmware does, and takes the robot's settings.

    Raises RunError when its port cannot be opened.
    """
    with visiting(device, robot) as visit:
        try:
            for _ in visit.meet():
                pass
        except RunError:
            return False
    return True


def check_wheel(device: str, robot: Robot, side: str, ask: Callable[[str], str]) -> str:
    """Turn one wheel and have a person look: `fine` or `reversed`. Raises RunError: what is wrong.

    `ask` is given the name of the question and returns the answer.
    """
    with visiting(device, robot) as visit:
        for _ in visit.meet():
            pass
        for _ in visit.stay(FIRST_FRAMES):
            pass
        turned = turn(visit, robot, side)
    verdict = judge(robot, side, turned, ask(f"{side}_wheel"))
    if verdict.kind == "fault":
        raise RunError(Problem("E-START-WIRING", f"{side} wheel", verdict.cause, verdict.fix))
    return verdict.kind


def reverse(path: Path, side: str, again: bool) -> None:
    """Turn round `reversed` of one motor in the robot file. Raises RunError where that was no help.

    `again`: it was turned round before.
    """
    if again:
        cause = "it still turns backward, though its direction was turned round"
        fix = "do IN1 and IN2 (IN3 and IN4) both reach the board? `diffbotctl wiring` shows them"
        raise RunError(Problem("E-START-WIRING", f"{side} wheel", cause, fix))
    now = getattr(load_robot(str(path.absolute())).robot.drive, side).motor.reversed
    put(path, ("drive", side, "motor", "reversed"), "false" if now else "true")


def say_polarity(path: Path) -> None:
    """Write into the robot file that both wheels were seen to turn the right way."""
    put(path, ("drive", "polarity"), "by_hand")
