"""The program's entry point; also `python -m diffbotctl`."""

# `signal` imports `enum`, which takes 10 ms in which an interrupt would print a traceback.
import _signal as signal
import gc
import os


def exit_interrupted(_number: int, _frame: object) -> None:
    """Handler of SIGINT while the program starts and ends: exit with 130, without a traceback."""
    os._exit(130)


if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, exit_interrupted)

# The default of 700 would collect 100 times while modules are imported, which drops nothing.
gc.set_threshold(10_000)

from diffbotctl.cli.main import main as run_program  # noqa: E402 - the handler comes first


def main() -> None:
    """Run the program and exit with its code."""
    try:
        run_program()
    finally:
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
            signal.signal(signal.SIGINT, exit_interrupted)


if __name__ == "__main__":
    main()
