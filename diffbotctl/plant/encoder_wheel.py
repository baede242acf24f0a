"""A wheel with an encoder: it passes the edges of its disc, which reach the board by its pins."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from math import inf, pi
from random import Random

from diffbotctl.plant.encoder_disc import EncoderDisc, EncoderPin, LevelChange, PulseFaults
from diffbotctl.plant.quadrature import TwoChannelPins


class EncoderWheel:
    """The encoder of a wheel; what turns the wheel is up to the subclass.

    Edges are numbered along the angle of the wheel (rad since the start, forward positive).
    `_previous_edge` and `_next_edge` are the angles between which no edge lies.
    """

    __slots__ = ("_disc", "_edge_index", "_next_edge", "_pins", "_previous_edge")

    def __init__(self, disc: EncoderDisc, rng: Random, falling: bool) -> None:
        """`falling`: the board counts falling edges of the pin instead of rising ones."""
        self._disc = disc
        self._pins: EncoderPin | TwoChannelPins = EncoderPin(disc, falling, rng)
        if disc.channels == 2:
            self._pins = TwoChannelPins(disc, rng)
        self._edge_index = bisect_right(disc.edges, disc.start)
        # The first edge of a disc may lie a little before its zero.
        while self._edge_angle(self._edge_index) <= 0.0:
            self._edge_index += 1
        self._previous_edge = self._edge_angle(self._edge_index - 1)
        self._next_edge = self._edge_angle(self._edge_index)

    @property
    def level(self) -> int:
        """Level of the pin, of channel A with two: 1 while a slot is open."""
        return self.levels[0]

    @property
    def levels(self) -> tuple[int, ...]:
        """Levels of the pins of all channels."""
        return self._pins.levels(self._edge_index)

    @property
    def taken_directions(self) -> Sequence[int]:
        """1 or -1: of the counted edges that were taken last; empty with one channel."""
        return self._pins.taken_directions

    def stop_counting(self) -> None:
        """Ignore all edges from now on, for a run that looks at the truth alone."""
        self._previous_edge, self._next_edge = -inf, inf

    def set_encoder_faults(self, faults: PulseFaults) -> None:
        """What is wrong with its encoder from now on; no effect with two channels."""
        if isinstance(self._pins, EncoderPin):
            self._pins.set_faults(faults)

    def watch(self, on: bool) -> None:
        """Start or stop collecting what `changes` returns."""
        self._pins.watch(on)

    def changes(self, until: int) -> list[LevelChange]:
        """Changes of the watched pin since the last call, until `until`, once it has come there."""
        return self._pins.changes(until)

    def changes_b(self, until: int) -> list[LevelChange]:
        """The same of channel B; none with one channel."""
        return self._pins.changes(until, 1)

    def take_edges(self, until: int) -> Sequence[int]:
        """Times (ns) of the counted edges since the last call, until `until`, in order."""
        return self._pins.take(until)

    def _cross_edges(self, angle: float, time_at: Callable[[float], int]) -> None:
        """Pass the edges up to `angle`; `time_at` returns when (ns) the wheel was at an angle.

        Only those that count are timed, unless the pins are watched.
        """
        pins, index = self._pins, self._edge_index
        previous, following = self._previous_edge, self._next_edge
        edges, start = self._disc.edges, self._disc.start
        turn, place = divmod(index, len(edges))
        while angle >= following:
            if pins.is_needed(index, True):
                pins.record(time_at(following), index, True)
            index += 1
            place += 1
            if place == len(edges):
                turn, place = turn + 1, 0
            previous, following = following, edges[place] + turn * 2 * pi - start
        while angle < previous:
            index -= 1
            if pins.is_needed(index, False):
                pins.record(time_at(previous), index, False)
            previous, following = self._edge_angle(index - 1), previous
        self._edge_index, self._previous_edge, self._next_edge = index, previous, following

    def _edge_angle(self, index: int) -> float:
        turn, place = divmod(index, len(self._disc.edges))
        return self._disc.edges[place] + turn * 2 * pi - self._disc.start
