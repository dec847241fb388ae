"""A certificate of a sampled loop, read into closed types: every object with the keys that it must and may have.

A key that is missing, unknown or of another kind is an error (TC603). Numbers are exact: decimals, or hexadecimal
floats in the one spelling that they have. What explains, `notes` and `run`, is not read; of a result that is not
certified only the specification and what repeats it are.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from fractions import Fraction

from flint import arb_mat

from tubecert.recheck.certificate import read_settings
from tubecert.recheck.document import Members, Node, nullable
from tubecert.recheck.plans import Plan, read_knots
from tubecert.recheck.specification import SampledSpecification, read_sampled_specification
from tubecert.recheck.specified.numbers import Numbers, Range
from tubecert.recheck.specified.trajectory import Planned, Tabled

_PARTS = ("planned", "nominal", "controller", "tube", "recipe", "inputs", "clearance", "lacks")
_BETWEEN = {"lags": (1, 50_000), "pieces": (1, 64), "panels": (1, 64), "windows": (1, 4_096)}
_MOST_START = 1_000_000  # samples before the last stage
_MOST_STAGES = _MOST_MEMORY = 64
Repeated = dict[str, tuple[object, object]]  # by path what is stated a second time, and what it is


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


@dataclass(frozen=True, slots=True)
class Proven:
    """What a certified result rests on: matrices A (n, n), B (n, m), E (n, k) and the `tables` of the controller.

    These are F (z, z), G (z, n), M (m, z), N (m, n). `ranges`: what each input keeps to. `cleared`: which obstacles.
    """

    nominal: tuple[arb_mat, ...]
    tables: dict[str, arb_mat]
    stages: tuple[Stage, ...]
    recipe: Recipe
    plan: Plan
    ranges: tuple[Range, ...]
    cleared: tuple[bool, ...]
    repeated: Repeated


@dataclass(frozen=True, slots=True)
class Result:
    """What is claimed, and `proven` where it is certified; `unread`: members that no claim examines.

    What refutes it is that the `plan` is `outside` of the safe set: which state, when, how far, and beyond which end.
    """

    verdict: str
    specification: SampledSpecification
    proven: Proven | None
    plan: Plan | None
    outside: list[tuple[int, Fraction, Fraction, Fraction]]
    repeated: Repeated
    unread: tuple[str, ...]


def read_result(node: Node) -> Result:
    """`result` of a certificate; raises `CertificateError` for whatever is not of its form."""
    own = node.closed("verdict", "spec", "claim", optional=_PARTS)
    verdict = own["verdict"].word("certified", "refuted", "undecided")
    certified, refuted = verdict == "certified", verdict == "refuted"
    if certified and "lacks" in own:
        raise own["lacks"].refused("is there, and yet the verdict is certified")
    source = own["spec"].closed("effective", "effective_hash", "file_hash", optional=("settings",))
    source["file_hash"].text()
    spec = read_sampled_specification(source["effective"])
    settings = source.get("settings", lambda item: read_settings(item, source["effective"])) or {}
    claim = own["claim"].closed("horizon", "afterwards", "hold")
    horizon = spec.trajectory.horizon if spec.afterwards == "nothing" else None
    repeated: Repeated = {
        "spec.effective_hash": (source["effective_hash"].text(), spec.hash),
        **{f"spec.settings.{path}": pair for path, pair in settings.items()},
        "claim.horizon": (nullable(Node.decimal)(claim["horizon"]), horizon),
        "claim.afterwards": (claim["afterwards"].text(), spec.afterwards),
        "claim.hold": (claim["hold"].text(), spec.hardware.hold),
    }
    examined = _PARTS if certified else ("lacks", "planned") if refuted else ()
    return Result(
        verdict=verdict,
        specification=spec,
        proven=_proven(own, spec) if certified else None,
        plan=_plan(own, spec) if refuted else None,
        outside=_outside(own["lacks"], spec) if refuted else [],
        repeated=repeated,
        unread=("spec.file_hash", *(key for key in _PARTS if key in own and key not in examined)),
    )


def _outside(lacks: Node, spec: SampledSpecification) -> list[tuple[int, Fraction, Fraction, Fraction]]:
    """Where the plan is outside of the safe set: the one thing that refutes a sampled loop, if the plan is known."""
    found, states = [], list(spec.plant.states)
    for item in lacks.entries():
        own = item.closed("kind", "where", "needed", "allowed", "at")
        own["kind"].word("plan")
        place = states.index(own["where"].word(*states))
        found.append((place, own["at"].number(), own["needed"].number(), own["allowed"].number()))
    if not found or spec.trajectory.kind in ("any", "ilqr"):
        raise lacks.refused("does not refute it")
    return found


def _proven(own: Members, spec: SampledSpecification) -> Proven:
    n, m, wind = len(spec.plant.states), len(spec.plant.inputs), spec.disturbance
    k = 0 if wind is None else len(wind.E[0])
    memory = own["controller"].closed("F", "G", "M", "N")["F"].closed("columns", "rows")
    z = _between(memory["columns"], 0, _MOST_MEMORY)
    uses = [item.closed("input", "range", optional=("limits",)) for item in own["inputs"].sized(m)]
    limits = [(use["input"].text(), use.get("limits", _ends)) for use in uses]
    cleared = own.get("clearance", lambda item: item.sized(len(spec.obstacles))) or []
    away = [item.closed("index", "verdict") for item in cleared]
    return Proven(
        nominal=tuple(_matrices(own["nominal"], A=(n, n), B=(n, m), E=(n, k)).values()),
        tables=_matrices(own["controller"], F=(z, z), G=(z, n), M=(m, z), N=(m, n)),
        stages=_stages(own["tube"], spec, z),
        recipe=_recipe(own["recipe"], n + m + z),
        plan=_plan(own, spec),
        ranges=tuple(_ends(use["range"]) for use in uses),
        cleared=tuple(item["verdict"].word("certified", "undecided") == "certified" for item in away),
        repeated={
            "inputs": (limits, [(name, spec.limits.get(name)) for name in spec.plant.inputs]),
            "clearance": ([item["index"].count() for item in away], list(range(len(spec.obstacles)))),
        },
    )


def _matrices(node: Node, **shapes: tuple[int, int]) -> dict[str, arb_mat]:
    own, found = node.closed(*shapes), {}
    for name, (p, q) in shapes.items():
        matrix = own[name].closed("columns", "rows")
        _between(matrix["columns"], q, q)
        found[name] = arb_mat(p, q, [_float(entry) for row in matrix["rows"].rows(p, q) for entry in row])
    return found


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
    ordered = starts == sorted(set(starts)) and starts[:1] == [0] and starts[-1] <= _MOST_START
    if not ordered or len(found) > _MOST_STAGES:
        raise node.refused(f"must have 1 to {_MOST_STAGES} stages in their order, the first from sample 0 on")
    return found


def _stage(node: Node, spec: SampledSpecification, z: int) -> Stage:
    own = node.closed("start", "half_widths", "deviations", "memory")
    widths, deviations = (
        tuple(own[key].closed(*names)[name].decimal() for name in names)
        for key, names in (("half_widths", spec.plant.states), ("deviations", spec.plant.inputs))
    )
    memory = tuple(item.decimal() for item in own["memory"].sized(z))
    if min(widths) <= 0 or min((*deviations, *memory)) < 0:
        raise node.refused("has a box without an inside")
    return Stage(own["start"].count(), widths, deviations, memory)


def _recipe(node: Node, outputs: int) -> Recipe:
    own = node.closed("cuts", "parameters", *_BETWEEN)
    counts = {key: _between(own[key], *ends) for key, ends in _BETWEEN.items()}
    rows = [row.entries() for row in own["cuts"].sized(outputs)]
    cuts = tuple(tuple(_between(lag, 0, counts["lags"]) for lag in row) for row in rows)
    return Recipe(**counts, cuts=cuts, slow=own["parameters"].word("slow", "sudden") == "slow")


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
        return Plan(kind)
    part = own["planned"].closed("t", "x", "u", "interpolation")
    knots = read_knots(part, len(plant.states), len(plant.inputs), Node.decimal)
    return Plan(kind, part["interpolation"].text(), knots=knots)


def _ends(node: Node) -> Range:
    low, high = node.pair()
    return low.decimal(), high.decimal()


def single(value: float) -> float:
    """The number of single precision next to one."""
    return float(struct.unpack("f", struct.pack("f", value))[0])
