"""The kernel: the one place where gains become certified.

A `Proof` exists only if every inequality of its theorem was evaluated in outward-rounded arithmetic at the recipe it
holds, and held: `check` is its only maker. Who proposed the recipe does not matter. A verdict on gains is derived from
proofs, here; nothing else may say "certified" (tests/house/test_trust.py).

In: a `TubeProblem` and recipes from anywhere. Out: proofs, or what is missing. Trusted: yes, and it imports nothing
that is not. Implements: theorems 0, A (26a)-(26c) and B by what `THEOREMS` lists.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Generic, NoReturn

import numpy as np

from tubecert.conditions import alone, distance, rates
from tubecert.conditions.arithmetic import Array
from tubecert.conditions.inputs import InputShares
from tubecert.conditions.problem import NOTHING_FOUND, Shortfall, TubeProblem, unbounded
from tubecert.conditions.theorem import Proposal, R, Recipe, Theorem
from tubecert.enclosure.interval import Interval
from tubecert.enclosure.processor import require_ieee
from tubecert.verdict import Verdict

THEOREMS: Final[Mapping[type, Theorem[Any]]] = {
    theorem.recipe: theorem for theorem in (alone.THEOREM, rates.THEOREM, distance.THEOREM)
}


_BESIDE_BANDWIDTH: Final = ("adaptation_rate", "predictor_gain", "projection_radius")


def theorem_of(recipe: type[R]) -> Theorem[R]:
    """The theorem that a kind of recipe is for; `KeyError` if the kernel knows none."""
    return THEOREMS[recipe]


class NotProvenError(ValueError):
    """A recipe that is no proof; `margins` tells by how much."""

    def __init__(self, margins: Mapping[str, Interval]) -> None:
        super().__init__("the recipe proves nothing")
        self.margins = margins


class Proof(Generic[R]):
    """A recipe that proves its theorem over a problem, with its margins, all positive. `check` makes it."""

    __slots__ = ("margins", "problem", "recipe")
    margins: Mapping[str, Interval]
    problem: TubeProblem
    recipe: R

    def __init__(self, problem: TubeProblem, recipe: R) -> None:
        """Evaluates every inequality; raises `NotProvenError` if one is not proven, or `ProcessorError`."""
        margins = _margins(problem, recipe)
        require_ieee()
        if not _proves(problem, recipe, margins):
            raise NotProvenError(margins)
        for name, value in (("margins", margins), ("problem", problem), ("recipe", recipe)):
            object.__setattr__(self, name, value)

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError("a proof cannot be changed")

    def __reduce__(self) -> tuple[type[Proof[R]], tuple[TubeProblem, R]]:
        """A copy is proven anew: what travels is the recipe."""
        return Proof, (self.problem, self.recipe)

    @property
    def ultimate_radius(self) -> float | None:
        """|x - x*| is at most this in the long run; None if the theorem does not say."""
        ultimate = theorem_of(type(self.recipe)).ultimate
        return None if ultimate is None else ultimate(self.problem, self.recipe)

    @property
    def input_shares(self) -> InputShares | None:
        """What the loop adds to u* at most; None if the theorem does not say."""
        inputs = theorem_of(type(self.recipe)).inputs
        return None if inputs is None else inputs(self.problem, self.recipe)


@dataclass(frozen=True, slots=True, kw_only=True)
class Unproven(Generic[R]):
    """A recipe that proves nothing, with its margins: not positive, or of formulas that prove nothing."""

    problem: TubeProblem = field(repr=False)
    recipe: R
    margins: Mapping[str, Interval]

    @property
    def ultimate_radius(self) -> None:
        """Nothing follows."""


Checked = Proof[R] | Unproven[R]


def check(problem: TubeProblem, recipe: R) -> Checked[R]:
    """The proof that a recipe is, or its margins if it is none."""
    try:
        return Proof(problem, recipe)
    except NotProvenError as error:
        return Unproven(problem=problem, recipe=recipe, margins=error.margins)


def margins_along(problem: TubeProblem, recipes: Sequence[R]) -> Mapping[str, Interval]:
    """Margins of many recipes at once, shape `(len(recipes),)`: lower ends are proven, upper ends are the recipes' own.

    `recipes` is not empty; all are of one kind and share the projection radius.
    """
    return theorem_of(type(recipes[0])).margins(problem, recipes)


def _margins(problem: TubeProblem, recipe: R) -> Mapping[str, Interval]:
    """Margins of one recipe, scalars: proven below, and above what any recipe with the same gains can reach."""
    theorem = theorem_of(type(recipe))
    above = theorem.ceilings(problem, recipe)
    own = {claim: margin[0] for claim, margin in theorem.margins(problem, [recipe]).items()}
    return {
        claim: Interval(margin.lo, np.asarray(max(above.get(claim, float(margin.hi)), float(margin.lo))))
        for claim, margin in own.items()
    }


def _proves(problem: TubeProblem, recipe: Recipe, margins: Mapping[str, Interval]) -> bool:
    """Whether all that the theorem asks for is proven."""
    theorem = theorem_of(type(recipe))
    sound = not theorem.provisos(problem) and not theorem.unbounded(problem)
    return sound and theorem.states(problem, recipe) and _holds(margins)


def _holds(margins: Mapping[str, Interval]) -> bool:
    return bool(margins) and all(bool(margin.lo > 0) for margin in margins.values())


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement(Generic[R]):
    """What is decided about the gains of one theorem, and what else was checked.

    `decisive` are the gains that the verdict is about. Of `beside` and `curve` only what holds is kept. `around` are
    the lower ends of margins, shape `(len(around_at),)`.
    """

    verdict: Verdict
    decisive: Checked[R] | None = None
    role: str = ""
    ultimate_radius: float | None = None
    shortfalls: tuple[Shortfall, ...] = ()
    beside: Mapping[str, Checked[R]] = field(default_factory=dict)
    curve: tuple[R, ...] = ()
    around_at: tuple[R, ...] = ()
    around: Mapping[str, Array] = field(default_factory=dict)

    @property
    def proof(self) -> Proof[R] | None:
        """The proof that the verdict rests on, if it is `certified`."""
        return self.decisive if isinstance(self.decisive, Proof) else None


def obstacles(problem: TubeProblem, theorem: Theorem[R]) -> tuple[Shortfall, ...]:
    """What stands in the way of any gains: constants without a bound, then what no gains can overcome."""
    return unbounded(theorem.unbounded(problem)) or theorem.obstacles(problem)


def judge(problem: TubeProblem, theorem: Theorem[R], proposal: Proposal[R]) -> Judgement[R]:
    """The verdict on the gains that a search proposes, or that were asked for, and the proofs beside it."""
    proposal = _about(problem, theorem, proposal)
    decided = _decided(problem, theorem, proposal)
    provisos = theorem.provisos(problem)
    if provisos:
        # the formulas prove nothing, for or against
        decided = replace(decided, verdict=Verdict.UNDECIDED, shortfalls=(*provisos, *decided.shortfalls))
    checked = {role: check(problem, recipe) for role, recipe in proposal.beside.items()}
    return replace(
        decided,
        ultimate_radius=None
        if provisos or decided.decisive is None
        else _ultimate(problem, decided.decisive, proposal),
        beside={role: each for role, each in checked.items() if _holds(each.margins)},
        curve=_holding(problem, proposal.curve),
        around_at=proposal.around,
        around={k: m.lo for k, m in margins_along(problem, proposal.around).items()}
        if proposal.around
        else {},
    )


def _about(problem: TubeProblem, theorem: Theorem[R], proposal: Proposal[R]) -> Proposal[R]:
    """What of a proposal is about this theorem and this loop; the rest is as if it had not been proposed.

    A curve has the projection that is printed for a pair alone; what is around a pair differs in its bandwidth alone.
    """

    def those(recipes: Iterable[R], *names: str) -> tuple[R, ...]:
        return tuple(r for r in recipes if theorem.states(problem, r) and _same(pair, r, *names))

    decisive = proposal.decisive if theorem.states(problem, proposal.decisive) else None
    beside = {role: r for role, r in proposal.beside.items() if theorem.states(problem, r)}
    pair = next((r for r in (decisive, *beside.values()) if r is not None), None)
    return replace(
        proposal,
        decisive=decisive,
        beside=beside,
        curve=those(proposal.curve, "projection_radius"),
        around=those(proposal.around, *_BESIDE_BANDWIDTH),
    )


def _decided(problem: TubeProblem, theorem: Theorem[R], proposal: Proposal[R]) -> Judgement[R]:
    """The verdict and what it is about."""
    blocked = obstacles(problem, theorem)
    blocking = _against(item.margin for item in blocked)
    if blocked and (proposal.decisive is None or blocking is Verdict.REFUTED):
        return Judgement(verdict=blocking, shortfalls=blocked)
    if proposal.decisive is None:
        return Judgement(verdict=Verdict.UNDECIDED, shortfalls=NOTHING_FOUND)
    checked = check(problem, proposal.decisive)
    if isinstance(checked, Proof):
        return Judgement(verdict=Verdict.CERTIFIED, decisive=checked, role=proposal.role)
    return Judgement(
        verdict=_against(checked.margins.values()),
        decisive=checked,
        role=proposal.role,
        shortfalls=_failing(checked) or blocked,
    )


def _against(margins: Iterable[Interval]) -> Verdict:
    """Refuted if a margin is proven not to be positive; each holds for every recipe with the same gains."""
    refuted = any(bool(margin.hi <= 0) for margin in margins)
    return Verdict.REFUTED if refuted else Verdict.UNDECIDED


def _failing(checked: Checked[R]) -> tuple[Shortfall, ...]:
    return tuple(Shortfall(claim=k, margin=m) for k, m in checked.margins.items() if not m.lo > 0)


def _holding(problem: TubeProblem, recipes: tuple[R, ...]) -> tuple[R, ...]:
    """The recipes whose margins are all proven."""
    if not recipes:
        return ()
    margins = margins_along(problem, recipes).values()
    return tuple(r for i, r in enumerate(recipes) if all(bool(margin.lo[i] > 0) for margin in margins))


def _ultimate(problem: TubeProblem, decisive: Checked[R], proposal: Proposal[R]) -> float | None:
    """What is proven of the long run at the decisive gains, by their own theorem or by the companion's."""
    if theorem_of(type(decisive.recipe)).ultimate is not None:
        return decisive.ultimate_radius
    own = THEOREMS.get(type(proposal.companion))
    same = _same(decisive.recipe, proposal.companion, "bandwidth", *_BESIDE_BANDWIDTH)
    if own is None or not same or not own.states(problem, proposal.companion):
        return None
    return check(problem, proposal.companion).ultimate_radius


def _same(first: object, second: object, *names: str) -> bool:
    """Whether two recipes are about loops that have these gains in common."""
    return all(getattr(first, name, None) == getattr(second, name, None) for name in names)


def overall(verdicts: Sequence[Verdict]) -> Verdict:
    """The verdict of a certificate from those that decide it: the worst of them, undecided if there are none."""
    order = (Verdict.REFUTED, Verdict.UNDECIDED, Verdict.CERTIFIED)
    return next((each for each in order if each in verdicts), Verdict.UNDECIDED)
