"""Gains of every kind for one problem: searches propose, the kernel decides, the kinds write their sections."""

from __future__ import annotations

from typing import Any

from tubecert.bounds.constants import DERIVED
from tubecert.certificate.sections import constant_data
from tubecert.conditions.problem import Formulas, TubeProblem
from tubecert.conditions.proposal import Asked
from tubecert.conditions.verdict import Verdict
from tubecert.kernel import overall
from tubecert.kinds.kind import Kind, Section
from tubecert.kinds.table import KINDS, kind_of
from tubecert.pipeline.options import Options
from tubecert.pipeline.reasons import reasons
from tubecert.records import to_json
from tubecert.search.proposers import PROPOSERS, Explained


def gains(problem: TubeProblem, options: Options) -> dict[str, Any]:
    """Sections of the result; those kinds that were chosen decide its `verdict`.

    `constants` holds the derived constants only, `reasons` those of the deciding sections.
    """
    asked = Asked(bandwidth=options.bandwidth, adaptation_rate=options.adaptation_rate)
    sections: dict[str, Section[Any]] = {}
    explained: dict[str, Explained] = {}
    for kind in KINDS:
        proposer = PROPOSERS[kind.theorem.recipe]
        proposal = proposer.propose(problem, asked)
        sections[kind.key] = kind.section(problem, proposal)
        explained[kind.key] = proposer.explain(problem, proposal)
    chosen = [kind.key for kind in _deciding(options)]
    printed = options.formulas == Formulas.AS_PRINTED
    told = list(dict.fromkeys([KINDS[0].key, *chosen])) if printed else chosen
    return {
        **{key: to_json(section.data()) for key, section in sections.items()},
        "constants": {
            name: constant_data(value.printable(), DERIVED[name])
            for kind in KINDS
            for name, value in kind.derived(sections[kind.key]).items()
        },
        "elasticities": {key: each.slopes for key, each in explained.items() if each.slopes is not None},
        "proof": {
            key: to_json(section.proof.recipe)
            for key, section in sections.items()
            if section.proof is not None
        },
        "decided_by": chosen,
        "reasons": [reason for key in told for reason in reasons(sections[key], explained[key].halved or {})],
        "verdict": str(Verdict.UNDECIDED if printed else overall([sections[key].verdict for key in chosen])),
    }


def _deciding(options: Options) -> tuple[Kind[Any], ...]:
    """The kinds that the verdict is about."""
    return KINDS if options.conditions == "all" else (kind_of(options.conditions),)
