"""The log: what blocks and drivers have said, and from which level on they are heard."""

from __future__ import annotations

from diffbotctl.hub.client import Client
from diffbotctl.hub.desk import Desk, Fields, Verb, Wanted, nearest_of
from diffbotctl.hub.knowledge import MOST_LINES
from diffbotctl.links.control import RefusalError, Request
from diffbotctl.links.json_messages import plain
from diffbotctl.log import ALL, LEVEL
from diffbotctl.messages import LOG_LEVELS

LAST = 50  # lines, when nobody says how many: a screenful


def log(desk: Desk, client: Client, request: Request) -> Fields:
    """The newest lines, the oldest of them first."""
    request.only("last", "level", "block")
    last = request.number_of("last", "lines", LAST)
    if not 0 <= last <= MOST_LINES:
        cause = f"the last {last:g} lines are not kept"
        raise RefusalError("E-REQUEST", cause, f"ask for 0 to {MOST_LINES}")
    wanted = LOG_LEVELS[_rank(request.text("level", LOG_LEVELS[0])) :]
    source = request.text("block", ALL)
    if source != ALL:
        _source(desk, source)
    found = [
        plain(line)
        for line in desk.knowledge.lines
        if line.level in wanted and source in (ALL, line.source)
    ]
    return {"lines": found[len(found) - min(int(last), len(found)) :]}


def log_level(desk: Desk, client: Client, request: Request) -> Wanted:
    """From now on hear a source from a level on."""
    request.only("block", "level")
    source, level = request.text("block"), LOG_LEVELS[_rank(request.text("level"))]
    if source != ALL:
        _source(desk, source)
    return Wanted("set", (source, LEVEL, None, level))


def level_of(desk: Desk, source: str) -> str:
    """From which level on `source` is heard."""
    book = desk.about.graph.book
    return "" if book is None else book.level(source)


def _rank(level: str) -> int:
    if level not in LOG_LEVELS:
        raise RefusalError(
            "E-REQUEST", f"there is no level '{level}'", f"there are {', '.join(LOG_LEVELS)}"
        )
    return LOG_LEVELS.index(level)


def _source(desk: Desk, name: str) -> None:
    book = desk.about.graph.book
    known = [] if book is None else list(book.logs)
    if name not in known:
        raise RefusalError("E-REQUEST", f"there is no block '{name}'", nearest_of(name, known))


VERBS: dict[str, Verb] = {"log": log, "log_level": log_level}
