"""Another processor, made worse: LAPACK and the solvers are handed data that are off by a rounding or two.

A pytest plugin, loaded by hand. Nothing that must hold may depend on it:

    PYTHONPATH=tests/harness LAST_DIGITS=7 python -m pytest -p last_digits tests/synthesis

`LAST_DIGITS` is a seed. Every float that goes into a decomposition, a linear solve or a conic program is multiplied
with 1 + k 2^-52, |k| <= 2, and the vectors of decompositions come out with other signs: always in the same way for the
same shape, as from one library on one processor.
"""

import os
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from scipy import sparse

_SEED = int(os.environ.get("LAST_DIGITS", "1"))
_ULPS = 2
_FUNCTIONS = ("eigvals", "eigvalsh", "solve", "inv", "pinv", "lstsq", "cholesky", "norm", "det", "cond")


@cache
def _factors(*shape: int) -> np.ndarray:
    moves = np.random.default_rng((_SEED, *shape)).integers(-_ULPS, _ULPS + 1, shape)
    return 1 + np.finfo(float).eps * moves


@cache
def _signs(count: int) -> np.ndarray:
    return np.random.default_rng((_SEED, count)).choice([-1.0, 1.0], count)


def moved(value: Any) -> Any:
    """The same numbers, each off by a rounding or two; what is no array of floats stays."""
    if sparse.issparse(value):
        value = value.copy()
        value.data = moved(value.data)
        return value
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        with np.errstate(all="ignore"):
            return value * _factors(*value.shape[-2:])
    return value


def _plain(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *given, **options: function(*map(moved, given), **options)


def _eigh(function: Callable[..., Any]) -> Callable[..., Any]:
    def eigh(a: Any, *rest: Any, **options: Any) -> Any:
        found = function(moved(a), *rest, **options)
        return type(found)(found.eigenvalues, found.eigenvectors * _signs(found.eigenvalues.shape[-1]))

    return eigh


def _svd(function: Callable[..., Any]) -> Callable[..., Any]:
    def svd(a: Any, *rest: Any, **options: Any) -> Any:
        found = function(moved(a), *rest, **options)
        if isinstance(found, np.ndarray):
            return found
        u, s, vt = found
        signs = _signs(s.shape[-1])
        u, vt = u.copy(), vt.copy()
        u[..., : len(signs)] *= signs
        vt[..., : len(signs), :] *= signs[:, None]
        return type(found)(u, s, vt)

    return svd


def _qr(function: Callable[..., Any]) -> Callable[..., Any]:
    def qr(a: Any, *rest: Any, **options: Any) -> Any:
        found = function(moved(a), *rest, **options)
        if isinstance(found, np.ndarray):
            return found
        q, r = found
        signs = _signs(r.shape[-2])
        return type(found)(q * signs, r * signs[:, None])

    return qr


def pytest_configure() -> None:
    """Puts itself between the package and its libraries."""
    import clarabel
    import scs

    for name in _FUNCTIONS:
        setattr(np.linalg, name, _plain(getattr(np.linalg, name)))
    for name, wrapper in (("eigh", _eigh), ("svd", _svd), ("qr", _qr)):
        setattr(np.linalg, name, wrapper(getattr(np.linalg, name)))
    clarabel.DefaultSolver = _plain(clarabel.DefaultSolver)
    first = scs.SCS

    def scs_moved(data: dict[str, Any], cone: Any, **options: Any) -> Any:
        return first({name: moved(part) for name, part in data.items()}, cone, **options)

    scs.SCS = scs_moved
