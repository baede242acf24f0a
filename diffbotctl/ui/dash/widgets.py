"""The dashboard's own widgets: the map, and a prompt on the last line of the screen.

On the map a click or drag sets a goal, the wheel zooms, the right button pans.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from math import atan2, hypot
from typing import Any, ClassVar, Self

from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.message import Message
from textual.screen import ModalScreen
from textual.strip import Strip
from textual.widget import Widget
from textual.widgets import Input, Label

from diffbotctl.ui.dash.state import RunView
from diffbotctl.ui.map.canvas import DOTS_ACROSS, Camera, Point
from diffbotctl.ui.map.layers import draw_map, mark_goal, overview_camera

ZOOM_STEP = 1.25  # of the mouse wheel
FIT_SCALE_RATIO = 0.9  # of the scale that would just fit, so that the map moves less often
REFIT_SCALE_RATIO = 0.6  # of the fitting scale; below it the map is drawn closer
CENTRE_TOLERANCE_DOTS = 1.0  # distance of the middle from where it should be
DRAG_MIN_CHARACTERS = 1.5  # a shorter drag is a click


@cache
def _style(name: str) -> Style:
    return Style.parse(name)


class MapBox(Widget):
    """The map of a run. `camera` None: everything is kept in view. `follows`: the robot is."""

    DEFAULT_CSS = "MapBox { width: 1fr; height: 1fr; }"

    class Pointed(Message):
        """The user chose a place (m, odom), and a heading (rad) by dragging."""

        def __init__(self, place: Point, heading: float | None) -> None:
            super().__init__()
            self.place, self.heading = place, heading

    def __init__(
        self,
        plain: bool,
        place: tuple[float, float, float] | None = None,
        follows: bool = False,
    ) -> None:
        """`place`: x, y and width in m to show first; None: everything."""
        super().__init__()
        self.plain = plain
        self.run_view: RunView | None = None
        self.camera: Camera | None = None
        self.fitted: tuple[Camera, tuple[int, int]] | None = None  # camera, size of its window
        self.drawn: Camera | None = None  # the camera of the last drawing
        self.drawn_width = 0  # its characters; a map that is hidden has no size
        self.follows = follows
        self.requested = place  # until the size of the window is known
        self.pressed: Point | None = None  # where the left button went down, in characters
        self.dragged: Point | None = None  # where the mouse is since
        self.panning: Point | None = None
        self.strips: list[Strip] = []  # the lines of the picture; empty: to be drawn

    def refresh(self, *arguments: Any, **named: Any) -> Self:
        self.strips = []
        return super().refresh(*arguments, **named)

    def render_line(self, y: int) -> Strip:
        """A line of the picture: as segments, since textual takes long to convert a text."""
        if len(self.strips) != self.size.height:
            self.strips = list(self._draw())
        return (
            self.strips[y]
            if y < len(self.strips)
            else Strip.blank(self.size.width, self.visual_style.rich_style)
        )

    def _draw(self) -> Iterator[Strip]:
        width, height = self.size
        if self.run_view is None or width < 1 or height < 1:
            return
        self.drawn, self.drawn_width = self._camera(self.run_view), width
        canvas = draw_map(self.run_view, self.drawn, width, height, self.plain)
        if self.pressed is not None:
            mark_goal(canvas, *self._goal(self.drawn, self.pressed, self.dragged or self.pressed))
        floor = self.visual_style.rich_style
        for row in range(height):
            segments = (Segment(text, floor + _style(name)) for text, name in canvas.runs(row))
            yield Strip(segments, width)

    def show(self, run_view: RunView) -> None:
        self.run_view = run_view
        self.refresh()

    def place(self) -> tuple[float, float, float] | None:
        """Middle (x, y) and width in m of the part that is shown; None: everything is in view."""
        if self.requested is not None:
            return self.requested
        if self.camera is None or self.drawn is None:
            return None
        return self.drawn.x, self.drawn.y, self.drawn_width * DOTS_ACROSS / self.drawn.scale

    def zoom(self, factor: float) -> None:
        """Closer by `factor`."""
        if self.drawn is not None:
            self.camera = self.drawn.zoomed(factor)
            self.refresh()

    def pan(self, columns: float, rows: float) -> None:
        """Move the window to the right and down, in characters."""
        if self.drawn is not None:
            self.follows, self.camera = False, self.drawn.moved(columns, rows)
            self.refresh()

    def fit(self) -> None:
        """Keep everything in view."""
        self.follows, self.camera = False, None
        self.refresh()

    def follow(self) -> None:
        """Start or end keeping the robot in the middle."""
        self.follows = not self.follows
        self.camera = self.drawn if self.follows else None
        self.refresh()

    def on_mouse_down(self, event: events.MouseDown) -> None:
        """Left: a goal. Right or middle: pan."""
        if event.button == 1:
            self.pressed, self.dragged = (event.x, event.y), None
        else:
            self.panning = (event.x, event.y)
        self.capture_mouse()

    def on_mouse_move(self, event: events.MouseMove) -> None:
        """Update the heading, or pan."""
        if self.pressed is not None:
            self.dragged = (event.x, event.y)
            self.refresh()
        elif self.panning is not None:
            self.pan(self.panning[0] - event.x, self.panning[1] - event.y)
            self.panning = (event.x, event.y)

    def on_mouse_up(self, event: events.MouseUp) -> None:
        """Report the chosen goal."""
        self.release_mouse()
        if self.pressed is not None and self.drawn is not None:
            goal = self._goal(self.drawn, self.pressed, (event.x, event.y))
            self.post_message(self.Pointed(*goal))
        self.pressed = self.dragged = self.panning = None
        self.refresh()

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        self.zoom(ZOOM_STEP)

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        self.zoom(1 / ZOOM_STEP)

    def _goal(self, camera: Camera, start: Point, end: Point) -> tuple[Point, float | None]:
        """Place and heading of a drag between two characters; no heading for a click."""
        place = camera.place(*start, *self.size)
        if hypot(end[0] - start[0], 2 * (end[1] - start[1])) < DRAG_MIN_CHARACTERS:
            return place, None
        target = camera.place(*end, *self.size)
        return place, atan2(target[1] - place[1], target[0] - place[0])

    def _camera(self, run_view: RunView) -> Camera:
        if self.pressed is not None and self.drawn is not None:
            return self.drawn  # the floor must not move under the mouse
        if self.requested is not None:
            x, y, width = self.requested
            self.camera, self.requested = Camera(x, y, self.size.width * DOTS_ACROSS / width), None
        if self.camera is None:
            return self._fitted_camera(run_view)
        if self.follows and run_view.trail.points:
            x, y = run_view.trail.points[-1]
            return self.camera._replace(x=x, y=y)
        return self.camera

    def _fitted_camera(self, run_view: RunView) -> Camera:
        """A camera that has everything in view; the present one while it is about right."""
        size = (self.size.width, self.size.height)
        best = overview_camera(run_view, *size)
        if self.fitted is not None and self.fitted[1] == size:
            last = self.fitted[0]
            offset = hypot(best.x - last.x, best.y - last.y) * best.scale
            ratio = last.scale / best.scale
            tolerance = (1.0 - ratio) * min(size) + CENTRE_TOLERANCE_DOTS
            if REFIT_SCALE_RATIO < ratio <= 1.0 and offset < tolerance:
                return last
        camera = best._replace(scale=best.scale * FIT_SCALE_RATIO)
        self.fitted = (camera, size)
        return camera


OnInput = Callable[[str | None], None]


class InputPrompt(ModalScreen[str | None]):
    """Asks for one line: returns it on enter, None on escape."""

    CSS = """
    InputPrompt { align: left bottom; background: transparent; }
    InputPrompt Horizontal { height: 1; width: 100%; }
    InputPrompt Label { width: auto; text-style: bold; padding: 0 1; }
    InputPrompt Input { width: 1fr; border: none; height: 1; padding: 0; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "cancel", "leave")]

    def __init__(self, question: str, initial: str) -> None:
        super().__init__()
        self.question, self.initial = question, initial

    def compose(self) -> ComposeResult:
        with Horizontal():
            yield Label(self.question, markup=False)
            yield Input(self.initial, select_on_focus=False)

    def on_mount(self) -> None:
        """Send the keys to the field."""
        self.query_one(Input).focus()

    def on_input_submitted(self, event: Input.Submitted) -> None:
        self.dismiss(event.value)

    def action_cancel(self) -> None:
        """Return None."""
        self.dismiss(None)
