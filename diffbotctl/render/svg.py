"""Pictures as SVG: marks, and the document around them. Text that any browser shows."""

from __future__ import annotations

from collections.abc import Iterable
from xml.sax.saxutils import escape, quoteattr

Point = tuple[float, float]


def mark(kind: str, *inside: str, **looks: object) -> str:
    """One mark, such as `line` or `circle`, with the marks `inside` it.

    A look's name has `_` where SVG has `-`, and one behind a word of Python's (`class_`); None
    leaves it out. Numbers are lengths in pixels, to a hundredth.
    """
    said = "".join(
        f" {name.rstrip('_').replace('_', '-')}={quoteattr(number(value))}"
        for name, value in looks.items()
        if value is not None
    )
    return f"<{kind}{said}>{''.join(inside)}</{kind}>" if inside else f"<{kind}{said}/>"


def words(x: float, y: float, text: str, **looks: object) -> str:
    """A text whose base line is at y."""
    return mark("text", escape(text), x=x, y=y, **looks)


def points(places: Iterable[Point]) -> str:
    """The corners of a polyline or polygon."""
    return " ".join(f"{number(x)},{number(y)}" for x, y in places)


def document(
    width: float, height: float, marks: Iterable[str], paper: str = "white", **looks: object
) -> str:
    """A whole picture on coloured paper; what comes later lies on top."""
    width, height = round(width), round(height)
    ground = mark("rect", width="100%", height="100%", fill=paper)
    inside = "\n".join(["", "<!-- diffbotctl -->", ground, *marks, ""])
    box = f"0 0 {width} {height}"
    return (
        mark(
            "svg",
            inside,
            xmlns="http://www.w3.org/2000/svg",
            width=width,
            height=height,
            viewBox=box,
            **looks,
        )
        + "\n"
    )


def number(value: object) -> str:
    """A number as SVG has it, as short as it can be; anything else as its text."""
    if not isinstance(value, float):
        return str(value)
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
