"""A certificate of a sampled loop, read into closed types: every object with the keys that it must and may have.

A key that is missing, unknown or of another kind is an error (TC603). Numbers are exact: decimals, or hexadecimal
floats in the one spelling that they have. What explains, `notes` and `run`, is not read; of a result that is not
certified only the specification and what repeats it are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from flint import arb, arb_mat

from tubecert.recheck.certificate import read_settings
from tubecert.recheck.document import Members, Node, digest
from tubecert.recheck.plans import Plan, read_knots
from tubecert.recheck.specification import SampledSpecification, read_sampled_specification
from tubecert.recheck.specified.numbers import Numbers, Range
from tubecert.recheck.specified.trajectory import Planned, Tabled

NOT_EXAMINED = ("notes", "run", "spec.file_hash")
_PARTS = ("nominal", "controller", "tube", "recipe", "inputs")  # of a certified result
_MOST_LAGS = 50_000
_MOST_START = 1_000_000  # samples before the last stage
_MOST_STAGES = _MOST_MEMORY = _MOST_PARTS = 64
_MOST_WINDOWS = 4_096


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
    """How the proof was found: a hint. `cuts` (n + m + z rows) of r lags; whether parameters are `slow`."""

    lags: int
    cuts: tuple[tuple[int, ...], ...]
    pieces: int
    panels: int
    windows: int
    slow: bool


Repeated = dict[str, tuple[object, object]]
"""By path what is stated a second time, and what it is."""


@dataclass(frozen=True, slots=True)
class Proven:
    """What a certified result rests on: A (n, n), B (n, m), E (n, k); tables F (z, z), G (z, n), M (m, z), N (m, n).

    `ranges`: what each input keeps to. `cleared`: from which obstacles the tube keeps away.
    """

    A: arb_mat
    B: arb_mat
    E: arb_mat
    F: arb_mat
    G: arb_mat
    M: arb_mat
    N: arb_mat
    stages: tuple[Stage, ...]
    recipe: Recipe
    plan: Plan
    ranges: tuple[Range, ...]
    cleared: tuple[bool, ...]
    repeated: Repeated


@dataclass(frozen=True, slots=True)
class Certificate:
    """What is claimed, and `proven` where it is certified; the hash that is stated, and the one that it has."""

    verdict: str
    specification: SampledSpecification
    proven: Proven | None
    repeated: Repeated
    stated_hash: str
    hash: str


def read_certificate(document: Node) -> Certificate:
    """The certificate in a document; raises `CertificateError` for whatever is not of its form."""
    whole = document.closed("format", "hash", "result", "notes", "run")
    for key in ("notes", "run"):
        whole[key].mapping()
    certified = whole["result"].mapping().get("verdict") == "certified"
    optional = ("planned", "clearance") if certified else ("planned", "clearance", "lacks", *_PARTS)
    own = whole["result"].closed(
        "verdict", "spec", "claim", *(_PARTS if certified else ()), optional=optional
    )
    source = own["spec"].closed("effective", "effective_hash", "file_hash", optional=("settings",))
    source["file_hash"].text()
    spec = read_sampled_specification(source["effective"])
    settings = source.get("settings", lambda item: read_settings(item, source["effective"])) or {}
    claim = own["claim"].closed("horizon", "afterwards", "hold")
    horizon = spec.trajectory.horizon if spec.afterwards == "nothing" else None
    repeated: Repeated = {
        "spec.effective_hash": (source["effective_hash"].text(), spec.hash),
        **{f"spec.settings.{path}": pair for path, pair in settings.items()},
        "claim.horizon": (claim.known("horizon", Node.decimal), horizon),
        "claim.afterwards": (claim["afterwards"].text(), spec.afterwards),
        "claim.hold": (claim["hold"].text(), spec.hardware.hold),
    }
    return Certificate(
        verdict=own["verdict"].word("certified", "refuted", "undecided"),
        specification=spec,
        proven=_proven(own, spec) if certified else None,
        repeated=repeated,
        stated_hash=whole["hash"].text(),
        hash=digest(whole["result"].value),
    )


def _proven(own: Members, spec: SampledSpecification) -> Proven:
    states, inputs = spec.plant.states, spec.plant.inputs
    n, m, k = len(states), len(inputs), 0 if spec.disturbance is None else len(spec.disturbance.E[0])
    nominal, tables = own["nominal"].closed("A", "B", "E"), own["controller"].closed("F", "G", "M", "N")
    z = _between(tables["F"].closed("columns", "rows")["columns"], 0, _MOST_MEMORY)
    uses = [item.closed("input", "range", optional=("limits",)) for item in own["inputs"].sized(m)]
    told = [(use["input"].text(), use.get("limits", _ends)) for use in uses]
    kept = own.get("clearance", lambda item: item.sized(len(spec.obstacles))) or []
    away = [item.closed("index", "verdict") for item in kept]
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
        plan=_plan(own, spec),
        ranges=tuple(_ends(use["range"]) for use in uses),
        cleared=tuple(item["verdict"].word("certified", "undecided") == "certified" for item in away),
        repeated={
            "inputs": (told, [(name, spec.limits.get(name)) for name in inputs]),
            "clearance": ([item["index"].count() for item in away], list(range(len(spec.obstacles)))),
        },
    )


def _matrix(node: Node, p: int, q: int) -> arb_mat:
    own = node.closed("columns", "rows")
    _between(own["columns"], q, q)
    return arb_mat(p, q, [arb(_float(entry)) for row in own["rows"].rows(p, q) for entry in row])


def _float(node: Node) -> float:
    """A finite float in the spelling of `float.hex`."""
    try:
        value = float.fromhex(node.text())
    except (ValueError, OverflowError):
        value = math.nan
    if not math.isfinite(value) or value.hex() != node.value:
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
    if min(found.half_widths) <= 0 or min(found.boxes) < 0:
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
    if not isinstance(spec.trajectory, (Planned, Tabled)):
        if "planned" in own:
            raise own["planned"].refused("is not known in this place")
        return Plan(kind, None, None, None, None, None)
    part = own["planned"].closed("t", "x", "u", "interpolation")
    knots = read_knots(part, len(plant.states), len(plant.inputs), Node.decimal)
    return Plan(kind, part["interpolation"].text(), None, knots, None, None)


def _ends(node: Node) -> Range:
    low, high = node.pair()
    return low.decimal(), high.decimal()
