"""Does the board behind a port run our firmware?"""

from __future__ import annotations

from typing import TYPE_CHECKING

from diffbotctl.drivers.port import gone, opened
from diffbotctl.errors import RunError
from diffbotctl.flash.visit import Visit
from diffbotctl.runs.real import diffbot_host

if TYPE_CHECKING:
    from diffbotctl.config.robot import Robot


def greets(device: str, robot: Robot) -> bool:
    """Whether the board answers as our firmware does, and takes the robot's settings.

    Raises RunError when its port cannot be opened, or is gone.
    """
    host = diffbot_host(robot, device)
    port = opened(device, host.baud)
    try:
        for _ in Visit(port, host).meet():
            pass
    except RunError:
        return False
    except OSError as error:
        raise gone(device, error) from error
    finally:
        port.close()
    return True
