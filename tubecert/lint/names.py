"""What the names of a specification give away; needs no numerics."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from itertools import combinations

from tubecert.digits import near
from tubecert.expression import (
    FUNCTIONS,
    ZERO,
    Expression,
    derivatives,
    free_symbols,
    number_text,
    to_text,
    topological,
)
from tubecert.findings import Finding, Severity
from tubecert.lint import codes
from tubecert.lint.codes import finding
from tubecert.spec import Spec

_WORDS = (*FUNCTIONS, "pi", "t")
# of a cart and its pendulum: masses m and M, a length l beside an inertia I; a current i beside one
_CUSTOMARY = {frozenset(pair) for pair in ("mM", "lI", "iI", "rR")}
_BODY = re.compile(r"(?:m|M|J|I|l|L)(?:\d+|_\w+)?|[IJ][xyz]{1,2}|(?:mass|inertia|length)\w*", re.ASCII)
_SHOWN = 4  # pairs of names
_TURNS = 4 * math.pi  # no angle of a set is expected to be larger, in rad
_PER_TIME = re.compile(r"(.+?) ?/ ?(min|h|hr|day|d|ms|us)")
_DEGREES = re.compile(r"\bdeg(rees?)?\b|°")
_ALIKE = str.maketrans({"O": "0", "o": "0", "l": "1", "I": "1", "i": "1"})


def name_findings(spec: Spec) -> list[Finding]:
    """Findings about names."""
    return [
        *_unused(spec),
        *_confusable(spec),
        *_negative(spec),
        *_units(spec),
        *_degrees(spec),
        *_many_turns(spec),
        *_unit_of_time(spec),
        *_idle(spec),
        *_expectation(spec),
    ]


def _unused(spec: Spec) -> Iterator[Finding]:
    """Parameters and definitions are substituted when they are read, so their names are looked for in the text."""
    text = "\n".join(re.sub(r"(^|\s)#.*", "", line) for line in spec.source.splitlines())
    words = re.findall(r"\b[A-Za-z]\w*", text)
    for what, name in _given(spec):
        if words.count(name) < 2:
            message = f"the {what} {name} is never used"
            help = "remove it, or use it"
            yield finding(spec, codes.UNUSED, f"system.{what}s.{name}", message, help)


def _given(spec: Spec) -> list[tuple[str, str]]:
    """The names beside those of states and inputs, each after what it names."""
    parameters = [("parameter", name) for name, _ in (*spec.parameters, *spec.ranges)]
    tables = [("table", table.name) for table in spec.tables]
    return [*parameters, *tables, *(("definition", name) for name in spec.definitions)]


def _confusable(spec: Spec) -> Iterator[Finding]:
    names = [*spec.states, *spec.inputs, *(name for _, name in _given(spec))]
    for name in names:
        word = next((word for word in _WORDS if word == name.lower()), None)
        if word is not None:
            what = {"t": "the time", "pi": "the number"}.get(word, "the function")
            yield _alike(spec, name, f"{name} is easily taken for {what} {word}")
    pairs = [
        (second, first)
        for first, second in combinations(names, 2)
        if _folded(first) == _folded(second) and not _customary(first, second)
    ]
    if pairs:  # a notation is one habit: one finding for all of them
        told = [f"{second} for {first}" for second, first in pairs[1:_SHOWN]]
        more = [f"{len(pairs) - _SHOWN} more"] if len(pairs) > _SHOWN else []
        message = f"{pairs[0][0]} is easily taken for {pairs[0][1]}"
        yield _alike(spec, pairs[0][0], ", ".join([message, *told, *more]))


def _negative(spec: Spec) -> Iterator[Finding]:
    lowest = [*spec.parameters, *((name, low) for name, (low, _) in spec.ranges)]
    for name, value in lowest:
        if value <= 0 and _BODY.fullmatch(name):
            message = f"{name} is {number_text(value)}; masses, inertias and lengths are positive"
            help = "write its value, or another name if it is something else"
            yield finding(spec, codes.NOT_POSITIVE, f"system.parameters.{name}", message, help)


def _customary(first: str, second: str) -> bool:
    """Whether two names are told apart by custom: m and M, l1 and I1."""
    return first[1:] == second[1:] and frozenset((first[0], second[0])) in _CUSTOMARY


def _folded(name: str) -> str:
    return name.translate(_ALIKE).lower()


def _alike(spec: Spec, name: str, message: str) -> Finding:
    path = f"system.{'definitions' if name in spec.definitions else 'parameters'}.{name}"
    for key, names in (("states", spec.states), ("inputs", spec.inputs)):
        if name in names:
            path = f"system.{key}[{names.index(name)}]"
    return finding(
        spec, codes.CONFUSABLE, path, message, "choose names that differ by more than case or shape"
    )


def _units(spec: Spec) -> Iterator[Finding]:
    given = dict(spec.units)
    missing = [name for name in (*spec.states, *spec.inputs) if name not in given]
    if given and missing:
        message = f"no unit is given for {', '.join(missing)}"
        help = 'write "1" for what has no dimension'
        yield finding(spec, codes.UNITS, "system.units", message, help, severity=Severity.NOTE)


def turned(spec: Spec, name: str) -> list[Expression]:
    """Sines, cosines and tangents of a state in f, B and h, but of those that turn degrees into radians by pi."""
    terms = [*spec.f, *(term for row in spec.B for term in row), *(spec.uncertainty.h or ())]
    found = [e for e in topological([term.expression for term in terms]) if e.op in ("sin", "cos", "tan")]
    return [
        e for e in found if name in free_symbols(e.args) and all(n.op != "pi" for n in topological(e.args))
    ]


def _degrees(spec: Spec) -> Iterator[Finding]:
    for name, unit in spec.units:
        if _DEGREES.search(unit) and (own := turned(spec, name)):
            message = f"{name} is in {unit}, and {to_text(own[0])[:60]} takes radians"
            help = f"let {name} be in rad (numbers may be written in degrees: 30 deg), or write pi/180*{name} there"
            yield finding(spec, codes.UNITS, f"system.units.{name}", message, help, severity=Severity.NOTE)


def _many_turns(spec: Spec) -> Iterator[Finding]:
    """Ends of the safe set that read as degrees: an angle, taken as it is, that goes round more than twice."""
    told = {name for name, unit in spec.units if _DEGREES.search(unit)}
    for name, ends in zip(spec.states, spec.safe_set, strict=True):
        if name in told or max(map(abs, ends)) <= _TURNS:
            continue
        slopes = ((e, derivatives(e.args, name)[0]) for e in turned(spec, name))
        own = next((e for e, slope in slopes if slope.is_constant and abs(slope.fraction) == 1), None)
        if own is not None:
            low, high = map(number_text, ends)
            message = (
                f"safe_set.{name} is [{low[:20]}, {high[:20]}], and {to_text(own)[:60]} takes radians: "
                f"that is {near(float(max(map(abs, ends))) / (2 * math.pi), 2)} turns"
            )
            help = f"if these are degrees, write [{low[:20]} deg, {high[:20]} deg]"
            yield finding(spec, codes.UNITS, f"safe_set.{name}", message, help)


def _unit_of_time(spec: Spec) -> Iterator[Finding]:
    """Units that say that time is not in seconds: a state whose derivative is another one, in its unit per minute."""
    units = dict(spec.units)
    for name, term in zip(spec.states, spec.f, strict=True):
        rate = str(term.expression.value) if term.expression.op == "symbol" else ""
        found = _PER_TIME.fullmatch(units.get(rate, ""))
        if found and found[1] == units.get(name):
            message = f"f has {name}' = {rate}, in {units[rate]}: the time of this file is in {found[2]}"
            beside, severity = "", Severity.NOTE
            if spec.hardware is not None:
                beside, severity = f", hardware counts samples per {found[2]}", Severity.WARNING
            help = (
                f"nothing is converted: horizons are in {found[2]} and rates in 1/{found[2]} then{beside}, whatever a "
                "report calls them; or write the dynamics in seconds"
            )
            yield finding(spec, codes.UNITS, f"system.units.{rate}", message, help, severity=severity)
            return


def _idle(spec: Spec) -> Iterator[Finding]:
    for i, (drift, row) in enumerate(zip(spec.f, spec.B, strict=True)):
        if drift.expression is ZERO and all(term.expression is ZERO for term in row):
            name = spec.states[i]
            message = f"{name} cannot change: its rows in f and B are zero, so nothing brings it back"
            help = f"make {name} a parameter"
            yield finding(spec, codes.IDLE_STATE, f"system.f[{i}]", message, help)


def _expectation(spec: Spec) -> Iterator[Finding]:
    expect = spec.expect
    if expect is None and spec.lacks:
        message = "this asks about a metric alone: there is neither uncertainty nor trajectory"
        help = "write expect: {metric: holds}, or add the sections that are missing"
        yield finding(spec, codes.METRIC_ALONE, "metric", message, help, severity=Severity.NOTE)
    if expect is not None and not (expect.verdict or expect.metric or expect.ranges):
        message = "expect names nothing that is expected"
        help = f"write expect: {{{'metric: holds' if spec.lacks else 'verdict: certified'}}}, or remove it"
        yield finding(spec, codes.EMPTY_EXPECTATION, "expect", message, help)
