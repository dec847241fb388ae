"""What a kind of certificate has to offer, and its section: what the kernel decided about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Generic

from tubecert.claims.gains import GainsSuffice
from tubecert.conditions.inputs import InputBound, LimitedInput
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Proposal
from tubecert.conditions.theorem import R, Theorem
from tubecert.conditions.verdict import Shortfall, Verdict
from tubecert.enclosure.constant import Constant
from tubecert.kernel import Checked, Judgement, Proof, judge
from tubecert.kinds import Name
from tubecert.kinds.data import SectionData


@dataclass(frozen=True, slots=True, kw_only=True)
class Section(Generic[R]):
    """What the kernel decided about one kind over a problem, from what was proposed."""

    kind: Kind[R]
    problem: TubeProblem
    proposal: Proposal[R]
    judgement: Judgement[R]

    @property
    def name(self) -> Name:
        """How its kind is called."""
        return self.kind.name

    @property
    def verdict(self) -> Verdict:
        """On the gains of this kind."""
        return self.judgement.verdict

    @property
    def decisive(self) -> Checked[R] | None:
        """The gains that the verdict is about, with their margins."""
        return self.judgement.decisive

    def at(self, role: str) -> Checked[R] | None:
        """The gains in a role, if there are any."""
        return self.decisive if role == self.judgement.role else self.judgement.beside.get(role)

    @property
    def predictor_gain(self) -> Fraction | None:
        """g of the decisive gains; None where there are none."""
        return None if self.decisive is None else getattr(self.decisive.recipe, "predictor_gain", None)

    @property
    def proof(self) -> Proof[R] | None:
        """What a verdict `certified` rests on."""
        return self.judgement.proof

    def input_bound(self, own: LimitedInput) -> InputBound | None:
        """What an input with limits does in the loop, by the proof; None if there is none."""
        return None if self.proof is None else own.bound(self.proof.input_shares)

    @property
    def shortfalls(self) -> tuple[Shortfall, ...]:
        """What is missing."""
        return self.judgement.shortfalls

    @property
    def curve(self) -> tuple[R, ...]:
        """Proven gains along the bandwidth."""
        return self.judgement.curve

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
        judgement = judge(problem, self.theorem, proposal)
        return Section(kind=self, problem=problem, proposal=proposal, judgement=judgement)
