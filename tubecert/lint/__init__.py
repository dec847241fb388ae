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

from dataclasses import replace

import numpy as np

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.domain import Range
from tubecert.findings import Finding, Severity
from tubecert.lint.codes import LEFT_OUT, finding
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


def _left_out(spec: Spec) -> list[Finding]:
    """What a specification says that no certificate of its kind is about."""
    if spec.hardware is None:
        message = "parameters known by ranges stand in B, of which nothing is proven in continuous time"
        help = (
            "name the computer, hardware: {rate: 500}, in place of the metric: its loop is proven with them"
        )
        told = {"system.parameters": (message, help)} if spec.gained else {}
    else:
        named = {output.name for output in spec.outputs}
        told = {
            f"tube.half_widths.{name}": (
                f"the half-width of the output {name} is asked for beside hardware; nothing is designed for it",
                "it decides the verdict; what the design follows are wishes for states",
            )
            for name, _ in spec.tube.half_widths
            if name in named
        }
    return [
        finding(spec, LEFT_OUT, key, message, help, severity=Severity.NOTE)
        for key, (message, help) in told.items()
    ]
