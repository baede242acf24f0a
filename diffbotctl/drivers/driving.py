"""Who is driving by hand, and until when that holds without another word."""

from __future__ import annotations

from diffbotctl.engine.channel import Command
from diffbotctl.graph import NEVER

SILENCE = 300_000_000  # ns; with one telemetry period and the way down it stays below 500 ms


class Driving:
    """At most one client drives. `deadline` is NEVER while nobody does.

    `silent` and `gone` are the causes to give when that client is lost; they are written when it
    begins, so that nothing need be written when it counts.
    """

    def __init__(self) -> None:
        self.client: int | None = None
        self.deadline = NEVER
        self.silent = self.gone = ""

    @property
    def is_on(self) -> bool:
        """True while someone drives."""
        return self.client is not None

    def is_by(self, client: int) -> bool:
        """True when it is `client` who drives."""
        return self.client == client

    def go_on(self, now: int, command: Command) -> None:
        """The client of `command` drives, and has just said so."""
        self.deadline = now + SILENCE
        if self.client != command.client:
            self.client = command.client
            self.silent = f"{command.who} was driving and fell silent"
            self.gone = f"{command.who} was driving and is gone"

    def let_go(self) -> None:
        """Nobody drives any more."""
        self.client, self.deadline = None, NEVER
