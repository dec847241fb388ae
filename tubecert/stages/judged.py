"""The verdict: what the kernel decides about the gains that searches propose, kind by kind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from tubecert.bounds.constants import DERIVED, Meaning
from tubecert.certificate.result import InputData, PlanInputData
from tubecert.conditions.inputs import LimitedInput
from tubecert.conditions.theorem import Proposal
from tubecert.enclosure.constant import Constant
from tubecert.kernel import overall
from tubecert.kinds import RATES
from tubecert.kinds.kind import Section
from tubecert.kinds.table import KINDS, kind_of
from tubecert.letters import ALL
from tubecert.stages.bounded import Bounded
from tubecert.stages.question import Options, Question
from tubecert.verdict import Verdict


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A section for every kind, by key."""

    bounded: Bounded
    sections: Mapping[str, Section[Any]]

    @property
    def question(self) -> Question:
        """What is asked."""
        return self.bounded.question

    @property
    def deciding(self) -> tuple[str, ...]:
        """The kinds that the verdict is about, by key."""
        return deciding(self.question)

    @property
    def verdict(self) -> Verdict:
        """The worst of those that decide."""
        obstacles = [each.verdict for each in self.bounded.clearances if each.decides]
        inputs = [each.verdict for each in self.inputs]
        return overall([*(self.sections[key].verdict for key in self.deciding), *obstacles, *inputs])

    @cached_property
    def inputs(self) -> tuple[InputData, ...]:
        """What is proven of the inputs that have limits."""
        return tuple(map(self._judged, self.bounded.inputs))

    def _judged(self, own: LimitedInput) -> InputData:
        found = {key: section.input_bound(own) for key, section in self.sections.items()}
        return InputData(
            input=own.name,
            limits=own.limits,
            verdict=own.verdict([found[key] for key in self.deciding]),
            plan=PlanInputData(least=own.least, greatest=own.greatest),
            bounds={key: bound for key, bound in found.items() if bound is not None},
        )

    def derived(self) -> dict[str, tuple[Constant, Meaning]]:
        """Constants at the gains found, that the certificate lists beside those of the tube."""
        return {
            name: (value.printable(), DERIVED[name])
            for kind in KINDS
            for name, value in self.sections[kind.key].derived().items()
        }


def deciding(question: Question) -> tuple[str, ...]:
    """The kinds that decide a question, by key."""
    chosen = question.options.conditions or question.spec.decides or RATES.option
    if chosen == ALL:
        return tuple(kind.key for kind in KINDS if kind.name.adapts)
    return (kind_of(chosen).key,)


def judge_all(bounded: Bounded, proposals: Mapping[type, Proposal[Any]]) -> Judged:
    """The sections about what is proposed, by the recipe of each kind."""
    options = bounded.question.options
    sections = {
        kind.key: kind.section(
            bounded.problem, _answering(options, proposals.get(kind.theorem.recipe, Proposal()))
        )
        for kind in KINDS
    }
    return Judged(bounded=bounded, sections=sections)


def _answering(options: Options, proposal: Proposal[Any]) -> Proposal[Any]:
    """A proposal without what would decide, where it is about other gains than were asked for."""
    wanted = {"bandwidth": options.bandwidth, "adaptation_rate": options.adaptation_rate}
    own = proposal.decisive
    same = all(value in (None, getattr(own, name, value)) for name, value in wanted.items())
    return proposal if same else replace(proposal, decisive=None)
