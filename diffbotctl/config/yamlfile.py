"""A YAML file as a tree of values that know where they stand.

The tree is built from the parser's events, so nothing here recurses on what a stranger wrote:
nesting is counted, and an alias counts with all that it stands for.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

from diffbotctl.config.scalar import ScalarError, resolve
from diffbotctl.errors import ConfigurationError, Place, Problem, Source

Data: TypeAlias = "bool | int | float | str | dict[str, Value] | list[Value] | None"

LARGEST = 256 * 1024  # bytes; the longest shipped file has 4 kB
DEEPEST = 40  # levels; a robot file has 6
MOST = 20_000  # values after every alias is unfolded; a robot file has about 150


class Value:
    """A scalar, mapping or list of a file, with its place and the place of its key.

    `text` is a scalar as it was written, `quoted` whether it stood in quotes. `flow` marks
    `{...}` and `[...]`.
    """

    __slots__ = ("data", "flow", "key", "place", "quoted", "size", "text")

    def __init__(
        self,
        data: Data,
        place: Place,
        key: Place | None = None,
        text: str = "",
        quoted: bool = False,
        flow: bool = False,
        size: int = 1,
    ) -> None:
        self.data = data
        self.place = place
        self.key = key
        self.text = text
        self.quoted = quoted
        self.flow = flow
        self.size = size

    def with_key(self, key: Place | None) -> Value:
        """The same value under another key."""
        return Value(self.data, self.place, key, self.text, self.quoted, self.flow, self.size)

    @property
    def spot(self) -> Place:
        """Where to point when the value as a whole is meant: a block's key stands for it."""
        is_block = isinstance(self.data, dict | list) and not self.flow
        return self.key if self.key and (is_block or not self.text) else self.place

    @property
    def entries(self) -> dict[str, Value]:
        """The entries of a mapping; none for anything else."""
        return self.data if isinstance(self.data, dict) else {}

    @property
    def items(self) -> list[Value]:
        """The items of a list; none for anything else."""
        return self.data if isinstance(self.data, list) else []

    def plain(self) -> Any:
        """The value as plain dictionaries, lists and scalars."""
        if isinstance(self.data, dict):
            return {name: value.plain() for name, value in self.data.items()}
        if isinstance(self.data, list):
            return [value.plain() for value in self.data]
        return self.data

    def with_entry(self, steps: Sequence[str], value: Value) -> Value:
        """A copy of this mapping in which `value` stands at the path `steps`."""
        entries = dict(self.entries)
        name, rest = steps[0], steps[1:]
        if rest:
            below = entries.get(name)
            if below is None or not isinstance(below.data, dict):
                below = Value({}, value.place, value.key)
            value = below.with_entry(rest, value)
        entries[name] = value
        copy = self.with_key(self.key)
        copy.data = entries
        return copy

    def at(self, *steps: str | int) -> Value | None:
        """The value found by keys and indices from here, or None."""
        found: Value | None = self
        for step in steps:
            if isinstance(step, int):
                items = found.items if found else []
                found = items[step] if step < len(items) else None
            else:
                found = found.entries.get(step) if found else None
        return found


def read(path: str, name: str | None = None, is_own: bool = True) -> Value:
    """Read the YAML mapping in file `path`, called `name` in messages; `is_own`: the user's file.

    Raises ConfigurationError with every problem that keeps it from being read.
    """
    return parse(Source(name or path, _text(path, name or path), is_own))


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
    builder = _Builder(source)
    try:
        for event in _events(text):
            builder.take(event)
    except _UnreadableError:
        pass
    except RecursionError:
        builder.problems.append(_too_deep(Place(source, 1, 1)))
    except Exception as error:
        if type(error).__module__.split(".")[0] not in ("yaml", "_yaml"):
            raise
        builder.problems.append(_syntax(source, error))
    if builder.problems:
        raise ConfigurationError(builder.problems)
    return builder.root


class _UnreadableError(Exception):
    """Reading on would be of no use."""


