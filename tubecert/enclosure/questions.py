"""What a search asks its objective and its domain, as values: whoever runs the search answers them.

One search is answered by its own objective and domain; several that are alike, all at once. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Generic, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.enclosure.objective import Estimate, Objective, Target

T = TypeVar("T")
Cut: TypeAlias = tuple[Array, Array, NDArray[np.bool_]]
Points: TypeAlias = tuple[Array, Array]


class Domain(Protocol):
    """A set of points, known through boxes."""

    def variables(self, needed: tuple[str, ...]) -> tuple[str, ...]:
        """The variables to search over: those needed, then those that the domain itself depends on."""
        ...

    def boxes(self, variables: tuple[str, ...]) -> tuple[Array, Array]:
        """Boxes (N, d) that cover the domain's projection to `variables`."""
        ...

    def contract(
        self, variables: tuple[str, ...], lo: Array, hi: Array
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Smaller boxes with the same points of the domain, and which of them may contain any."""
        ...

    def inside(self, variables: tuple[str, ...], points: Array) -> tuple[Array, Array]:
        """Thin boxes near the given points, each proven to lie in the domain's projection; shape (P', d)."""
        ...

    def priorities(self, variables: tuple[str, ...], lo: Array, hi: Array, estimate: Estimate) -> Array:
        """How much splitting each variable promises, (N, d); <= 0 where it cannot be split."""
        ...


class Question(Generic[T]):
    """What is asked, and the answer once it is known."""

    answer: T


class Contract(Question[Cut]):
    """`Domain.contract` of boxes (N, d)."""

    def __init__(self, variables: tuple[str, ...], lo: Array, hi: Array) -> None:
        self.variables, self.lo, self.hi = variables, lo, hi


class Inside(Question[Points]):
    """`Domain.inside` of points (P, d)."""

    def __init__(self, variables: tuple[str, ...], points: Array) -> None:
        self.variables, self.points = variables, points


class Priorities(Question[Array]):
    """`Domain.priorities` of boxes (N, d)."""

    def __init__(self, variables: tuple[str, ...], lo: Array, hi: Array, estimate: Estimate) -> None:
        self.variables, self.lo, self.hi, self.estimate = variables, lo, hi, estimate


class Bound(Question[Estimate]):
    """`Objective.upper` of boxes (N, d), in the variables of the objective."""

    def __init__(self, lo: Array, hi: Array, target: Target) -> None:
        self.lo, self.hi, self.target = lo, hi, target


class Values(Question[Array]):
    """`Objective.lower` at thin boxes (N, d)."""

    def __init__(self, lo: Array, hi: Array) -> None:
        self.lo, self.hi = lo, hi


Asked: TypeAlias = Contract | Inside | Priorities | Bound | Values
Steps: TypeAlias = Generator[Asked, None, T]


def answered(steps: Steps[T], objective: Objective, domain: Domain) -> T:
    """What a search comes to, of one objective over one domain."""
    while True:
        try:
            asked = next(steps)
        except StopIteration as end:
            found: T = end.value
            return found
        answer(asked, objective, domain)


def answer(asked: Asked, objective: Objective, domain: Domain) -> None:
    """Answer a question."""
    if isinstance(asked, Bound):
        asked.answer = objective.upper(asked.lo, asked.hi, asked.target)
    elif isinstance(asked, Values):
        asked.answer = objective.lower(asked.lo, asked.hi)
    elif isinstance(asked, Contract):
        asked.answer = domain.contract(asked.variables, asked.lo, asked.hi)
    elif isinstance(asked, Inside):
        asked.answer = domain.inside(asked.variables, asked.points)
    else:
        asked.answer = domain.priorities(asked.variables, asked.lo, asked.hi, asked.estimate)
