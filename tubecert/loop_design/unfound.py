"""Why no tables were found, as far as floats can tell; nothing is proven by it.

In: a plant, in units in which what acts on it is of order one. Out: `NoDesign`. Trusted: no.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.linalg import eig, null_space, orth

from tubecert.loop_design.plant import Plant

__all__ = ["NoDesign", "refuse_hopeless"]

Kind = Literal["no_design", "inputs", "no_fixed_point"]


class NoDesign(Exception):  # noqa: N818 -- an answer, not a fault
    """No tables keep a tube, or none were found.

    kind "no_design": a mode that no input moves, `where` the state in which it shows most, `needed` its growth in 1/s;
    without `where`, no stable loop was found. "inputs": input `where` needs that much of what is allowed.
    "no_fixed_point": the half-width of state `where` grows past `needed`, `allowed` it would have without remainders.
    """

    def __init__(
        self, kind: Kind, where: int | None = None, needed: float | None = None, allowed: float | None = None
    ) -> None:
        super().__init__(kind)
        self.kind = kind
        self.where = where
        self.needed = needed
        self.allowed = allowed


def refuse_hopeless(plant: Plant) -> None:
    """Raise `NoDesign` where no linear controller can stabilise, or no controller at all can hold, a mode."""
    _refuse_unmoved(plant)
    _refuse_too_strong(plant)


def _refuse_unmoved(plant: Plant) -> None:
    """Modes outside of all that the inputs reach must die away by themselves."""
    reached = orth(plant.B, rcond=1e-9)
    for _ in plant.A:
        reached = orth(np.hstack([reached, plant.A @ reached]), rcond=1e-9)
    rest = null_space(reached.T) if reached.size else np.eye(len(plant.A))
    if not rest.size:
        return
    inner = rest.T @ plant.A @ rest
    growth, modes = np.linalg.eig(inner.T)
    worst = int(np.argmax(growth.real))
    if growth.real[worst] > -1e-6 * np.abs(inner).max():
        shown = np.abs(rest @ modes[:, worst])
        raise NoDesign("no_design", int(np.argmax(shown)), float(growth.real[worst]))


def _refuse_too_strong(plant: Plant) -> None:
    """A real unstable mode z = l'e must be held against wind, eta and what nobody can know of it before he can act.

    z' = g z + l'(B delta + H eta + E w). Two errors that no sample tells apart are met by the same input: at the end
    of the time that passes before an input can answer, the larger z has grown to e^(g time) times what noise hides.
    """
    growth, lefts, rights = eig(plant.A, left=True, right=True)
    blind = plant.sample_time + plant.delay
    for g, left, right in zip(growth, lefts.T.real, rights.T.real, strict=True):
        if abs(g.imag) > 1e-9 * abs(g) or g.real <= 1e-9 * np.abs(plant.A).max():
            continue
        pushed = left @ plant.E * plant.wind
        push = float(np.linalg.norm(pushed, 2 if plant.wind_ball else 1))
        push += float(np.abs(left @ plant.H) @ plant.magnitude)
        seen = np.abs(right[right != 0]) / np.maximum(plant.noise[right != 0], 1e-300)
        hidden = abs(left @ right) / np.linalg.norm(seen, 2 if plant.noise_ball else np.inf)
        needed = (g.real * hidden + push) * np.exp(g.real * blind)
        held = np.abs(left @ plant.B)
        strength = held[held > 0] @ plant.room[held > 0]
        if needed > strength:
            j = int(np.argmax(held))
            raise NoDesign("inputs", j, float(plant.room[j] * needed / strength), float(plant.room[j]))
