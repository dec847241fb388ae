"""What mirror symmetries leave of a family, and of the points at which conditions are asked.

D = diag(+-1) with f(Dx) = D f(x), D range B(x) = range B(Dx) and D X = X: with W(x) also D W(Dx) D is feasible, and so
is their mean. With g_k(Dx) = s_k g_k(x) and E(Dx) = D E(x) diag(c), W is invariant iff V_k has no entry (i, j) with
s_k c_i c_j = -1. A symmetry under which some g_k or column of E is neither even nor odd is left out.
Untrusted: seen at random points, and a wrong symmetry can cost a metric but never a proof.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.model import ControlAffineModel
from tubecert.synthesis.family import MetricFamily
from tubecert.synthesis.forms import FormsTape

_CLOSE = 1e-9
_MOST_STATES = 12


def invariant_entries(
    model: ControlAffineModel, family: MetricFamily, box: Array, forms: FormsTape
) -> tuple[Array, NDArray[np.bool_]]:
    """The symmetries that the family shares, as signs (S, n), and the entries (K, n, n), i <= j, that they leave."""
    n = len(model.states)
    mask = np.repeat(np.triu(np.ones((n, n), dtype=bool))[None], len(family.functions), axis=0)
    points = np.random.default_rng(7).uniform(box[:, 0], box[:, 1], (3, n))
    tape = Tape(model.f, model.states)
    drift, here, projectors = _drift(tape, points, forms), forms(points), forms.projectors(points)
    shared = []
    for signs in _candidates(box, forms.variables):
        if not _same(_drift(tape, points * signs, forms), drift * signs):
            continue
        if not _same(forms.projectors(points * signs), signs[:, None] * projectors * signs):
            continue
        there = forms(points * signs)
        parity = _parity(there.values, here.values)
        columns = _parity(there.frame.reshape(-1, n), (here.frame * signs[:, None]).reshape(-1, n))
        if parity is not None and columns is not None:
            mask &= parity[:, None, None] * columns[:, None] * columns > 0
            shared.append(signs)
    return np.array(shared).reshape(-1, n), mask


def canonical(points: Array, symmetries: Array) -> Array:
    """Of the mirror images of each point (N, n) the one with the largest coordinates, the first ones first."""
    best = points
    rows = np.arange(len(points))
    for signs in symmetries:
        image = points * signs
        differs = image != best
        first = np.argmax(differs, axis=1)
        better = differs.any(axis=1) & (image[rows, first] > best[rows, first])
        best = np.where(better[:, None], image, best)
    return best


def _candidates(box: Array, variables: tuple[int, ...]) -> list[Array]:
    """Sign patterns that map the ranges of the states that matter to themselves, the identity left out."""
    if len(box) > _MOST_STATES:
        return []
    both = [lo == -hi or i not in variables for i, (lo, hi) in enumerate(box)]
    choices = [(1.0, -1.0) if free else (1.0,) for free in both]
    return [np.array(signs) for signs in product(*choices) if min(signs) < 0]


def _drift(tape: Tape, points: Array, forms: FormsTape) -> Array:
    """f at points, (N, n), free of units where the forms are."""
    return np.asarray(tape.run_floats(list(points.T), (len(points),)).T / forms.speeds)


def _same(a: Array, b: Array) -> bool:
    return bool((np.abs(a - b) <= _CLOSE * max(1.0, float(np.abs(b).max(initial=0.0)))).all())


def _parity(there: Array, here: Array) -> Array | None:
    """The signs (K,) with there = sign * here at all points (N, K); None if there are none."""
    size = _CLOSE * max(1.0, float(np.abs(here).max(initial=0.0)))
    even, odd = (np.asarray(np.abs(there - sign * here) <= size).all(axis=0) for sign in (1.0, -1.0))
    return np.where(even, 1.0, -1.0) if bool((even | odd).all()) else None
