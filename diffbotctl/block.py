"""The base class of blocks: a state machine with declared parameters, inputs and outputs.

A block does no I/O, reads no clock and uses no random numbers. `reset` creates its state; `react`
is called once in each instant that reaches the block, with the logical time and the inputs in the
order of their declaration, and returns the outputs.

    class DiffDrive(Block):
        '''Turn a body velocity into wheel speeds.'''
        track = FromRobot("drive.track")
        twist = In(Twist)
        wheels = Out(Wheels)
        def react(self, now: int, twist: Twist | None) -> Wheels | None: ...

With one output `react` returns the message or None; with several, a tuple in declared order.
An input is None before its first message, and when its last one is older than `fresh_for`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar, overload

from diffbotctl.log import QUIET, Log
from diffbotctl.params import Declaration, FromRobot, RobotField, declared, members

Method = TypeVar("Method", bound=Callable[..., Any])


class DeclarationError(TypeError):
    """A class of blocks is declared wrongly; `fix` is the remedy."""

    def __init__(self, cause: str, fix: str) -> None:
        super().__init__(cause)
        self.fix = fix


class Port:
    """An end of a wire."""

    name: str

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name


class In(Port):
    """An input for messages of class `kind`.

    `trigger`: a new message makes the block react; otherwise the input is only sampled.
    `fresh_for`: maximum age in seconds, or the name of a parameter that holds it. An older message
    is None in `react`, and the block reacts at the time at which it becomes too old.
    `optional`: may stay unconnected; it is then always None.
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

    Its argument in `react` is the nominal time in ns if the timer fired in this instant, else
    None. It fires for the first time one period after the start.
    """

    def __init__(self, period: float | str) -> None:
        self.period = period


class Out(Port):
    """An output of messages of class `kind`.

    `name` is the port's name if it differs from the attribute's, because an input has that name.
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
    """Mark a method `name(self, now, **arguments)` that may be called on a running block.

    `units`: the SI unit of each argument, as in `@action(x="m", heading="rad")`. An argument
    without a declared unit takes a number in any unit, one annotated `str` takes a text. The caller
    gets what the method returns: None, a number, text, truth value or message, or a tuple of them.
    """

    def mark(marked: Method) -> Method:
        marked.is_action = True  # type: ignore[attr-defined]
        marked.units = units  # type: ignore[attr-defined]
        return marked

    return mark if method is None else mark(method)


class Block:
    """Base class of all blocks: sets the parameters and checks the ports.

    `log` takes one line for each event: `self.log.warning("...")`; see `diffbotctl.log`.
    `connected` are the inputs that have a wire in this pipeline.
    Raises DeclarationError at class creation if the arguments of `react` are not the inputs in
    declared order, or if the class has an `__init__` or an attribute called `log` of its own.
    """

    log: Log = QUIET
    connected: frozenset[str] = frozenset()

    def __init_subclass__(cls) -> None:
        if "log" in vars(cls):
            cause = f"{cls.__name__}.log: the name `log` is reserved for the block's log"
            raise DeclarationError(cause, "choose another name")
        if isinstance(vars(cls).get("__init__"), FunctionType):
            cause = f"{cls.__name__} has an `__init__`, which would replace that of Block"
            fix = "create the state in `def reset(self):`, where the parameters are set already"
            raise DeclarationError(cause, fix)
        expected = ["self", "now", *inputs(cls)]
        actual = list(inspect.signature(cls.react).parameters)
        if actual != expected:
            cause = (
                f"{cls.__name__}.react must take ({', '.join(expected)}), "
                f"the inputs in the order of their declaration; it takes ({', '.join(actual)})"
            )
            raise DeclarationError(cause, f"write def react({', '.join(expected)}):")

    def __init__(self, **values: Any) -> None:
        for name, declaration in declared(type(self)).items():
            setattr(self, name, values.pop(name, declaration.default))
        for name in robot_fields(type(self)):
            setattr(self, name, values.pop(name))
        if values:
            raise TypeError(f"{type(self).__name__} has no parameter {', '.join(values)}")
        self.reset()

    def reset(self) -> None:
        """Create the state before the first message."""

    def changed(self, name: str) -> None:
        """Called after the live parameter `name` has changed."""

    react: Callable[..., Any]


def _nothing(self: Block, now: int) -> None:
    """Do nothing: a block without inputs."""


Block.react = _nothing


def inputs(block: type) -> dict[str, In | Every]:
    """Input ports and timers of a block class, in declared order."""
    return members(block, In, Every)


def outputs(block: type) -> dict[str, Out]:
    """Output ports of the class of a block or driver, in declared order."""
    return {out.name: out for out in members(block, Out).values()}


def robot_fields(block: type) -> dict[str, str]:
    """Attributes read from the robot file: attribute name to dotted path of the field."""
    return {name: value.field for name, value in members(block, RobotField).items()}


def actions(block: type) -> dict[str, Callable[..., Any]]:
    """Actions of a block class or driver class, by name."""
    return {
        name: getattr(block, name)
        for name in dir(block)
        if getattr(getattr(block, name), "is_action", False)
    }


def action_arguments(method: Callable[..., Any]) -> list[inspect.Parameter]:
    """The arguments of an action, without `self` and `now`."""
    return list(inspect.signature(method).parameters.values())[2:]


def takes_text(argument: inspect.Parameter) -> bool:
    """Whether an argument of an action is a text; all others are numbers."""
    return argument.annotation in (str, "str")


__all__ = [
    "Block",
    "Declaration",
    "Every",
    "FromRobot",
    "In",
    "Out",
    "action",
    "action_arguments",
    "actions",
    "inputs",
    "outputs",
    "takes_text",
]
