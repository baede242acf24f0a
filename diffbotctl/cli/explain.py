"""`diffbotctl explain`: an error code at length."""

from __future__ import annotations

import click


@click.command()
@click.argument("code", required=False)
def command(code: str | None) -> int:
    """Explain CODE, such as E-PIN-PWM; without one, list all codes."""
    from diffbotctl.codes import CODES
    from diffbotctl.errors import Problem, UsageError, nearest

    if code is None:
        for name, entry in CODES.items():
            click.echo(f"{name:18} {entry.title}")
        return 0
    found = CODES.get(code.upper())
    if found is None:
        near = nearest(code.upper(), CODES)
        fix = f"did you mean {near}?" if near else "`diffbotctl explain` lists them all"
        raise UsageError(Problem("E-CODE", "explain", f"there is no code '{code}'", fix))
    click.echo(f"{code.upper()}: {found.title}\n")
    click.echo(found.text)
    return 0
