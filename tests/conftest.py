"""Tests run in the root of the checkout, and do not use the user's folders."""

import atexit
import os
import shutil
import signal
import sys
import tempfile
from pathlib import Path

from hypothesis import settings

from tests.stalled_computer import StalledComputer

# Modules of half a minute or more; folders in real time, or with a compiler or a browser.
LONGEST = (
    "tests/test_docs_commands.py",
    "tests/start/",
    *(f"tests/{name}.py" for name in ("drivers/test_lidar", "test_hostile_files")),
    *(f"tests/{name}.py" for name in ("runs/test_handshake", "blocks/test_odometry")),
    *(f"tests/{name}/" for name in ("package", "cli", "client", "bluetooth", "learn")),
    *(f"tests/{name}.py" for name in ("test_first_block", "recording/test_own_messages")),
    *(f"tests/{name}/" for name in ("control_socket", "runs", "web", "firmware", "foxglove")),
    *(f"tests/{name}/" for name in ("flash", "ui", "calibrate", "ros2", "ports")),
)

os.chdir(Path(__file__).parent.parent)
# A busy machine makes single examples slow, which shows nothing about the program.
settings.register_profile("no_deadline", deadline=None)
settings.load_profile("no_deadline")
# A background shell starts its jobs with SIGINT ignored, nohup with SIGHUP ignored. Programs that
# the tests start would inherit that and not end on these signals.
signal.signal(signal.SIGHUP, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)

# Commands that tests start read the bytecode of the package; compiling it takes 0.3 s.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

_state = tempfile.mkdtemp(prefix="diffbotctl-state-")
os.environ["XDG_STATE_HOME"] = _state  # folder of the black box
atexit.register(shutil.rmtree, _state, ignore_errors=True)
# The sockets of running engines: a command that names none would reach that of another test.
_runtime = tempfile.mkdtemp(prefix="run-")
os.environ["XDG_RUNTIME_DIR"] = _runtime
atexit.register(shutil.rmtree, _runtime, ignore_errors=True)


def pytest_configure(config):
    config.pluginmanager.register(StalledComputer())


def pytest_collection_modifyitems(items):
    """What takes longest begins first: no worker is left alone with it at the end."""

    def place(item):
        begins = (at for at, name in enumerate(LONGEST) if item.nodeid.startswith(name))
        return next(begins, len(LONGEST))

    items.sort(key=place)
