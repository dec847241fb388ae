"""What the conditions of the certificates say, by their ids."""

from __future__ import annotations

from collections.abc import Mapping

from tubecert import kinds
from tubecert.kinds.data import Role

# what a certificate is called where its gains stand
SECTIONS: Mapping[str, str] = {name.key: str(name) for name in kinds.NAMES}

# what a set of gains is chosen for, in the order in which they are shown
ROLES: Mapping[Role, str] = {
    "feedback": "feedback alone",
    "asked": "asked for",
    "least_bandwidth": "least omega",
    "least_adaptation": "least Gamma",
    "longest_sample": "omega = 1/Ts",
    "machine": "least tube",
    "largest": "largest",
}

# a condition as it is named beside a certificate
NAMES: Mapping[str, str] = {
    "initial_distance": "dbar <= d0",
    "plan_defect": "dbar <= delta/lambda",
    "parameters": "dbar <= delta/lambda, with unknown parameters",
    "wind": "dbar <= delta/lambda, with the wind",
    "wind_bound": "wind without a bound",
    "wind_not_covered": "stated without wind",
    "gain_not_covered": "stated for a known B",
    "gain_unmatched": "inputs that act elsewhere",
    "gain_range": "gains that are too uncertain",
    "corrected_formulas": "as-printed",
    "proven_gains": "nothing found",
    "any_gains": "nothing found",
}

# the quantity that the only condition of a certificate bounds
SHOWN: Mapping[str, str] = {
    "no_adaptation": "sup D(t), feedback alone",
    "distance": "sup D(t)",
    "sampled": "sup D(t), sampled",
    "hardware": "sup D(t), as the machine runs it",
    "hardware_level": "dhat + n_M",
}

SAYS: Mapping[str, str] = {
    "26a": "the initial error and the filter's share must fit into rho_r",
    "26b": "the metric's lower bound must exceed zeta_2 + zeta_3",
    "26c": "the adaptation rate must make up for the estimation error",
    "no_adaptation": "the feedback alone must keep the distance below dbar",
    "distance": "the distance bound sup D(t) must stay below dbar",
    "sampled": "the distance bound with sampled adaptation must stay below dbar",
    "hardware": "the distance bound of the sampled and delayed loop must stay below its level dhat",
    "hardware_level": "the level dhat and the noise must fit into dbar together",
    "initial_distance": "d0, the length of the segment to the start, must be below dbar = sqrt(a) rho",
    "plan_defect": "the plan's defect alone must keep the distance below dbar",
    "parameters": "what unknown parameters do beside the inputs, with the plan's defect, must keep the distance "
    "below dbar",
    "wind": "what the wind does beside the inputs, with the plan's defect, must keep the distance below dbar",
    "wind_bound": "the bound of the wind is searched for, which certificate H does; nothing follows here without it",
    "wind_not_covered": "the theorem is stated for inputs and matched uncertainty alone: it says nothing of a wind, or "
    "of unknown parameters, beside what the inputs can make",
    "gain_not_covered": "the theorem is stated for a B that is known; parameters known by ranges in B are what "
    "certificate H alone covers",
    "gain_unmatched": "the inputs must be proven to act where those of the middles do: B(x, theta) = B B^+ B(x, theta)"
    "; what acts elsewhere can be written as a disturbance (docs/hardware.md)",
    "gain_range": "the gain of the inputs must be proven to be off by less than itself, |B^+ B(x, theta) - I| < 1",
    "corrected_formulas": "the paper's printed formulas are reproduced; several are wrong, so they certify nothing",
    "proven_gains": "gains that seem to serve were found, but none could be proven to; the constants may be too wide "
    "(lower --gap), or the margins too thin for the arithmetic",
    "any_gains": "no gains were found that can be proven to serve",
}


def condition_name(condition: str) -> str:
    """A condition as it is named beside a certificate."""
    return NAMES.get(condition, condition)


def equation(condition: str) -> str:
    """The condition of an equation with its tag in parentheses, others as they are."""
    return f"({condition})" if condition.startswith("26") else condition
