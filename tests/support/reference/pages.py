"""Generates docs/reference.md from the declarations: `python -m tests.support.reference.pages`."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

from diffbotctl import messages
from diffbotctl.block import Every, In, action_arguments, actions, inputs, outputs, robot_fields
from diffbotctl.codes import code_texts
from diffbotctl.config import registry
from diffbotctl.config.configuration import Pipeline
from diffbotctl.config.faults import FAULTS
from diffbotctl.config.motor_drivers import MOTOR_DRIVERS
from diffbotctl.config.robot import Robot
from diffbotctl.params import Declaration, Section, Spread, declared, with_unit
from diffbotctl.trials.sections import Trials

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference.md"


def page() -> str:
    """The whole page as Markdown."""
    parts = ["# Reference", "Made from the declarations in the code; do not edit."]
    parts += ["## Robot files", *section(Robot, "")]
    parts += ["## Motor drivers", motor_drivers()]
    parts += ["## Faults", faults()]
    parts += ["## Pipeline files", *section(Pipeline, "")]
    parts += ["## Files of trials", *section(Trials, "")]
    parts += ["## Blocks", *blocks(), "## Drivers", *drivers()]
    parts += ["## Messages", *kinds(), "## Codes", *codes()]
    return "\n\n".join(parts) + "\n"


def section(owner: type, path: str) -> Iterator[str]:
    """The table of a section of a file, followed by those of its subsections."""
    first = (owner.__doc__ or "").split("\n")[0]
    yield f"### `{path or owner.__name__.lower()}`\n\n{first}"
    yield table(declared(owner).values())
    for setting in declared(owner).values():
        inner = inside(setting.kind)
        if inner is not None:
            yield from section(inner, f"{path}.{setting.key}" if path else setting.key)


def inside(kind: Any) -> type | None:
    """The Section class of a setting, or of the items of a list or mapping."""
    for one in (kind, *get_args(kind)):
        if isinstance(one, type) and issubclass(one, Section):
            return one
    return None


def table(settings: Any) -> str:
    """Settings as a table of name, type, default, bounds and help."""
    lines = ["| key | type | default | bounds | what it is |", "|---|---|---|---|---|"]
    for setting in settings:
        lines.append(
            f"| `{setting.key}` | {kind_of(setting)} | {default_of(setting)} | "
            f"{bounds_of(setting)} | {setting.help} |"
        )
    return "\n".join(lines) if len(lines) > 2 else "No settings."


def motor_drivers() -> str:
    """The electrical figures of every motor driver, with their sources."""
    lines = [
        "Typical figures at 25 degrees, used by `wiring`, `check` and the simulation. Between two",
        "pulses of the PWM and at rest the motor is open, or shorted, which brakes it.",
        "",
        "| `driver` | inputs | continuous | loses | between pulses | at rest | too hot | source |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, facts in MOTOR_DRIVERS.items():
        bridge = facts.bridge
        lost = f"{bridge.resistance:g} ohm"
        if bridge.threshold:
            lost = f"{bridge.threshold:g} V + {lost}"
        rest = "`idle`" if len(facts.rests) > 1 else bridge.off_state
        between: str = "shorted" if facts.mode == "two_pwm" else bridge.off_state
        if facts.follows_input_pulses:
            between = "shorted; on enable: open"
        hot = "off until it cools" if bridge.has_thermal_shutdown else "not protected"
        lines.append(
            f"| `{name}` | {', '.join(facts.inputs())} | {bridge.current:g} A | {lost} | "
            f"{between} | {rest} | {hot} | {bridge.source} |"
        )
    return "\n".join(lines)


def faults() -> str:
    """Every fault of a simulated robot, with its size."""
    lines = [
        "`simulation.faults` of a robot file and `faults` of a file of trials are lists of them:",
        "`{fault: wheel_drag, at: 2 s, for: 1 s, side: left, size: 0.2}`. A range `[low, high]` is",
        "drawn by the seed of the run.",
        "",
        "| `fault` | what goes wrong | `side` | `size` | usual | bounds |",
        "|---|---|---|---|---|---|",
    ]
    for name, kind in FAULTS.items():
        side, size = "yes" if kind.has_side else "", kind.size
        columns = ("", "", "")
        if size is not None:
            columns = (size.help, default_of(size), bounds_of(size))
        lines.append(f"| `{name}` | {kind.help} | {side} | {' | '.join(columns)} |")
    return "\n".join(lines)


def kind_of(setting: Declaration) -> str:
    """Type and unit."""
    names = {
        float: "number",
        Spread: "number or range",
        int: "whole number",
        str: "text",
        bool: "true or false",
        dict: "mapping",
        tuple: "list",
    }
    if inside(setting.kind) is not None:
        return "section"
    name = names.get(setting.kind, getattr(setting.kind, "__name__", "").lower() or "list")
    return f"{name}, {setting.unit}" if setting.unit not in ("", "1") else name


def default_of(setting: Declaration) -> str:
    """The default as it is written in a file."""
    value = setting.default
    if setting.is_required:
        return "must be given"
    if value is None:
        return "none"
    if isinstance(value, Section) or inside(setting.kind) is not None:
        return ""
    if isinstance(value, Spread):
        value = value.low
    if isinstance(value, float):
        return with_unit(value, setting.unit)
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value}`"


def bounds_of(setting: Declaration) -> str:
    """Bounds and choices."""
    if setting.choices:
        return ", ".join(f"`{choice}`" for choice in setting.choices)
    return ", ".join(setting.bound_phrases())


def blocks() -> Iterator[str]:
    """Each built-in block: description, ports and parameters."""
    for name in sorted(registry.BLOCKS):
        kind: Any = registry.block(name)
        words = (kind.__doc__ or "").split("\n    blocks:")[0].split("\n")
        doc = "\n".join(line.strip() for line in words)
        lines = [f"### `{name}`", doc.strip()]
        for port, declaration in inputs(kind).items():
            if isinstance(declaration, Every):
                lines.append(f"- timer `{port}`: each {declaration.period} s")
            else:
                lines.append(f"- in `{port}`: {declaration.kind.__name__}{how(declaration)}")
        for port, out in outputs(kind).items():
            lines.append(f"- out `{port}`: {out.kind.__name__}. {out.help}".rstrip(". ") + ".")
        fields = ", ".join(f"`{field}`" for field in robot_fields(kind).values())
        if fields:
            lines.append(f"- from the robot file: {fields}")
        for action, method in actions(kind).items():
            names = ", ".join(argument.name for argument in action_arguments(method))
            first_line = inspect.cleandoc(method.__doc__ or "").partition("\n")[0]
            lines.append(f"- action `{action}({names})`: {first_line}")
        yield "\n".join([*lines[:2], "", *lines[2:]])
        yield table(declared(kind).values())


def drivers() -> Iterator[str]:
    """Each built-in driver: description, outputs and parameters."""
    for name in sorted(registry.DRIVERS):
        kind: Any = registry.driver(name)
        words = (kind.__doc__ or "").split("\n    sources:")[0].split("\n")
        yield f"### `{name}`\n" + "\n".join(line.strip() for line in words).strip()
        rows = [
            f"- out `{port}`: {out.kind.__name__}. {out.help}".rstrip(". ") + "."
            for port, out in outputs(kind).items()
        ]
        yield "\n".join(rows)
        yield table(declared(kind).values())


def how(port: In) -> str:
    """Notes on an input: sampled, freshness, optional."""
    words = []
    if not port.trigger:
        words.append("sampled")
    if port.fresh_for is not None:
        words.append(f"absent when older than `{port.fresh_for}`")
    if port.optional:
        words.append("may stay unconnected")
    text = f" ({'; '.join(words)})" if words else ""
    return f"{text}. {port.help}".rstrip(". ") + "."


def kinds() -> Iterator[str]:
    """Each message: its fields with unit and help."""
    for name, kind in messages.BUILT_IN.items():
        lines = [f"### `{name}`", "", (kind.__doc__ or "").split("\n")[0], ""]
        lines += ["| field | unit | what it is |", "|---|---|---|"]
        for field, (_, about) in messages.fields(kind).items():
            lines.append(f"| `{field}` | {about.unit} | {about.help} |")
        yield "\n".join(lines)


def codes() -> Iterator[str]:
    """All codes with their titles; `diffbotctl explain CODE` prints the texts."""
    lines = [f"| `{code}` | {entry.title} |" for code, entry in code_texts().items()]
    yield "\n".join(["| code | what it means |", "|---|---|", *lines])


if __name__ == "__main__":
    PAGE.write_text(page())
