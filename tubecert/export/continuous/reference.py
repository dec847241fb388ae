"""The loop of a certificate C in numpy, many runs at once: what exported code is compared with."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.export.controller import Continuous
from tubecert.export.reference import Around, execute


def _nothing() -> Array:
    return np.zeros((0, 0))


@dataclass(slots=True, kw_only=True)
class Reference(Around):
    """N controllers side by side; what is called is that of the exported code."""

    controller: Continuous
    sample: int = 0
    s_hat: Array = field(default_factory=_nothing)
    sigma_hat: Array = field(default_factory=_nothing)
    u_a: Array = field(default_factory=_nothing)

    def start(self, x: Array) -> Array:
        """Forgets everything; xhat (N, n), for the states (N, n) at t = 0."""
        self.sample, self.s_hat = 0, np.zeros_like(x)
        self.sigma_hat = np.zeros((len(x), len(self.controller.inputs)), dtype=x.dtype)
        self.u_a = self.sigma_hat.copy()
        return x.copy()

    def step(self, x: Array, xhat: Array) -> None:
        """The adaptation at a sample, from states and xhat (N, n)."""
        since = np.array([[self.real(float(self.controller.sample_time))]])
        self.u_a = self._filtered(since)
        self.s_hat, _, self.sigma_hat = execute(self.controller.estimator, x, xhat, real=self.real)
        self.sample += 1

    def law(self, since: Array, x: Array) -> tuple[Array, Array]:
        """The inputs (N, m) of states (N, n) at a time after the sample, and d(x*, x)^2 (N,)."""
        t = self.real(self.sample) * self.real(float(self.controller.sample_time)) + self.real(since)
        kappa, square = self.kappa(x, t)
        return (kappa + self.plan(t)[1]) + self._filtered(np.array([[self.real(since)]])), square

    def predictor(self, x: Array, xhat: Array, u: Array) -> Array:
        """xhat' (N, n)."""
        (v,) = execute(self.controller.flow, x, u, real=self.real)
        (rate,) = execute(self.controller.observer, v, x, xhat, self.s_hat, real=self.real)
        return rate

    def _filtered(self, since: Array) -> Array:
        (found,) = execute(self.controller.filter, since, self.u_a, self.sigma_hat, real=self.real)
        return found
