"""What compiled code loses to rounding at every sample, against what its certificate accounts for: theorem H-R.

In: what the code keeps before and after a sample, and what it measured. Out: shares of r_a, r_u and r_q. The same
programs run in `double` from the same memory, so that nothing adds up from sample to sample. Nothing is proven: in
`double` a share is told up to the rounding of the reference itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from tubecert.conditions.hardware import Rounding
from tubecert.enclosure.interval import Array
from tubecert.export.compiled import Memory
from tubecert.export.controller import Controller
from tubecert.export.program import Port, Program, Step
from tubecert.export.reference import Reference, execute

_Q: Final = "q"


def accounts(controller: Controller) -> bool:
    """Whether a certificate says what rounding may cost, and its loop is one that is compared here."""
    return controller.lost is not None and not controller.predicts and controller.swept is None


@dataclass(slots=True)
class Accounted:
    """The largest share so far of what may be lost, 1 being all of it; N controllers side by side."""

    controller: Controller
    lost: Rounding
    share: float = 0.0
    _beyond: Array = field(default_factory=lambda: np.zeros(0))

    def sample(self, k: int, y: Array, before: Memory, after: Memory) -> None:
        """The k-th: what was measured (N, n), as the code has it."""
        reference, c = Reference(controller=self.controller, sample=k), self.controller
        estimate = np.zeros_like(after.q)
        if k:
            reference.y, reference.q = before.y, before.q
            reference.held, reference.before = before.held, before.before
            (reference.f,) = execute(c.drift, reference.y)  # what rounding cost it there is lost here
            estimate = self._estimated(reference, y, after.q)
        if k % c.every == 0:
            self._fed(reference, y, after.feedback)
        written = np.linalg.norm(after.held - (after.feedback - estimate), axis=1)
        self._see((self._beyond + written) / float(self.lost.input))

    def _estimated(self, reference: Reference, y: Array, q: Array) -> Array:
        """The share of r_q; and the projection of what the code computed for q."""
        c = self.controller
        (f,) = execute(c.drift, y)
        given = (y, f, reference.y, reference.f, reference.q, reference.mean())
        exact, _ = execute(c.estimator, *given)
        off = np.linalg.norm(q - exact, axis=1) / float(c.share)
        self._see(off / float(self.lost.estimate))
        return execute(_clip(c.estimator), *given, q)[0]

    def _fed(self, reference: Reference, y: Array, feedback: Array) -> None:
        """alpha/2 + c'kappa against r_a + |c| r_u, and how far |kappa| is beyond du d."""
        c = self.controller
        x, u = reference.plan(reference.time())
        (f,), (v,) = execute(c.drift, y), execute(c.flow, x, u)
        marked = replace(c.law, outputs=(*c.law.outputs, *(own for own in c.law.marked if own.name == "c")))
        _, told, along = execute(marked, y, f, x, v, u)
        kappa = feedback - u if c.adds_plan else feedback
        over = told[:, 1] + (along * kappa).sum(axis=1)
        may = float(self.lost.feedback) + np.linalg.norm(along, axis=1) * float(self.lost.input)
        limit = float(c.feedback_gain) * np.sqrt(np.maximum(told[:, 0], 0.0))
        self._beyond = np.maximum(np.linalg.norm(kappa, axis=1) - limit, 0.0)
        self._see(over / may)

    def _see(self, shares: Array) -> None:
        worst = float(shares.max())
        self.share = max(self.share, np.inf if np.isnan(worst) else worst)


def _clip(estimator: Program) -> Program:
    """The projection alone: of a q that goes in last."""
    (q,) = (port.places for port in estimator.outputs if port.name == _Q)
    steps = list(estimator.steps)
    for index, place in enumerate(q):
        steps[place] = Step(operation="input", name="new", index=index)
    return replace(
        estimator,
        steps=tuple(steps),
        inputs=(*estimator.inputs, Port(name="new", places=q)),
        outputs=tuple(port for port in estimator.outputs if port.name != _Q),
    )
