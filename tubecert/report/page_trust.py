"""What a certificate has proven, and what it was told: one sentence per claim, only for claims that were reached."""

from __future__ import annotations

from collections.abc import Iterator

from tubecert.certificate.result import Result
from tubecert.digits import exact, up
from tubecert.report.claimed import plan_words
from tubecert.report.gains import NAMES
from tubecert.verdict import Verdict


def proven(result: Result) -> Iterator[str]:
    """Claims that are proven whatever the verdict."""
    metric, tube = result.metric, result.tube
    if metric is not None:
        yield "B has full rank on the whole safe set."
        if metric.verdict is Verdict.CERTIFIED:
            yield (
                f"The metric is positive definite, contracting at the rate {exact(metric.rate)} 1/s (C2) and "
                "compatible with the inputs (C3) on the whole safe set."
            )
    if tube is not None and tube.rho_r is not None:
        if tube.coordinates is None:
            yield f"The tube of radius {up(tube.rho)} around {plan_words(result)} lies in the safe set."
        else:
            yield f"The tube, as wide as its half-widths around {plan_words(result)}, lies in the safe set."
    if metric is not None and metric.unique_geodesics is not None and metric.unique_geodesics.holds:
        yield "Minimising geodesics in the tube are unique."
    if count := len(result.constants):
        yield (
            f"Each of the {count} constants below is bounded from below and from above by interval arithmetic; "
            "the proof uses the safe side."
        )
    for own in result.inputs:
        if own.verdict is Verdict.CERTIFIED:
            yield f"The input {own.input} stays within its limits, on the plan and in the loop."
    for key, words in CLAIMS.items():
        section = result.sections.get(key)
        if section is not None and section.verdict is Verdict.CERTIFIED:
            yield f"{NAMES[key]}: {words}"


CLAIMS = {  # of each kind, what is certified by it
    "no_adaptation": "the feedback alone, without adaptation, keeps the state in the tube.",
    "conditions_26": "the conditions (26a), (26b) and (26c), corrected, hold at its gains.",
    "distance": "the Riemannian distance to the plan stays below its bound at its gains.",
}
_DECLARED = {"h": "|h|", "h_x": "|dh/dx|", "h_t": "|dh/dt|"}


def declared(result: Result) -> Iterator[str]:
    """What the specification declares and nobody proves."""
    for name, value in sorted(result.declared.items()):
        yield f"{_DECLARED.get(name, name)} <= {up(value, 12)} on the tube"
