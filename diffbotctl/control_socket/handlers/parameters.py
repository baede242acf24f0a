"""Live parameters of running blocks: what there is, and what it may become."""

from __future__ import annotations

from math import isfinite
from typing import Any

from diffbotctl.block import Block
from diffbotctl.control_socket.connection import Client
from diffbotctl.control_socket.protocol import LONGEST_TEXT, RefusalError, Request
from diffbotctl.control_socket.request_context import (
    CommandDraft,
    Fields,
    RequestContext,
    Verb,
    nearest_of,
)
from diffbotctl.params import Declaration, declared
from diffbotctl.units import UnitError, quantity


def handle_parameters(desk: RequestContext, client: Client, request: Request) -> Fields:
    """Every parameter of every block, with its value now."""
    request.only()
    rows = []
    for name, block in desk.blocks.items():
        for attribute, setting in declared(type(block)).items():
            rows.append(
                {
                    "parameter": f"{name}.{setting.key}",
                    "value": _shown(getattr(block, attribute)),
                    "unit": setting.unit,
                    "live": setting.live,
                    "changed": (name, attribute) in desk.knowledge.changed,
                    "help": setting.help,
                }
            )
    return {"parameters": rows}


def handle_set_parameter(desk: RequestContext, client: Client, request: Request) -> CommandDraft:
    """Change a live parameter; a text with a unit is taken too."""
    request.only("parameter", "value")
    path = request.text("parameter")
    name, attribute, setting = _setting(desk, path)
    if not setting.live:
        fix = f"run again with --set {path}=..."
        raise RefusalError("E-REQUEST", f"{path} cannot change while running", fix)
    value = _value(setting, request.fields.get("value"), path)
    number = None if value is None or isinstance(value, str) else float(value)
    return CommandDraft("set", (name, attribute, number, value if isinstance(value, str) else None))


def _setting(desk: RequestContext, path: str) -> tuple[str, str, Declaration]:
    name, _, key = path.partition(".")
    block: Block | None = desk.blocks.get(name)
    if block is not None:
        for attribute, setting in declared(type(block)).items():
            if key in (setting.key, attribute):
                return name, attribute, setting
    paths = [f"{n}.{s.key}" for n, b in desk.blocks.items() for s in declared(type(b)).values()]
    raise RefusalError("E-REQUEST", f"there is no parameter '{path}'", nearest_of(path, paths))


def _value(setting: Declaration, given: Any, path: str) -> Any:
    """`given` as the parameter's type, in SI. Raises RefusalError."""
    value = given
    if setting.kind in (float, int) and isinstance(given, str) and given != "none":
        try:
            value = quantity(given[:LONGEST_TEXT], setting.unit)
        except UnitError as error:
            raise RefusalError("E-REQUEST", f"{path}: {error}") from None
    if given == "none" and setting.none:
        value = None
    if setting.kind is bool and given in ("true", "false"):
        value = given == "true"
    wrong = _complaint(setting, value)
    if wrong:
        raise RefusalError("E-REQUEST", f"{path} {wrong}")
    return value


def _complaint(setting: Declaration, value: Any) -> str | None:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value is None:
        return setting.complaint(value)
    if setting.kind in (float, int):
        if not number or not abs(value) < LARGEST or not isfinite(value):
            return "must be a finite number"
        if setting.kind is int and value != int(value):
            return "must be a whole number"
    elif not isinstance(value, setting.kind) or (value != value):
        return f"must be a {setting.kind.__name__}"
    return setting.complaint(value)


LARGEST = 1e300  # beyond any parameter; above it a whole number need not be a float


def _shown(value: Any) -> Any:
    if isinstance(value, float) and not isfinite(value):
        return str(value)
    return value if isinstance(value, int | float | str | bool | None) else str(value)


PARAMETER_REQUESTS: dict[str, Verb] = {"parameters": handle_parameters, "set": handle_set_parameter}
