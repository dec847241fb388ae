"""What a kind of certificate has to offer, and its section: what the kernel decided about it.

Sections of a certificate as data: what each kind writes and reads, and the one view that all of them offer.

A kind's own section is a record whose fields are the keys of the JSON. What a reader needs whatever the kind - its
gains with their margins, its curve, what is missing - is told by `pairs`, `decisive` and `points`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from fractions import Fraction
from math import inf, isfinite
from typing import ClassVar, Generic, Literal

from tubecert.claims.statements import GainsSuffice
from tubecert.conditions.inputs import InputBound, LimitedInput
from tubecert.conditions.problem import Shortfall, TubeProblem
from tubecert.conditions.theorem import LoopGains, Proposal, R, Theorem
from tubecert.enclosure.constant import Constant, printable_below
from tubecert.enclosure.interval import Interval
from tubecert.kernel import Checked, Judgement, judge
from tubecert.kinds import Name
from tubecert.verdict import Verdict

Role = Literal["feedback", "asked", "least_bandwidth", "least_adaptation"]
_BEYOND = 1e300  # larger margins are not told


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """One set of gains with its own margins, by condition; rows of different sets never mix.

    Without a bandwidth it is the feedback alone.
    """

    role: Role
    bandwidth: Fraction | None
    margins: Mapping[str, Constant]
    adaptation_rate: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GainPoint:
    """A proven point of a curve: the adaptation rate that a bandwidth needs."""

    bandwidth: Fraction
    adaptation_rate: Fraction
    predictor_gain: Fraction

    @classmethod
    def along(cls, curve: Iterable[LoopGains]) -> tuple[GainPoint, ...]:
        """Those of recipes."""
        return tuple(
            cls(bandwidth=r.bandwidth, adaptation_rate=r.adaptation_rate, predictor_gain=r.predictor_gain)
            for r in curve
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Missing:
    """A condition that is not proven, see `ConditionHolds`; `missing` is what is needed beyond the allowed."""

    condition: str
    margin: Constant
    constant: str | None = None
    allowed: float | None = None
    needed: float | None = None
    missing: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SectionData(ABC):
    """The section of one kind; `ultimate_radius` bounds |x - x*| in the long run."""

    name: ClassVar[Name]
    verdict: Verdict
    ultimate_radius: float | None
    shortfalls: tuple[Missing, ...]

    @abstractmethod
    def pairs(self, *, asked: bool) -> tuple[Pair, ...]:
        """Every set of gains that the section holds; the one that the verdict is about comes first."""

    def points(self) -> tuple[tuple[float, float], ...]:
        """The proven curve: bandwidth and adaptation rate; a section that chooses nothing has none."""
        return tuple((float(p.bandwidth), float(p.adaptation_rate)) for p in getattr(self, "curve", ()))

    def decisive(self, *, asked: bool) -> Pair | None:
        """The gains that the verdict is about."""
        return next(iter(self.pairs(asked=asked)), None)


# -- from what was proven


def margin_data(margin: Interval) -> Constant:
    """A margin as it is written: no bound where it is beyond all use."""
    low, high = float(margin.lo), float(margin.hi)
    return Constant(below=low if abs(low) < _BEYOND else -inf, above=high if abs(high) < _BEYOND else inf)


def missing_data(shortfalls: Iterable[Shortfall]) -> tuple[Missing, ...]:
    """What is missing, as it is written."""
    return tuple(
        Missing(
            condition=item.claim,
            constant=item.constant,
            margin=margin_data(item.margin),
            allowed=item.allowed,
            needed=item.needed,
            missing=item.missing,
        )
        for item in shortfalls
    )


def proven_data(values: Iterable[float]) -> tuple[float | None, ...]:
    """Bounds from below as they can be printed; None where nothing is proven."""
    return tuple(printable_below(float(value)) if isfinite(value) else None for value in values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Section(Judgement[R]):
    """What the kernel decided about one kind over a problem, from what was proposed."""

    kind: Kind[R]
    problem: TubeProblem
    proposal: Proposal[R]

    @property
    def name(self) -> Name:
        """How its kind is called."""
        return self.kind.name

    def at(self, role: str) -> Checked[R] | None:
        """The gains in a role, if there are any."""
        return self.decisive if role == self.role else self.beside.get(role)

    @property
    def predictor_gain(self) -> Fraction | None:
        """g of the decisive gains; None where there are none."""
        return None if self.decisive is None else getattr(self.decisive.recipe, "predictor_gain", None)

    def input_bound(self, own: LimitedInput) -> InputBound | None:
        """What an input with limits does in the loop, by the proof; None if there is none."""
        return None if self.proof is None else own.bound(self.proof.input_shares)

    def claim(self) -> GainsSuffice:
        """That the decisive gains suffice, with what is proven to be left, and which condition sets the bandwidth."""
        margins = {} if self.decisive is None else self.decisive.margins
        return GainsSuffice(
            section=self.name.key,
            margins={condition: float(m.lo) for condition, m in margins.items()},
            binds=self.proposal.binds,
        )

    def data(self) -> SectionData:
        """The section, as the certificate holds it."""
        return self.kind.data(self)

    def derived(self) -> Mapping[str, Constant]:
        """Constants at the decisive gains that the certificate lists beside those of the tube."""
        own = self.kind.constants
        return {} if own is None or self.decisive is None else own(self.problem, self.decisive.recipe)


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind(Generic[R]):
    """One kind of certificate: its theorem, and its section as data, of the type `form`.

    `constants`: those at the decisive gains, if the kind has any.
    """

    name: Name
    theorem: Theorem[R]
    form: type[SectionData]
    data: Callable[[Section[R]], SectionData]
    constants: Callable[[TubeProblem, R], Mapping[str, Constant]] | None = None

    @property
    def key(self) -> str:
        """The name of its section in a certificate."""
        return self.name.key

    def section(self, problem: TubeProblem, proposal: Proposal[R]) -> Section[R]:
        """The section about what a search proposes."""
        judged = judge(problem, self.theorem, proposal)
        decided = {item.name: getattr(judged, item.name) for item in fields(judged)}
        return Section(kind=self, problem=problem, proposal=proposal, **decided)
