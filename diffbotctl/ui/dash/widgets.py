"""The map as a widget: click or drag sets a goal, the wheel zooms, the right button pans.

One question on the last line of the screen.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, hypot
from typing import ClassVar

from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.message import Message
from textual.screen import ModalScreen
from textual.widget import Widget
from textual.widgets import Input, Label

from diffbotctl.ui.dash.state import RunView
from diffbotctl.ui.map import layers
from diffbotctl.ui.map.canvas import Camera, Point

ZOOM_STEP = 1.25  # a step of the wheel
FIT_SCALE_RATIO = 0.9  # of the scale that would just fit, so that the map stands still for a while
REFIT_SCALE_RATIO = 0.6  # of it; smaller, the map is drawn closer
CENTRE_TOLERANCE_DOTS = 1.0  # dots that the middle may be off all the same
DRAG_MIN_CHARACTERS = 1.5  # characters; a shorter drag is a click that shook


class MapBox(Widget):
    """Shows a Sight. `camera` None: everything is kept in view. `follows`: the robot is."""

    DEFAULT_CSS = "MapBox { width: 1fr; height: 1fr; }"

    class Pointed(Message):
        """A person chose a place (m, odom), and a heading (rad) if they dragged."""

        def __init__(self, at: Point, heading: float | None) -> None:
            super().__init__()
            self.at, self.heading = at, heading

    def __init__(self, plain: bool) -> None:
        super().__init__()
        self.plain = plain
        self.sight: RunView | None = None
        self.camera: Camera | None = None
        self.fitted: tuple[Camera, int, int] | None = None  # and the window that it was made for
        self.used: Camera | None = None  # with which the map was last drawn
        self.follows = False
        self.pressed: tuple[float, float] | None = None  # where the left button went down
        self.dragged: tuple[float, float] | None = None  # where the mouse is since
        self.panning: tuple[float, float] | None = None

    def render(self) -> Text:
        """The map, with the goal that is being dragged."""
        width, height = self.size
        if self.sight is None or width < 1 or height < 1:
            return Text("")
        self.used = self._camera(self.sight, width, height)
        drawing = layers.draw_map(
            self.sight.scene,
            self.sight.picture,
            self.sight.trail.places,
            self.used,
            width,
            height,
            self.plain,
            self.sight.sheet,
        )
        if self.pressed is not None:
            at, heading = self._goal(self.pressed, self.dragged or self.pressed)
            layers.mark_goal(drawing, at, heading)
        return drawing.text()

    def see(self, sight: RunView) -> None:
        """Draw this."""
        self.sight = sight
        self.refresh()

    def zoom(self, factor: float) -> None:
        """Closer by `factor`."""
        if self.used is not None:
            self.camera = self.used.zoomed(factor)
            self.refresh()

    def pan(self, columns: float, rows: float) -> None:
        """Look farther to the right and down."""
        if self.used is not None:
            self.follows, self.camera = False, self.used.moved(columns, rows)
            self.refresh()

    def fit(self) -> None:
        """Keep everything in view."""
        self.follows, self.camera = False, None
        self.refresh()

    def follow(self) -> None:
        """Keep the robot in the middle, or no longer."""
        self.follows = not self.follows
        self.camera = self.used if self.follows else None
        self.refresh()

    def on_mouse_down(self, event: events.MouseDown) -> None:
        """Left: a goal. Right or middle: pan."""
        if event.button == 1:
            self.pressed, self.dragged = (event.x, event.y), None
        else:
            self.panning = (event.x, event.y)
        self.capture_mouse()

    def on_mouse_move(self, event: events.MouseMove) -> None:
        """The heading, or the pan, under way."""
        if self.pressed is not None:
            self.dragged = (event.x, event.y)
            self.refresh()
        elif self.panning is not None:
            self.pan(self.panning[0] - event.x, self.panning[1] - event.y)
            self.panning = (event.x, event.y)

    def on_mouse_up(self, event: events.MouseUp) -> None:
        """The goal is chosen."""
        self.release_mouse()
        if self.pressed is not None and self.used is not None:
            at, heading = self._goal(self.pressed, (event.x, event.y))
            self.post_message(self.Pointed(at, heading))
        self.pressed = self.dragged = self.panning = None
        self.refresh()

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        """Closer."""
        self.zoom(ZOOM_STEP)

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        """Farther away."""
        self.zoom(1 / ZOOM_STEP)

    def _goal(
        self, start: tuple[float, float], end: tuple[float, float]
    ) -> tuple[Point, float | None]:
        assert self.used is not None
        width, height = self.size
        at = self.used.place(*start, width, height)
        if hypot(end[0] - start[0], 2 * (end[1] - start[1])) < DRAG_MIN_CHARACTERS:
            return at, None
        to = self.used.place(*end, width, height)
        return at, atan2(to[1] - at[1], to[0] - at[0])

    def _camera(self, sight: RunView, width: int, height: int) -> Camera:
        if self.pressed is not None and self.used is not None:
            return self.used  # the floor must not move under the mouse
        if self.camera is None:
            return self._fitted(sight, width, height)
        if self.follows and sight.trail.places:
            x, y = sight.trail.places[-1]
            return self.camera._replace(x=x, y=y)
        return self.camera

    def _fitted(self, sight: RunView, width: int, height: int) -> Camera:
        """A camera that has all in view; the one in use stays as long as it is about right."""
        wanted = layers.overview_camera(
            sight.scene, sight.picture, sight.trail.places, width, height
        )
        last = self.fitted
        if last is not None and last[1:] == (width, height):
            off = hypot(wanted.x - last[0].x, wanted.y - last[0].y) * wanted.scale
            closer = last[0].scale / wanted.scale
            if (
                REFIT_SCALE_RATIO < closer <= 1.0
                and off < (1.0 - closer) * min(width, height) + CENTRE_TOLERANCE_DOTS
            ):
                return last[0]
        camera = wanted._replace(scale=wanted.scale * FIT_SCALE_RATIO)
        self.fitted = (camera, width, height)
        return camera


OnInput = Callable[[str | None], None]


class InputPrompt(ModalScreen[str | None]):
    """Gives the line back on enter, None on escape."""

    CSS = """
    InputPrompt { align: left bottom; background: transparent; }
    InputPrompt Horizontal { height: 1; width: 100%; }
    InputPrompt Label { width: auto; text-style: bold; padding: 0 1; }
    InputPrompt Input { width: 1fr; border: none; height: 1; padding: 0; }
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
