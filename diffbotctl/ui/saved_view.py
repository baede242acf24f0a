"""A saved view: what a screen shows of a run, as a YAML file that opens it again."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, NamedTuple, get_args

from diffbotctl.config import yaml_reader
from diffbotctl.config.editor_schemas import modeline
from diffbotctl.config.section_reader import read_section
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import ConfigurationError, Problem, Source
from diffbotctl.file_replacement import replace_file
from diffbotctl.params import REQUIRED, Choice, Number, Param, Section

ScreenPanel = Literal["map", "plots", "parameters", "blocks", "log"]
SCREEN_PANELS: tuple[ScreenPanel, ...] = get_args(ScreenPanel)  # in the order of their keys
PLOT_SPAN_S, PLOT_SPAN_MIN_S, PLOT_SPAN_MAX_S = 30.0, 7.5, 120.0  # of the past
MAP_WIDTH_MIN_M, MAP_WIDTH_MAX_M = 0.05, 5000.0
FIRST_LINE = "# A view of diffbotctl: `run`, `dash` and `web` open it with --view FILE."


class PlotsView(Section):
    """What is plotted."""

    fields = Param(
        list[str],
        default=[],
        help="Names such as odometry.odometry.x; empty: the speeds of the wheels.",
    )
    span = Number(
        "s", f"[{PLOT_SPAN_MIN_S}, {PLOT_SPAN_MAX_S}]", PLOT_SPAN_S, "The past that the plots show."
    )


class MapSection(Section):
    """The part of the map that is shown."""

    x = Number("m", "", 0.0, "Middle of the map, in odom.")
    y = Number("m", "", 0.0, "Middle of the map, in odom.")
    width = Number(
        "m",
        f"[{MAP_WIDTH_MIN_M}, {MAP_WIDTH_MAX_M}]",
        REQUIRED,
        "Length from the left to the right edge.",
    )
    follow = Param(bool, default=False, help="Keep the robot in the middle, in place of x and y.")


class SavedView(Section):
    """A view of a running robot."""

    format = Param(int, choices=(1,), help="Version of the file format.")
    kind = Param(str, choices=("view",), help="Kind of file.")
    panel: ScreenPanel = Choice(ScreenPanel, "map", "What a small screen shows beside the values.")
    plots = Param(PlotsView, default=PlotsView(), help="What is plotted.")
    map: MapSection | None = Param(
        MapSection, none=True, default=None, help="Part of the map; absent: all is kept in view."
    )


class ViewSettings(NamedTuple):
    """A view as a screen uses it. `place`: x, y and width of the map in m; None: all in view."""

    panel: ScreenPanel = "map"
    fields: tuple[str, ...] = ()
    span: float = PLOT_SPAN_S
    place: tuple[float, float, float] | None = None
    follows: bool = False


def read_view(path: str) -> ViewSettings:
    """The view in the file at `path`. Raises ConfigurationError with every problem."""
    return _view_of(yaml_reader.read(path))


def parse_view(source: Source) -> ViewSettings:
    """The view in a text. Raises ConfigurationError with every problem."""
    return _view_of(yaml_reader.parse(source))


def _view_of(tree: Value) -> ViewSettings:
    problems: list[Problem] = []
    view = read_section(tree, SavedView, "view", problems)
    if problems:
        raise ConfigurationError(problems)
    part = view.map
    return ViewSettings(
        view.panel,
        tuple(view.plots.fields),
        view.plots.span,
        None if part is None else (part.x, part.y, part.width),
        part is not None and part.follow,
    )


def view_text(view: ViewSettings) -> str:
    lines = [FIRST_LINE, "format: 1", "kind: view", f"panel: {view.panel}", "plots:"]
    lines += [f"  fields: [{', '.join(view.fields)}]", f"  span: {view.span:g} s"]
    if view.place is not None:
        x, y, width = view.place
        lines += ["map:", f"  x: {x:.3f} m", f"  y: {y:.3f} m", f"  width: {width:.3f} m"]
        lines += [f"  follow: {str(view.follows).lower()}"]
    return "\n".join([*lines, ""])


def save_view(path: Path, view: ViewSettings) -> str:
    """Write the view to a file. Returns what was done, or why it was not."""
    if path.exists() and not is_view(path):
        return f"{path} exists already and is no view: choose another name"
    try:
        replace_file(path, (modeline("view", path) + view_text(view)).encode())
    except OSError as error:
        return f"{path} cannot be written: {error.strerror}"
    return f"saved: `diffbotctl dash --view {path}` opens this view again"


def is_view(path: Path) -> bool:
    """Whether the file at `path` is a saved view: `kind: view`."""
    try:
        kind = yaml_reader.read(str(path)).entries.get("kind")
    except (ConfigurationError, OSError, ValueError):
        return False
    return kind is not None and kind.text == "view"
