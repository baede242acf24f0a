"""Plain words of a YAML file to values: the few rules that people expect, and no others.

YAML 1.1 turns `on` into true, `12:30` into 750, `017` into 15 and `1e-3` into text. Here a word is
a number when it looks like a decimal number, true or false when it says so, and else itself.
"""

from __future__ import annotations

import re

from diffbotctl.units import NUMBER

INTEGER = re.compile(r"[-+]?[0-9]+\Z")
DECIMAL = re.compile(NUMBER + r"\Z")
OCTAL = re.compile(r"[-+]?(0[0-9_]+|0o[0-7_]+|0x[0-9a-fA-F_]+|0b[01_]+)\Z")
LONGEST = 40  # digits; more is no quantity of a robot, and slow to convert
WORDS: dict[str, bool | None] = {
    "": None,
    "~": None,
    "null": None,
    "Null": None,
    "NULL": None,
    "true": True,
    "True": True,
    "TRUE": True,
    "false": False,
    "False": False,
    "FALSE": False,
}


class ScalarError(ValueError):
    """A word looks like a number but cannot be one; `fix` says how to write it."""

    def __init__(self, cause: str, fix: str) -> None:
        super().__init__(cause)
        self.fix = fix


def resolve(text: str) -> bool | int | float | str | None:
    """The value that the unquoted `text` stands for.

    Raises ScalarError for octal, hexadecimal and binary numbers, which readers of YAML disagree
    about, and for numbers too large to hold.
    """
    if text in WORDS:
        return WORDS[text]
    if OCTAL.match(text):
        raise ScalarError(
            f"'{text}' is read as {_octal(text)} by some programs and not by others",
            "write the number in decimal, without leading zeros",
        )
    if not DECIMAL.match(text):
        return text
    number = float(text)
    if len(text) > LONGEST or abs(number) == float("inf"):
        raise ScalarError("this number is too large", "check the number of digits")
    return int(text) if INTEGER.match(text) else number


def _octal(text: str) -> str:
    try:
        digits = text.lower().replace("_", "")
        return f"{int(digits, 0 if digits.strip('+-0')[:1] in ('o', 'x', 'b') else 8)}"
    except ValueError:
        return "an octal number"
