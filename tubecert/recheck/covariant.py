"""Constants of certificate H that are measured by a metric which is not constant, each as a claim over the tube.

Written from their definitions (theory 8), with every index raised by W, so that the metric M = adj(W)/d, d = det W,
occurs once at most; each claim is multiplied by d, which is positive by C1, a claim of its own.
With D^a = sum_i W_ai d/dx_i and covectors p, |p|^2 = p'W p,
    G^kab = (-(D^a W)_kb - (D^b W)_ka + (D^k W)_ab)/2,    (D^b X)_k = (X_x W)_kb + G^kbc (M X)_c,
    D_nX: [t W, D X; (D X)', t W] >= 0;   beta_O: t^2 W >= B B';   phi_M: X' M X <= t^2;
    D_nF: |p_a (D^a F)| <= t |p| W, (D^a F)_kl = (D^a F_kl) + G^kac (M F)_cl + G^lac (M F)_ck:
          q' M q <= t^2 (v'W v)^2 for q_a = v'(D^a F) v, the largest p.q being |q|_M |p|;
    D_nb: [W, C'; C, t^2 |p|^2] >= 0, C_jk = p_a (D^a b_j)_k, on the plan;
    K_R: |R| <= t (W_ik W_jl - W_il W_jk), R_ijkl the curvature as a form of bivectors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations

from tubecert.recheck.cover import Outcome, prove
from tubecert.recheck.metric import adjugate, determinant, stated, together
from tubecert.recheck.place import Place
from tubecert.recheck.statements import NotNegative, PositiveDefinite
from tubecert.recheck.terms import (
    NOUGHT,
    UNIT,
    Matrix,
    Rows,
    Term,
    all_zero,
    matrix_replaced,
    matrix_slopes,
    number,
    plus,
    scaled,
    times,
    turned,
    variable,
)
from tubecert.recheck.turning import along, bordered

NAMES = ("drift_slope", "form_slope", "input_slope", "input_gain", "drift_metric", "curvature")
MOST_STATES = 3  # terms and directions multiply beyond that

_HALF = Fraction(1, 2)


def bounded(place: Place, name: str, limit: Fraction) -> Outcome:
    """Whether the constant `name` is at most `limit`."""
    if limit < 0:
        return stated(False, "it is negative")
    if place.system.flat:
        return stated(False, "the metric is constant")
    if len(place.system.states) > MOST_STATES:
        return Outcome(verdict="undecided", why="there are too many states")
    return _CLAIMS[name](_Geometry(place), limit)


@dataclass(frozen=True)
class _Geometry:
    """Terms of the metric; all in x, whatever the coordinates of the tube."""

    place: Place

    @property
    def W(self) -> Matrix:
        return self.place.system.W

    @cached_property
    def d(self) -> Term:
        return determinant(self.W)

    @cached_property
    def dM(self) -> Matrix:
        return adjugate(self.W)

    def slopes(self, a: Rows) -> list[Matrix]:
        return [matrix_slopes(a, name) for name in self.place.system.states]

    def raised(self, a: Rows) -> list[Matrix]:
        """D^a A, for every a."""
        return self.along(self.slopes(a))

    def along(self, by_state: Sequence[Rows]) -> list[Matrix]:
        """sum_i W_ai A_i, for every a."""
        found = []
        for row in self.W:
            total = scaled(0, by_state[0])
            for weight, slope in zip(row, by_state, strict=True):
                if not all_zero(slope):
                    total = plus(total, _by(weight, slope))
            found.append(total)
        return found

    @cached_property
    def symbols(self) -> list[Matrix]:
        """G^kab: a matrix (a, b) for every k, (5.2)."""
        D = self.raised(self.W)
        n = range(len(self.W))
        half = number(_HALF)
        return [[[half * (D[k][a][b] - D[a][k][b] - D[b][k][a]) for b in n] for a in n] for k in n]

    def derivative(self, X: Rows) -> Matrix:
        """D (D^b X)_k, (k, b), of a column X, theory 8.6."""
        X_x = turned([[row[0] for row in slope] for slope in self.slopes(X)])
        lowered = [row[0] for row in times(self.dM, X)]
        straight = times(X_x, self.W)
        return [
            [self.d * e + _dot(symbol, lowered) for e, symbol in zip(row, own, strict=True)]
            for row, own in zip(straight, self.symbols, strict=True)
        ]

    def bivectors(self) -> tuple[Matrix, Matrix]:
        """D R_ijkl and the metric of bivectors, i < j against k < l, theory 8.6."""
        pairs = list(combinations(range(len(self.W)), 2))
        W, R = self.W, self._curvature()
        form = [[W[i][k] * W[j][m] - W[i][m] * W[j][k] for k, m in pairs] for i, j in pairs]
        return [[R(i, j, k, m) for k, m in pairs] for i, j in pairs], form

    def _curvature(self) -> Callable[[int, int, int, int], Term]:
        """The curvature with raised indices, times d, from first and second derivatives of W."""
        n, half = range(len(self.W)), number(_HALF)
        D, G = self.raised(self.W), self.symbols
        # W M_ab W = -W_ab + W_a M W_b + W_b M W_a, with W_ab = sum_ij W_ai W_bj W,ij
        second = [self.along([self.along(self.slopes(W_i))[b] for W_i in self.slopes(self.W)]) for b in n]

        def g(a: int, b: int) -> Matrix:
            turn = times(D[a], times(self.dM, D[b]))
            return plus(plus(turn, turned(turn)), _by(self.d, second[b][a]), -1)

        bent = {(a, b): g(a, b) for a in n for b in n}

        def squared(j: int, k: int, i: int, m: int) -> Term:
            return _dot([G[q][j][k] for q in n], [_dot(row, [G[q][i][m] for q in n]) for row in self.dM])

        def R(i: int, j: int, k: int, m: int) -> Term:
            straight = bent[j, k][i][m] + bent[i, m][j][k] - bent[j, m][i][k] - bent[i, k][j][m]
            return half * straight + squared(j, k, i, m) - squared(j, m, i, k)

        return R

    def definite(
        self, S: Rows, unit: Rows, others: dict[str, tuple[Fraction, Fraction]] | None = None
    ) -> Outcome:
        """S > 0 over the tube."""
        return prove(PositiveDefinite(S, unit), self.place.tube(others), self.place.budget)

    def nonnegative(self, e: Term, others: dict[str, tuple[Fraction, Fraction]] | None = None) -> Outcome:
        """e >= 0 over the tube."""
        return prove(NotNegative(e), self.place.tube(others), self.place.budget)

    @cached_property
    def drift(self) -> Matrix:
        """f + B u*, u* by its names, or as it is where it rests."""
        s, curve = self.place.system, self.place.curve
        if curve.moves or curve.ranges:
            return s.drift
        return matrix_replaced(s.drift, dict(zip(s.inputs, curve.u, strict=True)))


def _by(weight: Term, a: Rows) -> Matrix:
    return [[weight * e for e in row] for row in a]


def _faces(n: int) -> Iterator[tuple[list[Term], dict[str, tuple[Fraction, Fraction]]]]:
    """A vector p on the faces p_k = 1 of a cube: every direction but for its sign; and the ranges of its entries."""
    names = [f"p{a}#" for a in range(n)]
    for k in range(n):
        p = [UNIT if a == k else variable(name) for a, name in enumerate(names)]
        yield p, {name: (Fraction(-1), Fraction(1)) for a, name in enumerate(names) if a != k}


def _dot(a: Sequence[Term], b: Sequence[Term]) -> Term:
    return sum((x * y for x, y in zip(a, b, strict=True)), start=NOUGHT)


def _form(a: Rows, v: Sequence[Term]) -> Term:
    """v'A v."""
    return _dot(v, [_dot(row, v) for row in a])


