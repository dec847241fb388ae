"""Vectorised interval arithmetic with outward rounding.

An `Interval` is a pair of float64 arrays; every operation returns an enclosure of the exact result for all reals in
its operands. IEEE operations are rounded to nearest and moved one float outward; library functions are not correctly
rounded and are widened by several ulps. An undefined operation (0/0, sqrt of a negative, inf - inf) yields NaN bounds;
`Interval.sanitised` turns those into [-inf, inf], so that NaN never reads as a bound.
"""

from __future__ import annotations

from fractions import Fraction
from math import isnan
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tubecert.enclosure.outward import INFINITE, NEGATIVE, down, number_above, number_below, up

Array = NDArray[np.float64]

# numpy's and libm's elementary functions are documented to 4 ulp; 16 units of 2**-53 relative are 8 to 16 ulp.
_LIBRARY_ERROR: Final = 16 * 2.0**-53
_TINY: Final = 1e-300  # covers gradual underflow of library functions
_LARGEST_ANGLE: Final = 1e12  # beyond it the quadrant test below would need more than double precision


_UNKNOWN: Final = np.array(np.nan)
# as arrays: a number of Python's costs numpy as much as the operation
_ZERO: Final = np.array(0.0)


class Interval:
    """Arrays `lo <= hi` of equal shape; the set of all x with lo <= x <= hi elementwise."""

    __slots__ = ("hi", "lo")

    # numpy must not take over `array + interval`
    __array_ufunc__ = None

    def __init__(self, lo: ArrayLike, hi: ArrayLike) -> None:
        self.lo: Array = np.asarray(lo, dtype=np.float64)
        self.hi: Array = np.asarray(hi, dtype=np.float64)

    @staticmethod
    def exact(value: ArrayLike) -> Interval:
        """The floats themselves, for what a float is by definition: a constant, a bound, a point or a corner of a box.

        What is computed in floats, measured or sampled is no such thing: it is near a number, and no enclosure of it.
        """
        found = Interval.__new__(Interval)
        found.lo = found.hi = np.asarray(value, dtype=np.float64)
        return found

    @staticmethod
    def of(value: Interval | Fraction | int) -> Interval:
        """The tightest interval that contains an exact number, rounded outward; raises `TypeError` for a float."""
        if isinstance(value, Interval):
            return value
        if not isinstance(value, (Fraction, int)):
            raise TypeError(
                f"{type(value).__name__} says nothing of its error: Interval.exact if it has none"
            )
        if isinstance(value, int) and abs(value) < 2**53:
            return Interval.exact(value)
        return Interval(*fraction_bounds(Fraction(value)))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the bounds."""
        return np.broadcast_shapes(self.lo.shape, self.hi.shape)

    @property
    def mid(self) -> Array:
        """A float inside (or beside by rounding) each interval."""
        return 0.5 * self.lo + 0.5 * self.hi

    @property
    def rad(self) -> Array:
        """A radius about `mid` that covers each interval, rounded up."""
        mid = self.mid
        return np.maximum(up(self.hi - mid), up(mid - self.lo))

    @property
    def magnitude(self) -> Array:
        """sup |x| over each interval."""
        return np.maximum(-self.lo, self.hi)

    @property
    def mignitude(self) -> Array:
        """inf |x| over each interval."""
        return np.maximum(0.0, np.maximum(self.lo, -self.hi))

    def sanitised(self) -> Interval:
        """The same with NaN bounds opened to infinity."""
        bad = np.isnan(self.lo) | np.isnan(self.hi)
        return Interval(np.where(bad, NEGATIVE, self.lo), np.where(bad, INFINITE, self.hi))

    def contains(self, x: ArrayLike) -> NDArray[np.bool_]:
        """Elementwise lo <= x <= hi."""
        value = np.asarray(x, dtype=np.float64)
        return (self.lo <= value) & (value <= self.hi)

    def hull(self, other: Interval) -> Interval:
        """The smallest interval containing both."""
        return Interval(np.minimum(self.lo, other.lo), np.maximum(self.hi, other.hi))

    def __getitem__(self, index: Any) -> Interval:  # any index that numpy takes
        return Interval(self.lo[index], self.hi[index])

    def __repr__(self) -> str:
        return f"Interval({self.lo!r}, {self.hi!r})"

    def __neg__(self) -> Interval:
        return Interval(-self.hi, -self.lo)

    def __add__(self, other: Interval | Fraction | int) -> Interval:
        b = Interval.of(other)
        return Interval(down(self.lo + b.lo), up(self.hi + b.hi))

    __radd__ = __add__

    def __sub__(self, other: Interval | Fraction | int) -> Interval:
        b = Interval.of(other)
        return Interval(down(self.lo - b.hi), up(self.hi - b.lo))

    def __rsub__(self, other: Interval | Fraction | int) -> Interval:
        return Interval.of(other) - self

    def __mul__(self, other: Interval | Fraction | int) -> Interval:
        b = Interval.of(other)
        if _numbers(self, b):
            c, d, e, f = self.lo.item(), self.hi.item(), b.lo.item(), b.hi.item()
            p, q, r, s = c * e, c * f, d * e, d * f
            if not isnan(p + q + r + s):  # nor any of them
                return _number(min(p, q, r, s), max(p, q, r, s), self, b)
        lo, hi = _ends(np.multiply, self, b)
        return Interval(down(lo), up(hi))

    __rmul__ = __mul__

    def __truediv__(self, other: Interval | Fraction | int) -> Interval:
        b = Interval.of(other)
        if _numbers(self, b):
            c, d, e, f = self.lo.item(), self.hi.item(), b.lo.item(), b.hi.item()
            if (e > 0 and f > 0) or (e < 0 and f < 0):
                p, q, r, s = c / e, c / f, d / e, d / f
                if not isnan(p + q + r + s):
                    return _number(min(p, q, r, s), max(p, q, r, s), self, b)
        through_zero = ~((b.lo > _ZERO) | (b.hi < _ZERO))
        lo, hi = _ends(np.divide, self, b)
        return Interval(np.where(through_zero, _UNKNOWN, down(lo)), np.where(through_zero, _UNKNOWN, up(hi)))

    def __rtruediv__(self, other: Interval | Fraction | int) -> Interval:
        return Interval.of(other) / self

    def __pow__(self, n: int) -> Interval:
        if n < 0:
            return 1 / self ** (-n)
        if n == 0:
            return Interval.exact(np.ones(self.shape))
        if n % 2:
            return Interval(_power(self.lo, n, upward=False), _power(self.hi, n, upward=True))
        # NaN in an end is NaN in both
        return Interval(
            _power(self.mignitude, n, upward=False, positive=True),
            _power(self.magnitude, n, upward=True, positive=True),
        )


def _numbers(a: Interval, b: Interval) -> bool:
    """Whether each of two is an interval of one number: there Python is several times as fast as numpy."""
    return a.lo.size == 1 and a.hi.size == 1 and b.lo.size == 1 and b.hi.size == 1


def _number(lo: float, hi: float, a: Interval, b: Interval) -> Interval:
    """What is computed from two such intervals, rounded outward, in their shape."""
    axes = max(a.lo.ndim, a.hi.ndim, b.lo.ndim, b.hi.ndim)
    return Interval(np.array(number_below(lo), ndmin=axes), np.array(number_above(hi), ndmin=axes))


def _ends(function: np.ufunc, a: Interval, b: Interval) -> tuple[Array, Array]:
    """The least and the greatest value at the ends; those of a number itself are one."""
    p = function(a.lo, b.lo)
    if b.lo is b.hi:
        if a.lo is a.hi:
            return p, p
        r = function(a.hi, b.lo)
        return np.minimum(p, r), np.maximum(p, r)
    q = function(a.lo, b.hi)
    lo, hi = np.minimum(p, q), np.maximum(p, q)
    if a.lo is not a.hi:
        for last in (function(a.hi, b.lo), function(a.hi, b.hi)):
            lo, hi = np.minimum(lo, last), np.maximum(hi, last)
    return lo, hi


def _power(x: Array, n: int, *, upward: bool, positive: bool = False) -> Array:
    """x**n by repeated multiplication, rounded upward or downward; `positive`: no x is below 0."""
    if x.size == 1 and not isnan(number := x.item()):
        if positive:
            number = abs(number)
        return np.array(_power_of_number(number, n, upward=upward), ndmin=x.ndim)
    magnitude = np.abs(x)
    if positive:
        return _power_above(magnitude, n) if upward else _power_below(magnitude, n)
    above, below = _power_above(magnitude, n), _power_below(magnitude, n)
    return np.where(x >= _ZERO, above, -below) if upward else np.where(x >= _ZERO, below, -above)


def _power_above(magnitude: Array, n: int) -> Array:
    value = magnitude
    for _ in range(n - 1):
        value = up(value * magnitude)
    return value


def _power_below(magnitude: Array, n: int) -> Array:
    value = magnitude
    for _ in range(n - 1):
        value = np.maximum(_ZERO, down(value * magnitude))
    return value


def _power_of_number(x: float, n: int, *, upward: bool) -> float:
    """The same of one number that is not NaN."""
    value = magnitude = abs(x)
    for _ in range(n - 1):
        value = (
            number_above(value * magnitude)
            if upward == (x >= 0)
            else max(0.0, number_below(value * magnitude))
        )
    return value if x >= 0 else -value


def fraction_bounds(q: Fraction) -> tuple[float, float]:
    """The floats next to a rational number: `(lo, hi)` with lo <= q <= hi, equal if q is a float."""
    try:
        near = q.numerator / q.denominator
    except OverflowError:
        return (np.finfo(float).max, np.inf) if q > 0 else (-np.inf, -np.finfo(float).max)
    exact = Fraction(near)
    if exact == q:
        return near, near
    if exact < q:
        return near, float(np.nextafter(near, np.inf))
    return float(np.nextafter(near, -np.inf)), near


PI: Final = Interval(np.pi, np.nextafter(np.pi, np.inf))  # float pi lies below pi


def _widened(lo: Array, hi: Array) -> Interval:
    return Interval(lo - (_LIBRARY_ERROR * np.abs(lo) + _TINY), hi + (_LIBRARY_ERROR * np.abs(hi) + _TINY))


def sqrt(a: Interval) -> Interval:
    """Square root; NaN where the operand reaches below 0."""
    lo, hi = np.sqrt(a.lo), np.sqrt(a.hi)
    return Interval(
        np.where(a.lo == 0, 0.0, np.maximum(down(lo), 0.0)), np.where(np.isnan(lo), np.nan, up(hi))
    )


def exp(a: Interval) -> Interval:
    """Exponential."""
    wide = _widened(np.exp(a.lo), np.exp(a.hi))
    return Interval(np.maximum(wide.lo, 0.0), wide.hi)


def expm1(a: Interval) -> Interval:
    """exp(a) - 1 without cancellation."""
    return _widened(np.expm1(a.lo), np.expm1(a.hi))


def log1p(a: Interval) -> Interval:
    """log(1 + a) without cancellation; NaN where the operand reaches -1."""
    wide = _widened(np.log1p(a.lo), np.log1p(a.hi))
    bad = ~(a.lo > -1)
    return Interval(np.where(bad, np.nan, wide.lo), np.where(bad, np.nan, wide.hi))


def _touches(a: Interval, phase: float) -> NDArray[np.bool_]:
    """Whether phase + 2 k pi may lie in `a` for some integer k; says yes in doubt."""
    # the float error of a quotient, and of its slack, is below 1e-16 (|x| + 10) for |x| <= 2e12
    left, right = (np.maximum(1e-9, 1e-15 * np.fmin(np.abs(end), 4e12)) for end in (a.lo, a.hi))
    return np.ceil((a.lo - phase) / (2 * np.pi) - left) <= np.floor((a.hi - phase) / (2 * np.pi) + right)


def _wave(a: Interval, function: np.ufunc, peak: float, trough: float) -> Interval:
    left, right = function(a.lo), function(a.hi)
    wide = _widened(np.minimum(left, right), np.maximum(left, right))
    # near its zeros the relative error of a range reduction can be lost: allow an absolute one too
    lo, hi = wide.lo - 2.0**-52, wide.hi + 2.0**-52
    large = ~((np.abs(a.lo) <= _LARGEST_ANGLE) & (np.abs(a.hi) <= _LARGEST_ANGLE))
    lo = np.where(_touches(a, trough) | large, -1.0, np.maximum(lo, -1.0))
    hi = np.where(_touches(a, peak) | large, 1.0, np.minimum(hi, 1.0))
    return Interval(lo, hi)


def sin(a: Interval) -> Interval:
    """Sine."""
    return _wave(a, np.sin, np.pi / 2, -np.pi / 2)


def cos(a: Interval) -> Interval:
    """Cosine."""
    return _wave(a, np.cos, 0.0, np.pi)


def tan(a: Interval) -> Interval:
    """Tangent; NaN where a pole may lie inside."""
    wide = _widened(np.tan(a.lo), np.tan(a.hi))
    doubled = Interval(2.0 * a.lo, 2.0 * a.hi)  # tan(x) has its poles where 2x = pi + 2 k pi
    bad = _touches(doubled, np.pi) | ~((np.abs(a.lo) <= _LARGEST_ANGLE) & (np.abs(a.hi) <= _LARGEST_ANGLE))
    return Interval(np.where(bad, np.nan, wide.lo - 2.0**-52), np.where(bad, np.nan, wide.hi + 2.0**-52))


def atan(a: Interval) -> Interval:
    """Inverse tangent."""
    wide = _widened(np.arctan(a.lo), np.arctan(a.hi))
    return Interval(np.maximum(wide.lo, -0.5 * PI.hi), np.minimum(wide.hi, 0.5 * PI.hi))


def asin(a: Interval) -> Interval:
    """Inverse sine; NaN where the operand leaves [-1, 1]."""
    wide = _widened(np.arcsin(a.lo), np.arcsin(a.hi))
    return _within_unit(a, wide, Interval(-0.5 * PI.hi, 0.5 * PI.hi))


def acos(a: Interval) -> Interval:
    """Inverse cosine; NaN where the operand leaves [-1, 1]."""
    wide = _widened(np.arccos(a.hi), np.arccos(a.lo))
    return _within_unit(a, wide, Interval(0.0, PI.hi))


def _within_unit(a: Interval, wide: Interval, most: Interval) -> Interval:
    bad = ~((a.lo >= -1) & (a.hi <= 1))
    lo, hi = np.maximum(wide.lo, most.lo), np.minimum(wide.hi, most.hi)
    return Interval(np.where(bad, np.nan, lo), np.where(bad, np.nan, hi))


def log(a: Interval) -> Interval:
    """Natural logarithm; NaN where the operand reaches 0."""
    wide = _widened(np.log(a.lo), np.log(a.hi))
    bad = ~(a.lo > 0)
    return Interval(np.where(bad, np.nan, wide.lo), np.where(bad, np.nan, wide.hi))


def sinh(a: Interval) -> Interval:
    """Hyperbolic sine."""
    return _widened(np.sinh(a.lo), np.sinh(a.hi))


def cosh(a: Interval) -> Interval:
    """Hyperbolic cosine; smallest at 0."""
    wide = _widened(np.cosh(a.mignitude), np.cosh(a.magnitude))
    return Interval(np.maximum(wide.lo, 1.0), wide.hi)


def tanh(a: Interval) -> Interval:
    """Hyperbolic tangent."""
    wide = _widened(np.tanh(a.lo), np.tanh(a.hi))
    return Interval(np.maximum(wide.lo, -1.0), np.minimum(wide.hi, 1.0))


def norm(parts: list[Interval]) -> Interval:
    """Euclidean norm; of one part its absolute value."""
    if len(parts) == 1:
        return Interval(parts[0].mignitude + 0 * parts[0].lo, parts[0].magnitude + 0 * parts[0].lo)
    total = parts[0] ** 2
    for part in parts[1:]:
        total = total + part**2
    return sqrt(Interval(np.maximum(total.lo, 0.0), total.hi))


def direction(parts: list[Interval], index: int) -> Interval:
    """The component parts[index]/norm(parts); any value in [-1, 1] where the norm may vanish."""
    length = norm(parts)
    ratio = parts[index] / length
    bad = np.isnan(ratio.lo) | np.isnan(ratio.hi) | ~(length.lo > 0)
    lo = np.where(bad, -1.0, np.clip(ratio.lo, -1.0, 1.0))
    return Interval(lo, np.where(bad, 1.0, np.clip(ratio.hi, -1.0, 1.0)))
