"""Every constant of the certificate as a claim: the supremum over O(rho) (or on the plan) is at most what is printed.

Written from the definitions (2.1)-(2.8) of the theory. Largest eigenvalues become definiteness at the printed bound:
    |B^+| <= t: B'B >= I/t^2;   beta <= t: t^2 W >= B B';   |M W_i M| <= t: t W^2 >= W_i and >= -W_i;
    |Theta p| <= t: [W p; p' t^2] >= 0;   du <= t: t (B B'/mu + mu W) >= F for all mu > 0 up to smax(Theta B).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.boxes import Box, Field, Found, Test
from tubecert.recheck.cover import Boxed, Outcome, prove
from tubecert.recheck.curve import CLOCK, Curve
from tubecert.recheck.lipschitz import LipschitzBelow
from tubecert.recheck.metric import (
    adjugate,
    determinant,
    lower_bound,
    stated,
    time_range,
    together,
    upper_bound,
)
from tubecert.recheck.statements import NormsBelow, NotNegative, PositiveDefinite
from tubecert.recheck.system import TIME, System
from tubecert.recheck.terms import (
    NOUGHT,
    Matrix,
    Program,
    Rows,
    all_zero,
    matrix_replaced,
    matrix_slopes,
    number,
    plus,
    scaled,
    times,
    turned,
    unit_matrix,
    variable,
)
from tubecert.recheck.tube import Tube

_FIRST = 500  # boxes before another way is tried
MU, _CURVE_MU, _LINE_MU = "mu#", "p#", "q#"  # no state can have these names


@dataclass(frozen=True, slots=True)
class Place:
    """A system with its plan and radius; `budget` boxes for each claim."""

    system: System
    curve: Curve
    rho: Fraction
    budget: int

    def tube(self, extra: dict[str, tuple[Fraction, Fraction]] | None = None) -> Tube:
        """O(rho), with the times that matter for h."""
        s = self.system
        time = time_range(s)
        free = {**(extra or {}), **({} if time is None else {TIME: time})}
        return Tube(self.curve, self.rho, s.states, s.inputs, free)

    def on_plan(self, rows: Rows) -> Matrix:
        """A matrix along the plan."""
        s = self.system
        return matrix_replaced(
            rows, dict(zip((*s.states, *s.inputs), (*self.curve.x, *self.curve.u), strict=True))
        )

    def along(self, test: Callable[[], NormsBelow | PositiveDefinite | NotNegative]) -> Outcome:
        """A test in s on every part of the plan."""
        whole = test()
        outcomes: list[Outcome] = []
        for part in self.curve.parts:
            own = whole.with_values(part.values)
            domain = Boxed({CLOCK: (arb(0), part.length)})
            outcomes.append(prove(own, domain, self.budget))
            if not outcomes[-1].holds:
                break
        return together(outcomes)

    @property
    def numbers(self) -> dict[str, Ball]:
        """The numbers of one part, for a test that is made once for all of them."""
        return self.curve.parts[0].values


def bounded(place: Place, name: str, limit: Fraction, largest: Fraction) -> Outcome:
    """Whether the constant `name` is at most `limit` (`lower`, `input_gain_least`: at least).

    `largest` is a bound of smax(Theta B) over the tube.
    """
    if name == "lower":
        return lower_bound(place.system, limit, place.tube(), place.budget)
    if name == "upper":
        return upper_bound(place.system, limit, place.tube(), place.budget)
    if limit < 0:
        return stated(False, "it is negative")
    if name == "feedback_gain":
        return feedback_gain(place, limit, largest)
    return _CLAIMS[name](place, limit)


def _norms(place: Place, matrices: Sequence[Rows], limit: Fraction) -> Outcome:
    test = NormsBelow(matrices, limit)
    found = prove(test, place.tube(), min(place.budget, _FIRST))
    if found.verdict != "undecided" or place.budget <= _FIRST:
        return found
    if len(matrices) == 1 and len(matrices[0][0]) == 1 and not place.curve.moves:
        from tubecert.recheck.multiplier import column_below

        eased = column_below(place, [row[0] for row in matrices[0]], limit)
        if eased is not None and eased.holds:
            return eased
    return prove(test, place.tube(), place.budget)


def _columns(s: System) -> list[Matrix]:
    return [[[row[j]] for row in s.B] for j in range(len(s.inputs))]


def _jacobian(column: Rows, states: Sequence[str]) -> Matrix:
    return turned([[row[0] for row in matrix_slopes(column, name)] for name in states])


def _left_inverse_slopes(s: System) -> list[Matrix]:
    gram = times(turned(s.B), s.B)
    d = determinant(gram)
    inverse = [[e / d for e in row] for row in times(adjugate(gram), turned(s.B))]
    return [matrix_slopes(inverse, name) for name in s.states]


def _left_inverse(place: Place, limit: Fraction) -> Outcome:
    if not limit:
        return stated(False, "it is zero")
    gram = times(turned(place.system.B), place.system.B)
    least = scaled(1 / limit**2, unit_matrix(len(gram)))
    return prove(PositiveDefinite(plus(gram, least, -1), gram), place.tube(), place.budget)


def _metric_slope(place: Place, limit: Fraction) -> Outcome:
    s = place.system
    moving = [slope for slope in s.W_x if not all_zero(slope)]
    if not moving:
        return stated(limit >= 0, "it is negative")
    return prove(SlopesBelow(moving, times(s.W, s.W), limit), place.tube(), place.budget)


class SlopesBelow:
    """The sum of the largest |eigenvalues| of the pencils (N_k, D) is at most `limit`.

    The share of each N_k is proposed at the centre of the box; that it serves is proven: share D +- N_k > 0.
    """

    def __init__(self, matrices: Sequence[Rows], D: Rows, limit: Fraction) -> None:
        self._limit = exact(limit)
        self._values = {"share#": arb(0)}
        share = variable("share#")
        tests = []
        for N in matrices:
            for sign in (1, -1):
                S = [
                    [share * d + number(sign) * e for d, e in zip(dr, nr, strict=True)]
                    for dr, nr in zip(D, N, strict=True)
                ]
                tests.append(PositiveDefinite(S, D, self._values))
        self.variables = tuple(sorted({v for test in tests for v in test.variables}))
        self._tests = [(test, [self.variables.index(v) for v in test.variables]) for test in tests]

    def over(self, box: Box) -> Found:
        """Every share on the whole box."""
        at = [arb(0.5 * lo + 0.5 * hi) for lo, hi in box]
        least = [self._least(k, at) for k in range(len(self._tests) // 2)]
        rest = self._limit - sum(least, start=arb(0))
        total = sum(least, start=arb(0))
        caused, spread = [hi - lo for lo, hi in box], [hi - lo for lo, hi in box]
        if not rest > 0:
            return Found(False, caused, spread)
        for k, value in enumerate(least):
            even = arb(1) / len(least) if len(least) == 1 or not total > 0 else value / total
            share = (value + rest * even).lower()
            for test, columns in self._tests[2 * k : 2 * k + 2]:
                own = test.with_values({"share#": share})
                found = own.over([box[i] for i in columns])
                if not found.proven:
                    for c, i in enumerate(columns):
                        caused[i], spread[i] = found.caused[c], found.spread[c]
                    return Found(False, caused, spread)
        return Found(True)

    def broken(self, point: Sequence[Ball]) -> bool:
        """Whether one matrix alone takes more than the limit."""
        return any(
            test.with_values({"share#": self._limit}).broken([point[i] for i in columns])
            for test, columns in self._tests
        )

    def _least(self, k: int, at: Sequence[Ball]) -> Ball:
        """About the least share of one matrix at a point: by bisection, a proposal."""
        low, high = 0.0, float(self._limit)
        for _ in range(30 if len(self._tests) > 2 else 0):
            middle = 0.5 * (low + high)
            box_tests = self._tests[2 * k : 2 * k + 2]
            serves = not any(
                test.with_values({"share#": arb(middle)}).broken([at[i] for i in columns])
                for test, columns in box_tests
            )
            low, high = (low, middle) if serves else (middle, high)
        return arb(low)


def feedback_gain(place: Place, limit: Fraction, largest: Fraction) -> Outcome:
    """F <= t (B B'/mu + mu W) for all mu in (0, largest]."""
    extra = {MU: (Fraction(0), largest)}
    return prove(GainBelow(place.system, limit), place.tube(extra), place.budget)


class GainBelow:
    """t (B B'/mu + mu W) - F > 0 on boxes of states and mu; 1/mu is replaced by a tangent, which lies below it."""

    def __init__(self, s: System, limit: Fraction) -> None:
        mu, p, q = (variable(name) for name in (MU, _CURVE_MU, _LINE_MU))
        inverse = q - mu * p  # 2/m - mu/m^2 <= 1/mu
        bound = [
            [number(limit) * (inverse * b + mu * w) for b, w in zip(br, wr, strict=True)]
            for br, wr in zip(s.BBt, s.W, strict=True)
        ]
        unit = [
            [q * b + w / q for b, w in zip(br, wr, strict=True)] for br, wr in zip(s.BBt, s.W, strict=True)
        ]
        self._test = PositiveDefinite(plus(bound, s.F, -1), unit, _tangent(1.0))
        self.variables = self._test.variables
        self._place = self.variables.index(MU) if MU in self.variables else None
        centre = [exact((lo + hi) / 2) for lo, hi in (s.safe_set[name] for name in s.states)]
        entries = Program([e for row in s.W for e in row], s.states).run(centre)
        self._size = float(limit) * sum(abs(float(e.mid())) for e in entries)

    def over(self, box: Box) -> Found:
        """With the tangent at the geometric middle of mu."""
        if self._place is None:
            return self._test.over(box)
        lo, hi = box[self._place]
        low = max(lo, 0.0)
        middle = (low * hi) ** 0.5 if low > 0 else hi
        found = self._test.with_values(_tangent(middle)).over(
            [*box[: self._place], (low, hi), *box[self._place + 1 :]]
        )
        if not found.proven and hi > low:  # the gap of the tangent, where B B'/mu and mu W are of one size
            ratio = (hi - middle) / middle if low > 0 else 1.0
            found.caused[self._place] = ratio**2 * middle * self._size
        return found

    def broken(self, point: Sequence[Ball]) -> bool:
        """At a point the tangent at mu itself is exact."""
        if self._place is None:
            return self._test.broken(point)
        mu = float(point[self._place])
        return mu > 0 and self._test.with_values(_tangent(mu)).broken(
            [*point[: self._place], arb(mu), *point[self._place + 1 :]]
        )


def _tangent(m: float) -> dict[str, Ball]:
    return {_CURVE_MU: 1 / (arb(m) * arb(m)), _LINE_MU: 2 / arb(m)}


def _input_gain_least(place: Place, limit: Fraction) -> Outcome:
    if not limit:
        return stated(True, "")
    return prove(LeastGain(place.system, limit), place.tube(), place.budget)


class LeastGain:
    """smin(Theta B) >= limit: for any G, u'B'M B u >= |G B u|^2/lmax(G W G'); G is taken from the centre of the box."""

    def __init__(self, s: System, limit: Fraction) -> None:
        self._n, self._m = len(s.states), len(s.inputs)
        self._field = Field([*(e for row in s.W for e in row), *(e for row in s.B for e in row)])
        self.variables = self._field.variables
        self._square = exact(limit**2)

    def over(self, box: Box) -> Found:
        """(G B)'(G B)/limit^2 >= lmax(G W G') on the box."""
        from tubecert.recheck.balls import is_positive, spectral_norm

        W, B = self._matrices(self._field.hull(box))
        wide = [hi - lo for lo, hi in box]
        G = self._weights([arb(0.5 * lo + 0.5 * hi) for lo, hi in box])
        if G is None:
            return Found(False, wide, wide)
        top = spectral_norm((G * W * G.transpose()).tolist())
        image = G * B
        gram = (image.transpose() * image).tolist()
        for i in range(self._m):
            gram[i][i] = gram[i][i] - top * self._square
        return Found(is_positive(gram), wide, wide)

    def broken(self, point: Sequence[Ball]) -> bool:
        """B'M B - limit^2 at a point."""
        from tubecert.recheck.balls import is_indefinite

        W, B = self._matrices(self._field.at(point))
        try:
            gram = (B.transpose() * W.solve(B)).tolist()
        except ZeroDivisionError:
            return False
        for i in range(self._m):
            gram[i][i] = gram[i][i] - self._square
        return is_indefinite(gram)

    def _matrices(self, entries: Sequence[Ball]):  # type: ignore[no-untyped-def]
        from flint import arb_mat

        split = self._n * self._n
        return arb_mat(self._n, self._n, entries[:split]), arb_mat(self._n, self._m, entries[split:])

    def _weights(self, centre: Sequence[Ball]):  # type: ignore[no-untyped-def]
        """(B'M B)^-1 B'M at a point, rounded to floats."""
        from flint import arb_mat

        W, B = self._matrices(self._field.at(centre))
        try:
            half = W.solve(B)
            G = (B.transpose() * half).solve(half.transpose())
        except ZeroDivisionError:
            return None
        return arb_mat([[float(x.mid()) for x in row] for row in G.tolist()])


def _excess(place: Place, limit: Fraction) -> Outcome:
    s = place.system
    return prove(PositiveDefinite(plus(scaled(limit, s.W), s.F, -1), s.W), place.tube(), place.budget)


def _input_on_plan(place: Place, limit: Fraction) -> Outcome:
    return place.along(lambda: NormsBelow([[[e] for e in place.curve.u]], limit, place.numbers))


def _drift(place: Place, limit: Fraction) -> Outcome:
    s, curve = place.system, place.curve
    drift = s.drift
    if not curve.moves:
        drift = matrix_replaced(drift, dict(zip(s.inputs, curve.u, strict=True)))
    return _norms(place, [drift], limit)


def _metric_input_gain(place: Place, limit: Fraction) -> Outcome:
    s = place.system
    W, BBt = place.on_plan(s.W), place.on_plan(s.BBt)
    S = plus(scaled(limit**2, W), BBt, -1)
    return place.along(lambda: PositiveDefinite(S, W, place.numbers))


def defect(place: Place) -> Matrix:
    """x*' - f(x*) - B(x*) u* along the plan, (n, 1)."""
    slope = [[e] for e in place.curve.slope]
    return plus(slope, place.on_plan(place.system.drift), -1)


def _defect_zero(place: Place, p: Matrix) -> bool:
    from tubecert.recheck.identity import vanish

    return len(place.curve.parts) == 1 and not place.numbers and vanish([row[0] for row in p])


def _plan_defect(place: Place, limit: Fraction) -> Outcome:
    p = defect(place)
    if _defect_zero(place, p):
        return stated(True, "")
    return place.along(lambda: NormsBelow([p], limit, place.numbers))


def _plan_defect_metric(place: Place, limit: Fraction) -> Outcome:
    p = defect(place)
    if _defect_zero(place, p):
        return stated(True, "")
    if not limit:
        return stated(False, "the plan has a defect")
    W = place.on_plan(place.system.W)
    top = number(limit**2)
    S = [*([*row, e] for row, (e,) in zip(W, p, strict=True)), [*(e for (e,) in p), top]]
    unit = [*([*row, NOUGHT] for row in W), [*(NOUGHT for _ in p), top]]
    return place.along(lambda: PositiveDefinite(S, unit, place.numbers))


def _uncertainty(place: Place, limit: Fraction, name: str) -> Outcome:
    s = place.system
    if name in s.declared and s.declared[name] > limit:
        return stated(False, f"it is below the declared {float(s.declared[name]):g}")
    if s.h is None:
        return stated(name in s.declared, "it is neither declared nor derived")
    if name == "h_x":
        test: Test = LipschitzBelow([row[0] for row in s.h], s.states, limit)
        return prove(test, place.tube(), place.budget)
    return _norms(place, [s.h if name == "h" else matrix_slopes(s.h, TIME)], limit)


_CLAIMS: dict[str, Callable[[Place, Fraction], Outcome]] = {
    "f": lambda p, t: _norms(p, [p.system.f], t),
    "f_x": lambda p, t: _norms(p, [p.system.f_x], t),
    "B": lambda p, t: _norms(p, [p.system.B], t),
    "B_x": lambda p, t: _norms(p, [matrix_slopes(p.system.B, name) for name in p.system.states], t),
    "b_x": lambda p, t: _norms(p, [_jacobian(b, p.system.states) for b in _columns(p.system)], t),
    "B_pinv": _left_inverse,
    "B_pinv_x": lambda p, t: _norms(p, _left_inverse_slopes(p.system), t),
    "M_x": _metric_slope,
    "u_star": _input_on_plan,
    "h": lambda p, t: _uncertainty(p, t, "h"),
    "h_x": lambda p, t: _uncertainty(p, t, "h_x"),
    "h_t": lambda p, t: _uncertainty(p, t, "h_t"),
    "metric_input_gain": _metric_input_gain,
    "drift_on_plan": _drift,
    "plan_defect": _plan_defect,
    "plan_defect_metric": _plan_defect_metric,
    "input_gain_least": _input_gain_least,
    "contraction_excess": _excess,
}

OVER_TUBE = ("lower", "upper", *_CLAIMS, "feedback_gain")
"""The constants that are suprema over the tube or the plan; those of the start are claims of `start`."""


def contained(place: Place) -> Outcome:
    """Assumption 1: x* stays at least rho away from every face of the safe set."""
    s, outcomes = place.system, []
    for name, x in zip(s.states, place.curve.x, strict=True):
        low, high = s.safe_set[name]
        for room in (number(high - place.rho) - x, x - number(low + place.rho)):
            outcomes.append(place.along(lambda room=room: NotNegative(room, place.numbers)))  # type: ignore[misc]
            if not outcomes[-1].holds:
                return together(outcomes)
    return together(outcomes)


def half_width(place: Place, state: int, width: Fraction, lower: Fraction) -> Outcome:
    """|x_i - x_i*| <= min(rho, sqrt(a) rho sup sqrt(W_ii)) <= width."""
    if width >= place.rho:
        return stated(True, "")
    if width <= 0:
        return stated(False, "it is not positive")
    top = number(width**2 / (lower * place.rho**2))
    return prove(NotNegative(top - place.system.W[state][state]), place.tube(), place.budget)
