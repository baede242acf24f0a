"""`vars:` and `$name`: a value written once and used in several places."""

from __future__ import annotations

import re

from diffbotctl.config.yaml_scalars import ScalarError, resolve
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Problem, closest_match, join_words

NAME = r"[A-Za-z_][A-Za-z0-9_]*"
WHOLE = re.compile(rf"\$({NAME})\Z")
WITHIN = re.compile(rf"\$\$|\$({NAME})")


def substitute(top: Value, problems: list[Problem]) -> Value:
    """`top` with every `$name` replaced from its `vars`; `$$` is a dollar sign.

    An unknown name is an error, one that is never used a warning; both go to `problems`.
    """
    table = dict(top.entries.get("vars", top).entries) if "vars" in top.entries else {}
    used: set[str] = set()
    entries = {
        name: value if name == "vars" else _replaced(value, table, used, problems)
        for name, value in top.entries.items()
    }
    for name in table.keys() - used:
        place = table[name].key or table[name].place
        cause = f"the variable {name} is never used"
        problems.append(
            Problem(
                "W-VAR-UNUSED", place, cause, f"remove it, or write ${name} somewhere", "warning"
            )
        )
    done = top.with_key(top.key)
    done.data = entries
    return done


def _replaced(
    value: Value, table: dict[str, Value], used: set[str], problems: list[Problem]
) -> Value:
    if isinstance(value.data, dict | list):
        copy = value.with_key(value.key)
        copy.data = (
            {name: _replaced(each, table, used, problems) for name, each in value.data.items()}
            if isinstance(value.data, dict)
            else [_replaced(each, table, used, problems) for each in value.data]
        )
        return copy
    if "$" not in value.text:
        return value
    names = [name for name in WITHIN.findall(value.text) if name]
    unknown = [name for name in names if name not in table]
    problems += [_unknown(value, name, table) for name in unknown]
    used |= set(names)
    whole = WHOLE.match(value.text)
    if unknown:
        return value
    if whole:
        return _in_place_of(value, table[whole[1]])
    return _within(value, table, problems)


def _in_place_of(value: Value, meant: Value) -> Value:
    """The meant value, standing where it is used: that is where it may be wrong."""
    return Value(meant.data, value.place, value.key, meant.text, meant.quoted, meant.flow)


def _within(value: Value, table: dict[str, Value], problems: list[Problem]) -> Value:
    text = WITHIN.sub(lambda found: table[found[1]].text if found[1] else "$", value.text)
    data: bool | int | float | str | None = text
    if not value.quoted:
        try:
            data = resolve(text)
        except ScalarError as error:
            problems.append(Problem("E-YAML-NUMBER", value.place, str(error), error.fix))
    return Value(data, value.place, value.key, text, value.quoted)


def _unknown(value: Value, name: str, table: dict[str, Value]) -> Problem:
    near = closest_match(name, table)
    if near:
        fix = f"did you mean ${near}?"
    elif table:
        fix = f"vars holds {join_words(table, 'and')}; a dollar sign itself is written $$"
    else:
        fix = f"add `vars: {{{name}: ...}}`; a dollar sign itself is written $$"
    return Problem("E-VAR-UNKNOWN", value.spot, f"there is no variable {name}", fix)
