"""The constants of certificate H as values, and the tables of what each one is; what bounds them is elsewhere.

Like `constants`, and like it free of numerics: `explain` reads the tables.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

from tubecert.bounds.constants import Constant, Meaning, table_of


def _of(symbol: str, unit: str, words: str) -> dict[str, Meaning]:
    """The registry entry of a constant; in formulas it has its symbol for a name."""
    return {"meaning": Meaning(symbol=symbol, equation="theory 8", unit=unit, words=words, number=symbol)}


@dataclass(frozen=True, slots=True, kw_only=True)
class HardwareConstants:
    """Every constant of certificate H that A, B and C do not have, each an enclosure; None where it does not apply.

    One unit of noise is |n| <= 1, or |n_i| <= what is given for state i.
    """

    feedback_slope: Constant = field(metadata=_of("D_F", "1/s", "sup |F~|, both signs of its eigenvalues"))
    feedback_curvature: Constant = field(
        metadata=_of("D_Fx", "1/(x s)", "how much F~ changes per distance that a geodesic is moved")
    )
    plan_tilt: Constant = field(
        metadata=_of(
            "D_cx", "1/(u s)", "how much B'M changes per distance that the plan moves, in the metric"
        )
    )
    plan_speed: Constant = field(metadata=_of("Ystar", "x/s", "sup |x*'|"))
    drift_difference: Constant = field(
        metadata=_of("phi_rel", "x/s", "sup |f + B u* at x, less the same at x*|")
    )
    drift_difference_metric: Constant | None = field(
        metadata=_of("phi_relM", "d/s", "sup |Theta (f(x) - f(x*))|, for constant M and B")
    )
    drift_slope_metric: Constant | None = field(
        metadata=_of("D_A", "1/s", "sup |Theta f_x Theta^-1|, for constant M and B")
    )
    drift_explained: Constant = field(
        metadata=_of("D_pf", "u/x", "sup |B^+ f_x|: how the drift between two samples enters the estimate")
    )
    feedback_drift: Constant | None = field(
        default=None,
        metadata=_of("D_Ft", "1/s^2", "sup |F~_t|: how fast F~ changes by itself, where f depends on t"),
    )
    drift_rate: Constant | None = field(
        default=None, metadata=_of("D_pt", "u/s", "sup |B^+ f_t|: what D_pf is by x, by t")
    )
    noise_size: Constant = field(metadata=_of("n_E", "x", "size of one unit of noise"))
    noise_metric: Constant = field(metadata=_of("n_M", "d", "sup |Theta n| over one unit of noise"))
    noise_explained: Constant = field(metadata=_of("n_B", "u s", "sup |B^+ n| over one unit of noise"))
    input_rate: Constant | None = field(
        metadata=_of("Lus", "u/s", "Lipschitz constant of u*, if u* is held from sample to sample")
    )
    symbols: Constant = field(metadata=_of("G", "1/x", "sup of the norm of the Christoffel symbols"))
    symbols_slope: Constant = field(metadata=_of("L_G", "1/x^2", "sup of the norm of their derivatives"))

    def printable(self) -> HardwareConstants:
        """The same with every enclosure widened to printable bounds."""
        return replace(self, **{name: value.printable() for name, value, _ in self.items()})

    def items(self) -> list[tuple[str, Constant, Meaning]]:
        """`(name, value, meaning)` of every constant that applies, in the order of the table."""
        return [
            (name, value, HARDWARE[name]) for name in HARDWARE if (value := getattr(self, name)) is not None
        ]


HARDWARE: dict[str, Meaning] = table_of(fields(HardwareConstants))


@dataclass(frozen=True, slots=True, kw_only=True)
class CovariantConstants:
    """What takes the place of coordinate derivatives where the metric is not constant, each an enclosure."""

    drift_slope: Constant = field(
        metadata=_of("D_nX", "1/s", "sup of the covariant derivative of f + B u*, in the metric")
    )
    form_slope: Constant = field(
        metadata=_of("D_nF", "1/(d s)", "sup of the covariant derivative of F, in the metric")
    )
    input_slope: Constant = field(
        metadata=_of("D_nb", "1/(u s)", "sup on the plan of the covariant derivatives of the columns of B")
    )
    input_gain: Constant = field(metadata=_of("beta_O", "d/(u s)", "sup of |Theta B| over the tube"))
    drift_metric: Constant = field(metadata=_of("phi_M", "d/s", "sup of |Theta (f + B u*)| over the tube"))
    curvature: Constant = field(metadata=_of("K_R", "1/d^2", "sup of the |curvature| of the metric"))

    def printable(self) -> CovariantConstants:
        """The same with every enclosure widened to printable bounds."""
        return replace(self, **{name: value.printable() for name, value, _ in self.items()})

    def items(self) -> list[tuple[str, Constant, Meaning]]:
        """`(name, value, meaning)` of every constant, in the order of the table."""
        return [(name, getattr(self, name), meaning) for name, meaning in COVARIANT.items()]


COVARIANT: dict[str, Meaning] = table_of(fields(CovariantConstants))
