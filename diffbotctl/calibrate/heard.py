"""What arrived from a robot under calibration, and the keys that stop it."""

from __future__ import annotations

from typing import NamedTuple, Protocol, TypeVar

from diffbotctl.engine.driver import Delivery
from diffbotctl.messages import Encoders, Message

Kind = TypeVar("Kind", bound=Message)


class Keys(Protocol):
    """Ends a movement when a person wants it: `file` is readable, `cause` says why."""

    file: int

    @property
    def cause(self) -> str | None: ...


class Heard(NamedTuple):
    """What arrived while something was done."""

    deliveries: list[Delivery]

    def of(self, kind: type[Kind], wire: str = "") -> list[Kind]:
        """The messages of one class, in order; of one wire, when it is named."""
        return [
            each.message
            for each in self.deliveries
            if isinstance(each.message, kind) and wire in ("", each.wire)
        ]

    @property
    def encoders(self) -> list[Encoders]:
        """All frames."""
        return self.of(Encoders)
