"""A YAML file as a tree of values that know where they stand."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from diffbotctl.config import textfile, yamlsyntax
from diffbotctl.config.value import Value
from diffbotctl.config.yamltree import TreeBuilder, UnreadableError, too_deep
from diffbotctl.errors import ConfigurationError, Place, Problem, Source


def read(path: str, name: str | None = None, is_own: bool = True) -> Value:
    """Read the YAML mapping in file `path`, called `name` in messages; `is_own`: the user's file.

    Raises ConfigurationError with every problem that keeps it from being read.
    """
    return parse(Source(name or path, textfile.read(path, name or path), is_own))


def parse(source: Source) -> Value:
    """Read the YAML mapping in `source`. Raises ConfigurationError."""
    root = parse_any(source, "\n".join(source.lines))
    wrong = _not_a_mapping(root, source)
    if wrong:
        raise ConfigurationError(wrong)
    assert root is not None
    return root


def parse_any(source: Source, text: str) -> Value | None:
    """Read any YAML value from `text`, whose columns are those of `source`; None when empty.

    Raises ConfigurationError.
    """
    builder = TreeBuilder(source)
    try:
        for event in _events(text):
            builder.take(event)
    except UnreadableError:
        pass
    except RecursionError:
        builder.problems.append(too_deep(Place(source, 1, 1)))
    except Exception as error:
        if type(error).__module__.split(".")[0] not in ("yaml", "_yaml"):
            raise
        builder.problems.append(yamlsyntax.problem(source, error))
    if builder.problems:
        raise ConfigurationError(builder.problems)
    return builder.root


def _not_a_mapping(root: Value | None, source: Source) -> list[Problem]:
    if root is None or root.data is None:
        cause, fix = (
            "this file is empty",
            "begin it with `format: 1` and `kind: robot` or `pipeline`",
        )
        return [Problem("E-YAML-TOP", source.name, cause, fix)]
    if isinstance(root.data, dict):
        return []
    what = "a list" if isinstance(root.data, list) else "a single value"
    cause = f"the file is {what}, but keys with values are wanted"
    fix = "write `key: value` lines, without a dash or bracket in front"
    return [Problem("E-YAML-TOP", root.place, cause, fix)]


def _events(text: str) -> Iterator[Any]:
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    return yaml.parse(text, Loader=loader)
