"""Reads a YAML file into a tree of values.

YAML 1.1 turns `on` into true, `12:30` into 750, `017` into 15 and `1e-3` into text. Here an
unquoted word is a number when it looks like a decimal number, a boolean when it is true or false,
and otherwise text.

Parsing does not recurse, so nesting cannot exhaust the stack: levels are counted, and an alias
counts with all the values that it refers to.
"""

from __future__ import annotations

import errno
import os
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, Any, NoReturn
from unicodedata import category

from diffbotctl.config import yaml_syntax
from diffbotctl.config.yaml_tree import Data, Scalar, Value
from diffbotctl.errors import ConfigurationError, Place, Problem, Source
from diffbotctl.units import NUMBER, ascii_digits

FILE_SIZE_MAX_BYTES = 256 * 1024  # the longest shipped file has 4 kB
VALUES_MAX_COUNT = 20_000  # after every alias is expanded; a robot file has about 150
INTEGER = re.compile(r"[-+]?[0-9]+\Z")
DECIMAL = re.compile(NUMBER + r"\Z")
NOT_DECIMAL = re.compile(r"[-+]?(0[0-9_]+|0o[0-7_]+|0x[0-9a-fA-F_]+|0b[01_]+)\Z")
NUMBER_MAX_LENGTH = 40  # characters; longer ones are slow to convert
KEYWORDS: dict[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
UTF_16_MARKS = (b"\xff\xfe", b"\xfe\xff")


def read(path: str, name: str | None = None, is_own: bool = True) -> Value:
    """Read the YAML mapping in file `path`, called `name` in messages; `is_own`: the user's file.

    Raises ConfigurationError with every problem that keeps it from being read.
    """
    return parse(Source(name or path, read_text(path, name or path), is_own))


def parse(source: Source) -> Value:
    """Read the YAML mapping in `source`. Raises ConfigurationError."""
    root = parse_any(source, "\n".join(source.lines))
    if root is not None and isinstance(root.data, dict):
        return root
    if root is None or root.data is None:
        cause = "this file is empty"
        fix = "begin it with `format: 1` and `kind:` robot, pipeline or trials"
        raise ConfigurationError(Problem("E-YAML-TOP", source.name, cause, fix))
    kind = "a list" if isinstance(root.data, list) else "a single value"
    cause = f"the file is {kind}, but a mapping is required"
    fix = "write `key: value` lines, without a leading dash or bracket"
    raise ConfigurationError(Problem("E-YAML-TOP", root.value_place, cause, fix))


def parse_any(source: Source, text: str) -> Value | None:
    """Read any YAML value from `text`, whose columns are those of `source`; None when empty.

    Raises ConfigurationError.
    """
    builder = _TreeBuilder(source)
    try:
        for event in _events(text):
            builder.add_event(event)
    except _UnreadableError:
        pass
    except UnicodeEncodeError as error:  # a word of the command line; files were decoded
        cause, fix = "this character is not UTF-8", "type the text again"
        builder.problems.append(
            Problem("E-FILE-ENCODING", Place(source, 1, error.start + 1), cause, fix)
        )
    except RecursionError:
        builder.problems.append(yaml_syntax.too_deep(Place(source, 1, 1)))
    except Exception as error:
        if type(error).__module__.split(".")[0] not in ("yaml", "_yaml"):
            raise
        builder.problems.append(yaml_syntax.problem(source, error))
    if builder.problems:
        raise ConfigurationError(builder.problems)
    return builder.root


class ScalarError(ValueError):
    """A word looks like a number but is ambiguous or too large; `fix` is the remedy."""

    def __init__(self, cause: str, fix: str) -> None:
        super().__init__(cause)
        self.fix = fix


def resolve(text: str) -> Scalar:
    """The value of the unquoted `text`.

    Raises ScalarError for octal, hexadecimal and binary numbers, which readers of YAML disagree
    about, for digits of another script, and for numbers too large to hold.
    """
    if text in KEYWORDS:
        return KEYWORDS[text]
    if NOT_DECIMAL.match(text):
        raise ScalarError(
            f"'{text}' is read as {_other_reading(text)} by some programs and not by others",
            "write the number in decimal, without leading zeros",
        )
    if not DECIMAL.match(text):
        plain = ascii_digits(text)
        if plain != text and DECIMAL.match(plain):
            raise ScalarError(f"'{text}' has digits of another script", f"write {plain}")
        return text
    number = float(text)
    if len(text) > NUMBER_MAX_LENGTH or abs(number) == float("inf"):
        raise ScalarError("this number is too large", "check the number of digits")
    return int(text) if INTEGER.match(text) else number


def _other_reading(text: str) -> str:
    digits = text.lower().replace("_", "")
    has_prefix = digits.strip("+-0")[:1] in ("o", "x", "b")
    try:
        return str(int(digits, 0 if has_prefix else 8))
    except ValueError:
        return "an octal number"


class SpecialFileError(OSError):
    """The path leads to a device or a pipe."""


def open_regular(path: str | Path) -> IO[bytes]:
    """Open a file for reading. Raises OSError, also for a directory, a device or a pipe.

    It is opened before it is examined, so that it cannot be exchanged in between, and without
    waiting for the writer of a pipe.
    """
    file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    mode = os.fstat(file).st_mode
    if stat.S_ISREG(mode):
        return open(file, "rb")
    os.close(file)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "this is a directory, not a file")
    raise SpecialFileError(errno.EINVAL, "this is a device or a pipe, not a file")


