"""Code in one file that a configuration names: `block: ./my_block.py:MyBlock`.

To import a file is to run it, with the user's rights. So only bytes are imported whose SHA-256 the
user has consented to, and exactly these: neither what the file becomes later, nor a compiled copy
of it. A recording holds the hashes alone, and its replay searches this computer for the files.
"""

from __future__ import annotations

import linecache
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass, field
from functools import cached_property
from importlib.util import decode_source
from pathlib import Path
from types import ModuleType
from typing import TypeVar

from diffbotctl.block import DeclarationError
from diffbotctl.config import consents, lookup
from diffbotctl.config.registry import RegistryError
from diffbotctl.errors import ConfigurationError, Problem, closest_match, place_in_code

CODE_BYTES_MAX = 1 << 20
SHOWN_DIGITS = 12  # of a SHA-256, in a message
EXAMPLE = "write ./my_block.py:MyBlock, a file beside this one and a class in it"
CONSENT_CODE = "E-CODE-CONSENT"

Kind = TypeVar("Kind")


@dataclass(frozen=True)
class CodeFile:
    """A file with code as it was read. `written`: as the configuration names it."""

    written: str
    path: Path
    data: bytes

    @cached_property
    def sha256(self) -> str:
        """The hash of its bytes, as hexadecimal digits."""
        # Imported late: it loads OpenSSL, 9 ms and 3 MB, and few pipelines have code of their own.
        import hashlib

        return hashlib.sha256(self.data).hexdigest()

    @property
    def consent_key(self) -> str:
        """What a person consents to who allows this file: its content, wherever it is."""
        return f"code {self.sha256}"


class CodeConsentError(ConfigurationError):
    """Nothing is wrong but that the user has not consented to `files`."""

    def __init__(self, problems: Sequence[Problem], files: Sequence[CodeFile]) -> None:
        super().__init__(problems)
        self.files = tuple(files)


@dataclass(eq=False)
class CodeFiles:
    """The files with code of one configuration: `used`, by `KEY` of a recording.

    `recorded`: of a replay, the SHA-256 of each key; the files are then searched for by their hash
    in `folders`. `refused` are those which the user has not consented to.
    """

    recorded: Mapping[str, str] | None = None
    folders: Sequence[Path] = ()
    used: dict[str, CodeFile] = field(default_factory=dict)
    refused: list[CodeFile] = field(default_factory=list)

    def find(self, text: str, file: Path | None, base: type[Kind]) -> type[Kind]:
        """The class derived from `base` that `text` names, such as `./my_block.py:MyBlock`.

        `file` is the YAML file that names it, from which the path counts; None: the command line.
        Raises RegistryError, before anything is imported with the code E-CODE-CONSENT.
        """
        written, _, name = text.rpartition(":")
        if not written.endswith(".py") or not name.isidentifier():
            raise RegistryError("E-CODE-FILE", f"'{text}' names no class in a file", EXAMPLE)
        key = f"{file.name if file else ''}: {written}"
        if self.recorded is None:
            folder = lookup.real_path(file).parent if file else Path.cwd()
            code = CodeFile(written, folder / written, _read(folder / written, written))
        else:
            code = self._recorded_file(written, self.recorded.get(key, ""))
        self.used[key] = code
        if not consents.is_allowed(code.consent_key):
            self.refused.append(code)
            cause = f"the code in {lookup.display_path(code.path)} has not been allowed, and was "
            cause += "not imported"
            fix = "`run` and `replay` ask on a terminal; or give `run` --allow-programs"
            raise RegistryError(CONSENT_CODE, cause, fix)
        return _class_in(_imported(code), name, code, base)

    def error(self, problems: Sequence[Problem]) -> ConfigurationError:
        codes = {problem.code for problem in problems if problem.severity == "error"}
        if codes == {CONSENT_CODE}:
            return CodeConsentError(problems, self.refused)
        return ConfigurationError(problems)

    def hashes(self) -> dict[str, str]:
        """The SHA-256 of each file, by its key: what a recording holds of them."""
        return {key: code.sha256 for key, code in self.used.items()}

    def _recorded_file(self, written: str, sha256: str) -> CodeFile:
        """The file with this hash on this computer. Raises RegistryError."""
        for path in self._candidates(Path(written).name):
            with suppress(RegistryError):
                code = CodeFile(written, path, _read(path, written))
                if code.sha256 == sha256:
                    return code
        digits = f"SHA-256 {sha256[:SHOWN_DIGITS]}..." if sha256 else "no SHA-256 in the recording"
        cause = (
            f"{written} as it was recorded ({digits}) is neither beside the recording nor in this "
            "folder; a recording holds no code"
        )
        raise RegistryError("E-CODE-FILE", cause, "put that version of the file there")

    def _candidates(self, name: str) -> Iterator[Path]:
        """The files that may be the recorded one: those of its name first."""
        for folder in self.folders:
            yield folder / name
        for folder in self.folders:
            yield from sorted(folder.glob("*.py"))


