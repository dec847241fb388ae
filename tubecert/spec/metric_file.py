"""A metric file (JSON, as `synth` writes it) -> the metric of a specification; nothing in it is believed.

JSON is read by the reader of specifications: numbers from their text, expressions in the same grammar, every
problem with its place. Only `rate` and `dual_metric` are used; what else the file says is proven again.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from tubecert.errors import SpecError
from tubecert.spec.document import MappingNode, compose
from tubecert.spec.names import Names
from tubecert.spec.reader import Field, Reader, root_field
from tubecert.spec.source import Source, check_limits, read_source
from tubecert.spec.system import read_metric
from tubecert.spec.types import Metric, Spec

FORMAT: Final = "tubecert-metric/1"

_REPORTED: Final = ("verified_on", "margin", "lower", "upper", "condition_number", "solver")


def with_metric(spec: Spec, path: str) -> Spec:
    """The specification with the metric of a file in place of its own.

    Raises `TargetError` if the file cannot be read, `SpecError` with every problem in it.
    """
    return _with(spec, read_source(path, "give the path of a metric file (tubecert synth writes them)"))


def with_metric_text(spec: Spec, text: str, file: str) -> Spec:
    """The same for the text of a metric file; `file` is what findings call it."""
    return _with(spec, Source.of(file, text))


def _with(spec: Spec, source: Source) -> Spec:
    check_limits(source)
    node, findings = compose(source)
    reader = Reader(source)
    reader.findings.extend(findings)
    metric = None if findings else _read(root_field(reader, node), spec)
    if reader.findings or metric is None:
        raise SpecError(reader.findings)
    return replace(spec, metric=metric, synthesis=None)


def _read(root: Field, spec: Spec) -> Metric | None:
    entries = root.mapping(required=("format", "rate", "dual_metric"), optional=_REPORTED)
    if entries is None or "format" not in entries or entries["format"].word((FORMAT,)) is None:
        return None
    assert isinstance(root.node, MappingNode)
    used = tuple((key, node) for key, node in root.node.pairs if key.text in ("rate", "dual_metric"))
    if len(used) < 2:
        return None
    names = Names(states=spec.states, inputs=spec.inputs, parameters=spec.parameters)
    section = MappingNode(start=root.node.start, pairs=used)
    return read_metric(Field(reader=root.reader, path="metric", node=section), names)
