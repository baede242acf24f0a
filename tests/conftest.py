"""Tests run from the root of the checkout, as a person would, and leave a person's files alone."""

import atexit
import os
import shutil
import tempfile
from pathlib import Path

os.chdir(Path(__file__).parent.parent)

_state = tempfile.mkdtemp(prefix="diffbotctl-state-")
os.environ["XDG_STATE_HOME"] = _state  # where runs keep their last minutes
atexit.register(shutil.rmtree, _state, ignore_errors=True)
