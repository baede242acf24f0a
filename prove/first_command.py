"""The command line, except that it ends at the first wheel command and prints when that was."""

from __future__ import annotations

import os
import sys
import time
from typing import Any


def main() -> None:
    """`python -m prove.first_command START WORDS...`: START is the monotonic time of the start."""
    began = float(sys.argv.pop(1))
    from diffbotctl.cli import main as cli
    from diffbotctl.drivers.simulated_robot import SimulatedRobotDriver

    def leave(self: SimulatedRobotDriver, now: int, wanted: Any) -> None:
        if wanted.left or wanted.right:
            os.write(1, f"FIRST {time.monotonic() - began:.4f}\n".encode())
            os._exit(0)

    SimulatedRobotDriver.command = leave  # type: ignore[method-assign]
    cli.main()


if __name__ == "__main__":
    main()
