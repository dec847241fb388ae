"""Ball arithmetic: exact numbers as balls, outward ends, norms and definiteness of small matrices.

A ball that is not a number bounds nothing: every comparison with it is false, so it can never confirm a claim.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction

from flint import arb, arb_mat, fmpq

Ball = arb
Balls = list[list[arb]]  # a matrix

_SQUARINGS = 7  # of a matrix, to propose its largest eigenvalue: its power of 2^7
_HALVINGS = 120
_NUDGE = 2.0**-30
_INFLATIONS = (1e-13, 1e-10, 1e-7, 1e-4, 1e-2)


def exact(q: Fraction | int) -> arb:
    """A rational number as a ball around it."""
    return arb(fmpq(q.numerator, q.denominator))


def between(lo: arb | float, hi: arb | float) -> arb:
    """A ball that contains everything between two numbers."""
    return arb(lo).union(arb(hi))


def floor(x: arb) -> float:
    """A float at or below every number of the ball; -inf if nothing is known."""
    value = float(x.lower())
    return -math.inf if math.isnan(value) else math.nextafter(value, -math.inf)


def ceiling(x: arb) -> float:
    """A float at or above every number of the ball; inf if nothing is known."""
    value = float(x.upper())
    return math.inf if math.isnan(value) else math.nextafter(value, math.inf)


def square(x: arb) -> arb:
    """x^2, never negative."""
    if x.contains(0):
        top = x.abs_upper()
        return between(0, top * top)
    found = x * x
    if found.contains(0):  # of a wide ball: a product of balls loses what is known of its sign
        return between((x.abs_lower() * x.abs_lower()).lower(), (x.abs_upper() * x.abs_upper()).upper())
    return found


def power(x: arb, n: int) -> arb:
    """x^n for an integer n by multiplication (flint's own power of a ball around 0 is not a number)."""
    if n < 0:
        return arb(1) / power(x, -n)
    result, factor, left = arb(1), x, n
    while left:
        if left & 1:
            result = result * factor
        left >>= 1
        if left:
            factor = square(factor)
    if x > 0 and result.contains(0) and x.lower() < x.upper():  # the same: x^n increases there
        return between(power(x.lower(), n).lower(), power(x.upper(), n).upper())
    return result


def root(x: arb) -> arb:
    """The square root of what is known not to be negative: a ball that reaches below 0 is cut there."""
    if x >= 0:
        return x.sqrt()
    top = x.upper()
    return between(0, top.sqrt().upper()) if top >= 0 else arb("nan")


def length(entries: Sequence[arb]) -> arb:
    """The Euclidean norm."""
    return root(sum((square(x) for x in entries), start=arb(0)))


def pivots(a: Balls) -> list[arb]:
    """The pivots of a symmetric matrix as far as they are positive, then the first that is not proven to be.

    All positive: positive definite. The last one negative: not even semidefinite.
    """
    rows = [list(row) for row in a]
    found: list[arb] = []
    for k in range(len(rows)):
        pivot = rows[k][k]
        found.append(pivot)
        if not pivot > 0:
            break
        for i in range(k + 1, len(rows)):
            ratio = rows[i][k] / pivot
            for j in range(k + 1, i + 1):
                rows[i][j] = rows[i][j] - ratio * rows[j][k]
    return found


def is_positive(a: Balls | arb_mat) -> bool:
    """Whether a symmetric matrix is proven to be positive definite.

    By the signs of its characteristic polynomial: the eigenvalues are real, and none of them is negative or zero if
    and only if the signs of the coefficients alternate. Where these are not known, by elimination.
    """
    m = a if isinstance(a, arb_mat) else arb_mat(a)
    alternating, signs = True, (1, -1)
    for k, c in enumerate(reversed(m.charpoly().coeffs())):
        value = c * signs[k % 2]
        if value < 0:
            return False
        alternating = alternating and bool(value > 0)
    return alternating or all(pivot > 0 for pivot in pivots(m.tolist()))


def is_indefinite(a: Balls) -> bool:
    """Whether a symmetric matrix is proven to have a negative eigenvalue.

    Where a pivot is near zero, a little is added to the diagonal: that makes no eigenvalue smaller.
    """
    if pivots(a)[-1] < 0:
        return True
    more = max(abs(float(x.mid())) for row in a for x in row) * _NUDGE
    return math.isfinite(more) and bool(
        pivots([[x + more if i == j else x for j, x in enumerate(row)] for i, row in enumerate(a)])[-1] < 0
    )


def spectral_norm(a: Balls) -> arb:
    """An upper bound of the spectral norm, close to it where the entries are thin."""
    if len(a) == 1 or len(a[0]) == 1:
        return length([x for row in a for x in row]).upper()
    tall = a if len(a) >= len(a[0]) else [list(column) for column in zip(*a, strict=True)]
    m = arb_mat(tall)
    gram = (m.transpose() * m).tolist()
    n = len(gram)
    guess = proposed_largest([[float(x.mid()) for x in row] for row in gram])
    if math.isfinite(guess):
        for inflation in _INFLATIONS:
            top = arb(guess) * (1 + inflation)
            if is_positive([[(top if i == j else 0) - gram[i][j] for j in range(n)] for i in range(n)]):
                return top.sqrt().upper()
    return length([x for row in a for x in row]).upper()


def sharp_norm(a: Balls) -> arb:
    """An upper bound of the spectral norm, as close as the precision allows."""
    m = arb_mat(a)
    gram = (m.transpose() * m).tolist()
    top = length([x for row in a for x in row]).upper()
    return _bisected(lambda t: is_positive(_shifted(t * t, gram)), top, arb(0)).upper()


def _shifted(t: arb, a: Balls) -> Balls:
    """t I - a."""
    return [[(t if i == j else 0) - x for j, x in enumerate(row)] for i, row in enumerate(a)]


def _bisected(serves: Callable[[arb], bool], high: arb, low: arb) -> arb:
    """The least t that is found to serve; not a number if `high` does not (a little above it is tried)."""
    high = (high * (1 + arb(2) ** -20)).mid() + arb(2) ** -60
    if not serves(high):
        return arb("nan")
    for _ in range(_HALVINGS):
        middle = ((low + high) / 2).mid()
        low, high = (low, middle) if serves(middle) else (middle, high)
    return high


def proposed_largest(a: list[list[float]]) -> float:
    """The largest eigenvalue of a positive semidefinite matrix, a proposal in floats."""
    b = a
    n = len(a)
    for _ in range(_SQUARINGS):
        size = max((abs(x) for row in b for x in row), default=0.0)
        if not 0 < size < math.inf:
            return 0.0 if size == 0 else math.inf
        b = [[x / size for x in row] for row in b]
        b = [[sum(b[i][k] * b[k][j] for k in range(n)) for j in range(n)] for i in range(n)]
    v = max(b, key=lambda row: sum(x * x for x in row))
    image = [sum(x * y for x, y in zip(row, v, strict=True)) for row in a]
    total = sum(x * x for x in v)
    return math.sqrt(sum(x * x for x in image) / total) if total > 0 else math.inf


def whitening(a: list[list[float]]) -> list[list[float]]:
    """T with T a T' near the identity, a proposal in floats; the identity where there is none."""
    n = len(a)
    lower = [[0.0] * n for _ in range(n)]
    inverse = [[float(i == j) for j in range(n)] for i in range(n)]
    for i in range(n):
        for j in range(i + 1):
            rest = a[i][j] - sum(lower[i][k] * lower[j][k] for k in range(j))
            if i == j:
                if not 0 < rest < math.inf:
                    return [[float(p == q) for q in range(n)] for p in range(n)]
                lower[i][i] = math.sqrt(rest)
            else:
                lower[i][j] = rest / lower[j][j]
    for i in range(n):
        for j in range(n):
            rest = inverse[i][j] - sum(lower[i][k] * inverse[k][j] for k in range(i))
            inverse[i][j] = rest / lower[i][i]
    return inverse


# -- matrices put together and taken apart


def picked(rows: range, size: int) -> arb_mat:
    """Rows of the unit matrix of a size."""
    return arb_mat(len(rows), size, [int(i == j) for i in rows for j in range(size)])


def column(entries: Sequence[arb]) -> arb_mat:
    """A matrix of one column."""
    return arb_mat(len(entries), 1, list(entries))


def joined(blocks: Sequence[Sequence[arb_mat]]) -> arb_mat:
    """A matrix of blocks: those of one row are equally high, those of one column equally wide."""
    lines = [line for row in blocks for line in zip(*(block.tolist() for block in row), strict=True)]
    width = sum(block.ncols() for block in blocks[0])
    return arb_mat(len(lines), width, [x for line in lines for part in line for x in part])


def stacked(parts: Sequence[arb_mat]) -> arb_mat:
    """A matrix of all rows."""
    return joined([[own] for own in parts])


def sizes(a: arb_mat) -> arb_mat:
    """The entries' largest magnitudes."""
    return arb_mat(a.nrows(), a.ncols(), [x.abs_upper() for x in a.entries()])


def around_zero(a: arb_mat) -> arb_mat:
    """Balls around 0 as large as the entries: r times such a column is a ball around 0 as large as |r| times it."""
    return arb_mat(a.nrows(), a.ncols(), [arb(0, x.abs_upper()) for x in a.entries()])
