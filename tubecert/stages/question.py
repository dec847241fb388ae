"""The question of a certification: options, the time that matters; and how an answer may end early."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, Final, TypeVar

from tubecert.bounds.compute import time_range
from tubecert.bounds.start import InitialState, KnownStart, StartBox, StartWithin
from tubecert.bounds.suprema import Suprema
from tubecert.certificate.file import digest
from tubecert.certificate.result import SynthesisData
from tubecert.claims.family import Claim, Reason, Relax
from tubecert.conditions.theorem import Asked
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.constant import Witness
from tubecert.enclosure.domain import Range
from tubecert.executor import Executor
from tubecert.expression.waves import frequencies
from tubecert.findings import Finding
from tubecert.metric.verify import Proofs
from tubecert.model import TIME, ControlAffineModel, build, moving_parts, time_period
from tubecert.progress import Progress
from tubecert.records import Json
from tubecert.spec import Spec, canonical
from tubecert.trajectory import Plan
from tubecert.verdict import Verdict

T = TypeVar("T")
# sections of the specification that say nothing of the model, the plan, the start or the tube
_APART: Final = (
    "name",
    "expect",
    "simulation",
    "conditions",
    "adaptation",
    "limits",
    "obstacles",
)
_MANY: Final = (
    4  # states: with fewer, constants that are as close as asked for cost less than to find which matter
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What the command line asks for beside the specification.

    `by_effect`: whether each constant has a gap of its own, such that closer constants would lower the gains that
    decide by less than `gap`; None: as the specification says.
    """

    rho_a: Fraction | None = None
    epsilon: Fraction | None = None
    metric: Path | None = None
    conditions: str | None = None
    bandwidth: Fraction | None = None
    adaptation_rate: Fraction | None = None
    gap: Fraction = Fraction(1, 100)
    by_effect: bool | None = None
    budget: int = 2_000_000

    def asked(self, *, curve: bool) -> Asked:
        """The gains that are asked for; with `curve`, what else is possible beside them."""
        pair = self.bandwidth, self.adaptation_rate
        return Asked(gains=None if pair[0] is None or pair[1] is None else (pair[0], pair[1]), curve=curve)


def overridden(spec: Spec, options: Options) -> Spec:
    """The specification with the radii of the command line."""
    tube = replace(
        spec.tube,
        epsilon=spec.tube.epsilon if options.epsilon is None else options.epsilon,
        rho_a=spec.tube.rho_a if options.rho_a is None else options.rho_a,
    )
    return replace(spec, tube=tube)


@dataclass(slots=True)
class Memory:
    """What was proven before, by what was computed and from what: it cannot be taken for another proof.

    `computed` counts what was not found, by name. With `most`, so many are kept: those that were computed last.
    `proofs` of metrics are kept for whoever asks.
    """

    kept: dict[tuple[str, str], Any] = field(default_factory=dict)
    computed: dict[str, int] = field(default_factory=dict)
    most: int | None = None
    proofs: Proofs = field(default_factory=Proofs)

    def recall(self, name: str, depends_on: Json, compute: Callable[[], T]) -> T:
        """The value that `compute` gives, which depends on `depends_on` (JSON data) and nothing else."""
        key = name, digest(depends_on)
        if key not in self.kept:
            self.kept[key] = compute()
            self.computed[name] = self.computed.get(name, 0) + 1
            if self.most is not None and len(self.kept) > self.most:
                del self.kept[next(key for key in self.kept)]
        value: T = self.kept[key]
        return value


@dataclass(frozen=True, kw_only=True)
class Question:
    """What is to be certified: a specification with its radii, the options, the range of time that matters for h.

    `synthesis` is what the certificate says of a metric that was synthesised for this question. `memory` may be shared
    between questions, and `workers` search parts of long suprema; nothing that comes out depends on either. `brief`:
    what decides is all that is asked for, without curves, other kinds and what explains.
    """

    spec: Spec
    options: Options
    time: Range | None
    synthesis: SynthesisData | None = None
    progress: Progress | None = field(default=None, repr=False, compare=False)
    memory: Memory = field(default_factory=Memory, repr=False, compare=False)
    workers: Executor | None = field(default=None, repr=False, compare=False)
    brief: bool = False

    @property
    def question(self) -> Question:
        """Itself: every stage knows its question."""
        return self

    @cached_property
    def ground(self) -> Json:
        """Everything that the model, the start and the tube follow from, as data; plans in files have other knots.

        The whole specification but the sections that these are not made of: one that is not in `_APART` counts.
        """
        own = {key: value for key, value in canonical(self.spec).items() if key not in _APART}
        return own | {"gap": str(self.options.gap), "budget": self.options.budget}

    @property
    def by_effect(self) -> bool:
        """Whether the gap of each constant is to follow from its effect on the gains.

        Half-widths along a plan that moves, or of many states, ask for it by themselves: all constants as close as
        that may take minutes there.
        """
        if self.options.by_effect is not None:
            return self.options.by_effect
        spec = self.spec
        long = spec.trajectory.moves or len(spec.states) >= _MANY
        return spec.tube.gap == "auto" or (bool(spec.tube.half_widths) and long)

    @cached_property
    def model(self) -> ControlAffineModel:
        """The expressions of the system and its metric."""
        return build(self.spec)

    @cached_property
    def start(self) -> InitialState:
        """Where the state starts."""
        if self.spec.start_box:
            return StartBox(self.spec.start_box)
        within = self.spec.within
        return KnownStart(self.spec.x0) if within is None else StartWithin(within)

    @cached_property
    def effort(self) -> Effort:
        """The gap and the budget of every search."""
        return Effort(gap=float(self.options.gap), budget=self.options.budget, workers=self.workers)

    def effort_of(self, name: str) -> Effort:
        """The effort for a search by name, which tells its progress."""
        show = self.progress
        if show is None:
            return self.effort
        return replace(self.effort, progress=lambda step: show(replace(step, name=name)))

    def suprema(self, plan: Plan) -> Suprema:
        """Suprema along a plan, which tell their progress."""
        return Suprema(self.model, plan, 0.0, self.time, self.effort, self.progress)


@dataclass(frozen=True, kw_only=True)
class Stopped:
    """A claim that is not proven: no stage follows. `partial` is what was found on the way to the stage that failed."""

    at: Any
    reason: Reason
    partial: object = None

    @property
    def question(self) -> Question:
        """The question that has this answer."""
        question: Question = self.at.question
        return question


def stopped(
    at: Any,
    claim: Claim,
    verdict: Verdict,
    *,
    where: Witness | None = None,
    relax: tuple[Relax, ...] = (),
    partial: object = None,
) -> Stopped:
    """The end of a certification at a claim that is refuted or undecided."""
    return Stopped(at=at, reason=Reason(claim=claim, verdict=verdict, at=where, relax=relax), partial=partial)


def time_of(spec: Spec) -> tuple[list[Finding], Range | None]:
    """The range of time that matters for h and f, or why there is none.

    What must hold for h to be defined may depend on t where h does not, as in 0*(1/(t + 1)).
    """
    try:
        return [], time_range(spec.trajectory.horizon, time_period(moving_parts(spec)))
    except ValueError as error:
        finding = Finding(
            code="TC204",
            message=str(error),
            location=spec.location("uncertainty.h"),
            help="add trajectory.horizon, in seconds",
        )
        return [finding], None


def period_of(spec: Spec) -> tuple[Fraction, bool] | None:
    """The period as (q, whether times pi), in s; None if nothing depends on t, or none is to be seen."""
    found = frequencies(moving_parts(spec), TIME)
    return None if found is None else found.period
