"""The Python interpreters of this machine that the package supports."""

import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

OWN = f"{sys.version_info.major}.{sys.version_info.minor}"
VERSIONS = ("3.11", "3.12", "3.13", "3.14")
PYENV = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
# A working one can make a virtual environment; a shim of pyenv may lead nowhere.
CHECK = "import ensurepip, sys, venv; print(*sys.version_info[:2])"


@cache
def interpreters():
    """Version, such as 3.12, and path of one interpreter for each version that is installed here.

    For the version of this interpreter, this one.
    """
    present = {}
    for version in VERSIONS:
        if version == OWN:
            present[version] = sys.executable
            continue
        name = f"python{version}"
        candidates = [shutil.which(name), *sorted(PYENV.glob(f"{version}.*/bin/{name}"))]
        works = next((str(each) for each in candidates if each and _is(each, version)), None)
        if works is not None:
            present[version] = works
    return present


def _is(program, version):
    done = subprocess.run([program, "-c", CHECK], capture_output=True, text=True)
    return done.stdout.split() == version.split(".")
