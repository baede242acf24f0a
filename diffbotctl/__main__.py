"""The program's entry point; also `python -m diffbotctl`."""

import os
import signal


def _exit_interrupted(_number: int, _frame: object) -> None:
    os._exit(130)


# Importing the command line takes 50 ms or more, in which an interrupt must not end in a traceback.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _exit_interrupted)

from diffbotctl.cli.main import main  # noqa: E402 - the handler comes first

if __name__ == "__main__":
    main()
