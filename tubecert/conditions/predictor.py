"""The state predictor A_m = -g I as the conditions see it: three norms, with P = I.

A general matrix would serve no better: with g = lmin(Q)/2 and its unit eigenvector v, v'A_m v = -g, so |A_m| >= g and
|A_m + omega I| >= |omega - g|, and -g I has the same q. Implements: theory section 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic

from tubecert.conditions.arithmetic import T, absolute


@dataclass(frozen=True, slots=True, kw_only=True)
class Predictor(Generic[T]):
    """What the conditions need of A_m: |A_m|, |A_m + omega I| and q = lmin(Q), Q = -(A_m + A_m'); P = I."""

    norm: T
    shifted: T
    q: T

    @staticmethod
    def of_gain(g: T, omega: T) -> Predictor[T]:
        """A_m = -g I, as in theory 2.7: omega + |g - omega| in (2.12)."""
        return Predictor(norm=g, shifted=absolute(omega - g), q=2 * g)