def is_code(text: str) -> bool:
    """Whether `text` names a class in a file, in place of a registered name."""
    return "/" in text or ".py" in text or text.startswith(":")


def _read(path: Path, written: str) -> bytes:
    """The bytes of the file at `path`. Raises RegistryError."""
    try:
        if not path.is_file():
            cause = f"there is no file {lookup.display_path(path)}"
            raise RegistryError(
                "E-CODE-FILE", cause, "correct the path: in a file it counts from its folder"
            )
        with path.open("rb") as file:
            data = file.read(CODE_BYTES_MAX + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        cause = f"{written} cannot be read: {reason}"
        raise RegistryError("E-CODE-FILE", cause, "correct the path") from error
    if len(data) > CODE_BYTES_MAX:
        cause = f"{written} has more than {CODE_BYTES_MAX >> 20} MB"
        raise RegistryError("E-CODE-FILE", cause, "make a package of it: diffbotctl new block")
    return data


def _imported(code: CodeFile) -> ModuleType:
    """The module with this code. Raises RegistryError.

    Its name has the hash, so that no other module has it, and a `~`, so that no `import` finds it.
    """
    name = f"{code.path.stem}~{code.sha256[:SHOWN_DIGITS]}"
    if name in sys.modules:
        return sys.modules[name]
    place = lookup.display_path(code.path)
    module = ModuleType(name)
    module.__file__ = place
    sys.modules[name] = module  # a dataclass in it looks for it there
    try:
        lines = _text(code).splitlines(keepends=True)
        # The lines of an error are those that were imported, whatever the file is by then.
        linecache.cache[place] = (len(code.data), None, lines, place)
        with redirect_stdout(sys.stderr):  # a `print` must not be taken for JSON
            exec(compile(code.data, place, "exec", dont_inherit=True), vars(module))
    except RegistryError:
        del sys.modules[name]
        raise
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise _import_error(code, place, error) from error
    return module


def _text(code: CodeFile) -> str:
    """The text of the file. Raises RegistryError."""
    try:
        return decode_source(code.data)
    except (SyntaxError, UnicodeDecodeError) as error:
        cause = f"{code.written} is no UTF-8 text, and names no other encoding"
        raise RegistryError("E-CODE-FILE", cause, "save it as UTF-8") from error


def _import_error(code: CodeFile, place: str, error: BaseException) -> RegistryError:
    cause = f"{code.written} cannot be imported: {type(error).__name__}: {error}"
    fix = "correct the file"
    if isinstance(error, DeclarationError):
        cause, fix = str(error), error.fix
    elif isinstance(error, SyntaxError):
        cause = f"{code.written} is no valid Python: {error.msg}"
    elif isinstance(error, ModuleNotFoundError):
        fix = f"install {error.name}; code of another file beside it needs a package: "
        fix += "diffbotctl new block"
    return RegistryError("E-CODE-FILE", cause, fix, place_in_code(error, place))


def _class_in(module: ModuleType, name: str, code: CodeFile, base: type[Kind]) -> type[Kind]:
    """The class `name` of the module. Raises RegistryError."""
    found = vars(module).get(name)
    if isinstance(found, type) and issubclass(found, base) and found is not base:
        return found
    known = [
        key
        for key, kind in vars(module).items()
        if isinstance(kind, type) and issubclass(kind, base) and kind is not base
    ]
    cause = f"{code.written} has no class '{name}'"
    if found is not None:
        cause = f"'{name}' in {code.written} is not derived from {base.__name__}"
    near = closest_match(name, known) or next(iter(known), None)
    fix = f"did you mean {near}?" if near else f"write class {name}({base.__name__}) there"
    raise RegistryError("E-CODE-FILE", cause, fix)
