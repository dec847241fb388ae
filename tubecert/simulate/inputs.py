"""Inputs in runs: how far each went, and whether it left the range that a certificate proves. Implements: (4.13)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tubecert.certificate.result import Result
from tubecert.enclosure.interval import Array
from tubecert.simulate.runs import Runs
from tubecert.spec import Spec


@dataclass(frozen=True, slots=True, kw_only=True)
class InputRange:
    """An input, by name and column, and a range that it keeps to."""

    name: str
    column: int
    least: float
    greatest: float


def proven_ranges(result: Result, key: str) -> tuple[InputRange, ...]:
    """What a certificate proves of every input with limits, in the loop of a kind."""
    columns = {name: column for column, name in enumerate(result.spec.effective.system.inputs)}
    return tuple(
        InputRange(
            name=own.input,
            column=columns[own.input],
            least=own.bounds[key].least,
            greatest=own.bounds[key].greatest,
        )
        for own in result.inputs
        if key in own.bounds
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class InputUse:
    """How far an input went in some runs, and the range that is proven, if one is."""

    input: str
    least: float
    greatest: float
    proven: tuple[float, float] | None

    def joined(self, other: InputUse) -> InputUse:
        """Over the runs of both."""
        least, greatest = min(self.least, other.least), max(self.greatest, other.greatest)
        return InputUse(input=self.input, least=least, greatest=greatest, proven=self.proven or other.proven)


def used(
    spec: Spec, runs: Runs, usable: NDArray[np.bool_], proven: Sequence[InputRange]
) -> tuple[InputUse, ...]:
    """The range of every input that has limits or a proven range, over all steps of the runs that are results."""
    ranges = {own.name: (own.least, own.greatest) for own in proven}
    names = dict.fromkeys((*(name for name, _ in spec.limits or ()), *ranges))
    if not names or not usable.any():
        return ()
    least, greatest = runs.least[usable].min(axis=0), runs.greatest[usable].max(axis=0)
    columns = {name: spec.inputs.index(name) for name in names}
    return tuple(
        InputUse(input=name, least=float(least[i]), greatest=float(greatest[i]), proven=ranges.get(name))
        for name, i in columns.items()
    )


def beyond(runs: Runs, proven: Sequence[InputRange]) -> Iterator[tuple[str, Array, float, float]]:
    """For both ends of every proven range: what it is called, values (N,), their bound from above, its size."""
    for own in proven:
        size = own.greatest - own.least
        yield f"input {own.name}", runs.greatest[:, own.column], own.greatest, size
        yield f"input -{own.name}", -runs.least[:, own.column], -own.least, size
