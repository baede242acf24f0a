"""Packages that only some commands need."""

from __future__ import annotations


def require_packages(code: str, subject: str, extra: str, *packages: str) -> None:
    """Raises RunError with `code` if a package of the optional `extra` is not installed."""
    from importlib import import_module

    from diffbotctl.errors import Problem, RunError

    try:
        for package in packages:
            import_module(package)
    except ImportError as error:
        cause = f"the package {error.name} is not installed"
        fix = f"pip install 'diffbotctl[{extra}]'"
        raise RunError(Problem(code, subject, cause, fix)) from error
