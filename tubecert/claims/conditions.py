"""What the conditions of the certificates are called and say, by their ids."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tubecert.letters import NAMES

# what a certificate is called where its gains stand
SECTIONS: Final[Mapping[str, str]] = {name.key: str(name) for name in NAMES}

# a condition as it is named beside a certificate
_NAMES: Final[Mapping[str, str]] = {
    "initial_distance": "dbar <= d0",
    "plan_defect": "dbar <= delta/lambda",
    "parameters": "dbar <= delta/lambda, with unknown parameters",
    "wind": "dbar <= delta/lambda, with the wind",
    "wind_not_covered": "stated without wind",
    "gain_not_covered": "stated for a known B",
    "proven_gains": "nothing found",
    "any_gains": "nothing found",
}

# the quantity that the only condition of a certificate bounds
SHOWN: Final[Mapping[str, str]] = {
    "no_adaptation": "sup D(t), feedback alone",
    "distance": "sup D(t)",
}

SAYS: Final[Mapping[str, str]] = {
    "26a": "the initial error and the filter's share must fit into rho_r",
    "26b": "the metric's lower bound must exceed zeta_2 + zeta_3",
    "26c": "the adaptation rate must make up for the estimation error",
    "no_adaptation": "the feedback alone must keep the distance below dbar",
    "distance": "the distance bound sup D(t) must stay below dbar",
    "initial_distance": "d0, the length of the segment to the start, must be below dbar = sqrt(a) rho",
    "plan_defect": "the plan's defect alone must keep the distance below dbar",
    "parameters": "what unknown parameters do beside the inputs, with the plan's defect, must keep the distance "
    "below dbar",
    "wind": "what the wind does beside the inputs, with the plan's defect, must keep the distance below dbar",
    "wind_not_covered": "the theorem is stated for inputs and matched uncertainty alone: it says nothing of a wind, or "
    "of unknown parameters, beside what the inputs can make",
    "gain_not_covered": "the theorem is stated for a B that is known, and parameters known by ranges stand in B; give "
    "each of them one value",
    "proven_gains": "gains that seem to serve were found, but none could be proven to; the constants may be too wide "
    "(lower --gap), or the margins too thin for the arithmetic",
    "any_gains": "no gains were found that can be proven to serve",
}


def condition_name(condition: str) -> str:
    """A condition as it is named beside a certificate."""
    return _NAMES.get(condition, condition)


def equation(condition: str) -> str:
    """The condition of an equation with its tag in parentheses, others as they are."""
    return f"({condition})" if condition.startswith("26") else condition
