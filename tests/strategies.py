"""Random expressions as texts of the grammar."""

import math
from fractions import Fraction
from functools import cache

from hypothesis import strategies as st

from tubecert.expression import Expression, parse, symbol

NAMES = ("x", "y", "t")
SYMBOLS: dict[str, Expression] = {name: symbol(name) for name in NAMES}


def read(text: str) -> Expression:
    """The expression of a text in these names."""
    return parse(text, symbols=SYMBOLS, kinks=True).expression


def fractions(
    low: Fraction | str | int, high: Fraction | str | int, largest: int
) -> st.SearchStrategy[Fraction]:
    """Of [low, high]; hypothesis' own makes strategies anew for every number, which takes ten times as long."""
    least, most = Fraction(low), Fraction(high)

    def inside(drawn: tuple[int, int]) -> Fraction:
        numerator, denominator = drawn
        first, last = math.ceil(least * denominator), math.floor(most * denominator)
        if last < first:
            return least
        return Fraction(first + (numerator - first) % (last - first + 1), denominator)

    numerators = st.integers(math.ceil(least * largest), math.floor(most * largest))
    return st.tuples(numerators, st.integers(1, largest)).map(inside)


_numbers = st.sampled_from(["0", "1", "2", "3", "0.5", "1e-1", ".25", "7/3", "12"])
_leaves = st.one_of(st.sampled_from(NAMES), _numbers, st.just("pi"))


def _grow(children: st.SearchStrategy[str], *, smooth: bool) -> st.SearchStrategy[str]:
    pair = st.tuples(children, children)
    shapes = [
        st.tuples(st.sampled_from("+-*"), pair).map(lambda v: f"({v[1][0]} {v[0]} {v[1][1]})"),
        children.map(lambda e: f"-({e})"),
        st.tuples(children, st.integers(0, 3)).map(lambda v: f"({v[0]})**{v[1]}"),
        st.tuples(st.sampled_from(("sin", "cos")), children).map(lambda v: f"{v[0]}({v[1]})"),
    ]
    if not smooth:
        shapes += [
            pair.map(lambda v: f"({v[0]})/(({v[1]})**2 + 1)"),
            children.map(lambda e: f"sqrt(({e})**2 + 1/2)"),
            children.map(lambda e: f"exp(sin({e}))"),
            children.map(lambda e: f"tan(sin({e}))"),
            children.map(lambda e: f"(2 + cos({e}))**-2"),
            st.tuples(st.sampled_from(("tanh", "atan")), children).map(lambda v: f"{v[0]}({v[1]})"),
            st.tuples(st.sampled_from(("asin", "acos", "sinh", "cosh")), children).map(
                lambda v: f"{v[0]}(0.99*sin({v[1]}))"
            ),
            children.map(lambda e: f"log(({e})**2 + 1/8)"),
        ]
    return st.one_of(shapes)


@cache
def texts(*, smooth: bool = False, leaves: int = 8) -> st.SearchStrategy[str]:
    """Expressions that are defined everywhere; `smooth` ones are polynomials, sines and cosines."""
    return st.recursive(_leaves, lambda children: _grow(children, smooth=smooth), max_leaves=leaves)


points = st.fixed_dictionaries({name: fractions(-2, 2, 16) for name in NAMES})
rationals = st.fractions(max_denominator=10**6) | st.builds(
    lambda digits, exponent: Fraction(digits) * Fraction(10) ** exponent,
    st.integers(-(10**6), 10**6),
    st.integers(-40, 40),
)
