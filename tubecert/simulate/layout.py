"""The state y of the fast part: its blocks and where they are. Nothing else in this room counts entries.

| block | shape | what | theory |
|---|---|---|---|
| `xtilde` | (n,) | xhat - x, the error of the predictor | (0.6) |
| `sigma_hat` | (m,) | the estimate of h | (0.7) |
| `u_a` | (m,) | the filter's output | (0.8) |
| `v` | (n,) | int B u_a since the start of the step: all that the slow part needs of y | |
"""

from __future__ import annotations

from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from tubecert.simulate.compiled import inlined


class Layout(NamedTuple):
    """Where the blocks of y begin, for n states and m inputs; `size` entries in all."""

    n: int
    m: int
    sigma_hat: int
    u_a: int
    v: int
    size: int


class Blocks(NamedTuple):
    """The blocks of a y, or their slices."""

    xtilde: Any
    sigma_hat: Any
    u_a: Any
    v: Any


def layout(n: int, m: int) -> Layout:
    """The layout for n states and m inputs."""
    return Layout(n, m, *accumulate((n, m, m, n)))


@inlined
def blocks(y: Any, at: Any) -> Any:
    """The blocks of y (Y,) as views of it."""
    return Blocks(
        y[: at.sigma_hat],
        y[at.sigma_hat : at.u_a],
        y[at.u_a : at.v],
        y[at.v : at.size],
    )


def slices(at: Layout) -> Blocks:
    """The slices of the blocks, for matrices whose rows or columns are those of y."""
    found: Blocks = blocks.py_func(np.s_, at)  # type: ignore[attr-defined]
    return found
