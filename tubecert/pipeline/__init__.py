"""Certification from a specification to a result: the rooms in their order.

In: a `Spec` and `Options`. Out: the `result` object of a certificate, for every verdict. Trusted: yes, for the order.

| module | what it does |
|---|---|
| `options` | what a command asks for beside the specification |
| `checks` | what makes the question meaningless, as findings |
| `certification` | the claims in their order, up to the constants |
| `gains` | gains of A, B and C, and the verdict |
| `synthesis`, `synthesised` | a metric where none is given: objectives, the sweep over rates, why there is none |
"""

from dataclasses import replace

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.errors import SpecError
from tubecert.findings import Severity
from tubecert.model import domain_findings
from tubecert.pipeline.certification import Certification, Result
from tubecert.pipeline.checks import inspect, missing_parts, time_of
from tubecert.pipeline.options import Options, Progress, Step, overridden
from tubecert.pipeline.synthesis import SynthesisRun
from tubecert.pipeline.synthesised import Synthesised, metric_file
from tubecert.spec import Spec, Synthesis
from tubecert.synthesis.bridge import required

__all__ = [
    "Options",
    "Progress",
    "Result",
    "Step",
    "Synthesised",
    "certify",
    "inspect",
    "metric_file",
    "synthesise",
]


def certify(spec: Spec, options: Options, progress: Progress | None = None) -> Result:
    """The result for a specification; raises `SpecError` for what makes the question meaningless."""
    spec = overridden(spec, options)
    findings, time = time_of(spec)
    findings += missing_parts(spec)
    if not findings:
        findings = domain_findings(spec, time, Effort(budget=options.budget))
    if any(item.severity is Severity.ERROR for item in findings):
        raise SpecError(findings)
    if spec.metric is None and spec.synthesis is not None:
        found = synthesise(spec, spec.synthesis, options, progress)
        return Certification(found.spec or spec, options, time, progress, found).run()
    return Certification(spec, options, time, progress).run()


def synthesise(
    spec: Spec, wanted: Synthesis, options: Options, progress: Progress | None = None, *, sweep: bool = False
) -> Synthesised:
    """A proven metric for a specification, or why there is none; with `sweep` others over a range of rates beside it.

    Raises `SpecError` for what makes the question meaningless, and for a solver that is not installed.
    """
    required(wanted.solver)
    spec = replace(overridden(spec, options), metric=None, synthesis=None)
    findings, time = time_of(spec)
    findings += domain_findings(spec, time, Effort(budget=options.budget)) if not findings else []
    if any(item.severity is Severity.ERROR for item in findings):
        raise SpecError(findings)
    return SynthesisRun(spec, wanted, options, certify, progress).run(sweep=sweep)
