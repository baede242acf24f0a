"""`diffbotctl calibrate discs`, `range`, `battery`: single parts of the robot."""

from __future__ import annotations

from typing import Any

import click

from diffbotctl.cli.calibrate_steps import Wanted, common, run


@click.command("discs")
@common
def discs(**options: Any) -> None:
    """Find out where the slots of both encoders' discs lie.

    Wheels off the ground. They turn forward and backward for some seconds; odometry finds the
    discs again by their pattern after each power-on.
    """
    run(["discs"], Wanted(**options))


@click.command("range")
@common
@click.option("--sensor", default="", help="Which distance sensor; the only one when left out.")
@click.option("--seconds", default=5.0, show_default=True, type=click.FloatRange(1, 60),
              help="How long the voltage is averaged at each distance.")  # fmt: skip
def range_(sensor: str, seconds: float, **options: Any) -> None:
    """Find the curve of a distance sensor, with a rule and a white card.

    Six distances from 4 to 30 cm. Nothing moves.
    """
    run(["range"], Wanted(**options), sensor=sensor, seconds=seconds)


@click.command("battery")
@common
def battery(**options: Any) -> None:
    """Find the ratio of the battery's divider with a meter, and the limit below which it is low.

    Nothing moves.
    """
    run(["battery"], Wanted(**options))
