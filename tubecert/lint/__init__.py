"""What a control engineer would ask about a specification before certifying it.

In: a `Spec` that loads and whose expressions are defined. Out: findings; an error is something that a certification
would refute, a warning what is hardly meant, a note what is worth knowing. Trusted: no; nothing rests on it.

| module | what it looks at |
|---|---|
| `codes` | finding codes, and how findings are made |
| `names` | parameters, names, units, states that cannot change, empty expectations |
| `plan` | plan and start in the safe set, room for the tube, equilibria, obstacles |
| `table` | a plan from a file against the dynamics: rows, units of time, exchanged columns |
| `uncertainty` | h that is zero, declared bounds that are broken or loose |
| `metric` | C1-C3 and declared bounds at points; what no input reaches along the plan |
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.domain import Range
from tubecert.findings import Finding, Severity
from tubecert.lint.codes import EXACT_SENSORS, LEFT_OUT, finding
from tubecert.lint.metric import metric_findings, reach_findings
from tubecert.lint.names import name_findings
from tubecert.lint.plan import plan_findings
from tubecert.lint.uncertainty import uncertainty_findings
from tubecert.spec import Spec
from tubecert.verdict import Verdict

__all__ = ["lint", "name_findings"]


def lint(spec: Spec, time: Range | None, effort: Effort) -> list[Finding]:
    """Every finding; what a file is known to be refuted for (`expect`) is only a note."""
    with np.errstate(all="ignore"):  # what overflows is not finite, and nothing is said about it
        findings = [*name_findings(spec), *metric_findings(spec), *_left_out(spec)]
        if not spec.lacks:  # else it asks about a metric alone
            findings += [*reach_findings(spec), *plan_findings(spec)]
            findings += uncertainty_findings(spec, time, effort)
    if spec.expect is not None and Verdict.REFUTED in (spec.expect.verdict, spec.expect.metric):
        return [replace(item, severity=Severity.NOTE) for item in findings]
    return findings


def _left_out(spec: Spec) -> Iterator[Finding]:
    """What a specification says that no certificate of its kind is about; sensors of which it says nothing."""
    note = partial(finding, spec, severity=Severity.NOTE)
    if spec.hardware is None:
        message = "parameters known by ranges stand in B, of which nothing is proven in continuous time"
        help = (
            "name the computer, hardware: {rate: 500}, in place of the metric: its loop is proven with them"
        )
        if spec.gained:
            yield note(LEFT_OUT, "system.parameters", message, help)
        return
    for output in spec.outputs:
        if output.name in dict(spec.tube.half_widths):
            message = f"nothing is designed for the half-width of the output {output.name} beside hardware"
            help = "it decides the verdict; what the design follows are wishes for states"
            yield note(LEFT_OUT, f"tube.half_widths.{output.name}", message, help)
    exact = [name for name in spec.states if f"hardware.noise.{name}" not in spec.locations]
    if isinstance(spec.hardware.noise, tuple) and exact:
        message = f"measured exactly: {', '.join(exact)}; hardware.noise names other states alone"
        help = f"give the error of their sensors, or write {exact[0]}: 0 if that is meant"
        yield note(EXACT_SENSORS, "hardware.noise", message, help)
