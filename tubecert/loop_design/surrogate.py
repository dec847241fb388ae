"""The remainder as a quadratic in the tube, fitted to the bound that a proof uses: cheap, for a search. Untrusted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.remainders import Remainders


def fitted(remainders: Remainders, reach: Array) -> Callable[[Array, Array], Array]:
    """rho(W, U) (n + m,) as c + V z + z'Q z, z = (W, U): exact where `reach` (n + m,) says, on axes and in pairs."""
    n, k = remainders.loop.states, len(reach)

    def bound(z: Array) -> Array:
        return remainders.rho(z[:n], z[n:], remainders.sizes(z[:n]).size)

    steps = np.diag(reach)
    base = bound(np.zeros(k))
    near = np.array([bound(0.5 * step) for step in steps]) - base
    far = np.array([bound(step) for step in steps]) - base
    bent = np.maximum(2 * far - 4 * near, 0.0)  # of reach_j^2
    slope = np.maximum(far - bent, 0.0)
    linear = slope / reach[:, None]
    square = np.zeros((k, k, len(base)))
    for i in range(k):
        square[i, i] = bent[i] / reach[i] ** 2
        for j in range(i):
            both = bound(steps[i] + steps[j]) - base - far[i] - far[j]
            square[i, j] = np.maximum(both, 0.0) / (reach[i] * reach[j])
    flat = np.nan_to_num(square.reshape(k, -1), posinf=1e30)
    linear = np.nan_to_num(linear, posinf=1e30)

    def rho(W: Array, U: Array) -> Array:
        z = np.concatenate([W, U])
        return np.asarray(base + z @ linear + z @ (z @ flat).reshape(k, -1))

    return rho
