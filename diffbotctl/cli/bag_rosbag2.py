"""`diffbotctl bag export --format rosbag2`: a recording as a folder that ROS 2 plays."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from diffbotctl.errors import Problem, UsageError

if TYPE_CHECKING:
    from diffbotctl.ros2.bag_export import ExportResult


def export_rosbag2(
    file: Path, fields: tuple[str, ...], output: Path | None, robot: str | None, force: bool
) -> int:
    """Write the recording `file` as the folder `output`, and print what it holds."""
    if fields:
        raise click.UsageError("a rosbag2 has all topics: leave out FIELD")
    if output is None:
        raise click.UsageError("a rosbag2 is a folder: name it with --output")
    try:
        from diffbotctl.ros2.bag_export import export_bag
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "rosbags":
            raise
        cause = "the package rosbags is not installed"
        fix = "pip install 'diffbotctl[ros2]'"
        raise UsageError(Problem("E-ROSBAG2", "--format", cause, fix)) from error
    _print_result(output, export_bag(file, output, robot, force))
    return 0


def _print_result(output: Path, result: ExportResult) -> None:
    width = max(map(len, result.counts), default=0)
    for topic, count in result.counts.items():
        click.echo(f"{topic:<{width}}  {count}")
    if result.omitted:
        click.echo(f"without a ROS topic: {', '.join(result.omitted)}", err=True)
    if result.complaint:
        click.echo(f"no frames, joints or velocity: {result.complaint}", err=True)
    click.echo(f"written: {output}")
