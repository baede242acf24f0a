"""A section of a proof: the rows that belong together, with how much is measured for them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from inspect import signature
from random import Random
from typing import NamedTuple, TypeVar

from tests.support.trials.row import Row

Sizes = Mapping[str, float]
Kind = TypeVar("Kind")


class Section(NamedTuple):
    """Its name is one word. `rows` takes the sizes by name, and `seed` where it has this parameter.

    `brief` are the sizes of the smallest sample that runs the code of all rows, or the reason for
    which there is none. In full it is to take 20 minutes at most, in brief a few seconds.
    `is_statistical`: its targets are those of many trials, so a brief sample is not judged by them.
    """

    name: str
    rows: Callable[..., Iterator[Row]]
    full: Sizes = {}
    brief: Sizes | str = {}
    is_statistical: bool = False

    def measured(self, is_brief: bool, seed: int, scale: float = 1.0) -> Iterator[Row]:
        """Its rows; nothing is measured before the first one is asked for.

        `scale`: factor of the sizes in full. Raises ValueError when it has no brief form.
        """
        sizes = self.brief
        if not is_brief:
            sizes = {name: scaled(size, scale) for name, size in self.full.items()}
        if isinstance(sizes, str):
            raise ValueError(f"{self.name} is only measured in full: {sizes}")
        given = {"seed": seed} if "seed" in signature(self.rows).parameters else {}
        return self.rows(**given, **sizes)


def scaled(size: float, scale: float) -> float:
    """A size times a factor; a whole one stays whole, and at least 1."""
    return max(1, int(size * scale)) if isinstance(size, int) else size * scale


def drawn(cases: Iterable[Kind], number: int, seed: int) -> list[Kind]:
    """At most `number` of the cases, drawn by the seed, in their order."""
    every = list(cases)
    places = Random(seed).sample(range(len(every)), min(number, len(every)))
    return [every[place] for place in sorted(places)]
