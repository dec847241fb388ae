"""A second evaluator: texts of the grammar in ball arithmetic, read without the package's parser or graph."""

import re
from collections.abc import Iterator
from contextlib import nullcontext
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from flint import arb, ctx

_NUMBER = re.compile(r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")


def ball(q: Fraction) -> arb:
    """A rational number."""
    return arb(q.numerator) / q.denominator


def precision(bits: int, *, quiet: bool = False) -> Any:
    """A fixture for all tests of a file: balls of so many bits; `quiet`: the silence that searches grant, too."""

    @pytest.fixture(autouse=True)
    def precision() -> Iterator[None]:
        with ctx.workprec(bits), np.errstate(all="ignore") if quiet else nullcontext():
            yield

    return precision


def _norm(*parts: arb) -> arb:
    return sum((p * p for p in parts), start=arb(0)).sqrt()


_NAMES = {
    "sin": lambda x: x.sin(),
    "cos": lambda x: x.cos(),
    "tan": lambda x: x.tan(),
    "exp": lambda x: x.exp(),
    "asin": lambda x: x.asin(),
    "acos": lambda x: x.acos(),
    "atan": lambda x: x.atan(),
    "sinh": lambda x: x.sinh(),
    "cosh": lambda x: x.cosh(),
    "tanh": lambda x: x.tanh(),
    "log": lambda x: x.log(),
    "sqrt": lambda x: x.sqrt(),
    "abs": abs,
    "norm": _norm,
    "__builtins__": {},
}


def evaluate(text: str, point: dict[str, Fraction]) -> arb:
    """The value of a text at a rational point."""
    code = _NUMBER.sub(lambda m: f"Q('{m.group()}')", text)
    names = {name: ball(q) for name, q in point.items()}
    return eval(code, {**_NAMES, "pi": arb.pi(), "Q": lambda s: ball(Fraction(s)), **names})


def possible(value: arb, lo: float, hi: float) -> bool:
    """False only if the value is proven to lie outside [lo, hi]; infinite ends bound nothing."""
    above_lo = lo == -float("inf") or not value < arb(float(lo))
    return above_lo and (hi == float("inf") or not value > arb(float(hi)))
