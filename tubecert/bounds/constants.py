"""The constants of the certificates as values, and the table of what each one is.

Console, JSON, docs and formulas read names, symbols, equations, units and sides from `TABLE` and nowhere else. A new
constant is a line here, what bounds it (`bounds.compute`), its name in `conditions.problem.Numbers`, and recheck's own.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import ClassVar, Literal, Self

from tubecert.claims import family
from tubecert.enclosure.constant import Constant, Witness

Side = Literal["below", "above"]

__all__ = ["TABLE", "BoundConstants", "Constant", "Meaning", "WindConstants", "Witness"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Meaning:
    """What a constant is: symbol of the paper or of docs/theory, equation tag, unit, and words.

    `side` is the one that the certificate uses: `below` for an infimum, `above` for a supremum. `number` is its name in
    the formulas (`conditions.problem.Numbers`), empty if they do not contain it. `given`: its size is that of the
    metric or of the actuators, which nobody can relax alone.
    """

    symbol: str
    equation: str
    unit: str
    words: str
    side: Side = "above"
    number: str = ""
    given: bool = False


def _of(
    symbol: str,
    equation: str,
    unit: str,
    words: str,
    *,
    side: Side = "above",
    number: str | None = None,
    given: bool = False,
) -> dict[str, Meaning]:
    """The meaning of a constant; in formulas it has its symbol for a name, unless said otherwise."""
    number = symbol if number is None else number
    own = Meaning(
        symbol=symbol, equation=equation, unit=unit, words=words, side=side, number=number, given=given
    )
    return {"meaning": own}


@dataclass(frozen=True, slots=True, kw_only=True)
class Constants:
    """Constants over a tube, each an enclosure, with their meanings; `prefix` is that of their names in a certificate.

    The units are those of the states and inputs of the specification; "1" is dimensionless.
    """

    prefix: ClassVar[str] = ""

    def printable(self) -> Self:
        """The same with every enclosure widened to printable bounds."""
        return replace(self, **{item.name: getattr(self, item.name).printable() for item in fields(self)})

    def items(self) -> list[tuple[str, Constant, Meaning]]:
        """`(name, value, meaning)` of every constant, by its name in a certificate."""
        return [
            (self.prefix + item.name, getattr(self, item.name), item.metadata["meaning"])
            for item in fields(self)
        ]

    @classmethod
    def table(cls) -> dict[str, Meaning]:
        """What each of them is, by its name in a certificate."""
        return {cls.prefix + item.name: item.metadata["meaning"] for item in fields(cls)}


@dataclass(frozen=True, slots=True, kw_only=True)
class BoundConstants(Constants):
    """Every constant of certificates 0, A and B over O(rho)."""

    lower: Constant = field(
        metadata=_of("a", "CCM_1", "1", "smallest eigenvalue of the metric M", side="below", given=True)
    )
    upper: Constant = field(metadata=_of("A", "CCM_1", "1", "largest eigenvalue of the metric M", given=True))
    f: Constant = field(metadata=_of("Df", "assumption 3", "x/s", "sup |f|"))
    f_x: Constant = field(metadata=_of("Dfx", "assumption 3", "1/s", "sup |df/dx|"))
    B: Constant = field(metadata=_of("DB", "assumption 3", "x/(u s)", "sup |B|", given=True))
    B_x: Constant = field(
        metadata=_of("DBx", "assumption 3", "1/(u s)", "sup of the sum of |dB/dx_i|", given=True)
    )
    b_x: Constant = field(
        metadata=_of("Dbx", "assumption 3", "1/(u s)", "sup of the sum of |db_j/dx|", given=True)
    )
    B_pinv: Constant = field(metadata=_of("DBp", "assumption 5", "u s/x", "sup |B^+|", given=True))
    B_pinv_x: Constant = field(
        metadata=_of("DBpx", "assumption 5", "u s/x^2", "sup of the sum of |dB^+/dx_i|", given=True)
    )
    M_x: Constant = field(metadata=_of("DMx", "bounds:M_x", "1/x", "sup of the sum of |dM/dx_i|"))
    u_star: Constant = field(metadata=_of("Dus", "assumption 2", "u", "sup |u*|"))
    h: Constant = field(metadata=_of("Dh", "assumption 4", "u", "sup |h|"))
    h_x: Constant = field(metadata=_of("Dhx", "assumption 4", "u/x", "sup |dh/dx|"))
    h_t: Constant = field(metadata=_of("Dht", "assumption 4", "u/s", "sup |dh/dt|"))
    h_initial: Constant = field(metadata=_of("H0", "theory 4", "u", "|h(0, x(0))|, or sup |h|"))
    feedback_gain: Constant = field(
        metadata=_of("du", "bounds:delta_u, corrected", "u/d", "|feedback| per Riemannian distance")
    )
    metric_input_gain: Constant = field(
        metadata=_of(
            "beta", "theory 4", "d/(u s)", "largest singular value of Theta B on the plan", given=True
        )
    )
    drift_on_plan: Constant = field(metadata=_of("phi", "theory 4", "x/s", "sup |f + B u*| over the tube"))
    initial_distance: Constant = field(
        metadata=_of("d0", "theory 4", "d", "length of the segment from x*(0) to x(0)")
    )
    plan_defect: Constant = field(
        metadata=_of("delta_p", "theory 3", "x/s", "sup |x*' - f(x*) - B(x*) u*|", number="")
    )
    plan_defect_metric: Constant = field(
        metadata=_of("delta", "theory 3", "d/s", "the plan defect measured by the metric on the plan")
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class WindConstants(Constants):
    """What E w does for |w| <= 1 (theory 7): how hard it pushes, how fast it moves the state, what of it B explains.

    Where w has a rate, E stands for (I - B B^+) E, and B^+ E w is a part of h.
    """

    prefix = "wind_"
    push: Constant = field(
        metadata=_of("beta_w", "theory 7", "d/s", "how fast the wind lengthens the geodesic at most, per |w|")
    )
    size: Constant = field(metadata=_of("D_E", "theory 7", "x/s", "sup |E|"))
    explained: Constant = field(metadata=_of("eps_w", "theory 7", "u", "sup |B^+ E|"))


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualConstants(Constants):
    """What parameters in boxes leave of f that no input reaches, r = (I - B B^+)(f(x, theta) - f0(x)) (theory 7)."""

    prefix = "residual_"
    push: Constant = field(
        metadata=_of(
            "beta_r", "theory 7", "d/s", "what unknown parameters do to the distance beside the inputs"
        )
    )
    size: Constant = field(
        metadata=_of("D_r", "theory 7", "x/s", "sup of what unknown parameters do beside the inputs")
    )


TABLE: dict[str, Meaning] = BoundConstants.table()
WIND: dict[str, Meaning] = WindConstants.table() | ResidualConstants.table()

DERIVED: dict[str, Meaning] = {
    name: Meaning(symbol=symbol, equation=equation, unit=unit, words=words)
    for name, symbol, equation, unit, words in (
        ("speed", "Y", "bounds:dx", "x/s", "bound of |xdot|"),
        ("uncertainty_rate", "s1", "theory 2", "u/s", "bound of |dh(t, x(t))/dt|"),
        ("prediction_error", "Dxt", "bounds:tx", "x/s^0.5", "bound of |xtilde| times the root of Gamma"),
        (
            "filter_error",
            "Deta",
            "bounds:teta",
            "u/s^0.5",
            "bound of the filtered error times the root of Gamma",
        ),
        ("theta", "Dtheta", "bounds:theta", "d^2/x", "effect of the estimation error in (26c)"),
        ("Psi_x", "DPsix", "bounds:psi_x", "1/x", "slope of the input direction along a geodesic"),
        ("geodesic_rate", "Dgs", "bounds:dgamma_s", "1/s", "rate of the geodesic's initial velocity"),
        ("Psi_rate", "DPsidot", "bounds:dpsi", "1/s", "rate of the input direction"),
        ("zeta_1", "zeta1", "conditions:zeta_1", "x^2", "effect of the filter in (26a)"),
        ("zeta_2", "zeta2", "conditions:zeta_2", "1", "effect of the filter in (26b)"),
        ("zeta_3", "zeta3", "conditions:zeta_3", "1", "effect of the state-dependence of h in (26b)"),
    )
}


EVERY: dict[str, Meaning] = {**TABLE, **WIND, **DERIVED}
family.name({name: (own.symbol, own.words) for name, own in EVERY.items()})  # claims stand below constants


def meaning(name: str) -> Meaning:
    """The same whatever the name."""
    return EVERY.get(name, Meaning(symbol=name, equation="", unit="", words=name.replace("_", " ")))