def _text(path: str, name: str) -> str:
    try:
        status = os.stat(path)
    except OSError as error:
        raise _unreadable(name, error) from None
    if stat.S_ISDIR(status.st_mode):
        raise ConfigurationError(
            Problem("E-FILE-READ", name, "this is a directory, not a file", "name a file in it")
        )
    if not stat.S_ISREG(status.st_mode):
        raise ConfigurationError(
            Problem("E-FILE-READ", name, "this is a device or a pipe, not a file", "name a file")
        )
    if status.st_size > LARGEST:
        raise ConfigurationError(_too_large(name, status.st_size))
    try:
        with open(path, "rb") as file:
            raw = file.read(LARGEST + 1)
    except OSError as error:
        raise _unreadable(name, error) from None
    return _decoded(raw, name)


def _decoded(raw: bytes, name: str) -> str:
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in raw:
        what = "UTF-16 text" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "not a text file"
        raise ConfigurationError(
            Problem("E-FILE-ENCODING", name, f"this is {what}", "save it as UTF-8 text")
        )
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = raw[: error.start].decode("utf-8", "replace")
        line, column = text.count("\n") + 1, error.start - raw.rfind(b"\n", 0, error.start)
        source = Source(name, raw.decode("utf-8", "replace"))
        cause = f"byte 0x{raw[error.start]:02x} is not UTF-8"
        raise ConfigurationError(
            Problem("E-FILE-ENCODING", Place(source, line, column), cause, "save the file as UTF-8")
        ) from None


def _unreadable(name: str, error: OSError) -> ConfigurationError:
    causes = {
        FileNotFoundError: ("there is no such file", "check the name and the folder"),
        PermissionError: ("you may not read this file", "check its permissions with ls -l"),
    }
    reason = (error.strerror or str(error)).lower()
    cause, fix = causes.get(type(error), (f"the file cannot be read: {reason}", "check the path"))
    return ConfigurationError(Problem("E-FILE-READ", name, cause, fix))


def _too_large(name: str, size: int) -> Problem:
    amount = f"{size / 1e6:.0f} MB" if size >= 1e6 else f"{size / 1e3:.0f} kB"
    return Problem(
        "E-FILE-SIZE",
        name,
        f"this file has {amount}; a robot or pipeline file has a few kB",
        f"name another file; at most {LARGEST // 1024} kB are read",
    )


def _too_deep(place: Place) -> Problem:
    return Problem(
        "E-YAML-SIZE",
        place,
        f"this is nested more than {DEEPEST} levels deep",
        "close the brackets that are open",
    )


def _not_a_mapping(root: Value | None, source: Source) -> list[Problem]:
    if root is None or root.data is None:
        cause, fix = "this file is empty", "begin it with `format: 1` and `kind: robot`"
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


class _Open:
    """A mapping or list whose end has not come yet."""

    __slots__ = ("anchor", "key", "value")

    def __init__(self, value: Value, anchor: str | None) -> None:
        self.value = value
        self.anchor = anchor
        self.key: Value | None = None


