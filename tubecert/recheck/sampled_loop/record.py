"""A certificate of a sampled loop, read into closed types: every object with the keys that it must and may have.

A key that is missing, unknown or of another kind is an error (TC603). Numbers are exact: decimals, or hexadecimal
floats in the one spelling that they have. What explains, `notes` and `run`, is not read.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

from flint import arb, arb_mat

from tubecert.recheck.certificate import read_settings
from tubecert.recheck.document import Members, Node, digest
from tubecert.recheck.plans import Plan, read_knots
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
T = TypeVar("T")


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
    """What a certified result rests on: A (n, n), B (n, m), E (n, k); tables F (z, z), G (z, n), M (m, z), N (m, n)."""

    A: arb_mat
    B: arb_mat
    E: arb_mat
    F: arb_mat
    G: arb_mat
    M: arb_mat
    N: arb_mat
    stages: tuple[Stage, ...]
    recipe: Recipe


@dataclass(frozen=True, slots=True)
class Result:
    """What is claimed; `proven` is there where the verdict is certified.

    `repeated`: by path what is stated a second time, and what it is.
    """

    verdict: str
    specification: SampledSpecification
    repeated: dict[str, tuple[object, object]]
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
    if own["verdict"].word(*VERDICTS) == "certified":
        own.require(*parts)
    settings = spec.get("settings", lambda item: read_settings(item, spec["effective"])) or {}
    return Result(
        verdict=own["verdict"].text(),
        specification=specification,
        repeated={
            "spec.effective_hash": (spec["effective_hash"].text(), specification.hash),
            **{f"spec.settings.{path}": pair for path, pair in settings.items()},
            **_claim(own["claim"], specification),
        },
        plan=_plan(own, specification),
        proven=_proven(own, specification) if all(part in own for part in parts) else None,
        inputs=_each(own, "inputs", _input),
        clearance=_each(own, "clearance", _cleared),
        lacks=len(_each(own, "lacks", _lack)),
    )


def _each(own: Members, key: str, reads: Callable[[Node], T]) -> tuple[T, ...]:
    return tuple(map(reads, own[key].entries())) if key in own else ()


def _claim(node: Node, spec: SampledSpecification) -> dict[str, tuple[object, object]]:
    own = node.closed("horizon", "afterwards", "hold")
    horizon = spec.trajectory.horizon if spec.afterwards == "nothing" else None
    return {
        "claim.horizon": (own.known("horizon", Node.decimal), horizon),
        "claim.afterwards": (own["afterwards"].word("nothing", "rest", "repeat"), spec.afterwards),
        "claim.hold": (own["hold"].word("middle", "left", "continuous"), spec.hardware.hold),
    }


def _proven(own: Members, spec: SampledSpecification) -> Proven:
    n, m = len(spec.plant.states), len(spec.plant.inputs)
    k = 0 if spec.disturbance is None else len(spec.disturbance.E[0])
    nominal = own["nominal"].closed("A", "B", "E")
    tables = own["controller"].closed("F", "G", "M", "N")
    z = len(tables["F"].closed("columns", "rows")["rows"].entries())
    if z > _MOST_MEMORY:
        raise tables["F"].refused(f"has more than {_MOST_MEMORY} rows")
    return Proven(
        A=_matrix(nominal["A"], n, n),
        B=_matrix(nominal["B"], n, m),
        E=_matrix(nominal["E"], n, k),
        F=_matrix(tables["F"], z, z),
        G=_matrix(tables["G"], z, n),
        M=_matrix(tables["M"], m, z),
        N=_matrix(tables["N"], m, n),
        stages=_stages(own["tube"], spec, z),
        recipe=_recipe(own["recipe"], n + m + z),
    )


def _matrix(node: Node, p: int, q: int) -> arb_mat:
    own = node.closed("columns", "rows")
    if own["columns"].count() != q:
        raise node.refused(f"has not {q} columns")
    return arb_mat(p, q, [arb(_float(entry)) for row in own["rows"].rows(p, q) for entry in row])


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
    kind, plant = spec.trajectory.kind, spec.plant
    if "planned" not in own:
        return Plan(kind, None, None, None, None, None)
    if not isinstance(spec.trajectory, (Planned, Tabled)):
        raise own["planned"].refused("is not known in this place")
    part = own["planned"].closed("t", "x", "u", "interpolation")
    knots = read_knots(part, len(plant.states), len(plant.inputs), Node.decimal)
    return Plan(
        kind, part["interpolation"].word("hold", "linear", "hermite-simpson"), None, knots, None, None
    )


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
