"""The Python interpreters of this machine that the package supports."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

OLDEST, NEWEST = (3, 11), (3, 14)
PYENV = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
# A working one can make a virtual environment; a shim of pyenv may lead nowhere.
CHECK = "import ensurepip, sys, venv; print(*sys.version_info[:2])"


def interpreters():
    """Version, such as 3.12, and path of one interpreter for each version that is installed here.

    For the version of this interpreter, this one.
    """
    present = {}
    for minor in range(OLDEST[1], NEWEST[1] + 1):
        if sys.version_info[:2] == (3, minor):
            present[f"3.{minor}"] = sys.executable
            continue
        name = f"python3.{minor}"
        candidates = [shutil.which(name), *sorted(PYENV.glob(f"3.{minor}.*/bin/{name}"))]
        works = next((str(each) for each in candidates if each and _is(each, minor)), None)
        if works is not None:
            present[f"3.{minor}"] = works
    return present


def _is(program, minor):
    done = subprocess.run([program, "-c", CHECK], capture_output=True, text=True)
    return re.fullmatch(rf"3 {minor}\n", done.stdout) is not None
