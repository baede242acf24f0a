"""`diffbotctl dash`: a run on one screen, and a person's hands on it."""

from __future__ import annotations

from typing import ClassVar

from rich.console import Group, RenderableType
from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.binding import BindingType
from textual.containers import Horizontal
from textual.screen import Screen
from textual.widgets import Static

from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.ui.dash import panels
from diffbotctl.ui.dash.key_bindings import HELP, VIEWS, help_page, press
from diffbotctl.ui.dash.panels import facts_panel
from diffbotctl.ui.dash.state import LOG_MAX_LINES, RunView
from diffbotctl.ui.dash.widgets import InputPrompt, MapBox, OnInput
from diffbotctl.ui.engine_app import EngineApp, ScreenOptions

SIDE, WIDE_SIDE = 32, 44  # characters of the facts
WIDE, HIGH = 110, 36  # from this size on plots, blocks and log have a place below the map
HIGHEST = 55  # and from this height on the parameters too
PLOTS = 3  # fields that are plotted until somebody chooses


class Dashboard(EngineApp):
    """Map and facts; the other views in place of the map, or below it where there is room."""

    CSS = """
    Screen { layout: vertical; overflow: hidden; }
    #title, #hand, #said, #help { height: 1; width: 100%; }
    #banner { display: none; height: auto; max-height: 3; width: 100%; }
    #body { height: 1fr; }
    #view { width: 1fr; height: 1fr; display: none; padding: 0 1; }
    #facts { height: 1fr; }
    #below { height: 12; display: none; border-top: solid $primary; }
    #below Static { width: 1fr; height: 100%; padding: 0 1; }
    #more { height: 14; display: none; border-top: solid $primary; padding: 0 1; }
    """
    BINDINGS: ClassVar[list[BindingType]] = []

    def __init__(
        self, engine: EngineAddress, tool: str, wishes: ScreenOptions, fields: list[str]
    ) -> None:
        super().__init__(engine, tool, wishes)
        self.view = "map"
        self.fields = fields
        self.chosen = 0  # the parameter that is marked
        self.is_wide = self.is_highest = False
        self.drawn: dict[str, object] = {}  # what stands in each widget, or from what it was made

    def compose(self) -> ComposeResult:
        """Title, stop, map and facts, what is below, keys."""
        yield Static(id="title")
        yield Static(id="banner")
        with Horizontal(id="body"):
            yield MapBox(self.wishes.ascii_only)
            yield Static(id="view")
            yield Static(id="facts")
        with Horizontal(id="below"):
            yield Static(id="plots")
            yield Static(id="blocks")
            yield Static(id="log")
        yield Static(id="more")
        yield Static(id="said")
        yield Static(id="hand")
        yield Static(HELP, id="help")

    async def on_mount(self) -> None:
        """Lay out; then textual calls the cockpit's own on_mount, which connects."""
        if self.wishes.ascii_only:
            for name in ("#below", "#more"):
                self.main.query_one(name).styles.border_top = ("ascii", "white")
        self._lay_out(self.size.width, self.size.height)

    async def look_slowly(self) -> None:
        """Rates, blocks, parameters."""
        await super().look_slowly()
        self.sight.blocks = (await self.caller.ask("blocks"))["blocks"]
        self.sight.take_log(await self.caller.ask("log", last=LOG_MAX_LINES))
        self.sight.parameters = (await self.caller.ask("parameters"))["parameters"]
        if not self.fields:
            self.fields = first_fields(self.sight)

    def on_resize(self, event: events.Resize) -> None:
        """Use the room there is."""
        self._lay_out(event.size.width, event.size.height)
        self.draw()

    def _lay_out(self, width: int, height: int) -> None:
        self.is_wide = width >= WIDE and height >= HIGH
        self.is_highest = self.is_wide and height >= HIGHEST
        self.main.query_one("#facts").styles.width = WIDE_SIDE if width >= WIDE else SIDE
        self.main.query_one("#below").styles.display = "block" if self.is_wide else "none"
        self.main.query_one("#more").styles.display = "block" if self.is_highest else "none"

    # Drawing.

    @property
    def main(self) -> Screen[object]:
        """The screen below any question that is being asked."""
        return self.screen_stack[0]

    def show(self) -> None:
        """Draw what is known now."""
        if self.reins is None:
            return
        self._put("title", panels.title_line(self.sight))
        held = self.main.query_one("#banner", Static)
        held.styles.display = "block" if self.sight.held else "none"
        self._put("banner", panels.stop_banner(self.sight), resizes=True)
        is_map = self.view == "map"
        side = self.main.query_one("#facts", Static)
        side.styles.display = "block" if is_map or self.size.width >= WIDE else "none"
        if side.display:
            width = max(side.size.width, SIDE) - 1
            self._put("facts", facts_panel(self.sight, width, self.wishes.ascii_only))
        box, view = self.main.query_one(MapBox), self.main.query_one("#view", Static)
        box.styles.display, view.styles.display = ("block", "none") if is_map else ("none", "block")
        if is_map:
            box.see(self.sight)
        else:
            self._pane("view", self.view, 2)
        for name in ("plots", "blocks", "log") if self.is_wide else ():
            self._pane(name, name)
        if self.is_highest:
            self._pane("more", "parameters")
        self._put("said", Text(self.said, "yellow", no_wrap=True, overflow="ellipsis"))
        self._put("hand", panels.keyboard_line(self.reins))

    def _pane(self, name: str, view: str, margin: int = 0) -> None:
        """Draw a view in its pane, if what it shows may have changed since."""
        size = self.main.query_one(f"#{name}", Static).size
        moment = self.sight.picture.time if view == "plots" else self.slow_look
        state = (view, size, moment, self.chosen, tuple(self.fields))
        if self.drawn.get(name) != state:
            self.drawn[name] = state
            self._show(name, self._renderable(view, size.width - margin, size.height), False)

    def _put(self, name: str, what: RenderableType, resizes: bool = False) -> None:
        """Draw what is cheap to make, if it differs from what stands there."""
        if not isinstance(what, Text) or self.drawn.get(name) != what:
            self.drawn[name] = what
            self._show(name, what, resizes)

    def _show(self, name: str, what: RenderableType, resizes: bool) -> None:
        # In a group: textual would make of a bare text its own kind, which wraps. The layout is
        # worked out anew only for what may change its size: that costs more than all drawing.
        self.main.query_one(f"#{name}", Static).update(Group(what), layout=resizes)

    def _renderable(self, name: str, width: int, height: int) -> RenderableType:
        sight, plain = self.sight, self.wishes.ascii_only
        if name == "plots":
            return panels.plots_panel(sight, self.fields, width, max(height, 4), plain)
        if name == "blocks":
            return panels.blocks_panel(sight, height)
        if name == "parameters":
            return panels.parameters_panel(sight, self.chosen, height)
        if name == "help":
            return help_page(self.reins.hand.keys.help if self.reins else "")
        return panels.log_panel(sight, max(height, 1))

    # Keys and mouse.

    def own_key(self, key: str) -> bool:
        """What is no driving."""
        if self.view == "parameters" and self._parameter_key(key):
            return True
        if self.view == "log" and key == "enter":
            self.ask("log: BLOCK LEVEL, such as guard debug, * info:", "", self._hear)
            return True
        return press(self, key)

    def _parameter_key(self, key: str) -> bool:
        rows = panels.live_parameters(self.sight)
        if key in ("up", "down"):
            step = 1 if key == "down" else -1
            self.chosen = min(max(self.chosen + step, 0), max(len(rows) - 1, 0))
        elif key == "enter" and rows:
            row = rows[self.chosen]
            self.ask(f"{row['parameter']} ({row['unit']}) =", str(row["value"]), self._set)
        else:
            return False
        return True

    def turn_to(self, view: str) -> None:
        """Show another view in place of the map."""
        self.view = view
        self.draw()

    def next_view(self) -> None:
        """The next of VIEWS."""
        at = VIEWS.index(self.view) if self.view in VIEWS else -1
        self.turn_to(VIEWS[(at + 1) % len(VIEWS)])

    def on_map_box_pointed(self, event: MapBox.Pointed) -> None:
        """A click or drag on the map: go there."""
        heading = {} if event.heading is None else {"heading": event.heading}
        self.do("goto", x=event.at[0], y=event.at[1], **heading)

    def ask(self, question: str, first: str, answer: OnInput) -> None:
        """Ask for a line of text below the map."""
        if self.reins is not None:
            self.reins.release()  # the keys are letters now
        self.push_screen(InputPrompt(question, first), answer)

    def ask_goal(self) -> None:
        """A goal in numbers."""
        self.ask("goal: X Y [HEADING], such as 1.0 0.5 90deg:", "", self._goal)

    def ask_fields(self) -> None:
        """The fields to plot."""
        self.ask("plot (block.port.field ...):", " ".join(self.fields), self._choose)

    def _goal(self, text: str | None) -> None:
        from diffbotctl.units import UnitError, quantity

        parts = (text or "").replace(",", " ").split()
        if not parts:
            return
        try:
            if not 2 <= len(parts) <= 3:
                raise UnitError("give X Y and, if you like, a heading")
            values = [quantity(part, "m") for part in parts[:2]]
            heading = {"heading": quantity(parts[2], "rad")} if len(parts) == 3 else {}
        except UnitError as error:
            self.said = f"{text}: {error}"
            return
        self.do("goto", x=values[0], y=values[1], **heading)

    def _choose(self, text: str | None) -> None:
        if text is None:
            return
        from diffbotctl.errors import closest_match

        known = self.sight.fields
        self.fields = [name for name in text.split() if name in known]
        wrong = [name for name in text.split() if name not in known]
        if wrong:
            near = closest_match(wrong[0], known)
            self.said = f"there is no {wrong[0]}" + (f"; did you mean {near}?" if near else "")

    def _hear(self, text: str | None) -> None:
        """Hear a block in the log from a level on."""
        parts = (text or "").split()
        if len(parts) == 2:
            self.do("log_level", block=parts[0], level=parts[1])
        elif parts:
            self.said = f"{text}: give a block, or *, and a level"

    def _set(self, text: str | None) -> None:
        rows = panels.live_parameters(self.sight)
        if text is not None and rows:
            self.slow_look = 0.0
            self.do("set", parameter=rows[self.chosen]["parameter"], value=text)


def first_fields(sight: RunView) -> list[str]:
    """What is plotted until somebody chooses: the wheels, else whatever there is."""
    wanted = ("gate.wheels.left", "gate.wheels.right")
    found = [name for end in wanted for name in sight.fields if name.endswith(end)]
    return (found or sight.fields)[:PLOTS]
