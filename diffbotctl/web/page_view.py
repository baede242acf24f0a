"""The view of a page as a file: the one that it opens with, and what it shows now."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import isfinite

from diffbotctl.client.request_check import RequestRefusalError
from diffbotctl.control_socket.protocol import Fields
from diffbotctl.errors import ConfigurationError, Source
from diffbotctl.ui.saved_view import SCREEN_PANELS, ViewSettings, parse_view, view_text
from diffbotctl.web.plot_samples import FIELDS_MAX

FILE_NAME = "view.yaml"
FIELD = re.compile(r"\w+(\.\w+){2,}", re.ASCII)  # of a plot, such as odometry.odometry.x
NUMBERS = ("x", "y", "width")  # of the part of the map, m


def view_record(view: ViewSettings | None) -> Fields:
    """The view as the page reads it, in SI; empty for none."""
    return {} if view is None else view._asdict()


def requested_view(query: Mapping[str, str]) -> str:
    """The text of the file for the view that the query of a page describes.

    Keys: `panel`, `fields` (separated by commas), `span` (s), and for a part of the map `x`, `y`,
    `width` (m) and `follow` (true or false). Raises RequestRefusalError.
    """
    fields = tuple(filter(None, query.get("fields", "").split(",")))
    panel = next((each for each in SCREEN_PANELS if each == query.get("panel")), None)
    is_part = "width" in query
    numbers = [_number(query, name) for name in ("span", *(NUMBERS if is_part else ()))]
    if panel is None or len(fields) > FIELDS_MAX or not all(map(FIELD.fullmatch, fields)):
        raise RequestRefusalError(400, "the page described no view")
    span, *place = numbers
    part = (place[0], place[1], place[2]) if is_part else None
    text = view_text(ViewSettings(panel, fields, span, part, query.get("follow") == "true"))
    try:
        parse_view(Source(FILE_NAME, text))  # its bounds are declared there
    except ConfigurationError as error:
        raise RequestRefusalError(400, error.problems[0].cause) from error
    return text


def _number(query: Mapping[str, str], name: str) -> float:
    try:
        value = float(query[name])
    except (KeyError, ValueError) as error:
        raise RequestRefusalError(400, f"the page sent no number as {name}") from error
    if not isfinite(value):
        raise RequestRefusalError(400, f"the page sent no number as {name}")
    return value