def read_text(path: str, name: str) -> str:
    """The text of the file at `path`, called `name` in messages. Raises ConfigurationError."""
    if not path.isprintable() and path.encode("utf-8", "replace") != os.fsencode(path):
        cause = "the name of this file is not UTF-8 text, and cannot be recorded or displayed"
        _refuse("E-FILE-READ", name, cause, "rename the file")
    try:
        with open_regular(path) as file:
            size = os.fstat(file.fileno()).st_size
            if size > FILE_SIZE_MAX_BYTES:
                _refuse_size(name, size)
            content = file.read(FILE_SIZE_MAX_BYTES + 1) or b""
    except IsADirectoryError:
        _refuse("E-FILE-READ", name, "this is a directory, not a file", "name a file in it")
    except SpecialFileError as error:
        _refuse("E-FILE-READ", name, str(error.strerror), "name a file")
    except FileNotFoundError:
        _refuse("E-FILE-READ", name, "there is no such file", "check the name and the folder")
    except PermissionError:
        cause, fix = "no permission to read this file", "check it with ls -l"
        _refuse("E-FILE-READ", name, cause, fix)
    except (OSError, ValueError) as error:  # ValueError: no file can have such a name
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        _refuse("E-FILE-READ", name, f"the file cannot be read: {reason}", "check the path")
    return _decode(content, name)


def _decode(content: bytes, name: str) -> str:
    is_utf_16 = content.startswith(UTF_16_MARKS)
    if is_utf_16 or b"\0" in content:
        cause = f"this is {'UTF-16 text' if is_utf_16 else 'not a text file'}"
        _refuse("E-FILE-ENCODING", name, cause, "save it as UTF-8 text")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        column = error.start - content.rfind(b"\n", 0, error.start)
        place = Place(Source(name, content.decode("utf-8", "replace")), line, column)
        cause = f"byte 0x{content[error.start]:02x} is not UTF-8"
        _refuse("E-FILE-ENCODING", place, cause, "save the file as UTF-8")


def _refuse_size(name: str, size: int) -> NoReturn:
    amount = f"{size / 1e6:.0f} MB" if size >= 1e6 else f"{size / 1e3:.0f} kB"
    cause = f"this file has {amount}; a robot or pipeline file has a few kB"
    fix = f"name another file; at most {FILE_SIZE_MAX_BYTES // 1024} kB are read"
    _refuse("E-FILE-SIZE", name, cause, fix)


def _refuse(code: str, place: Place | str, cause: str, fix: str) -> NoReturn:
    raise ConfigurationError(Problem(code, place, cause, fix)) from None


def _events(text: str) -> Iterator[Any]:
    import yaml  # 20 ms; `--help` does without

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    return yaml.parse(text, Loader=loader)


class _UnreadableError(Exception):
    """The rest of the file cannot be read."""


@dataclass(eq=False, repr=False)
class _OpenCollection:
    """A mapping or list whose end has not been reached. `key` waits for its value."""

    value: Value
    anchor: str | None
    key: Value | None = None


