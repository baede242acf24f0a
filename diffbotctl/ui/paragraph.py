"""Sentences that fit the narrowest terminal in common use, folded between words."""

from __future__ import annotations

from diffbotctl.errors import WIDTH


def folded(text: str, hang: int = 0, width: int = WIDTH) -> str:
    """Each line of `text` within `width` columns; what is folded keeps its line's indentation.

    `hang`: columns by which continued lines stand further in. A word that is longer than a line,
    such as a path, stays whole, so that it can be copied.
    """
    return "\n".join(part for line in text.split("\n") for part in _parts(line, hang, width))


def _parts(line: str, hang: int, width: int) -> list[str]:
    from textwrap import wrap

    if len(line) <= width:
        return [line]
    indent = " " * (len(line) - len(line.lstrip(" ")))
    return wrap(
        line.strip(" "),
        width,
        initial_indent=indent,
        subsequent_indent=indent + " " * hang,
        break_long_words=False,
        break_on_hyphens=False,
    )
