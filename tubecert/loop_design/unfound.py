"""Why no tables were found, as far as floats can tell; nothing is proven by it.

In: a plant, in units in which what acts on it is of order one. Out: `NoDesign`. Trusted: no.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.linalg import eig, null_space, orth

from tubecert.enclosure.interval import Array
from tubecert.loop_design.plant import Plant


class NoDesign(Exception):  # noqa: N818 -- an answer, not a fault
    """No tables keep a tube, or none were found.

    "no_design": no input moves a mode that does not die away, `where` the state in which it shows most, `needed` its
    growth in 1/s; without `where`, no stable loop was found. "inputs": input `where` needs that much of what is
    allowed. "no_fixed_point": the half-width of state `where` grows past `needed`; it would be `allowed` without
    remainders.
    """

    def __init__(
        self,
        kind: Literal["no_design", "inputs", "no_fixed_point"],
        where: int | None = None,
        needed: float | None = None,
        allowed: float | None = None,
    ) -> None:
        super().__init__(kind, where, needed, allowed)
        self.kind, self.where, self.needed, self.allowed = kind, where, needed, allowed


def refuse_unmoved(plant: Plant) -> None:
    """Modes outside of all that the inputs reach must die away by themselves."""
    reached = plant.B
    for _ in plant.A:
        reached = orth(np.hstack([reached, plant.A @ reached]), rcond=1e-9)
    rest = null_space(reached.T)
    if rest.shape[1]:
        inner = rest.T @ plant.A @ rest
        growth, modes = np.linalg.eig(inner.T)
        worst = int(np.argmax(growth.real))
        if growth.real[worst] > -1e-6 * np.abs(inner).max():
            shown = int(np.argmax(np.abs(rest @ modes[:, worst])))
            raise NoDesign("no_design", shown, float(growth.real[worst]))


def refuse_too_strong(plant: Plant) -> None:
    """A real unstable mode z = l'e must be held against wind, eta and what nobody can know of it before he can act.

    z' = g z + l'(B delta + H eta + E w). Two errors that no sample tells apart are met by the same input: by the time
    an input can answer, the larger z has grown to e^(g time) times what noise hides.
    """
    growth, lefts, rights = eig(plant.A, left=True, right=True)  # type: ignore[misc]
    for g, left, right in zip(growth, lefts.T.real, rights.T.real, strict=True):
        if abs(g.imag) > 1e-9 * abs(g) or g.real <= 1e-9 * np.abs(plant.A).max():
            continue
        wind = np.linalg.norm(left @ plant.E * plant.wind, 2 if plant.wind_ball else 1)
        seen = np.abs(right) / np.maximum(plant.noise, 1e-30)
        hidden = np.abs(left @ right) / np.linalg.norm(seen, 2 if plant.noise_ball else np.inf)
        pushed = g.real * hidden + wind + np.abs(left @ plant.H) @ plant.magnitude
        held = np.abs(left @ plant.B)
        strength = held[held > 0] @ plant.room[held > 0]
        needed = pushed * np.exp(g.real * (plant.sample_time + plant.delay)) / strength
        if needed > 1:
            j = int(np.argmax(held))
            raise NoDesign("inputs", j, float(plant.room[j] * needed), float(plant.room[j]))


def refuse_inputs(plant: Plant, U: Array) -> None:
    """Every input must be within its room."""
    j = int(np.argmax(U / plant.room))
    if U[j] > plant.room[j]:
        raise NoDesign("inputs", j, float(U[j]), float(plant.room[j]))
