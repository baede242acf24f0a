"""Rich's console, on which no text from elsewhere can write an escape sequence."""

from __future__ import annotations

from collections.abc import Iterable
from typing import IO, Any

from rich.console import Console
from rich.segment import Segment

from diffbotctl.printable import PrintableStream, RawStream, printable


class PrintableConsole(Console):
    """A console whose texts are printable; its own sequences for colours and places are written."""

    @property
    def file(self) -> Any:
        """Where the console writes: standard output as it is, without its own filter."""
        stream = super().file
        return RawStream(stream) if isinstance(stream, PrintableStream) else stream

    @file.setter
    def file(self, stream: IO[str]) -> None:
        self._file = stream

    def _render_buffer(self, buffer: Iterable[Segment]) -> str:
        """The texts of the buffer, with the sequences of their styles."""
        return super()._render_buffer(
            segment if segment.control else Segment(printable(segment.text), segment.style)
            for segment in buffer
        )
