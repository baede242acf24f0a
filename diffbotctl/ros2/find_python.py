"""Finds the Python that has rclpy, checks what it has, and replaces this process by the bridge."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import diffbotctl
from diffbotctl.errors import Problem, RunError

PYTHON_VARIABLE = "DIFFBOTCTL_ROS2_PYTHON"
OPTIONAL_MODULES = {"tf2_msgs": "/tf and /tf_static"}
MODULES = (
    "rclpy",
    "geometry_msgs",
    "nav_msgs",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
    "diagnostic_msgs",
    "rcl_interfaces",
    "rosgraph_msgs",
)
ROS_FOLDER = Path("/opt/ros")
PROBE_TIMEOUT_S = 60.0
PYTHON_MIN = (3, 11)
PROBE = """
import importlib, json, os, sys
missing = {}
for name in sys.argv[1:]:
    try:
        importlib.import_module(name + ('.msg' if name.endswith('_msgs') else ''))
    except Exception as error:
        missing[name] = str(error)
print()
print(json.dumps({"missing": missing, "version": sys.version_info[:3],
    "distribution": os.environ.get("ROS_DISTRO", ""),
    "middleware": os.environ.get("RMW_IMPLEMENTATION", "")}))
"""
# The package is made importable alone: the packages beside it may be built for another Python, and
# must not be found.
START = """
import sys, types
package = types.ModuleType("diffbotctl")
package.__path__ = [sys.argv[1]]
sys.modules["diffbotctl"] = package
from diffbotctl.ros2.bridge import main
sys.exit(main(sys.argv[2]))
"""


class RosPython(NamedTuple):
    """A Python, and what it has for ROS. `missing` maps modules to the error of their import."""

    path: str
    version: tuple[int, ...]
    distribution: str
    middleware: str
    missing: dict[str, str]

    @property
    def is_usable(self) -> bool:
        """Whether the bridge can run, perhaps without what is optional."""
        return not (set(self.missing) & set(MODULES)) and self.version >= PYTHON_MIN


def find_python(path: str | None) -> RosPython:
    """The Python for the bridge: `path`, the one of the environment variable, or python3.

    Raises RunError when there is none that can be asked.
    """
    name = path or os.environ.get(PYTHON_VARIABLE) or "python3"
    found = shutil.which(name, path=_system_path())
    if found is None:
        cause = f"there is no program '{name}'"
        raise RunError(Problem("E-ROS2", "--python", cause, "name the Python that has rclpy"))
    command = [found, "-c", PROBE, *MODULES, *OPTIONAL_MODULES]
    try:
        done = subprocess.run(
            command,
            env=ros_environment(()),
            capture_output=True,
            text=True,
            timeout=PROBE_TIMEOUT_S,
        )
        record = json.loads(done.stdout.splitlines()[-1])
    except (OSError, ValueError, IndexError, subprocess.TimeoutExpired) as error:
        cause = f"it could not be asked what it has: {error}"
        raise RunError(Problem("E-ROS2", found, cause, "name another Python: --python")) from None
    return RosPython(
        found,
        tuple(record["version"]),
        record["distribution"],
        record["middleware"],
        record["missing"],
    )


def missing_problem(python: RosPython) -> Problem:
    lacking = [name for name in MODULES if name in python.missing]
    if "rclpy" not in lacking and python.version < PYTHON_MIN:
        cause = f"it is Python {version_text(python)}; the bridge needs 3.11 or newer"
        return Problem("E-ROS2", python.path, cause, "use ROS 2 Jazzy or newer")
    if "rclpy" not in lacking:
        packages = " ".join(
            f"ros-{python.distribution or 'jazzy'}-{name.replace('_', '-')}" for name in lacking
        )
        cause = f"it has rclpy, but not {', '.join(lacking)}"
        return Problem("E-ROS2", python.path, cause, f"sudo apt-get install {packages}")
    cause = "this Python has no rclpy"
    installed = sorted(ROS_FOLDER.glob("*/setup.sh"))
    if installed:
        return Problem("E-ROS2", python.path, cause, f"first: . {installed[-1]}")
    fix = "install ROS 2 (docs/ros2.md has three ways), or name its Python: --python PATH"
    return Problem("E-ROS2", python.path, cause, fix)


def version_text(python: RosPython) -> str:
    """The version as a text such as 3.12.3."""
    return ".".join(map(str, python.version))


def ros_environment(peers: Sequence[str]) -> dict[str, str]:
    """The environment of the bridge: discovery on this computer, and of the named peers."""
    environment = dict(os.environ)
    environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    environment["ROS_STATIC_PEERS"] = ";".join(peers)
    environment["PATH"] = _system_path()
    return environment


def start_bridge(python: RosPython, options: str, peers: Sequence[str]) -> None:
    """Replace this process by the bridge. Returns only by an exception."""
    package = str(Path(diffbotctl.__file__).parent)
    sys.stdout.flush()
    os.execve(
        python.path,
        [python.path, "-c", START, package, options],
        ros_environment(peers),
    )


def _system_path() -> str:
    """PATH without the virtual environment in which this program runs: it has no rclpy."""
    own = str(Path(sys.prefix) / "bin")
    folders = os.environ.get("PATH", os.defpath).split(os.pathsep)
    kept = [folder for folder in folders if sys.prefix == sys.base_prefix or folder != own]
    return os.pathsep.join(kept)
