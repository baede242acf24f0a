"""`diffbotctl dash`: a run on one screen, driven with keys and mouse."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import ClassVar, assert_never

from rich.console import Group, RenderableType
from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.containers import Horizontal
from textual.screen import Screen
from textual.widgets import Static

from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.errors import closest_match
from diffbotctl.time import SECOND
from diffbotctl.ui.dash import panels
from diffbotctl.ui.dash.facts import facts_panel
from diffbotctl.ui.dash.key_help import help_line, help_panel
from diffbotctl.ui.dash.panels import PANELS, PanelName
from diffbotctl.ui.dash.state import Request, RunView
from diffbotctl.ui.dash.widgets import ZOOM_STEP, InputPrompt, MapBox, OnInput
from diffbotctl.ui.engine_app import EngineApp, ScreenOptions
from diffbotctl.ui.plot.canvas import BRAILLE
from diffbotctl.ui.saved_view import PLOT_SPAN_MAX_S, PLOT_SPAN_MIN_S, ViewSettings, save_view
from diffbotctl.units import UnitError, parse_pose

FACTS_WIDTH, FACTS_WIDTH_WIDE = 33, 44  # characters
WIDE_MIN_WIDTH, WIDE_MIN_HEIGHT = 110, 36  # from here plots, blocks and log are below the map
HIGH_MIN_HEIGHT = 55  # from here the parameters too
DEFAULT_PLOTS = 3  # fields that are plotted until the user chooses
PAN_CHARACTERS = 4  # a key press
# Plots are drawn when time has moved by a dot; their numbers cannot be read faster than this.
PLOT_PERIOD_MIN_S = 0.2
VIEW_FILE = "view.yaml"  # unless the user writes another name


class Dashboard(EngineApp):
    """Map and facts; the other panels in place of the map, or below it on a large screen."""

    CSS = """
    Screen { layout: vertical; overflow: hidden; }
    #title, #keyboard, #help { height: 1; width: 100%; }
    #status { height: auto; min-height: 1; max-height: 3; width: 100%; }
    #banner { display: none; height: auto; max-height: 3; width: 100%; }
    #body { height: 1fr; }
    #view { width: 1fr; height: 1fr; display: none; padding: 0 1; }
    #facts { height: 1fr; padding: 0 0 0 1; }
    #below { height: 12; display: none; border-top: solid $primary; }
    #below Static { width: 1fr; height: 100%; padding: 0 1; }
    #below #blocks { width: 46; }
    #more { height: 14; display: none; border-top: solid $primary; padding: 0 1; }
    """
    slow_requests: ClassVar[tuple[Request, ...]] = (
        "list_topics",
        "list_blocks",
        "read_log",
        "list_parameters",
    )

    def __init__(
        self,
        engine: EngineAddress,
        tool: str,
        options: ScreenOptions,
        view: ViewSettings | None = None,
    ) -> None:
        super().__init__(engine, tool, options)
        self.view = view or ViewSettings()  # at the start
        self.panel: PanelName = self.view.panel
        self.fields = list(self.view.fields)  # that are plotted
        self.plot_span = self.view.span
        self.selected = 0  # row of the parameters
        self.is_wide = self.is_high = False
        self.drawn: dict[str, object] = {}  # content of each widget, or what it was made from

    def compose(self) -> ComposeResult:
        """Title, stop, map and facts, the panels below, keys."""
        yield Static(id="title")
        yield Static(id="banner")
        with Horizontal(id="body"):
            yield MapBox(self.options.ascii_only, self.view.place, self.view.follows)
            yield Static(id="view")
            yield Static(id="facts")
        with Horizontal(id="below"):
            yield Static(id="plots")
            yield Static(id="blocks")
            yield Static(id="log")
        yield Static(id="more")
        yield Static(id="status")
        yield Static(id="keyboard")
        yield Static(id="help")

    async def on_mount(self) -> None:
        """Lay out; then textual calls the on_mount of EngineApp, which connects."""
        if self.options.ascii_only:
            for name in ("#below", "#more"):
                self.main.query_one(name).styles.border_top = ("ascii", "white")
        self._lay_out(self.size.width, self.size.height)

    def on_resize(self, event: events.Resize) -> None:
        """Lay out for the new size."""
        self._lay_out(event.size.width, event.size.height)
        self.redraw()

    def _lay_out(self, width: int, height: int) -> None:
        self.is_wide = width >= WIDE_MIN_WIDTH and height >= WIDE_MIN_HEIGHT
        self.is_high = self.is_wide and height >= HIGH_MIN_HEIGHT
        facts_width = FACTS_WIDTH_WIDE if width >= WIDE_MIN_WIDTH else FACTS_WIDTH
        self.main.query_one("#facts").styles.width = facts_width
        self._set_shown("#below", self.is_wide)
        self._set_shown("#more", self.is_high)

    def _set_shown(self, selector: str, is_shown: bool) -> None:
        self.main.query_one(selector).styles.display = "block" if is_shown else "none"

    # Drawing.

    @property
    def main(self) -> Screen[object]:
        """The screen below a prompt."""
        return self.screen_stack[0]

    def draw_run(self) -> None:
        if not self.is_connected:
            return
        panel: PanelName = (
            "log" if self.panel == "map" and not self.run_view.has_map else self.panel
        )
        is_map, plain = panel == "map", self.options.ascii_only
        self._put("title", panels.title_line(self.run_view))
        self._set_shown("#banner", self.run_view.held is not None)
        self._put("banner", panels.stop_banner(self.run_view), resizes=True)
        has_facts = is_map or self.size.width >= WIDE_MIN_WIDTH
        self._set_shown("#facts", has_facts)
        if has_facts:
            size = self.main.query_one("#facts").size
            width, height = max(size.width, FACTS_WIDTH) - 1, size.height
            self._put("facts", facts_panel(self.run_view, width, height, plain))
        self._set_shown("MapBox", is_map)
        self._set_shown("#view", not is_map)
        if is_map:
            self.main.query_one(MapBox).show(self.run_view)
        else:
            self._draw_panel("view", panel)
        if self.is_wide:
            self._draw_panel("plots", "plots")
            self._draw_panel("blocks", "blocks")
            self._draw_panel("log", "log")
        if self.is_high:
            self._draw_panel("more", "parameters")
        self._put("status", Text(self.status, "yellow"), resizes=True)
        width = self.size.width
        met = self.met_needs
        keys = panels.keyboard_line(self.deadman, width) if "drive" in met else Text()
        self._put("keyboard", keys)
        self._put("help", Text(help_line(width, met), no_wrap=True))

    def _draw_panel(self, widget: str, panel: PanelName) -> None:
        """Draw a panel in a widget, if what it shows may have changed since."""
        size = self.main.query_one(f"#{widget}", Static).size
        time: float = self.last_slow_poll
        if panel == "plots":
            period = max(self.plot_span / max(size.width * BRAILLE.across, 1), PLOT_PERIOD_MIN_S)
            time = self.run_view.snapshot.time // round(period * SECOND)
        state = (panel, size, time, self.selected, tuple(self.fields), self.plot_span)
        if self.drawn.get(widget) != state:
            self.drawn[widget] = state
            self._update(widget, self._render_panel(panel, size.width, size.height))

    def _put(self, widget: str, content: RenderableType, resizes: bool = False) -> None:
        """Draw what is fast to make, if it differs from the content of the widget."""
        if not isinstance(content, Text) or self.drawn.get(widget) != content:
            self.drawn[widget] = content
            self._update(widget, content, resizes)

    def _update(self, widget: str, content: RenderableType, resizes: bool = False) -> None:
        # In a group: textual converts a bare text to its own kind, which wraps. Only what may
        # change its size causes a new layout, which takes longer than all drawing.
        self.main.query_one(f"#{widget}", Static).update(Group(content), layout=resizes)

    def _render_panel(self, panel: PanelName, width: int, height: int) -> RenderableType:
        view, plain = self.run_view, self.options.ascii_only
        match panel:
            case "plots":
                span, height = self.plot_span, max(height, 4)
                return panels.plots_panel(view, self.plotted, span, width, height, plain)
            case "blocks":
                return panels.blocks_panel(view, width, height)
            case "parameters":
                return panels.parameters_panel(view, self.selected, width, height)
            case "help":
                return help_panel(self.keyboard.keys.help, self.met_needs)
            case "log":
                return panels.log_panel(view, width, max(height, 1))
            case "map":
                return Text()  # a widget of its own
        assert_never(panel)

    @property
    def plotted(self) -> list[str]:
        """The fields that are plotted: the chosen ones, else defaults."""
        return self.fields or default_fields(self.run_view)

    def plotted_topics(self) -> set[str]:
        return {name.rpartition(".")[0] for name in self.plotted}

    # Keys and mouse.

    def handle_key(self, key: str) -> bool:
        """The keys that do not drive."""
        if self.panel == "parameters" and self._handle_parameter_key(key):
            return True
        if self.panel == "log" and key == "enter":
            self.ask("log: BLOCK LEVEL, such as guard debug or * info:", "", self._set_log_level)
            return True
        action = self._key_actions().get(key)
        if action is not None:
            action()
        return action is not None

    def _key_actions(self) -> dict[str, Callable[[], None]]:
        box = self.main.query_one(MapBox)
        return {
            **{str(n): partial(self.show_panel, panel) for n, panel in enumerate(PANELS, 1)},
            "escape": partial(self.show_panel, "map"),
            "?": partial(self.show_panel, "map" if self.panel == "help" else "help"),
            "n": self.show_next_panel,
            "<": partial(self.scale_plots, 0.5),
            ">": partial(self.scale_plots, 2.0),
            "g": self.ask_goal,
            "v": self.ask_view_file,
            "p": self.ask_fields,
            "r": partial(self.request, "resume"),
            "t": self.next_key_set,
            "b": self.next_mode,
            "f": box.follow,
            "0": box.fit,
            "]": partial(box.zoom, ZOOM_STEP),
            "[": partial(box.zoom, 1 / ZOOM_STEP),
            "{": partial(box.pan, -PAN_CHARACTERS, 0),
            "}": partial(box.pan, PAN_CHARACTERS, 0),
            "(": partial(box.pan, 0, -PAN_CHARACTERS),
            ")": partial(box.pan, 0, PAN_CHARACTERS),
        }

    def _handle_parameter_key(self, key: str) -> bool:
        rows = self.run_view.live_parameters
        if key in ("up", "down"):
            step = 1 if key == "down" else -1
            self.selected = min(max(self.selected + step, 0), max(len(rows) - 1, 0))
        elif key == "enter" and rows:
            row = rows[self.selected]
            question = f"{row['parameter']} ({row['unit']}) ="
            self.ask(question, str(row["value"]), self._set_parameter)
        else:
            return False
        return True

    def show_panel(self, panel: PanelName) -> None:
        self.panel = panel
        self.redraw()

    def show_next_panel(self) -> None:
        index = PANELS.index(self.panel) if self.panel in PANELS else -1
        self.show_panel(PANELS[(index + 1) % len(PANELS)])

    def scale_plots(self, factor: float) -> None:
        """Show more or less of the past in the plots."""
        self.plot_span = min(max(self.plot_span * factor, PLOT_SPAN_MIN_S), PLOT_SPAN_MAX_S)

    def on_map_box_pointed(self, event: MapBox.Pointed) -> None:
        """A click or drag on the map: set a goal there, or state that the robot is there."""
        if self.run_view.asks_place:
            self.request("call_action", **self.run_view.place_call(*event.place, event.heading))
        else:
            self._go_to(*event.place, event.heading)

    def ask(self, question: str, initial: str, on_input: OnInput) -> None:
        """Ask for a line of text below the map."""
        self.deadman.release()  # the keys are letters now
        self.push_screen(InputPrompt(question, initial), on_input)

    def ask_goal(self) -> None:
        if "goal" not in self.met_needs:
            self.status = "no block of this pipeline follows goals"
            return
        self.ask("goal: X Y [HEADING], such as 1.0 0.5 90deg:", "", self._set_goal)

    def ask_fields(self) -> None:
        self.ask("plot (block.port.field ...):", " ".join(self.plotted), self._set_fields)

    def ask_view_file(self) -> None:
        self.ask("save this view as:", VIEW_FILE, self._save_view)

    def _save_view(self, text: str | None) -> None:
        if not text or not text.strip():
            return
        box = self.main.query_one(MapBox)
        panel = self.panel if self.panel != "help" else "map"
        view = ViewSettings(panel, tuple(self.plotted), self.plot_span, box.place(), box.follows)
        self.status = save_view(Path(text.strip()), view)

    def _set_goal(self, text: str | None) -> None:
        if not text or not text.strip():
            return
        try:
            x, y, heading = parse_pose(text)
        except UnitError as error:
            self.status = f"{text}: {error}"
            return
        self._go_to(x, y, heading)

    def _go_to(self, x: float, y: float, heading: float | None) -> None:
        fields = {} if heading is None else {"heading": heading}
        self.request("goto", x=x, y=y, **fields)

    def _set_fields(self, text: str | None) -> None:
        if text is None:
            return
        available, names = self.run_view.fields, text.split()
        self.fields = [name for name in names if name in available]
        unknown = next((name for name in names if name not in available), None)
        if unknown is not None:
            match = closest_match(unknown, available)
            self.status = f"there is no {unknown}" + (f"; did you mean {match}?" if match else "")

    def _set_log_level(self, text: str | None) -> None:
        parts = (text or "").split()
        if len(parts) == 2:
            self.request("set_log_level", block=parts[0], level=parts[1])
        elif parts:
            self.status = f"{text}: give a block or * and a level"

    def _set_parameter(self, text: str | None) -> None:
        rows = self.run_view.live_parameters
        if text is not None and rows:
            self.last_slow_poll = 0.0
            self.request("set_parameter", parameter=rows[self.selected]["parameter"], value=text)


def default_fields(view: RunView) -> list[str]:
    """What is plotted until the user chooses: the wheels, else the first fields."""
    wheels = [
        name
        for end in ("gate.wheels.left", "gate.wheels.right")
        for name in view.fields
        if name.endswith(end)
    ]
    return (wheels or view.fields)[:DEFAULT_PLOTS]
