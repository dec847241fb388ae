"""Theorems 0, A and B once more, in 60 digits: what is true of the recipes that searches hand over.

Written from the theory alone (sections 3, 4, 4a, 7), not from the code: sup D by its one stationary point, the kernel J
as a sup D, every constant on the side that bounds it. Nothing is rounded outward: so a proof has to be one here without
any tolerance; where no more than `CLOSE` is left, it need not be one.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath
from mpmath import mpf

from tubecert.conditions.alone import NoGains
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.rates import RateRecipe
from tubecert.enclosure.interval import Interval

DIGITS = 60
CLOSE = 1e-11  # what outward rounding may cost
_ALONE = {"lower", "metric_input_gain", "h", "initial_distance", "plan_defect_metric"}
_LOOP = {"B", "B_pinv", "B_pinv_x", "h_x", "h_t", "feedback_gain", "drift_on_plan"}
NEEDED: dict[type, set[str]] = {  # by each theorem
    NoGains: _ALONE,
    RateRecipe: (_ALONE - {"metric_input_gain"}) | _LOOP | {"upper", "f_x", "B_x", "b_x", "M_x", "u_star"},
    DistanceRecipe: _ALONE | _LOOP | {"h_initial"},
}
_NEVER = mpf("-inf")


@dataclass(frozen=True)
class Course:
    """D(t) of D' = -lam D + beta (e^(-w t) H0 + (1 - e^(-w t)) S + e) + delta, D(0) = d0, over [0, T]."""

    d0: mpf
    beta: mpf
    H0: mpf
    S: mpf
    e: mpf
    delta: mpf
    lam: mpf
    w: mpf
    T: mpf | None = None

    @property
    def ultimate(self) -> mpf:
        return (self.beta * (self.S + self.e) + self.delta) / self.lam

    def at(self, t: mpf) -> mpf:
        gap, A1 = self.w - self.lam, self.ultimate
        slow, fast = mpmath.exp(-self.lam * t), mpmath.exp(-self.w * t)
        K = t * slow if gap == 0 else (slow - fast) / gap
        return A1 + (self.d0 - A1) * slow + self.beta * (self.H0 - self.S) * K

    def supremum(self) -> mpf:
        """D is a constant and two exponentials: it turns once at most."""
        A1, C1, gap = self.ultimate, self.beta * (self.H0 - self.S), self.w - self.lam
        found = [self.d0, A1 if self.T is None else self.at(self.T)]
        start, turns = self.d0 - A1, mpf(-1)
        if gap == 0 and C1 != 0:
            turns = 1 / self.lam - start / C1
        elif gap != 0 and self.lam * (start + C1 / gap) != 0:
            ratio = self.w * (C1 / gap) / (self.lam * (start + C1 / gap))
            turns = mpmath.log(ratio) / gap if ratio > 0 else mpf(-1)
        if turns > 0 and (self.T is None or turns < self.T):
            found.append(self.at(turns))
        return max(found)


def number(x: Fraction | Interval | float, *, side: str = "hi") -> mpf:
    """Exactly; of an interval one of its ends."""
    if isinstance(x, Interval):
        return mpf(float(getattr(x, side)))
    exact = Fraction(x)
    return mpf(exact.numerator) / exact.denominator


@dataclass(frozen=True)
class Given:
    """A problem as the theory has it: `c` the constants by their names in a certificate."""

    c: dict[str, mpf]
    lam: mpf
    rho: mpf
    rho_a: mpf
    rho_r: mpf
    T: mpf | None
    layer: Fraction
    g: Fraction | None
    wind: tuple[mpf, mpf, mpf]  # beta_w |w|, D_E |w|, eps_w |w|
    rest: tuple[mpf, mpf]  # beta_r, D_r
    covered: bool  # by theorem A

    @classmethod
    def of(cls, p: TubeProblem) -> Given:
        c = {name: mpf(getattr(p.constants, name).above) for name in set().union(*NEEDED.values())}
        c["lower"] = mpf(p.constants.lower.below)
        none, rest, blows = mpf(0), (mpf(0), mpf(0)), False
        wind = (none, none, none)
        if p.wind is not None:
            own, size = p.wind.constants, number(p.wind.bound)
            wind = tuple(mpf(x.above) * size for x in (own.push, own.size, own.explained))  # type: ignore[assignment]
            blows = own.size.above > 0 and size > 0
        if p.residual is not None:
            rest = mpf(p.residual.push.above), mpf(p.residual.size.above)
        rho, rho_a = number(p.rho), number(p.rho_a)
        return cls(
            c=c,
            lam=number(p.rate),
            rho=rho,
            rho_a=rho_a,
            rho_r=min(number(p.rho_r, side="lo"), rho - rho_a),
            T=None if p.horizon is None else number(p.horizon),
            layer=p.smooth or Fraction(0),
            g=p.predictor_gain,
            wind=wind,
            rest=rest,
            covered=not blows and rest[1] <= 0,
        )

    @property
    def dbar(self) -> mpf:
        return mpmath.sqrt(self.c["lower"]) * self.rho

    @property
    def delta(self) -> mpf:
        return self.c["plan_defect_metric"] + self.rest[0] + self.wind[0]

    def loop(self, recipe: Any) -> bool:
        """Gains that are positive decimals, for the predictor that is asked for and a projection that keeps h."""
        gains = (recipe.bandwidth, recipe.adaptation_rate, recipe.predictor_gain, recipe.projection_radius)
        if not all(type(x) is Fraction and x > 0 for x in gains):
            return False
        serves = (1 + self.layer) * Fraction(float(self.c["h"])) ** 2 <= recipe.projection_radius**2
        return serves and self.g in (None, recipe.predictor_gain)


