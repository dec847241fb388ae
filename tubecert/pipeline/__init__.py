"""Certification from a specification to a result: the rooms in their order.

In: a `Spec` and `Options`. Out: the `result` object of a certificate, for every verdict. Trusted: yes, for the order.

| module | what it does |
|---|---|
| `options` | what a command asks for beside the specification |
| `checks` | what makes the question meaningless, as findings |
| `certification` | the claims in their order, up to the constants |
| `gains` | gains of A, B and C, and the verdict |
"""

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.errors import SpecError
from tubecert.findings import Severity
from tubecert.model import domain_findings
from tubecert.pipeline.certification import Certification, Result
from tubecert.pipeline.checks import inspect, missing_parts, time_of
from tubecert.pipeline.options import CONDITIONS, Options, Progress, Step, overridden
from tubecert.spec import Spec

__all__ = ["CONDITIONS", "Options", "Progress", "Result", "Step", "certify", "inspect"]


def certify(spec: Spec, options: Options, progress: Progress | None = None) -> Result:
    """The result for a specification; raises `SpecError` for what makes the question meaningless."""
    spec = overridden(spec, options)
    findings, time = time_of(spec)
    findings += missing_parts(spec)
    if not findings:
        findings = domain_findings(spec, time, Effort(budget=options.budget))
    if any(item.severity is Severity.ERROR for item in findings):
        raise SpecError(findings)
    return Certification(spec, options, time, progress).run()
