"""A metric file -> the metric of a specification.

It is JSON, as `synth` writes it, and is read by the reader of specifications: numbers from their text, expressions in
the same grammar, every problem with its place. Nothing in it is believed: only `rate` and `dual_metric` are used; what
else it says is proven again.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from tubecert.errors import SpecError
from tubecert.findings import Finding
from tubecert.spec import codes
from tubecert.spec.document import compose
from tubecert.spec.metric import METRIC, Metric
from tubecert.spec.names import Names
from tubecert.spec.reader import Field, Reader, is_of_another_kind, root_field
from tubecert.spec.source import Source, check_limits
from tubecert.spec.types import Spec

FORMAT: Final = "tubecert-metric/1"

_REPORTED: Final = ("verified_on", "margin", "lower", "upper", "condition_number", "solver")
_REMEDY: Final = (
    "give a metric file: tubecert synth writes one, and certify writes the metric that it synthesises beside "
    "its certificate"
)
_OTHERS: Final = {
    "tubecert: ": ("this is a specification, not a metric file", _REMEDY),
    "format: tubecert-certificate/": ("this is a certificate, not a metric file", _REMEDY),
}


def of_no_metric(spec: Spec) -> list[Finding]:
    """That a specification asks about a sampled loop, where a metric is asked for or given; empty if it does not."""
    if spec.hardware is None:
        return []
    message = "hardware asks about the sampled loop, which is proven without a metric"
    help = f"`tubecert certify {spec.path}` needs none; for a loop in continuous time leave hardware out"
    place = spec.location("hardware")
    return [Finding(code=codes.RANGE, message=message, location=place, help=help)]


def with_metric(spec: Spec, source: Source) -> Spec:
    """The specification with the metric of a file in place of its own; raises `SpecError` with every problem in it."""
    if refused := of_no_metric(spec):
        raise SpecError(refused)
    check_limits(source)
    node, findings = compose(source, language="JSON")
    reader = Reader(source, document="the metric file")
    reader.findings.extend(findings)
    metric = None if findings else _read(root_field(reader, node), spec)
    if reader.findings or metric is None:
        raise SpecError(reader.findings)
    return replace(spec, metric=metric, synthesis=None)


def _read(root: Field, spec: Spec) -> Metric | None:
    if is_of_another_kind(root, _OTHERS):
        return None
    entries = root.mapping(required=("format", "rate", "dual_metric"), optional=_REPORTED)
    if entries is None or "format" not in entries or entries["format"].word((FORMAT,)) is None:
        return None
    names = Names(states=spec.states, inputs=spec.inputs, parameters=spec.parameters, ranges=spec.ranges)
    values = METRIC.sound(entries, names)
    return None if values is None else Metric(**values)
