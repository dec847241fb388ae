"""Parts of one plan, each with a tube around it, whose constants are asked for one part after the other.

What the first part asks is found for all of them at once. A part that asks the same of the same tube, with the same
effort, is given what was found; whatever else it asks is found for it alone. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Protocol, TypeAlias

from tubecert.enclosure.branch_and_bound import Effort, Supremum
from tubecert.enclosure.domain import Range
from tubecert.enclosure.objective import Comparable, Objective
from tubecert.enclosure.together import suprema
from tubecert.trajectory import Plan
from tubecert.trajectory.plan import PIECE
from tubecert.tube import Ball, Section, Tube, Tubes

Extra: TypeAlias = Mapping[str, Range]


class Part(Protocol):
    """What is searched of a part."""

    @property
    def plan(self) -> Plan:
        """The part of the plan."""
        ...

    @property
    def section(self) -> Section:
        """The tube around it."""
        ...

    @property
    def time(self) -> Range | None:
        """The range of t where the plan brings none."""
        ...

    def tube(self, extra: Extra) -> Tube:
        """The tube as a domain, with further ranges."""
        ...


class Parts:
    """What is found for several parts at once; `whole` is the plan that they are parts of."""

    def __init__(self, whole: Plan, members: Sequence[Part]) -> None:
        self._whole, self._members = whole, members
        self._found: dict[Hashable, Supremum] = {}

    def over_tube(self, own: Part, objective: Objective, effort: Effort, extra: Extra) -> Supremum | None:
        """The supremum over the tube of a part; None if that is to be found for it alone."""
        key = _key(own, objective, effort, extra)
        if key is None or key in self._found:
            return None if key is None else self._found.pop(key)
        if not self._leads(own):
            return None
        tubes = [each.tube(extra) for each in self._members]
        alone = any(
            PIECE in tube.variables(objective.variables) for tube in tubes
        )  # pieces are counted by part
        joint = None if alone else Tubes(self._whole, tubes)
        keys = [_key(each, objective, effort, extra) for each in self._members]
        self._found |= zip(keys, suprema(objective, tubes, effort, joint), strict=True)
        return self._found.pop(key)

    def _leads(self, own: Part) -> bool:
        return len(self._members) > 1 and _tube(own, {}) == _tube(self._members[0], {})


def _key(own: Part, objective: Objective, effort: Effort, extra: Extra) -> Hashable | None:
    """All that a supremum follows from; None where that cannot be told."""
    tube = _tube(own, extra)
    if tube is None or not isinstance(objective, Comparable):
        return None
    told = replace(effort, progress=None, workers=None)
    return tube, type(objective), objective.made_of, told


def _tube(own: Part, extra: Extra) -> Hashable | None:
    if not isinstance(own.section, Ball):
        return None
    return id(own.plan), own.section.rho, own.time, tuple(sorted(extra.items()))
