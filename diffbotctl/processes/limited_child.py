"""For a forked child that runs code of the user: its limits, and its result for the parent."""

from __future__ import annotations

import os
import pickle
import resource
import sys
from contextlib import suppress


def limit_child(processor: float, memory: int, file: int | None = None) -> None:
    """Limit what this child may use, and let it print nothing: the terminal is the parent's.

    `processor`: time of a processor (s); `memory` and `file`: bytes in all, and of each file.
    """
    seconds = max(round(processor), 1)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    if file is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (file, file))
    with suppress(ValueError, OSError):  # a lower limit is in force
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    null = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):
        os.dup2(null, number)
    sys.stdout = sys.stderr = os.fdopen(null, "w")


def send_result(file: int, result: object) -> None:
    """Write the pickle of `result` to the pipe `file`, whose other end the parent reads."""
    data = pickle.dumps(result)
    while data:
        data = data[os.write(file, data) :]