def margins(problem: TubeProblem, recipe: object) -> dict[str, mpf]:
    """What is left of each condition by its name, against what is allowed; empty where the theorem is not stated."""
    with mpmath.workdps(DIGITS):
        given = Given.of(problem)
        if not all(mpmath.isfinite(given.c[name]) for name in NEEDED[type(recipe)]):
            return {}
        if isinstance(recipe, NoGains):
            return {"no_adaptation": 1 - alone(given).supremum() / given.dbar}
        if isinstance(recipe, RateRecipe) and given.covered and given.loop(recipe):
            return rates(given, recipe)
        if isinstance(recipe, DistanceRecipe) and given.loop(recipe):
            return distance(given, recipe)
        return {}


def left(found: dict[str, mpf]) -> mpf:
    """The least of what is left; -inf where nothing is stated, or something is not a number."""
    return min(found.values()) if found and all(map(mpmath.isfinite, found.values())) else _NEVER


def proves(problem: TubeProblem, recipe: object) -> bool:
    """Whether a recipe is a proof."""
    return bool(left(margins(problem, recipe)) > 0)


@dataclass(frozen=True)
class Claims:
    """What a proof says beside its margins: |k|, |u_a| and |x - x*| in the long run are at most these."""

    feedback: mpf
    adaptation: Fraction
    radius: mpf | None


def claims(problem: TubeProblem, recipe: Any) -> Claims:
    """What follows from a recipe that is a proof."""
    with mpmath.workdps(DIGITS):
        n, R_H = Given.of(problem), getattr(recipe, "projection_radius", Fraction(0))
        du = n.c["feedback_gain"]
        if isinstance(recipe, RateRecipe):  # it says that d stays below dbar, and no more
            return Claims(du * n.dbar, R_H, None)
        if isinstance(recipe, NoGains):
            own = alone(n)
        else:
            own = course(n, recipe, number(recipe.uncertainty), number(recipe.prediction_error))
        return Claims(du * own.supremum(), R_H, own.ultimate / mpmath.sqrt(n.c["lower"]))


def alone(n: Given) -> Course:
    """|h| <= Dh acts as it is: the filter has not begun, (4.0)."""
    nothing, Dh = mpf(0), n.c["h"]
    return Course(
        n.c["initial_distance"], n.c["metric_input_gain"], Dh, Dh, nothing, n.delta, n.lam, n.lam, n.T
    )


def kernel(c: mpf, w: mpf, s0: mpf, s1: mpf) -> mpf:
    """J of (2.19): what filtering leaves of |h| <= s0 at the start, |h'| <= s1, seen at rate c."""
    return Course(mpf(0), mpf(1), s0, s1 / w, mpf(0), mpf(0), c, w).supremum()