class _Builder:
    """Makes the tree out of events, noting what is wrong on the way."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.problems: list[Problem] = []
        self.root: Value | None = None
        self.stack: list[_Open] = []
        self.anchors: dict[str, Value | None] = {}
        self.documents = 0

    def take(self, event: Any) -> None:
        step = getattr(self, "_" + type(event).__name__.removesuffix("Event").lower(), None)
        if step is not None:
            step(event)

    def _documentstart(self, event: Any) -> None:
        self.documents += 1
        if self.documents > 1:
            cause = "a second document begins here, but a file holds one"
            self._stop("E-YAML-TOP", self._place(event), cause, "remove the `---` line")

    def _mappingstart(self, event: Any) -> None:
        self._open(event, {})

    def _sequencestart(self, event: Any) -> None:
        self._open(event, [])

    def _mappingend(self, event: Any) -> None:
        self._close()

    def _sequenceend(self, event: Any) -> None:
        self._close()

    def _scalar(self, event: Any) -> None:
        self._check_tag(event)
        place, text = self._place(event), event.value
        data: Data = text
        quoted = not event.implicit[0]
        if not quoted and not self._expects_key():
            try:
                data = resolve(text)
            except ScalarError as error:
                self._note("E-YAML-NUMBER", place, str(error), error.fix)
        self._add(Value(data, place, None, text, quoted), event.anchor)

    def _alias(self, event: Any) -> None:
        place, name = self._place(event), event.anchor
        if name not in self.anchors:
            cause = f"*{name} refers to &{name}, which is not defined above"
            self._stop("E-YAML-ANCHOR", place, cause, "write the value itself")
        meant = self.anchors[name]
        if meant is None:
            cause = f"*{name} stands inside the value that it refers to"
            self._stop("E-YAML-ANCHOR", place, cause, "write the value itself")
        assert meant is not None
        copy = meant.with_key(None)
        self._add(copy, None, place)

    def _open(self, event: Any, data: Data) -> None:
        self._check_tag(event)
        value = Value(data, self._place(event), flow=bool(event.flow_style))
        if self._expects_key():
            cause = "a list or mapping cannot be a key"
            self._stop("E-YAML-KEY", value.place, cause, "check for a stray bracket or brace")
        self.stack.append(_Open(value, event.anchor))
        if event.anchor:
            self.anchors[event.anchor] = None
        if len(self.stack) > DEEPEST:
            self.problems.append(_too_deep(value.place))
            raise _UnreadableError

    def _close(self) -> None:
        done = self.stack.pop()
        self._add(done.value, done.anchor)

    def _expects_key(self) -> bool:
        if not self.stack:
            return False
        return isinstance(self.stack[-1].value.data, dict) and self.stack[-1].key is None

    def _add(self, value: Value, anchor: str | None, place: Place | None = None) -> None:
        if anchor:
            self.anchors[anchor] = value
        if not self.stack:
            self.root = value
            return
        parent = self.stack[-1]
        parent.value.size += value.size
        if parent.value.size > MOST:
            cause = f"this unfolds to more than {MOST} values"
            self._stop("E-YAML-SIZE", place or value.place, cause, "write it without aliases")
        if isinstance(parent.value.data, list):
            parent.value.data.append(value)
        elif parent.key is None:
            self._check_key(parent, value)
            parent.key = value
        else:
            self._store(parent, parent.key, value)
            parent.key = None

    def _check_key(self, parent: _Open, key: Value) -> None:
        if not isinstance(key.data, str):
            cause = "a list or mapping cannot be a key"
            self._stop("E-YAML-KEY", key.place, cause, "check for a stray `*` or bracket")
        if key.text == "<<":
            cause = "merge keys (`<<`) are not read"
            fix = "use `include`, or write what both sides share once in `drive`"
            self._note("E-YAML-KEY", key.place, cause, fix)

    def _store(self, parent: _Open, key: Value, value: Value) -> None:
        entries = parent.value.entries
        if key.text in entries:
            first = entries[key.text].key
            here = first is not None and first.line == key.place.line
            where = "earlier in this line" if here or first is None else f"in line {first.line}"
            cause = f"'{key.text}' is given twice; the first stands {where}"
            self._note("E-YAML-DUPLICATE", key.place, cause, "keep one of them")
            return
        value.key = key.place
        if parent.value.flow and value.data is None and not value.text:
            self._check_comma(entries, key)
        entries[key.text] = value

    def _check_comma(self, entries: dict[str, Value], key: Value) -> None:
        """`{width: 1,5 m}` is two entries: `width: 1` and an empty `5 m`."""
        before = list(entries.values())[-1] if entries else None
        if before is None or not re.match(r"\d", key.text) or not re.search(r"\d\Z", before.text):
            return
        whole = f"{before.text}.{key.text}"
        cause = f"the comma ends the value {before.text}, and '{key.text}' becomes a key of its own"
        self._note("E-YAML-COMMA", key.place, cause, f"write a point: {whole}")

    def _check_tag(self, event: Any) -> None:
        if event.tag is not None and event.tag != "!":
            cause = f"tags such as {event.tag} are not read"
            self._note("E-YAML-TAG", self._place(event), cause, "remove the tag")

    def _place(self, event: Any) -> Place:
        start, end = event.start_mark, event.end_mark
        line = self.source.line(start.line + 1)
        stop = end.column if end.line == start.line else len(line)
        collection = type(event).__name__.endswith("StartEvent")
        length = 1 if collection else max(1, stop - start.column)
        return Place(self.source, start.line + 1, start.column + 1, length)

    def _note(self, code: str, place: Place, cause: str, fix: str) -> None:
        self.problems.append(Problem(code, place, cause, fix))

    def _stop(self, code: str, place: Place, cause: str, fix: str) -> None:
        self._note(code, place, cause, fix)
        raise _UnreadableError


def _syntax(source: Source, error: Any) -> Problem:
    """The parser's complaint in our words."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    words = str(getattr(error, "problem", None) or getattr(error, "reason", None) or error)
    if mark is None:
        cause = f"this is not YAML text: {words.splitlines()[0].strip()}"
        return Problem("E-FILE-ENCODING", source.name, cause, "save it as UTF-8 text")
    place = Place(source, mark.line + 1, mark.column + 1)
    tab = _indented_by_tab(source, mark.line + 1)
    if tab is not None:
        cause = "a tab stands here; YAML indents by spaces only"
        return Problem("E-YAML-TAB", tab, cause, "replace each tab by spaces")
    if "mapping values are not allowed" in words:
        return _unexpected_key(source, place)
    for pattern, cause, fix in SYNTAX:
        if re.search(pattern, words):
            opened = getattr(error, "context_mark", None)
            where = f" (opened in line {opened.line + 1})" if opened and "closed" in cause else ""
            return Problem("E-YAML-SYNTAX", place, cause + where, fix)
    cause = f"YAML cannot be read from here: {words}"
    return Problem("E-YAML-SYNTAX", place, cause, "compare this line with the ones around it")


