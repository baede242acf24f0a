"""`diffbotctl teleop`: the keys drive, and a dozen facts say what comes of it."""

from __future__ import annotations

from rich.console import Group
from rich.text import Text
from textual.app import ComposeResult
from textual.widgets import Static

from diffbotctl.ui.dash import panels
from diffbotctl.ui.dash.panels import facts_panel
from diffbotctl.ui.engine_app import EngineApp

HELP = "t other keys   b hold/latched   r resume   space stop   ctrl-c leave"
OWN = {"t": "next_keys", "b": "next_mode"}
WIDEST = 60  # characters of the facts


class Teleop(EngineApp):
    """Keys, speeds and facts; no map."""

    CSS = "Screen { overflow: hidden; }"

    def compose(self) -> ComposeResult:
        """One widget with everything."""
        yield Static(id="all")

    def own_key(self, key: str) -> bool:
        """What is no driving."""
        if key == "r":
            self.do("resume")
        elif key in OWN:
            getattr(self, OWN[key])()
        else:
            return False
        return True

    def show(self) -> None:
        """Draw it all anew."""
        if self.reins is None:
            return
        plain = self.wishes.ascii_only
        rows = [
            panels.title_line(self.sight),
            panels.stop_banner(self.sight),
            panels.keyboard_line(self.reins),
        ]
        self.query_one("#all", Static).update(
            Group(
                *rows,
                Text(self.reins.hand.keys.help, "dim", no_wrap=True),
                Text(HELP, "dim", no_wrap=True),
                Text(self.said, "yellow", no_wrap=True, overflow="ellipsis"),
                facts_panel(self.sight, min(self.size.width, WIDEST), plain),
            )
        )
