"""Why no tables were found, as far as floats can tell; nothing is proven by it.

In: a plant. Out: `NoDesign`. Trusted: no.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import null_space, orth

from tubecert.enclosure.interval import Array
from tubecert.loop_design.plant import Plant


@dataclass(eq=False)
class NoDesign(Exception):  # noqa: N818 -- an answer, not a fault
    """No tables keep a tube, or none were found.

    "no_design": no input moves a mode that does not die away, `where` the state in which it shows most, `needed` its
    growth in 1/s; without `where`, no stable loop was found. "inputs": input `where` needs that much of what is
    allowed. "no_fixed_point": state `where` grows past `needed`, `allowed` it would have without remainders.
    """

    kind: Literal["no_design", "inputs", "no_fixed_point"]
    where: int | None = None
    needed: float | None = None
    allowed: float | None = None


def refuse_unmoved(A: Array, B: Array) -> None:
    """Modes outside of all that the inputs reach must die away by themselves; in units of order one."""
    reached = B
    for _ in A:
        reached = orth(np.hstack([reached, A @ reached]), rcond=1e-9)
    rest = null_space(reached.T)
    inner = rest.T @ A @ rest
    for growth, mode in zip(*np.linalg.eig(inner.T), strict=True):
        if growth.real > -1e-6 * np.abs(inner).max():
            raise NoDesign("no_design", int(np.argmax(np.abs(rest @ mode))), float(growth.real))


def refuse_unheld(plant: Plant) -> None:
    """A real mode z = l'e that grows must be held against eta and wind, as large as it is when an input can answer.

    z' = g z + l'(B delta + H eta + E w): no controller, linear or not, does with less.
    """
    growths, modes = np.linalg.eig(plant.A.T)
    for growth, left in zip(growths, modes.T, strict=True):
        if growth.imag == 0 and growth.real > 1e-9 * np.abs(plant.A).max():
            wind = np.linalg.norm(left @ plant.E * plant.wind, 2 if plant.wind_ball else 1)
            pushed = wind + np.abs(left @ plant.H) @ plant.magnitude
            needed = pushed * np.exp(growth.real * (plant.sample_time + plant.delay))
            moved = np.abs(left @ plant.B)
            strength = moved[moved > 0] @ plant.room[moved > 0]
            if needed > strength:
                j = int(np.argmax(moved))
                raise NoDesign("inputs", j, float(plant.room[j] * needed / strength), float(plant.room[j]))


def refuse_inputs(plant: Plant, U: Array) -> None:
    """Every input must be within its room, which is not empty."""
    j = int(np.argmax(U - plant.room))
    if U[j] > plant.room[j]:
        raise NoDesign("inputs", j, float(U[j]), float(plant.room[j]))
