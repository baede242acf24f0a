"""Pictures as SVG: text that any browser shows, the same for the same picture."""

from __future__ import annotations

from xml.sax.saxutils import escape, quoteattr

from diffbotctl.ui.figure import SIZE, Figure, Line, Words

FONT = "system-ui, sans-serif"


def encode(picture: Figure) -> bytes:
    """The picture as an SVG document."""
    size = f'width="{picture.width}" height="{picture.height}"'
    box = f'viewBox="0 0 {picture.width} {picture.height}"'
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} {box} '
        f'font-family="{FONT}" font-size="{SIZE}">'
    )
    ground = '<rect width="100%" height="100%" fill="white"/>'
    body = [_line(each) if isinstance(each, Line) else _words(each) for each in picture.shapes]
    return "\n".join([head, ground, *body, "</svg>", ""]).encode()


def _line(line: Line) -> str:
    points = " ".join(f"{x:.2f},{y:.2f}" for x, y in line.points)
    ink = f"stroke={quoteattr(line.colour)} stroke-width={quoteattr(f'{line.width:g}')}"
    return f'<polyline points="{points}" fill="none" {ink} stroke-linejoin="round"/>'


def _words(words: Words) -> str:
    place = f'x="{words.x:.2f}" y="{words.y:.2f}" text-anchor={quoteattr(words.anchor)}'
    return f"<text {place} fill={quoteattr(words.colour)}>{escape(words.text)}</text>"
