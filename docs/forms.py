"""The JSON Schema of records: what `tubecert.records` reads and writes, said to others."""

from __future__ import annotations

import re
import types
import typing
from collections.abc import Mapping
from dataclasses import is_dataclass
from enum import Enum
from fractions import Fraction
from typing import Any, Literal, Union

from tubecert.certificate.effective import Asked, Effective
from tubecert.claims.advice import PlanRemedy
from tubecert.claims.failures import Failure, Outcome
from tubecert.claims.family import Assumption, Claim, Relax
from tubecert.enclosure.constant import Constant, Witness
from tubecert.enclosure.interval import Array
from tubecert.records import Tagged, members, required

FAMILIES: dict[str, type[Tagged]] = {
    "claim": Claim,
    "failure": Failure,
    "relax": Relax,
    "plan_remedy": PlanRemedy,
    "assumption": Assumption,
    "outcome": Outcome,
}
_REFERRED: dict[Any, str] = {  # types with a definition of their own
    Fraction: "decimal",
    Witness: "point",
    Constant: "enclosure",
    Array: "matrix",
    Effective: "specification",
    Asked: "asked",
}
_MATRIX = "A matrix of floats (p, q) that are exact numbers: written as hexadecimal texts, row by row."
_EVERYWHERE = {  # what a key means in each record that has it and does not say otherwise
    "verdict": "What is known of it: only certified is proven.",
    "bandwidth": "Bandwidth omega of the filter, in rad/s.",
    "adaptation_rate": "Adaptation rate Gamma, in 1/s^2.",
    "predictor_gain": "g of the predictor A_m = -g I, in 1/s.",
    "projection_radius": "Radius R_H of the projection.",
    "margin": "What is left of a condition, (allowed - needed)/allowed: it holds where this is positive.",
    "margins": "What is left of each condition, (allowed - needed)/allowed: it holds where this is positive.",
    "allowed": "What is allowed.",
    "needed": "What is needed.",
    "condition": "Which: see the claim `condition_holds`.",
    "constant": "The constant without a bound, where that is why.",
    "ultimate_radius": "What |x - x*| is at most in the long run.",
    "split": "The gains of least bandwidth.",
    "least_adaptation": "The gains of least adaptation rate.",
    "asked": "The gains that were asked for.",
    "least": "The input is never less.",
    "greatest": "The input is never more.",
    "feedback": "What the feedback adds to u* at most.",
    "adaptation": "What the adaptation adds to u* at most.",
    "diagonal": "Bounds of W11 and W22 from above.",
    "beside": "[low, high] of W12.",
    "rate": "Contraction rate of the metric, in 1/s.",
    "degree": "Degree of W.",
    "rho": "Radius of the tube.",
    "rho_a": "Radius left to the adaptation.",
    "epsilon": "Radius beyond the initial offset.",
    "condition_number": "Condition number of the metric.",
    "route": "How the metric was searched for.",
    "floor": "What W has to exceed: the identity, or B B'.",
}


def schema(kind: Any) -> dict[str, Any]:
    """The JSON Schema of the values of a type: what is read, and nothing else."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (Union, types.UnionType):
        (inner,) = (each for each in arguments if each is not types.NoneType)
        return {"anyOf": [schema(inner), {"type": "null"}]}
    if kind in _REFERRED:
        return {"$ref": f"#/$defs/{_REFERRED[kind]}"}
    if kind in FAMILIES.values():
        (name,) = (name for name, family in FAMILIES.items() if family is kind)
        return {"$ref": f"#/$defs/{name}", "unevaluatedProperties": False}
    if origin is tuple and arguments[-1] is Ellipsis:
        return {"type": "array", "items": schema(arguments[0])}
    if origin is tuple:
        (inner,) = set(arguments)
        count = len(arguments)
        return {"type": "array", "items": schema(inner), "minItems": count, "maxItems": count}
    if origin is not None and isinstance(origin, type) and issubclass(origin, Mapping):
        return {"type": "object", "additionalProperties": schema(arguments[1])}
    if origin is Literal:
        return {"enum": list(arguments)}
    if isinstance(kind, type) and issubclass(kind, Enum):
        return {"enum": [member.value for member in kind]}
    if is_dataclass(kind):
        return _record(kind)
    return {"type": {str: "string", bool: "boolean", int: "integer", float: "number"}[kind]}


def family(kind: type[Tagged]) -> dict[str, Any]:
    """The records of a family, told apart by their tags; they are open, for other members may stand beside theirs."""
    return {"description": _head(kind), "anyOf": [_record(member) for member in kind.family.values()]}


def _record(kind: Any) -> dict[str, Any]:
    """A record with the words of its keys; closed, but for members of families."""
    properties: dict[str, Any] = {kind.key: {"const": kind.tag}} if issubclass(kind, Tagged) else {}
    needed, beside = list(properties), {} if properties else {"additionalProperties": False}
    for item, hint in members(kind):
        if item.metadata.get("inline"):
            beside = schema(hint)
        elif kinds := item.metadata.get("keyed"):
            properties |= {
                name: schema(each) | _told(kind, item.name, each) for name, each in kinds().items()
            }
        else:
            properties[item.name] = schema(hint) | _told(kind, item.name, hint)
            needed += [item.name] if required(item) else []
    found = {"type": "object", "description": _head(kind), "properties": properties}
    return found | ({"required": needed} if needed else {}) | beside


def _head(kind: Any) -> str:
    """What a record is; what its keys are is said at them, but for parameters of families, which are shown with it."""
    words = " ".join((kind.__doc__ or "").partition("\n\n")[0].split())
    shown = issubclass(kind, Tagged) and kind.tag
    return words if shown else re.split(r"; `\w+`: ", words)[0].rstrip(".") + "."


def _told(kind: Any, key: str, hint: Any) -> dict[str, str]:
    """Words of a key: the sentence of its record that names it, what it means everywhere, or what it holds."""
    words = " ".join(each.__doc__ or "" for each in kind.__mro__ if is_dataclass(each))
    sentences = re.split(r"(?<=[.;]) ", " ".join(words.split()).replace("| None", ""))
    named = next((sentence.rstrip(".;") + "." for sentence in sentences if f"`{key}`" in sentence), "")
    held = (hint, *typing.get_args(hint))
    inner = next((each for each in held if is_dataclass(each) or each in FAMILIES.values()), None)
    own = _MATRIX if hint == Array else f"{key}.".replace("_", " ") if inner is None else _head(inner)
    said = named.removeprefix(f"`{key}`: ")
    return {"description": said[:1].upper() + said[1:] or _EVERYWHERE.get(key, own)}
