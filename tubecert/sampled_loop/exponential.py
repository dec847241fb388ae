"""Phi(s) = e^(A s) and J(s) = int_0^s Phi, enclosed. Trusted: yes.

J(s) = s (I + A s/2 (I + A s/3 (..))) by Horner's rule, then Phi = I + A J exactly. What the series leaves out is at
most s v^(K+1)/(K+2)! e^v in every entry, where v = |A| s in the norm of row sums, which no power exceeds (theory,
section 2; entry by entry with |A|^(K+1) it would be false). Longer times are halved until v <= 1/2, then doubled:
J(2 s) = (I + Phi(s)) J(s), Phi(2 s) = Phi(s)^2.
"""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from math import factorial
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.midrad import SUMMED, TINY, Known

_TERMS: Final = 18
_MOST: Final = Fraction(1, 2)
_E: Final = 1.7  # > e^(1/2)


class Exponential:
    """Phi and J of one matrix of floats A (n, n) at exact times, each enclosed once."""

    def __init__(self, A: Array) -> None:
        self.A = Known.exact(A)
        self._one = Known.exact(np.eye(len(A)))
        self._norm = Fraction(float(np.max(np.abs(A).sum(axis=1), initial=0.0) * SUMMED))
        self._found = lru_cache(maxsize=None)(self._computed)

    def at(self, s: Fraction) -> tuple[Known, Known]:
        """Phi(s) and J(s), each (n, n), for s >= 0."""
        return self._found(s)

    def _computed(self, s: Fraction) -> tuple[Known, Known]:
        if self._norm * s > _MOST:
            phi, whole = self.at(s / 2)
            return phi @ phi, (self._one + phi) @ whole
        step = self.A.times(s)
        series = self._one
        for k in range(_TERMS, 0, -1):
            series = self._one + (step @ series).times(Fraction(1, k + 1))
        left = _E * float(_MOST) ** (_TERMS + 1) / factorial(_TERMS + 2) * (1 + 1e-12)
        whole = Known(series.mid, series.rad + left).times(s)
        return self._one + self.A @ whole, Known(whole.mid, whole.rad + TINY)
