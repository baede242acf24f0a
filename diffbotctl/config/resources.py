"""The one place that finds the folders shipped beside the code."""

from __future__ import annotations

from pathlib import Path

FOLDERS = ("robots", "pipelines", "schemas", "firmware")


def folder(name: str) -> Path:
    """The shipped folder `name`: inside the package when installed, beside it in a checkout.

    Raises FileNotFoundError when the installation is damaged.
    """
    package = Path(__file__).resolve().parent.parent
    for candidate in (package / name, package.parent / name):
        if candidate.is_dir():
            return candidate
    raise FileNotFoundError(f"the folder {name} is missing from this installation of diffbotctl")


def names(kind: str) -> list[str]:
    """The names of the shipped YAML files in folder `kind`, without their ending."""
    return sorted(path.stem for path in folder(kind).glob("*.yaml"))
