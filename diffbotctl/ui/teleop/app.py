"""`diffbotctl teleop`: the keys drive; a screen of facts shows the effect."""

from __future__ import annotations

from rich.console import Group
from rich.text import Text
from textual.app import ComposeResult
from textual.widgets import Static

from diffbotctl.ui.dash import panels
from diffbotctl.ui.dash.facts import facts_panel
from diffbotctl.ui.engine_app import EngineApp

HELP = "r resume   space stop   ctrl-c leave"
LATCH_HELP = "b hold/latched"
FACTS_MAX_WIDTH, HEAD_ROWS = 60, 8  # characters; rows above the facts, with a stop


class Teleop(EngineApp):
    """Keys, speeds and facts; no map."""

    CSS = "Screen { overflow: hidden; }"

    def compose(self) -> ComposeResult:
        yield Static(id="all")

    def handle_key(self, key: str) -> bool:
        """The keys that do not drive."""
        actions = {
            "r": lambda: self.request("resume"),
            "t": self.next_key_set,
            "b": self.next_mode,
        }
        if key in actions:
            actions[key]()
        return key in actions

    def draw_run(self) -> None:
        if not self.is_connected:
            return
        width = min(self.size.width, FACTS_MAX_WIDTH)
        rows = max(self.size.height - HEAD_ROWS, 1)
        keys = ["t other letters", *([LATCH_HELP] if "latch" in self.met_needs else []), HELP]
        lines = (
            panels.title_line(self.run_view),
            panels.stop_banner(self.run_view),
            panels.keyboard_line(self.deadman, self.size.width),
            Text(self.keyboard.keys.help, "dim", no_wrap=True),
            Text("   ".join(keys), "dim", no_wrap=True),
            Text(self.status, "yellow", no_wrap=True, overflow="ellipsis"),
            facts_panel(self.run_view, width, rows, self.options.ascii_only),
        )
        self.query_one("#all", Static).update(Group(*lines))
