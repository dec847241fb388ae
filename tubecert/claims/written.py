"""Points and enclosures, which stand in claims, as JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tubecert.enclosure.constant import Constant, Witness
from tubecert.records import FormError, Json, foreign, from_json


def _place_json(at: Witness) -> Json:
    return {**({} if at.t is None else {"t": at.t}), "x": list(at.x)}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Place:
    """Where a value is attained or a claim fails; `x`: the state; `t`: the time in s, if it matters."""

    x: tuple[float, ...]
    t: float | None = None


def _place(data: Json, path: str) -> Witness:
    form = from_json(_Place, data, path)
    return Witness(t=form.t, x=form.x)


def _pair_json(value: Constant) -> Json:
    """[below, above]; null where there is no bound."""
    return [side if math.isfinite(side) else None for side in (value.below, value.above)]


def _pair(data: Json, path: str) -> Constant:
    low, high = from_json(tuple[float | None, float | None], data, path)
    try:
        return Constant(below=-math.inf if low is None else low, above=math.inf if high is None else high)
    except ValueError as error:
        raise FormError(path, f"is {error}") from error


foreign(Witness, _place_json, _place)
foreign(Constant, _pair_json, _pair)
