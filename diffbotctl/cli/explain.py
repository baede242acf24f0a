"""`diffbotctl explain`: an error code at length."""

from __future__ import annotations

import click


@click.command()
@click.argument("code", required=False)
def command(code: str | None) -> int:
    """Explain CODE, such as E-PIN-PWM; without one, list all codes."""
    from diffbotctl.codes import CODES
    from diffbotctl.errors import Problem, UsageError, closest_match
    from diffbotctl.ui.text import render_columns

    if code is None:
        for line in render_columns([(each, entry.title) for each, entry in CODES.items()]):
            click.echo(line)
        return 0
    by_name = {name.upper(): name for name in CODES}
    name = by_name.get(code.upper(), "")
    found = CODES.get(name)
    if found is None:
        near = by_name.get(closest_match(code.upper(), by_name) or "")
        fix = f"did you mean {near}?" if near else "`diffbotctl explain` lists them all"
        raise UsageError(Problem("E-CODE", "explain", f"there is no code '{code}'", fix))
    click.echo(f"{name}: {found.title}\n")
    click.echo(click.wrap_text(found.text, 78, preserve_paragraphs=True))
    return 0
