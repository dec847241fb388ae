"""A second evaluator: texts of the grammar in ball arithmetic, read without the package's parser or graph."""

import re
from collections.abc import Callable, Iterator, Sequence
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


def exactly(text: str) -> arb:
    """A decimal or a quotient."""
    return ball(Fraction(text))


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
    return eval(code, {**_NAMES, "pi": arb.pi(), "Q": exactly, **names})


def possible(value: arb, lo: float, hi: float) -> bool:
    """False only if the value is proven to lie outside [lo, hi]; infinite ends bound nothing."""
    above_lo = lo == -float("inf") or not value < arb(float(lo))
    return above_lo and (hi == float("inf") or not value > arb(float(hi)))


def balls_of(box: Sequence[Sequence[Fraction]]) -> list[arb]:
    """The sides of a box, outward."""

    def radius(width: Fraction) -> arb:
        return arb(0, float(width / 2) * (1 + 1e-12) + 1e-300)

    return [arb((lo + hi).numerator, 0) / (2 * (lo + hi).denominator) + radius(hi - lo) for lo, hi in box]


def prove(box: Sequence[Sequence[Fraction]], holds: Callable[[list[arb]], bool], budget: int) -> int:
    """Whether `holds` (on boxes of balls) is proven everywhere by bisection of the widest side; of how many boxes."""
    stack, count = [box], 0
    while stack:
        part = stack.pop()
        count += 1
        assert count < budget, "the independent proof ran out of boxes"
        if holds(balls_of(part)):
            continue
        k = max(range(len(part)), key=lambda i: part[i][1] - part[i][0])
        middle = sum(part[k]) / 2
        stack += [
            [*part[:k], (part[k][0], middle), *part[k + 1 :]],
            [*part[:k], (middle, part[k][1]), *part[k + 1 :]],
        ]
    return count
