"""One question on the last line of the screen."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.screen import ModalScreen
from textual.widgets import Input, Label

Asked = Callable[[str | None], None]


class Prompt(ModalScreen[str | None]):
    """Gives the line back on enter, None on escape."""

    CSS = """
    Prompt { align: left bottom; background: transparent; }
    Prompt Horizontal { height: 1; width: 100%; }
    Prompt Label { width: auto; text-style: bold; padding: 0 1; }
    Prompt Input { width: 1fr; border: none; height: 1; padding: 0; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "give_up", "leave")]

    def __init__(self, question: str, first: str) -> None:
        super().__init__()
        self.question, self.first = question, first

    def compose(self) -> ComposeResult:
        """The question and a field."""
        with Horizontal():
            yield Label(self.question, markup=False)
            yield Input(self.first, select_on_focus=False)

    def on_mount(self) -> None:
        """The field has the keys from the first moment on."""
        self.query_one(Input).focus()

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """The answer."""
        self.dismiss(event.value)

    def action_give_up(self) -> None:
        """No answer."""
        self.dismiss(None)
