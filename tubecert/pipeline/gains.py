"""Gains of certificates A, B and C for one problem, with their proofs, what limits them, and the verdict."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from tubecert.bounds.constants import DERIVED
from tubecert.certificate.sections import constant_data
from tubecert.conditions.problem import Formulas, TubeProblem
from tubecert.conditions.rates import derived_constants
from tubecert.pipeline.options import CONDITIONS, Options
from tubecert.pipeline.reasons import reasons_26, reasons_distance, reasons_sampled
from tubecert.search.distance import search_distance
from tubecert.search.elasticities import elasticities_26, elasticities_distance, halving
from tubecert.search.margins import margins_26_around, margins_distance_around
from tubecert.search.rates import search_26
from tubecert.search.results import recipe_json
from tubecert.search.sampled import search_sampled

_ORDER = ("refuted", "undecided", "certified")


def gains(problem: TubeProblem, options: Options) -> dict[str, Any]:
    """Sections of the result; those conditions that were chosen decide its `verdict`.

    `constants` holds the derived constants only, `reasons` those of the deciding sections.
    """
    asked = {"bandwidth": options.bandwidth, "adaptation_rate": options.adaptation_rate}
    rates = search_26(problem, **asked)
    distance = search_distance(problem, **asked)
    sampled = search_sampled(problem, bandwidth=options.bandwidth)
    derived = {} if rates.pair is None else derived_constants(problem, rates.pair.recipe)
    slopes = {
        "conditions_26": elasticities_26(problem, rates),
        "distance": elasticities_distance(problem, distance),
    }
    explained = {
        "conditions_26": reasons_26(rates, halving(problem, slopes["conditions_26"], _least_26)),
        "distance": reasons_distance(distance, halving(problem, slopes["distance"], _least_distance)),
        "sampled": reasons_sampled(sampled),
    }
    sections: dict[str, Any] = {
        "conditions_26": rates.to_dict(),
        "distance": distance.to_dict(),
        "sampled": sampled.to_dict(),
    }
    pairs = {"conditions_26": rates.pair, "distance": distance.decisive, "sampled": sampled.pair}
    if rates.pair is not None:
        sections["conditions_26"]["margins_around"] = margins_26_around(problem, rates.pair)
    if distance.decisive is not None:
        sections["distance"]["margins_around"] = margins_distance_around(problem, distance.decisive)
    chosen = list(CONDITIONS.values()) if options.conditions == "all" else [CONDITIONS[options.conditions]]
    verdicts = {sections[name]["verdict"] for name in chosen}
    deciding = chosen
    if options.formulas == Formulas.AS_PRINTED:
        verdicts, deciding = {"undecided"}, list(dict.fromkeys(["conditions_26", *chosen]))
    return {
        **sections,
        "constants": {
            name: constant_data(value.printable(), DERIVED[name]) for name, value in derived.items()
        },
        "elasticities": slopes,
        "proof": {
            name: recipe_json(pair.recipe)
            for name, pair in pairs.items()
            if pair is not None and sections[name]["verdict"] == "certified"
        },
        "decided_by": chosen,
        "reasons": [reason for name in deciding for reason in explained[name]],
        "verdict": next(word for word in _ORDER if word in verdicts),
    }


def _least_26(problem: TubeProblem) -> Fraction | None:
    pair = search_26(problem).least_adaptation
    return None if pair is None else pair.recipe.adaptation_rate


def _least_distance(problem: TubeProblem) -> Fraction | None:
    pair = search_distance(problem).least_adaptation
    return None if pair is None else pair.recipe.adaptation_rate
