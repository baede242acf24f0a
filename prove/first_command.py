"""diffbotctl, except that it ends at the first command that turns a wheel and prints its time."""

from __future__ import annotations

import os
import sys
import time
from typing import Any


def main() -> None:
    """`python -m prove.first_command START WORDS...`: START is the monotonic time of the start."""
    start = float(sys.argv.pop(1))
    from diffbotctl.__main__ import main as run_program
    from diffbotctl.drivers.simulated_robot import SimulatedRobotDriver

    def end_when_moving(self: SimulatedRobotDriver, now: int, command: Any) -> None:
        if command.left or command.right:
            os.write(1, f"FIRST {time.monotonic() - start:.4f}\n".encode())
            os._exit(0)

    SimulatedRobotDriver.command = end_when_moving  # type: ignore[method-assign]
    run_program()


if __name__ == "__main__":
    main()
