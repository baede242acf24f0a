"""What the commands that serve programs over TCP have in common."""

from __future__ import annotations

from collections.abc import Callable

import click

from diffbotctl.cli.options import Command

TCP_PORT_MAX = 65535


def tcp_port_option(default: int, help: str) -> Callable[[Command], Command]:
    """`--tcp-port NUMBER`."""
    return click.option(
        "--tcp-port",
        metavar="NUMBER",
        type=click.IntRange(1, TCP_PORT_MAX),
        default=default,
        show_default=True,
        help=help,
    )


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