@dataclass(eq=False, repr=False)
class _TreeBuilder:
    """Builds the tree from a parser's events and collects the problems."""

    source: Source
    problems: list[Problem] = field(default_factory=list)
    root: Value | None = None
    stack: list[_OpenCollection] = field(default_factory=list)
    anchors: dict[str, Value | None] = field(default_factory=dict)
    documents: int = 0

    def add_event(self, event: Any) -> None:
        """Take the next event of the parser. Raises _UnreadableError."""
        match type(event).__name__:
            case "DocumentStartEvent":
                self._begin_document(event)
            case "MappingStartEvent":
                self._begin_collection(event, {})
            case "SequenceStartEvent":
                self._begin_collection(event, [])
            case "MappingEndEvent" | "SequenceEndEvent":
                collection = self.stack.pop()
                self._add(collection.value, collection.anchor)
            case "ScalarEvent":
                self._add_scalar(event)
            case "AliasEvent":
                self._add_alias(event)

    def _begin_document(self, event: Any) -> None:
        self.documents += 1
        if self.documents > 1:
            cause = "a second document begins here; a file contains only one"
            self._stop("E-YAML-TOP", self._place(event), cause, "remove the `---` line")

    def _begin_collection(self, event: Any, data: Data) -> None:
        self._check_tag(event)
        value = Value(data, self._place(event), flow=bool(event.flow_style))
        if self._expects_key():
            cause = "a list or mapping cannot be a key"
            fix = "check for a stray bracket or brace"
            self._stop("E-YAML-KEY", value.value_place, cause, fix)
        self.stack.append(_OpenCollection(value, event.anchor))
        if event.anchor:
            self.anchors[event.anchor] = None
        if len(self.stack) > yaml_syntax.NESTING_MAX_LEVELS:
            self.problems.append(yaml_syntax.too_deep(value.value_place))
            raise _UnreadableError

    def _add_scalar(self, event: Any) -> None:
        self._check_tag(event)
        place, text = self._place(event), event.value
        data: Data = text
        self._check_characters(place, text)
        quoted = not event.implicit[0]
        if not quoted and not self._expects_key():
            try:
                data = resolve(text)
            except ScalarError as error:
                self._note("E-YAML-NUMBER", place, str(error), error.fix)
        self._add(Value(data, place, None, text, quoted), event.anchor)

    def _add_alias(self, event: Any) -> None:
        place, name = self._place(event), event.anchor
        if name not in self.anchors:
            cause = f"*{name} refers to &{name}, which is not defined above"
            self._stop("E-YAML-ANCHOR", place, cause, "write the value itself")
        value = self.anchors[name]
        if value is None:
            cause = f"*{name} is inside the value that it refers to"
            self._stop("E-YAML-ANCHOR", place, cause, "write the value itself")
        self._add(replace(value, key_place=None), None, place)

    def _expects_key(self) -> bool:
        if not self.stack:
            return False
        return isinstance(self.stack[-1].value.data, dict) and self.stack[-1].key is None

    def _add(self, value: Value, anchor: str | None, place: Place | None = None) -> None:
        """Add a finished value to the innermost open collection."""
        if anchor:
            self.anchors[anchor] = value
        if not self.stack:
            self.root = value
            return
        parent = self.stack[-1]
        parent.value.size += value.size
        if parent.value.size > VALUES_MAX_COUNT:
            cause = f"this expands to more than {VALUES_MAX_COUNT} values"
            self._stop("E-YAML-SIZE", place or value.value_place, cause, "write it without aliases")
        if isinstance(parent.value.data, list):
            parent.value.data.append(value)
        elif parent.key is None:
            self._check_key(value)
            parent.key = value
        else:
            self._add_entry(parent.value, parent.key, value)
            parent.key = None

    def _check_key(self, key: Value) -> None:
        if not isinstance(key.data, str):
            cause = "a list or mapping cannot be a key"
            self._stop("E-YAML-KEY", key.value_place, cause, "check for a stray `*` or bracket")
        if key.text == "<<":
            cause = "merge keys (`<<`) are not supported"
            fix = "use `include`, or write values of both sides once in `drive`"
            self._note("E-YAML-KEY", key.value_place, cause, fix)

    def _add_entry(self, mapping: Value, key: Value, value: Value) -> None:
        entries, place = mapping.entries, key.value_place
        if key.text in entries:
            first = entries[key.text].key_place
            where = "earlier in this line"
            if first is not None and first.line != place.line:
                where = f"in line {first.line}"
            cause = f"'{key.text}' is defined twice; the first definition is {where}"
            self._note("E-YAML-DUPLICATE", place, cause, "keep one of them")
            return
        value.key_place = place
        if mapping.flow and value.data is None and not value.text:
            self._check_comma(entries, key)
        entries[key.text] = value

    def _check_comma(self, entries: dict[str, Value], key: Value) -> None:
        """`{width: 1,5 m}` is two entries: `width: 1` and an empty `5 m`."""
        previous = list(entries.values())[-1].text if entries else ""
        if not re.match(r"[0-9]", key.text) or not re.search(r"[0-9]\Z", previous):
            return
        cause = f"the comma ends the value {previous} and makes '{key.text}' a separate key"
        fix = f"write a decimal point: {previous}.{key.text}"
        self._note("E-YAML-COMMA", key.value_place, cause, fix)

    def _check_characters(self, place: Place, text: str) -> None:
        """Refuse NUL and the like, which only an escape in double quotes can write."""
        strange = next(
            (each for each in text if category(each) == "Cc" and each not in "\t\n"), None
        )
        if strange is not None:
            cause = f"this text has the control character U+{ord(strange):04X}"
            fix = "remove it; a backslash is itself in single quotes: 'C:\\0'"
            self._note("E-YAML-CONTROL", place, cause, fix)

    def _check_tag(self, event: Any) -> None:
        if event.tag is not None and event.tag != "!":
            cause = f"tags such as {event.tag} are not supported"
            self._note("E-YAML-TAG", self._place(event), cause, "remove the tag")

    def _place(self, event: Any) -> Place:
        start, end = event.start_mark, event.end_mark
        line = self.source.line(start.line + 1)
        end_column = end.column if end.line == start.line else len(line)
        is_collection = type(event).__name__.endswith("StartEvent")
        length = 1 if is_collection else max(1, end_column - start.column)
        return Place(self.source, start.line + 1, start.column + 1, length)

    def _note(self, code: str, place: Place, cause: str, fix: str) -> None:
        self.problems.append(Problem(code, place, cause, fix))

    def _stop(self, code: str, place: Place, cause: str, fix: str) -> NoReturn:
        self._note(code, place, cause, fix)
        raise _UnreadableError
