"""One line of a table of figures."""

from typing import NamedTuple


class Row(NamedTuple):
    """A measured figure beside its target."""

    what: str
    figure: str
    target: str
    met: bool
