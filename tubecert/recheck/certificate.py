"""The certificate, read into closed types: every object with the keys that it must have and may have, and no others.

A key that is missing, unknown or of another kind is an error (TC603). Numbers are exact: the decimals that are written.
What explains and claims nothing is in `notes`, which are not read.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from fractions import Fraction
from typing import Any

from tubecert.recheck import wind
from tubecert.recheck.coordinates import Coordinates
from tubecert.recheck.document import Enclosure, Members, Node, digest, each
from tubecert.recheck.grammar import GrammarError, read_number
from tubecert.recheck.inputs import read_limited
from tubecert.recheck.kinds.kind import VERDICTS, Section
from tubecert.recheck.kinds.table import KEYS, KINDS
from tubecert.recheck.obstacles import Cleared
from tubecert.recheck.plans import read_plan
from tubecert.recheck.reasons import read_assumption, read_reason
from tubecert.recheck.result import (
    MEASURED,
    Claim,
    MetricSection,
    Overrides,
    Plans,
    Result,
    TubeSection,
)
from tubecert.recheck.specification import Specification, read_specification
from tubecert.recheck.specified.numbers import Range, Rows
from tubecert.recheck.specified.plant import Plant, Wanted, read_wanted
from tubecert.recheck.specified.trajectory import read_start

NOT_HASHED = ("notes", "run")
"""Members of a certificate beside its result: what they say is not examined."""

_ALWAYS = ("spec", "claim", "overrides", "plan", "safe_set", "assumptions", "declared", "reasons", "proof")
_PATH = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*|\[\d{1,6}\])*", re.ASCII)
_PART = re.compile(r"([A-Za-z_]\w*)|\[(\d+)\]", re.ASCII)


def opened(document: Node) -> tuple[Node, str, str]:
    """The result of a certificate, the hash that it states, and the one that the result has."""
    own = document.closed("format", "hash", "result", *NOT_HASHED)
    for key in NOT_HASHED:
        own[key].mapping()
    return own["result"], own["hash"].text(), digest(own["result"].value)


def read_result(node: Node) -> Result:
    """`result` of a certificate; one that says `certified` must have every section.

    Raises `CertificateError` for whatever is not of its form.
    """
    last = ("constants", "tube", *KEYS, "decided_by")
    own = node.closed("verdict", *_ALWAYS, optional=("synthesis", "metric", "clearance", "inputs", *last))
    verdict = own["verdict"].word(*VERDICTS)
    spec = own["spec"].closed("effective", "effective_hash", "file_hash")
    spec["file_hash"].text()
    specification = read_specification(spec["effective"])
    states = specification.plant.states
    searched = any(key in own for key in last[2:])
    if verdict == "certified" or searched:  # the search comes last: everything else must be there
        own.require("metric", *last)
    sections = {kind.key: kind.read(own[kind.key]) for kind in KINDS} if searched else None
    result = Result(
        verdict=verdict,
        specification=specification,
        effective_hash=spec["effective_hash"].text(),
        claim=_claim(own["claim"], states, specification.plant.inputs),
        overrides=own["overrides"].record(
            Overrides, settings=lambda item: read_settings(item, spec["effective"])
        ),
        plan=read_plan(own["plan"], specification),
        safe_set=_box(own["safe_set"], states, Node.decimal),
        assumptions=each(read_assumption)(own["assumptions"]),
        declared=_declared(own["declared"]),
        reasons=tuple(read_reason(item, len(states)) for item in own["reasons"].entries()),
        recipes=_recipes(own["proof"], sections),
        synthesised=own.get(
            "synthesis", lambda item: read_wanted(item.closed("asked")["asked"], specification.plant)
        ),
        metric=own.get("metric", lambda item: _metric(item, len(states))),
        tube=own.get("tube", lambda item: _tube(item, specification.plant)),
        clearance=own.get("clearance", each(lambda item: item.record(Cleared))) or (),
        inputs=own.get("inputs", each(lambda item: read_limited(item, specification.plant.inputs))) or (),
        constants=own.get("constants", lambda item: _constants(item, own, specification)),
        sections=sections,
        decided_by=own["decided_by"].texts() if searched else (),
    )
    return _complete(node, result) if verdict == "certified" else result


def _complete(node: Node, result: Result) -> Result:
    """A result that says `certified` states all that this rests on."""
    metric, tube, plan = result.metric, result.tube, result.plan
    assert metric is not None
    assert tube is not None
    parts: list[object] = [metric.lower_on_set, metric.upper_on_set, metric.lower, metric.upper]
    parts.append(metric.unique_geodesics)
    if len(result.specification.plant.inputs) < len(result.specification.plant.states):
        parts += [metric.margin, metric.largest_rate]  # C2 says something
    if any(part is None for part in parts):
        raise node.refused("is certified and lacks a part of `metric`")
    if tube.rho_r is None or tube.half_widths is None:
        raise node.refused("is certified and lacks a part of `tube`")
    if plan.interpolation is None:
        raise node.refused("is certified and lacks a part of `plan`")
    if isinstance(result.specification.metric, Wanted):
        raise node.refused("is certified for a metric that is not in the specification")
    return result


# -- what is claimed, and of what ----------------------------------------------------------------------------------


def _claim(node: Node, states: tuple[str, ...], inputs: tuple[str, ...]) -> Claim:
    def plans(item: Node) -> Plans:
        own = item.closed("x", "u", "defect")
        x, u = (_box(own[key], names, Node.exact) for key, names in (("x", states), ("u", inputs)))
        return x, u, own["defect"].exact()

    return node.record(
        Claim,
        domain=lambda item: _box(item, states, Node.exact),
        start=lambda item: read_start(item, states),
        plans=plans,
    )


def _box(node: Node, states: tuple[str, ...], read: Callable[[Node], Fraction]) -> dict[str, Range]:
    sides = node.closed(*states)
    return {name: (read(low), read(high)) for name in states for low, high in [sides[name].pair()]}


def read_settings(node: Node, effective: Node) -> dict[str, tuple[Fraction, Fraction]]:
    """What was set and is a number, where the specification has one; other texts are no more than told."""
    found = {}
    for path, item in node.items():
        if not _PATH.fullmatch(path):
            raise item.refused("is not named by the path of a key")
        given, own = _rational(item.text()), _rational(_at(effective.value, path))
        if given is not None and own is not None:
            found[path] = (given, own)
    return found


def _at(value: Any, path: str) -> object:
    """What stands at a path, None where there is nothing."""
    for name, index in _PART.findall(path):
        if name:
            value = value.get(name) if isinstance(value, dict) else None
        else:
            value = value[int(index)] if isinstance(value, list) and int(index) < len(value) else None
    return value


def _rational(text: object) -> Fraction | None:
    try:
        return read_number(text) if isinstance(text, str) else None
    except GrammarError:
        return None


def _declared(node: Node) -> dict[str, Fraction]:
    node.closed(optional=("h", "h_x", "h_t"))
    return {key: value.decimal() for key, value in node.items()}


# -- what is measured ----------------------------------------------------------------------------------------------


def _metric(node: Node, n: int) -> MetricSection:
    return node.record(
        MetricSection, dual_metric=lambda item: tuple(tuple(e.text() for e in row) for row in item.rows(n, n))
    )


def _tube(node: Node, plant: Plant) -> TubeSection:
    def widths(item: Node) -> dict[str, Fraction]:
        own = item.closed(*plant.lengths)
        return {name: own[name].decimal() for name in plant.lengths}

    return node.record(
        TubeSection, half_widths=widths, coordinates=lambda item: _coordinates(item, len(plant.states))
    )


def _coordinates(node: Node, n: int) -> Rows:
    """The rows of S."""
    rows = tuple(tuple(e.exact() for e in row) for row in node.rows(n, n))
    try:
        Coordinates(rows)
    except ValueError as error:
        raise node.refused(f"is no matrix of coordinates: {error}") from None
    return rows


def _constants(node: Node, result: Members, spec: Specification) -> dict[str, Enclosure]:
    """Every constant there is, and no other; those that follow from gains only where such gains are printed.

    Those of a disturbance and of unknown parameters are there if and only if the specification has these.
    """
    derived = (kind.derived(result[kind.key]) for kind in KINDS if kind.key in result)
    names = [*MEASURED, *(name for names in derived for name in names)]
    if spec.disturbance is not None:
        names += wind.CONSTANTS
    if spec.plant.ranges:
        names += wind.OF_UNKNOWN
    own = node.closed(*names)
    return {name: own[name].record(Enclosure) for name in names}


# -- gains ---------------------------------------------------------------------------------------------------------


def _recipes(node: Node, sections: dict[str, Section] | None) -> dict[str, object]:
    """What proves the gains of each kind that is certified; of another it would be examined by nothing."""
    read = sections or {}
    own = node.closed(optional=[key for key, section in read.items() if section.verdict == "certified"])
    return {kind.key: kind.read_recipe(own[kind.key]) for kind in KINDS if kind.key in own}
