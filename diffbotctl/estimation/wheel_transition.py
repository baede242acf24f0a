"""How the motion of a wheel carries its uncertainty on, gathered over several steps."""

from __future__ import annotations

Factors = tuple[float, float, float, float, float, float, float, float]
"""z' = z + a v + b gain + c offset + d lag; v' = e v + f gain + g offset + h lag."""

STILL: Factors = (0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


class Transition:
    """The product of the transition matrices since it was last taken."""

    __slots__ = ("factors", "still")

    def __init__(self) -> None:
        self.factors = STILL
        self.still = True

    def add(self, later: Factors) -> None:
        """A further step follows."""
        if self.still:
            self.factors, self.still = later, False
            return
        a, b, c, d, e, f, g, h = self.factors
        p, q, r, s, t, u, v, w = later
        self.factors = (
            a + p * e,
            b + p * f + q,
            c + p * g + r,
            d + p * h + s,
            t * e,
            t * f + u,
            t * g + v,
            t * h + w,
        )

    def take(self) -> Factors:
        """The product so far; begins anew."""
        taken, self.factors, self.still = self.factors, STILL, True
        return taken