def _drift_slope(g: _Geometry, limit: Fraction) -> Outcome:
    """D_nX of theory 8.6."""
    Z = g.derivative(g.drift)
    if all_zero(Z):
        return stated(True, "")
    block = _by(number(limit) * g.d, g.W)
    return g.definite(bordered(block, Z, block), bordered(g.W, scaled(0, Z), g.W))


def _form_slope(g: _Geometry, limit: Fraction) -> Outcome:
    """Direction by direction of v: t^2 d^3 (v'W v)^2 - q' adj(W) q >= 0, D_nF of theory 8.6."""
    F, n = g.place.system.F, range(len(g.W))
    mixed = times(g.dM, F)
    forms = []
    for a, straight in enumerate(g.raised(F)):
        turn = times([g.symbols[k][a] for k in n], mixed)
        forms.append(plus(_by(g.d, straight), plus(turn, turned(turn))))
    outcomes = []
    for v, others in _faces(len(n)):
        q, size = [_form(a, v) for a in forms], _form(g.W, v)
        rest = number(limit**2) * g.d * g.d * g.d * size * size - _form(g.dM, q)
        outcomes.append(g.nonnegative(rest, others))
        if not outcomes[-1].holds:
            break
    return together(outcomes)


def _input_slope(g: _Geometry, limit: Fraction) -> Outcome:
    """On the plan; a plan that rests does not turn B: D_nb of theory 8.6."""
    place = g.place
    if not (place.curve.moves or place.curve.ranges):
        return stated(True, "")
    slopes = [g.derivative([[e] for e in b]) for b in turned(place.system.B)]
    n, m = range(len(g.W)), range(len(slopes))
    outcomes = []
    for p, others in _faces(len(n)):
        C = [[_dot(p, [slopes[j][k][a] for a in n]) for k in n] for j in m]
        square = number(limit**2) * g.d * g.d * _form(g.W, p)
        corner = [[square if i == j else NOUGHT for j in m] for i in m]
        S = place.on_plan(bordered(g.W, turned(C), corner))
        unit = place.on_plan(bordered(g.W, [[NOUGHT for _ in m] for _ in n], corner))
        outcomes.append(along(place, PositiveDefinite(S, unit, place.numbers), others))
        if not outcomes[-1].holds:
            break
    return together(outcomes)


def _input_gain(g: _Geometry, limit: Fraction) -> Outcome:
    """beta_O of theory 8.6."""
    return g.definite(plus(scaled(limit**2, g.W), g.place.system.BBt, -1), g.W)


def _drift_metric(g: _Geometry, limit: Fraction) -> Outcome:
    """phi_M of theory 8.6."""
    X = g.drift
    if all_zero(X):
        return stated(True, "")
    return g.nonnegative(number(limit**2) * g.d - _form(g.dM, [e for (e,) in X]))


def _curvature(g: _Geometry, limit: Fraction) -> Outcome:
    """K_R of theory 8.6."""
    R, form = g.bivectors()
    if all_zero(R) or not R:
        return stated(True, "")
    level = _by(number(limit) * g.d, form)
    return together([g.definite(plus(level, R, sign), form) for sign in (1, -1)])


_CLAIMS: dict[str, Callable[[_Geometry, Fraction], Outcome]] = {
    "drift_slope": _drift_slope,
    "form_slope": _form_slope,
    "input_slope": _input_slope,
    "input_gain": _input_gain,
    "drift_metric": _drift_metric,
    "curvature": _curvature,
}