def rate_terms(n: Given, recipe: RateRecipe) -> dict[str, mpf]:
    """(3.1)-(3.5) as the sheet states them, at P = I, A_m = -g I, Q = 2 g I, by their names in a certificate."""
    c, root = n.c, mpmath.sqrt
    w, g, R = (number(x) for x in (recipe.bandwidth, recipe.predictor_gain, recipe.projection_radius))
    a, A, DB, du, both = c["lower"], c["upper"], c["B"], c["feedback_gain"], c["h"] + R
    kmax = root(a) * n.rho * du
    Dx = c["drift_on_plan"] + DB * (both + kmax)
    s1 = c["h_t"] + c["h_x"] * Dx
    Dxt = root(2 * both * s1 / (2 * g) + both**2)
    Deta = (c["B_pinv_x"] * Dx + (2 * w + g) * c["B_pinv"]) * Dxt
    along = c["f_x"] + (both + c["u_star"] + kmax) * c["b_x"] + c["h_x"] * DB
    Dgs = root(A / a) * along + root(A) * du * DB
    turning = A * (DB * Dgs + DB * c["M_x"] * Dx / root(A * a) + c["B_x"] * Dx)
    Psi_x, J = 2 * c["B_x"] + DB * c["M_x"] / a, kernel(2 * n.lam, w, c["h"], s1)
    return {
        "speed": Dx,
        "uncertainty_rate": s1,
        "prediction_error": Dxt,
        "filter_error": Deta,
        "theta": DB * A * Deta / n.lam,
        "Psi_x": Psi_x,
        "geodesic_rate": Dgs,
        "Psi_rate": turning,
        "zeta_1": 2 * n.rho * DB * (A / a) * J,
        "zeta_2": A * Psi_x * J,
        "zeta_3": c["h_x"] * (4 * n.lam * A * DB + turning) / (n.lam * w),
    }


def rates(n: Given, recipe: RateRecipe) -> dict[str, mpf]:
    """What (26a), (26b), (26c) leave."""
    a, found = n.c["lower"], rate_terms(n, recipe)
    zeta_p = n.rho * n.delta / (n.lam * mpmath.sqrt(a))
    first = 1 - (n.c["initial_distance"] ** 2 / a + found["zeta_1"] + zeta_p) / n.rho_r**2
    rest = a - found["zeta_2"] - found["zeta_3"]
    if not rest > 0:
        return {"26a": first, "26b": rest / a, "26c": _NEVER}
    third = 1 - found["theta"] / (n.rho_a * rest) / mpmath.sqrt(number(recipe.adaptation_rate))
    return {"26a": first, "26b": rest / a, "26c": third}


def needed(n: Given, recipe: Any, Y: mpf) -> tuple[mpf, mpf]:
    """What S and e have to be at least where |x'| <= Y, (4.1), (4.2), (7.9)."""
    c, root = n.c, mpmath.sqrt
    w, Gamma, g, R = (
        number(x)
        for x in (recipe.bandwidth, recipe.adaptation_rate, recipe.predictor_gain, recipe.projection_radius)
    )
    _, blown, taken = n.wind
    s1, q, both = c["h_t"] + c["h_x"] * Y, 2 * g, c["h"] + R
    zb = min(blown, c["B"] * taken) if c["B_x"] == 0 else blown + n.rest[1]
    y = zb / q + root((zb / q) ** 2 + 2 * both * s1 / (q * Gamma))
    Xt = root(both**2 / Gamma + y**2)
    return s1 / w, (c["B_pinv_x"] * Y + c["B_pinv"] * (w + abs(g - w))) * Xt + taken


def speed(n: Given, recipe: Any, S: mpf, e: mpf) -> mpf:
    """What Y has to exceed, (4.3)."""
    c = n.c
    left = min(c["h"] + number(recipe.projection_radius), max(c["h_initial"], S) + e)
    drift = c["drift_on_plan"] + n.rest[1] + n.wind[1]
    return drift + c["B"] * (c["feedback_gain"] * n.dbar + left)


def course(n: Given, recipe: Any, S: mpf, e: mpf) -> Course:
    """D(t) of theorem B, (2.15)."""
    c = n.c
    return Course(
        c["initial_distance"],
        c["metric_input_gain"],
        c["h_initial"],
        S,
        e,
        n.delta,
        n.lam,
        number(recipe.bandwidth),
        n.T,
    )


def distance(n: Given, recipe: DistanceRecipe) -> dict[str, mpf]:
    """What is left in the inequality of Y, and in that of dbar; nothing if S or e is less than it has to be."""
    Y, e, S = (number(x) for x in (recipe.speed, recipe.prediction_error, recipe.uncertainty))
    if min(Y, e, S) < 0:
        return {}
    least_S, least_e = needed(n, recipe, Y)
    if least_S > S or e < least_e:
        return {}
    return {"Y": Y / speed(n, recipe, S, e) - 1, "distance": 1 - course(n, recipe, S, e).supremum() / n.dbar}


def best(problem: TubeProblem, recipe: Any) -> mpf:
    """The least margin at the gains of a recipe; of B that which no Y, e and S exceed: at the least Y that serves."""
    with mpmath.workdps(DIGITS):
        n, Y = Given.of(problem), mpf(0)
        if isinstance(recipe, RateRecipe):
            return left(rates(n, recipe))
        for _ in range(200):
            Y, before = speed(n, recipe, *needed(n, recipe, Y)), Y
            if before == Y:
                break
        return 1 - course(n, recipe, *needed(n, recipe, Y)).supremum() / n.dbar