SYNTAX = [
    (
        r"expected ',' or '[}]'|expected ',' or '\]'|flow (mapping|sequence)",
        "a brace or bracket is not closed before here",
        "close it, and put a comma between its entries",
    ),
    (
        r"could not find expected ':'|expected ':'",
        "a key without a colon",
        "write `key: value`, with a space behind the colon",
    ),
    (
        r"quoted scalar|end of stream",
        "a quotation mark is not closed before here",
        "close the text with the same mark that opened it",
    ),
    (
        r"expected <block end>|did not find expected key|block (mapping|collection|end)",
        "this line is indented unlike the lines that it belongs to",
        "give all keys of one mapping the same indentation",
    ),
    (
        r"cannot start any token",
        "no value can begin with this character",
        "put the text in quotes",
    ),
]  # fmt: skip


def _unexpected_key(source: Source, colon: Place) -> Problem:
    """A key where none can stand: usually the line before is to blame, or the indentation."""
    line, before = source.line(colon.line), source.line(colon.line - 1)
    glued = re.match(r"\s*[A-Za-z_][A-Za-z0-9_]*(:)\S", before)
    if glued:
        place = Place(source, colon.line - 1, glued.start(1) + 1)
        return Problem("E-YAML-SYNTAX", place, "no space follows this colon", "write `key: value`")
    indent = len(line) - len(line.lstrip())
    if ":" not in line[: colon.column - 1] and indent > len(before) - len(before.lstrip()):
        cause = "this is indented deeper than the line before, which has a value already"
        place = Place(source, colon.line, indent + 1)
        fix = "give all keys of one mapping the same indentation"
        return Problem("E-YAML-SYNTAX", place, cause, fix)
    cause = "a second colon in this line: what stands before it cannot be a key"
    fix = "put braces around inner keys, `body: {front: 9 cm}`, or quotes around a text"
    return Problem("E-YAML-SYNTAX", colon, cause, fix)


def _indented_by_tab(source: Source, number: int) -> Place | None:
    for candidate in (number, number - 1):
        found = re.match(r"[ ]*(\t)", source.line(candidate))
        if found:
            return Place(source, candidate, found.start(1) + 1)
    return None
