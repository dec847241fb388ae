"""A certificate of a sampled loop, read into closed types: every object with the keys that it must and may have.

A key that is missing, unknown or of another kind is an error (TC603). Numbers are exact: decimals, or hexadecimal
floats in the one spelling that they have. What explains, `notes` and `run`, is not read.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

from tubecert.recheck.certificate import read_settings
from tubecert.recheck.document import Members, Node, digest
from tubecert.recheck.plans import Knots, Plan
from tubecert.recheck.specification import SampledSpecification, read_sampled_specification
from tubecert.recheck.specified.numbers import Numbers, Range
from tubecert.recheck.specified.trajectory import Planned, Tabled

NOT_EXAMINED = ("notes", "run", "spec.file_hash")
VERDICTS = ("certified", "refuted", "undecided")
_HEX = re.compile(r"-?0x[01]\.[0-9a-f]{1,13}p[+-][0-9]{1,4}")
_MOST_LAGS = 50_000
_MOST_START = 1_000_000  # samples before the last stage
_MOST_STAGES = _MOST_MEMORY = _MOST_PARTS = 64
_MOST_WINDOWS = 4_096

Floats = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class Tables:
    """F (z, z), G (z, n), M (m, z), N (m, n)."""

    F: Floats
    G: Floats
    M: Floats
    N: Floats


@dataclass(frozen=True, slots=True)
class Nominal:
    """A (n, n), B (n, m), E (n, k)."""

    A: Floats
    B: Floats
    E: Floats


@dataclass(frozen=True, slots=True)
class Stage:
    """From sample `start` on: boxes of the errors (n), of what the controller adds (m), of its memory (z)."""

    start: int
    half_widths: Numbers
    deviations: Numbers
    memory: Numbers

    @property
    def boxes(self) -> Numbers:
        """All of them, (n + m + z)."""
        return (*self.half_widths, *self.deviations, *self.memory)


@dataclass(frozen=True, slots=True)
class Recipe:
    """How the proof was found: a hint. `cuts` (n + m + z rows) of r lags."""

    lags: int
    cuts: tuple[tuple[int, ...], ...]
    pieces: int
    panels: int
    windows: int
    slow: bool


@dataclass(frozen=True, slots=True)
class InputUse:
    """An input by name: what it keeps to, and its limits."""

    name: str
    range: Range
    limits: Range | None


@dataclass(frozen=True, slots=True)
class Proven:
    """What a certified result rests on."""

    nominal: Nominal
    tables: Tables
    stages: tuple[Stage, ...]
    recipe: Recipe


@dataclass(frozen=True, slots=True)
class Result:
    """What is claimed; `proven` is there where the verdict is certified."""

    verdict: str
    specification: SampledSpecification
    effective_hash: str
    settings: dict[str, tuple[Fraction, Fraction]]
    horizon: Fraction | None
    afterwards: str
    hold: str
    plan: Plan
    proven: Proven | None
    inputs: tuple[InputUse, ...]
    clearance: tuple[tuple[int, str], ...]
    lacks: int


@dataclass(frozen=True, slots=True)
class Certificate:
    """The result with the hash that is stated and the one that it has."""

    result: Result
    stated_hash: str
    hash: str


def read_certificate(document: Node) -> Certificate:
    """The certificate in a document; raises `CertificateError` for whatever is not of its form."""
    own = document.closed("format", "hash", "result", "notes", "run")
    for key in ("notes", "run"):
        own[key].mapping()
    return Certificate(read_result(own["result"]), own["hash"].text(), digest(own["result"].value))


def read_result(node: Node) -> Result:
    """`result`."""
    parts = ("nominal", "controller", "tube", "recipe")
    own = node.closed(
        "verdict", "spec", "claim", optional=("planned", *parts, "inputs", "clearance", "lacks")
    )
    spec = own["spec"].closed("effective", "effective_hash", "file_hash", optional=("settings",))
    spec["file_hash"].text()
    specification = read_sampled_specification(spec["effective"])
    claim = own["claim"].closed("horizon", "afterwards", "hold")
    verdict = own["verdict"].word(*VERDICTS)
    if verdict == "certified":
        own.require(*parts)
    proven = _proven(own, specification) if all(part in own for part in parts) else None
    return Result(
        verdict=verdict,
        specification=specification,
        effective_hash=spec["effective_hash"].text(),
        settings=spec.get("settings", lambda item: read_settings(item, spec["effective"])) or {},
        horizon=claim.known("horizon", Node.decimal),
        afterwards=claim["afterwards"].word("nothing", "rest", "repeat"),
        hold=claim["hold"].word("middle", "left", "continuous"),
        plan=_plan(own, specification),
        proven=proven,
        inputs=tuple(map(_input, own["inputs"].entries())) if "inputs" in own else (),
        clearance=tuple(map(_cleared, own["clearance"].entries())) if "clearance" in own else (),
        lacks=len(list(map(_lack, own["lacks"].entries()))) if "lacks" in own else 0,
    )


def _proven(own: Members, spec: SampledSpecification) -> Proven:
    n, m = len(spec.plant.states), len(spec.plant.inputs)
    k = 0 if spec.disturbance is None else len(spec.disturbance.E[0])
    nominal = own["nominal"].closed("A", "B", "E")
    tables = own["controller"].closed("F", "G", "M", "N")
    z = len(tables["F"].closed("columns", "rows")["rows"].entries())
    if z > _MOST_MEMORY:
        raise tables["F"].refused(f"has more than {_MOST_MEMORY} rows")
    return Proven(
        nominal=Nominal(
            _floats(nominal["A"], n, n), _floats(nominal["B"], n, m), _floats(nominal["E"], n, k)
        ),
        tables=Tables(
            _floats(tables["F"], z, z),
            _floats(tables["G"], z, n),
            _floats(tables["M"], m, z),
            _floats(tables["N"], m, n),
        ),
        stages=_stages(own["tube"], spec, z),
        recipe=_recipe(own["recipe"], n + m + z),
    )


def _floats(node: Node, p: int, q: int) -> Floats:
    own = node.closed("columns", "rows")
    if own["columns"].count() != q:
        raise node.refused(f"has not {q} columns")
    return tuple(tuple(map(_float, row)) for row in own["rows"].rows(p, q))


def _float(node: Node) -> float:
    """A finite float in the spelling of `float.hex`."""
    text = node.text()
    try:
        value = float.fromhex(text) if _HEX.fullmatch(text) else math.nan
    except OverflowError:
        value = math.nan
    if not math.isfinite(value) or value.hex() != text:
        raise node.refused("is no finite hexadecimal number in its own spelling")
    return value


def _stages(node: Node, spec: SampledSpecification, z: int) -> tuple[Stage, ...]:
    found = tuple(_stage(item, spec, z) for item in node.entries()[: _MOST_STAGES + 1])
    starts = [own.start for own in found]
    if not 0 < len(found) <= _MOST_STAGES or starts[0] != 0 or starts[-1] > _MOST_START:
        raise node.refused(f"must have 1 to {_MOST_STAGES} stages, the first from sample 0 on")
    if any(a >= b for a, b in pairwise(starts)):
        raise node.refused("has stages that are not in order")
    return found


def _stage(node: Node, spec: SampledSpecification, z: int) -> Stage:
    own = node.closed("start", "half_widths", "deviations", "memory")
    widths = own["half_widths"].closed(*spec.plant.states)
    deviations = own["deviations"].closed(*spec.plant.inputs)
    found = Stage(
        own["start"].count(),
        tuple(widths[name].decimal() for name in spec.plant.states),
        tuple(deviations[name].decimal() for name in spec.plant.inputs),
        tuple(item.decimal() for item in own["memory"].sized(z)),
    )
    if min(found.half_widths) <= 0 or min((*found.deviations, *found.memory)) < 0:
        raise node.refused("has a box without an inside")
    return found


def _recipe(node: Node, outputs: int) -> Recipe:
    own = node.closed("lags", "cuts", "pieces", "panels", "windows", "parameters")
    lags = _between(own["lags"], 1, _MOST_LAGS)
    rows = [row.entries() for row in own["cuts"].sized(outputs)]
    return Recipe(
        lags=lags,
        cuts=tuple(tuple(_between(item, 0, lags) for item in row) for row in rows),
        pieces=_between(own["pieces"], 1, _MOST_PARTS),
        panels=_between(own["panels"], 1, _MOST_PARTS),
        windows=_between(own["windows"], 1, _MOST_WINDOWS),
        slow=own["parameters"].word("slow", "sudden") == "slow",
    )


def _between(node: Node, least: int, most: int) -> int:
    if not least <= node.count() <= most:
        raise node.refused(f"is not between {least} and {most}")
    return node.count()


def _plan(own: Members, spec: SampledSpecification) -> Plan:
    """The knots of a plan through knots, which no other plan may have."""
    n, m, through = (
        len(spec.plant.states),
        len(spec.plant.inputs),
        isinstance(spec.trajectory, (Planned, Tabled)),
    )
    interpolation = knots = None
    if "planned" in own:
        if not through:
            raise own["planned"].refused("is not known in this place")
        part = own["planned"].closed("t", "x", "u", "interpolation")
        t = part["t"].decimals()
        x, u = (
            tuple(tuple(e.decimal() for e in row) for row in part[key].rows(len(t), size))
            for key, size in (("x", n), ("u", m))
        )
        knots, interpolation = Knots(t, x, u), part["interpolation"].word("hold", "linear", "hermite-simpson")
    return Plan(spec.trajectory.kind, interpolation, None, knots, None, None)


def _input(node: Node) -> InputUse:
    own = node.closed("input", "range", optional=("limits",))
    return InputUse(own["input"].text(), _ends(own["range"]), own.get("limits", _ends))


def _ends(node: Node) -> Range:
    low, high = node.pair()
    return low.decimal(), high.decimal()


def _cleared(node: Node) -> tuple[int, str]:
    own = node.closed("index", "verdict")
    return own["index"].count(), own["verdict"].word(*VERDICTS)


def _lack(node: Node) -> None:
    own = node.closed("kind", optional=("where", "needed", "allowed"))
    own["kind"].text()
    own.get("where", Node.text)
    for key in ("needed", "allowed"):
        own.get(key, Node.number)
