"""What a block is: a state machine with declared parameters, input ports and output ports.

A block does no I/O, never asks the time and draws no chance. `reset` makes its state; `react` is
called once at each instant that reaches it, with the logical time and the inputs in the order in
which the class declares them, and returns its outputs.

    class DiffDrive(Block):
        '''Turn a body velocity into wheel speeds.'''
        track = FromRobot("drive.track")
        twist = In(Twist)
        wheels = Out(Wheels)
        def react(self, now: int, twist: Twist | None) -> Wheels | None: ...

With one output `react` returns the message or None; with several, a tuple in declared order.
An input that never came, or is older than its `fresh_for`, is None.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, TypeVar, overload

from diffbotctl.log import QUIET, Log
from diffbotctl.params import Declaration, FromRobot, RobotField, declared, members

Method = TypeVar("Method", bound=Callable[..., Any])


class Port:
    """A place where a wire ends."""

    name: str

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name


class In(Port):
    """An input for messages of class `kind`.

    `trigger`: a new message makes the block react (otherwise it is only looked at).
    `fresh_for`: seconds, or the name of a parameter that holds them; older is absent, and the
    engine wakes the block at the moment it becomes so.
    `optional`: may stay unconnected, then it is always None.
    """

    def __init__(
        self,
        kind: type,
        *,
        trigger: bool = True,
        fresh_for: float | str | None = None,
        optional: bool = False,
        help: str = "",
    ) -> None:
        self.kind = kind
        self.trigger = trigger
        self.fresh_for = fresh_for
        self.optional = optional
        self.help = help


class Every(Port):
    """A timer: the block reacts each `period` seconds (or the parameter of that name).

    Its argument in `react` is the nominal time in ns when the timer fired in this instant, else
    None. The first firing is one period after the start.
    """

    def __init__(self, period: float | str) -> None:
        self.period = period


class Out(Port):
    """An output of messages of class `kind`.

    `name` is the port's name where an input of the block already has the one that fits.
    """

    def __init__(self, kind: type, *, name: str = "", help: str = "") -> None:
        self.kind = kind
        self.help = help
        self.explicit_name = name

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = self.explicit_name or name


@overload
def action(method: Method, /) -> Method: ...


@overload
def action(**units: str) -> Callable[[Method], Method]: ...


def action(method: Method | None = None, /, **units: str) -> Any:
    """Mark a method `name(self, now, **arguments)` that an operator may call on a running block.

    `units`: the SI unit of each argument, as in `@action(x="m", heading="rad")`. An argument
    without a declared unit takes a number in any unit.
    """

    def mark(marked: Method) -> Method:
        marked.is_action = True  # type: ignore[attr-defined]
        marked.units = units  # type: ignore[attr-defined]
        return marked

    return mark if method is None else mark(method)


class Block:
    """Common ground of all blocks: takes its parameters, knows its ports, says what happens.

    `log` takes a line an event: `self.log.warning("...")`; see `diffbotctl.log`.
    Raises TypeError at class creation when `react` does not name the inputs in declared order,
    or when something of the block's own is called `log`.
    """

    log: Log = QUIET

    def __init_subclass__(cls) -> None:
        if "log" in vars(cls):
            raise TypeError(f"{cls.__name__}.log: `log` is where a block says what happens")
        wanted = ["self", "now", *inputs(cls)]
        given = list(inspect.signature(cls.react).parameters)
        if given != wanted:
            raise TypeError(
                f"{cls.__name__}.react must take ({', '.join(wanted)}), "
                f"the inputs in the order of their declaration; it takes ({', '.join(given)})"
            )

    def __init__(self, **values: Any) -> None:
        for name, declaration in declared(type(self)).items():
            setattr(self, name, values.pop(name, declaration.default))
        for name in robot_fields(type(self)):
            setattr(self, name, values.pop(name))
        if values:
            raise TypeError(f"{type(self).__name__} has no parameter {', '.join(values)}")
        self.reset()

    def reset(self) -> None:
        """Make the state as it is before the first message."""

    def changed(self, name: str) -> None:
        """Called after the live parameter `name` was changed."""

    react: Callable[..., Any]


def _nothing(self: Block, now: int) -> None:
    """React to nothing."""


Block.react = _nothing


def inputs(block: type[Block]) -> dict[str, In | Every]:
    """Input ports and timers of a block class, in declared order."""
    return members(block, In, Every)


def outputs(block: type[Block]) -> dict[str, Out]:
    """Output ports of a block class, in declared order."""
    return {out.name: out for out in members(block, Out).values()}


def robot_fields(block: type[Block]) -> dict[str, str]:
    """Attributes that come from the robot file: attribute name to the field's dotted path."""
    return {name: value.field for name, value in members(block, RobotField).items()}


def actions(block: type) -> dict[str, Callable[..., Any]]:
    """Actions of a block class, or of a driver's, by name."""
    return {
        name: getattr(block, name)
        for name in dir(block)
        if getattr(getattr(block, name), "is_action", False)
    }


__all__ = [
    "Block",
    "Declaration",
    "Every",
    "FromRobot",
    "In",
    "Out",
    "action",
    "actions",
    "inputs",
    "outputs",
]
