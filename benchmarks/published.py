"""The published gains of the two-state system beside what can be proven, as a Markdown table.

    python benchmarks/published.py

The first columns are the paper's gains and those that its conditions require as they are printed (docs/errata.md, E4 to
E11, says what is wrong with them), in floats, with the constants of the certificate: nothing is proven by them. The
others are from one certification of configs/two_state.yaml each.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import brentq

from tubecert.pipeline import Options, certify
from tubecert.spec import load

CONFIG = Path(__file__).resolve().parent.parent / "configs" / "two_state.yaml"
PUBLISHED = {("0.6", "0.01"): (51, 2e9), ("0.6", "0.1"): (60, 2e7), ("0.4", "0.1"): (90, 4e7)}
RATE, GAIN, FILTER = 1.74, 1.0, 2.0  # lambda, the g of A_m = -g I, |sC| over omega
LEFT = 0.99  # of (26b): without a rest no Gamma serves
W = np.array([[4.25828, -0.93423], [-0.93423, 3.76692]])
B = np.array([[0.5], [-2.0]])
SLOPES = np.array([[-1.0, 2.0], [-3.0, 4.0]])  # of f where x2 = 0: there F is largest


@dataclass(frozen=True, slots=True)
class Printed:
    """The derived constants as printed, from the constants `c` of a certificate; the start is on the plan."""

    c: dict[str, float]
    rho_a: float

    @property
    def speed(self) -> float:
        """Bound of |x'| (bounds:dx)."""
        c = self.c
        return c["f"] + c["B"] * (c["u_star"] + 2 * c["h"] + c["rho"] * self.feedback)

    @property
    def feedback(self) -> float:
        """(bounds:delta_u): the largest eigenvalue of (F, W) over twice the least singular value of Theta B."""
        F = SLOPES @ W + W @ SLOPES.T + 2 * RATE * W
        return float(eigh(F, W, eigvals_only=True)[-1] / (2 * np.sqrt((B.T @ np.linalg.solve(W, B))[0, 0])))

    def kernel(self, omega: float) -> float:
        """Dh/|2 lambda - omega| + s1/(2 lambda omega)."""
        return self.c["h"] / abs(2 * RATE - omega) + self.slope / (2 * RATE * omega)

    @property
    def slope(self) -> float:
        """Bound of |dh/dt| along the loop."""
        return self.c["h_t"] + self.c["h_x"] * self.speed

    def rest(self, omega: float) -> float:
        """What (26b) leaves of a."""
        c, A = self.c, self.c["upper"]
        turning = np.sqrt(A / c["lower"]) * (c["f_x"] + c["h_x"] * c["B"]) + self.feedback * c["B"]
        growth = A * c["B"] * turning
        third = A * c["h_x"] * (4 * RATE * c["B"] + growth) / RATE
        return c["lower"] - third / omega  # W and B are constant: zeta_2 = 0

    def gains(self) -> tuple[float, float]:
        """The least bandwidth above 2 lambda of (26a) and (26b), and the rate that (26c) asks for with it."""
        c = self.c
        rho_r = c["rho"] - self.rho_a
        weight = 2 * c["rho"] * c["B"] * c["upper"] / c["lower"]

        def room(omega: float) -> float:
            return min(rho_r**2 - weight * self.kernel(omega), self.rest(omega) - (1 - LEFT) * c["lower"])

        omega = float(brentq(room, 2 * RATE * (1 + 1e-9), 1e6))
        error = np.sqrt(2 * 2 * c["h"] * self.slope / (2 * GAIN) + (2 * c["h"]) ** 2)
        filtered = (c["B_pinv_x"] * self.speed + (FILTER * omega + GAIN) * c["B_pinv"]) * error
        theta = c["B"] * c["upper"] * filtered / RATE
        return omega, float((theta / (self.rho_a * self.rest(omega))) ** 2)


def printed(result: dict[str, Any], rho_a: float) -> Printed:
    """With the proven constants of a certificate."""
    constants = {name: item["above"] for name, item in result["constants"].items()}
    constants["lower"] = result["constants"]["lower"]["below"]
    return Printed({**constants, "rho": result["tube"]["rho"]}, rho_a)


def pair(gains: dict[str, Any]) -> str:
    """A bandwidth and an adaptation rate."""
    return f"{gains['bandwidth']:.4g} / {gains['adaptation_rate']:.3g}"


def main() -> None:
    """Print the table."""
    spec = load(str(CONFIG))
    print("| eps, rho_a | published | required by the printed conditions | A, corrected | B, least Gamma |")
    print("|---|---|---|---|---|")
    for (epsilon, rho_a), (omega, Gamma) in PUBLISHED.items():
        radii = {"epsilon": Fraction(epsilon), "rho_a": Fraction(rho_a)}
        proven = certify(spec, Options(**radii, conditions="all")).to_json()
        assert proven["verdict"] == "certified", proven["reasons"]
        needed = printed(proven, float(rho_a)).gains()
        print(
            f"| {epsilon}, {rho_a} | {omega} / {Gamma:.0e} | {needed[0]:.4g} / {needed[1]:.3g} "
            f"| {pair(proven['conditions_26'])} | {pair(proven['distance']['least_adaptation'])} |"
        )


if __name__ == "__main__":
    main()
