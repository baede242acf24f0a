"""`diffbotctl replay`: run a recording again."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--check", is_flag=True, help="Compare every message with the recorded one.")
def command(file: Path, check: bool) -> int:
    """Replay the recording FILE: the drivers' messages come from it, the blocks react anew.

    Exit code: 0 the same, 1 different or unreadable.
    """
    from diffbotctl import __version__
    from diffbotctl.runs.again import replay

    done = replay(file, check)
    if done.version != __version__:
        click.echo(f"recorded with version {done.version}, replayed with {__version__}")
    click.echo(f"replayed {done.ending.time / 1e9:.2f} s")
    click.echo(f"digest {done.digest}")
    if not check:
        return 0
    if done.difference is None:
        click.echo(f"same: {done.compared} messages compared, bit for bit")
        return 0
    first = done.difference
    click.echo(f"DIFFERENT at {first.time / 1e9:.6f} s on {first.wire}")
    click.echo(f"  recorded {first.recorded}")
    click.echo(f"  replayed {first.replayed}")
    return 1
