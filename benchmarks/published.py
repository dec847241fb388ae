"""The published gains of the two-state system beside what can be proven, as a Markdown table.

    python benchmarks/published.py

Every number but those in the first columns is the result of one certification of configs/two_state.yaml.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

from tubecert.pipeline import Options, certify
from tubecert.spec import load

CONFIG = Path(__file__).resolve().parent.parent / "configs" / "two_state.yaml"
PUBLISHED = {("0.6", "0.01"): (51, 2e9), ("0.6", "0.1"): (60, 2e7), ("0.4", "0.1"): (90, 4e7)}


def pair(gains: dict[str, Any] | None) -> str:
    """A bandwidth and an adaptation rate."""
    return "-" if gains is None else f"{gains['bandwidth']:.4g} / {gains['adaptation_rate']:.3g}"


def sampled(section: dict[str, Any]) -> str:
    """A bandwidth and a sample time."""
    return f"{section['bandwidth']:.4g} rad/s / {1e3 * section['sample_time']:.4g} ms"


def main() -> None:
    """Print the table."""
    spec = load(str(CONFIG))
    print(
        "| eps, rho_a | published | required by the printed conditions | A, corrected | B, least Gamma | C |"
    )
    print("|---|---|---|---|---|---|")
    for (epsilon, rho_a), (omega, Gamma) in PUBLISHED.items():
        radii = {"epsilon": Fraction(epsilon), "rho_a": Fraction(rho_a)}
        printed = certify(spec, Options(**radii, formulas="as-printed")).to_json()
        proven = certify(spec, Options(**radii, conditions="all")).to_json()
        print(
            f"| {epsilon}, {rho_a} | {omega} / {Gamma:.0e} | {pair(printed['conditions_26'])} "
            f"| {pair(proven['conditions_26'])} | {pair(proven['distance']['least_adaptation'])} "
            f"| {sampled(proven['sampled'])} |"
        )
        assert proven["verdict"] == "certified", proven["reasons"]


if __name__ == "__main__":
    main()
