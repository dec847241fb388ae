"""Suprema of one objective over several domains, searched side by side.

Most searches have few boxes at a time, so that an evaluation costs what its calls cost. What several of them ask is
evaluated at once, row by row; each gets the answer, and comes to the result, that it would have alone, but for last
digits where numpy rounds a row alone in another way than among others: either is a bound. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.branch_and_bound import Effort, Search, Supremum
from tubecert.enclosure.interval import Array
from tubecert.enclosure.objective import Estimate, Objective
from tubecert.enclosure.questions import (
    Asked,
    Bound,
    Contract,
    Cut,
    Domain,
    Inside,
    Points,
    Priorities,
    Values,
    answer,
)

_MOST = 4096  # rows of one evaluation

Rows = NDArray[np.intp]
Kind = type[Asked]
Q = TypeVar("Q", Contract, Inside, Priorities, Bound, Values)


class Joint(Protocol):
    """Several domains as one; `which` (N,) tells of which domain a row is."""

    def contract(self, variables: tuple[str, ...], which: Rows, lo: Array, hi: Array) -> Cut:
        """`Domain.contract`, row by row."""
        ...

    def inside(self, variables: tuple[str, ...], which: Rows, points: Array) -> tuple[Rows, Points]:
        """`Domain.inside`: the rows that are left, and their boxes."""
        ...

    def priorities(
        self, variables: tuple[str, ...], which: Rows, lo: Array, hi: Array, estimate: Estimate
    ) -> Array:
        """`Domain.priorities`, row by row."""
        ...


def suprema(
    objective: Objective, domains: Sequence[Domain], effort: Effort, joint: Joint | None = None
) -> list[Supremum]:
    """Enclose the supremum of `objective` over each domain, as `supremum` does; `joint` may answer for all of them.

    Raises `ValueError` if a domain turns out empty.
    """
    searches = [Search(objective, domain, effort) for domain in domains]
    if len({search.variables for search in searches}) > 1:
        joint = None
    with np.errstate(all="ignore"):
        return _SideBySide(objective, searches, joint).run()


class _SideBySide:
    def __init__(self, objective: Objective, searches: Sequence[Search], joint: Joint | None) -> None:
        self._objective, self._searches, self._joint = objective, searches, joint
        self._steps = [search.run() for search in searches]
        self._found: dict[int, Supremum] = {}
        self._waiting: dict[int, Asked] = {}

    def run(self) -> list[Supremum]:
        for place in range(len(self._steps)):
            self._go_on(place)
        while self._waiting:
            chosen = self._alike()
            self._answer({place: self._waiting.pop(place) for place in chosen})
            for place in chosen:
                self._go_on(place)
        return [self._found[place] for place in range(len(self._steps))]

    def _go_on(self, place: int) -> None:
        try:
            self._waiting[place] = next(self._steps[place])
        except StopIteration as end:
            self._found[place] = end.value

    def _alike(self) -> list[int]:
        """The searches that are answered next: those that ask what most of them ask, up to so many rows."""
        kinds = [_kind(asked) for asked in self._waiting.values()]
        most = max(kinds, key=kinds.count)
        chosen: list[int] = []
        rows = 0
        for place, asked in self._waiting.items():
            if _kind(asked) == most and (not chosen or rows + _height(asked) <= _MOST):
                chosen.append(place)
                rows += _height(asked)
        return chosen

    def _answer(self, asked: dict[int, Asked]) -> None:
        places, questions, joint = list(asked), list(asked.values()), self._joint
        first = questions[0]
        if len(questions) > 1 and isinstance(first, Bound):
            self._bound(_all(Bound, questions))
        elif len(questions) > 1 and isinstance(first, Values):
            self._values(_all(Values, questions))
        elif len(questions) == 1 or joint is None:
            for place, question in asked.items():
                answer(question, self._objective, self._searches[place].domain)
        elif isinstance(first, Contract):
            _contract(joint, places, _all(Contract, questions))
        elif isinstance(first, Inside):
            _inside(joint, places, _all(Inside, questions))
        else:
            _priorities(joint, places, _all(Priorities, questions))

    def _bound(self, questions: Sequence[Bound]) -> None:
        heights = [len(each.lo) for each in questions]
        target = np.repeat([each.target for each in questions], heights)
        lo, hi = _stacked(questions)
        whole = self._objective.upper(lo, hi, target)
        for each, part in zip(questions, _estimates(whole, heights), strict=True):
            each.answer = part

    def _values(self, questions: Sequence[Values]) -> None:
        found = self._objective.lower(*_stacked(questions))
        for each, part in zip(questions, _parts(found, [len(q.lo) for q in questions]), strict=True):
            each.answer = part


def _contract(joint: Joint, places: Sequence[int], questions: Sequence[Contract]) -> None:
    heights = [len(each.lo) for each in questions]
    found = joint.contract(questions[0].variables, np.repeat(places, heights), *_stacked(questions))
    lo, hi, alive = found
    parts = zip(_parts(lo, heights), _parts(hi, heights), _parts(alive, heights), strict=True)
    for each, part in zip(questions, parts, strict=True):
        each.answer = part


def _inside(joint: Joint, places: Sequence[int], questions: Sequence[Inside]) -> None:
    which = np.repeat(places, [len(each.points) for each in questions])
    points = np.concatenate([each.points for each in questions])
    left, (lo, hi) = joint.inside(questions[0].variables, which, points)
    for place, each in zip(places, questions, strict=True):
        own = which[left] == place
        each.answer = lo[own], hi[own]


def _priorities(joint: Joint, places: Sequence[int], questions: Sequence[Priorities]) -> None:
    heights = [len(each.lo) for each in questions]
    whole = Estimate(*map(np.concatenate, zip(*(_columns(each.estimate) for each in questions), strict=True)))
    lo, hi = _stacked(questions)
    found = joint.priorities(questions[0].variables, np.repeat(places, heights), lo, hi, whole)
    for each, part in zip(questions, _parts(found, heights), strict=True):
        each.answer = part


def _kind(asked: Asked) -> tuple[Kind, bool]:
    """What is asked; bounds with a target are others than those without."""
    return type(asked), isinstance(asked, Bound) and bool(np.isfinite(asked.target))


def _height(asked: Asked) -> int:
    return len(asked.points) if isinstance(asked, Inside) else len(asked.lo)


def _all(kind: type[Q], questions: Sequence[Asked]) -> list[Q]:
    return [each for each in questions if isinstance(each, kind)]


def _stacked(questions: Sequence[Contract | Priorities | Bound | Values]) -> tuple[Array, Array]:
    return np.concatenate([each.lo for each in questions]), np.concatenate([each.hi for each in questions])


T = TypeVar("T", Array, NDArray[np.bool_])


def _parts(rows: T, heights: Sequence[int]) -> list[T]:
    return np.split(rows, np.cumsum(heights)[:-1])


def _estimates(whole: Estimate, heights: Sequence[int]) -> list[Estimate]:
    columns = (_parts(column, heights) for column in _columns(whole))
    return [Estimate(*parts) for parts in zip(*columns, strict=True)]


def _columns(e: Estimate) -> tuple[Array, Array, Array, Array]:
    return e.upper, e.corner, e.caused, e.spread
