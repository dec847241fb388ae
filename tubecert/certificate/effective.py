"""The specification in a certificate: kept as it is, with what readers need of it typed."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields
from fractions import Fraction
from typing import Any, TypeVar

from tubecert.records import OPEN, FormError, Json, foreign, from_json
from tubecert.spec.canonical import as_file

T = TypeVar("T")
Tree = Any  # texts, lists and mappings of them, as canonical data holds


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A number as a text, or the two ends of a range."""

    ends: tuple[str, ...]

    def __str__(self) -> str:
        return self.ends[0] if len(self.ends) == 1 else f"[{', '.join(self.ends)}]"


def _read_parameter(data: Json, path: str) -> Parameter:
    ends = data if isinstance(data, list) and len(data) == 2 else [data]
    if not all(isinstance(end, str) for end in ends):
        raise FormError(path, "is neither a text nor a pair of texts")
    return Parameter(ends=tuple(ends))


foreign(Parameter, lambda value: value.ends[0] if len(value.ends) == 1 else list(value.ends), _read_parameter)


@dataclass(frozen=True, slots=True, kw_only=True)
class TableView:
    """The points of a table: x, y and slope, as texts."""

    points: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SystemView:
    """States, inputs, units and equations, as texts."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    f: tuple[str, ...] = ()
    B: tuple[tuple[str, ...], ...] = ()
    tables: Mapping[str, TableView] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)

    @property
    def lengths(self) -> tuple[str, ...]:
        """What has a half-width: states, then outputs."""
        return *self.states, *self.outputs

    def ordered(self, named: Mapping[str, T]) -> dict[str, T]:
        """What states and inputs have, in their order: a file has it by the alphabet."""
        return {name: named[name] for name in (*self.states, *self.inputs) if name in named}


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyView:
    """The expressions of h, and the bounds that are declared."""

    h: tuple[str, ...] = ()
    bounds: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class DisturbanceView:
    """The expressions of E, a row per state; none without a wind."""

    E: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class TrajectoryView:
    """The kind of plan and its end in s, None if it has none."""

    kind: str
    horizon: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TubeView:
    """What is asked of the tube, as far as reports say it again."""

    rho_a: Fraction | None = None
    half_widths: Mapping[str, Fraction] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class DiscView:
    """A disc."""

    center: tuple[Fraction, Fraction]
    radius: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class ObstacleView:
    """An obstacle in the plane of two states: a disc or a polygon."""

    states: tuple[str, str]
    disc: DiscView | None = None
    polygon: tuple[tuple[Fraction, Fraction], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What readers need of a specification, typed."""

    name: str
    system: SystemView
    trajectory: TrajectoryView
    tube: TubeView = field(default_factory=TubeView)
    uncertainty: UncertaintyView = field(default_factory=UncertaintyView)
    disturbance: DisturbanceView = field(default_factory=DisturbanceView)
    obstacles: tuple[ObstacleView, ...] = ()


for _kind in (
    View, SystemView, TableView, UncertaintyView, DisturbanceView, TrajectoryView, TubeView,
    ObstacleView, DiscView,
):  # fmt: skip
    OPEN.add(_kind)


@dataclass(frozen=True, slots=True, kw_only=True)
class Effective(View):
    """The effective specification: canonical data, itself a specification (`data`), and typed views of it."""

    data: Mapping[str, Tree] = field(repr=False)

    def part(self, name: str) -> Mapping[str, Tree]:
        """A section as it stands, to be shown; empty if there is none."""
        return _mapping(self.data.get(name))

    @property
    def says_what_decides(self) -> bool:
        """Whether the specification names the certificate that decides."""
        return "decides" in self.part("conditions")

    def parts(self, name: str) -> list[Mapping[str, Tree]]:
        """The entries of a list of sections, to be shown."""
        found = self.data.get(name)
        return [_mapping(item) for item in found] if isinstance(found, list) else []

    @property
    def text(self) -> str:
        """The text of the specification, as a file may hold it."""
        return json.dumps(as_file(self.data))

    def at_rest(self, without: Collection[str]) -> str:
        """The text of a specification at rest at 0, for where the plan is in a file that is elsewhere.

        The sections `without` are left out.
        """
        rest = {"kind": "equilibrium", "at": ["0"] * len(self.system.states)}
        if "horizon" in (own := self.part("trajectory")):  # an f that depends on t needs one
            rest["horizon"] = own["horizon"]
        kept = {key: value for key, value in as_file(self.data).items() if key not in without}
        return json.dumps(kept | {"trajectory": rest})

    @classmethod
    def of(cls, data: Mapping[str, Tree], path: str = "effective") -> Effective:
        """The views of canonical data; raises `FormError`."""
        view = from_json(View, data, path)
        return cls(data=data, **{item.name: getattr(view, item.name) for item in fields(view)})


def _mapping(value: Tree) -> Mapping[str, Tree]:
    return value if isinstance(value, Mapping) else {}


def _read(data: Json, path: str) -> Effective:
    if not isinstance(data, dict):
        raise FormError(path, "is not an object")
    return Effective.of(data, path)


foreign(Effective, lambda value: dict(value.data), _read)


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What metric was asked for, as canonical data (`metric.synthesise` of the specification)."""

    data: Mapping[str, Tree] = field(repr=False)


_ASKED, _MAY_ASK = (
    ("objective", "degree", "variables", "route", "solver"),
    ("rate", "condition_number", "coordinates", "outputs"),
)


_LISTS = ("variables", "outputs")


def _read_asked(data: Json, path: str) -> Asked:
    if not isinstance(data, dict):
        raise FormError(path, "is not an object")
    for key in (*_ASKED, *data):
        if key not in data or key not in (*_ASKED, *_MAY_ASK):
            raise FormError(f"{path}.{key}", "is missing" if key in _ASKED else "is not known")
        words = data[key] if key in _LISTS and isinstance(data[key], list) else [data[key]]
        if not all(isinstance(word, str) for word in words):
            raise FormError(f"{path}.{key}", "is not a text")
    return Asked(data=data)


foreign(Asked, lambda value: dict(value.data), _read_asked)
