"""Progress of a job at a board: a bar on a terminal, plain lines without one."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

from diffbotctl.board.progress import Event, FlashMessage


def show_progress(events: Iterable[Event]) -> None:
    """Draw the events of a job as they come. Raises what the job raises."""
    console = Console(highlight=False)
    columns = (TextColumn("{task.description:<8}"), BarColumn(), TaskProgressColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as bars:
        tasks = {}
        for event in events:
            if isinstance(event, JobMessage):
                bars.console.print(event.text, markup=False)
                continue
            if event.what not in tasks:
                tasks[event.what] = bars.add_task(event.what, total=event.total)
            bars.update(tasks[event.what], completed=event.done)
