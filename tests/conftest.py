"""Tests run in the root of the checkout, and do not use the user's folders."""

import atexit
import inspect
import os
import shutil
import signal
import sys
import tempfile
from functools import cache
from pathlib import Path
from types import CodeType

import pytest
from hypothesis import settings

from diffbotctl.emulator.virtual_board import virtual_board
from tests.stalled_computer import StalledComputer
from tests.support import virtual_board as running_board

# What opens an emulated board that keeps pace with real time.
BOARDS = (running_board, running_board.board, virtual_board)

os.chdir(Path(__file__).parent.parent)
# A busy machine makes single examples slow, which says nothing about the program.
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
    """One board at a time, since one needs most of a core; and each module's fixtures once."""
    for item in items:
        fixtures = [each for found in item._fixtureinfo.name2fixturedefs.values() for each in found]
        functions = [item.function, *(each.func for each in fixtures)]
        if item.get_closest_marker("board") or any(map(opens_board, functions)):
            item.add_marker("board")
            item.add_marker(pytest.mark.xdist_group("board"))
        elif any(each.scope == "module" for each in fixtures):
            item.add_marker(pytest.mark.xdist_group(item.module.__name__))


def opens_board(function):
    """Whether a function, or one of its module that it calls, opens a board in real time."""
    reached = [inspect.unwrap(function)]
    for each in reached:
        if any(each is board for board in BOARDS):
            return True
        if inspect.isfunction(each) and each.__module__ == function.__module__:
            named = [each.__globals__.get(name) for name in names_in(each.__code__)]
            reached += [value for value in named if not any(value is old for old in reached)]
    return False


@cache
def names_in(code):
    """Names that a function's code reads, in the functions and classes inside it too."""
    inside = [each for each in code.co_consts if isinstance(each, CodeType)]
    return {*code.co_names, *(name for each in inside for name in names_in(each))}
