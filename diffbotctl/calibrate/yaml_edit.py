"""Changes one value of a YAML text and keeps comments, order and layout."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import yaml


def with_entry(text: str, path: Sequence[str], written: str) -> str:
    """`text` with the value at `path` replaced by `written`, or added where there was none.

    Raises ValueError when the layout does not allow a safe change.
    """
    root = yaml.compose(text, Loader=yaml.CSafeLoader)
    if not isinstance(root, yaml.MappingNode):
        raise ValueError("it is not a mapping")
    node: Any = root
    for depth, step in enumerate(path):
        if not isinstance(node, yaml.MappingNode):
            raise ValueError(f"there is a plain value in place of the mapping with {step}")
        value = next((value for key, value in node.value if key.value == step), None)
        if value is None:
            return _checked(text, _with_new(text, node, path[depth:], written), path, written)
        node = value
    changed = text[: node.start_mark.index] + written + text[node.end_mark.index :]
    return _checked(text, changed, path, written)


def _with_new(text: str, node: Any, keys: Sequence[str], written: str) -> str:
    """`text` with a new entry at the end of the mapping `node`."""
    entry = written
    for key in reversed(keys[1:]):
        entry = f"{{{key}: {entry}}}"
    entry = f"{keys[0]}: {entry}"
    if node.flow_style:
        at = node.value[-1][1].end_mark.index if node.value else node.start_mark.index + 1
        return f"{text[:at]}{', ' if node.value else ''}{entry}{text[at:]}"
    at = text.find("\n", _last(node).end_mark.index)  # after a comment on that line
    at = len(text) if at < 0 else at
    return f"{text[:at]}\n{' ' * node.value[0][0].start_mark.column}{entry}{text[at:]}"


def _last(node: Any) -> Any:
    """The last node inside a block mapping or list, whose own end mark is after later comments."""
    while isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        node = last[1] if isinstance(node, yaml.MappingNode) else last
    return node


def _checked(before: str, after: str, path: Sequence[str], written: str) -> str:
    """`after`, if its content is that of `before` with exactly this value changed."""
    expected = _unshared(yaml.load(before, Loader=yaml.CSafeLoader))
    parent = expected
    for step in path[:-1]:
        parent = parent.setdefault(step, {})
    parent[path[-1]] = yaml.load(written, Loader=yaml.CSafeLoader)
    return reads_as(after, expected)


def reads_as(after: str, expected: Any) -> str:
    """The text `after`, if its content is `expected`. Raises ValueError otherwise."""
    try:
        content = yaml.load(after, Loader=yaml.CSafeLoader)
    except yaml.YAMLError:
        content = None
    if content != expected:
        raise ValueError("its layout does not allow a safe change")
    return after


def _unshared(value: Any) -> Any:
    """A copy in which aliases are separate objects."""
    if isinstance(value, dict):
        return {key: _unshared(entry) for key, entry in value.items()}
    return [_unshared(item) for item in value] if isinstance(value, list) else value
