"""Who hears of a search: how far it is, and until when it goes on; what is proven by then is what it comes out with.

A deadline cuts the list of what is tried and never a proof; the result says that it was cut. Trusted: no, nothing that
is proven depends on any of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf
from typing import TYPE_CHECKING, Final, Literal, SupportsFloat

from tubecert.bounds.constants import TABLE
from tubecert.kinds.table import KINDS
from tubecert.progress import Phase, Progress, Step
from tubecert.spec import Spec
from tubecert.stages.question import Question

if TYPE_CHECKING:
    from tubecert.pipeline.synthesised import Synthesised

Cut = Literal["deadline", "interrupted", "no_adaptation", "plan"]
"""What ended a search before its end: time, somebody, a tube that needs no adaptation, a plan that no metric serves."""


class OutOfTime(Exception):  # noqa: N818 - an end, no error
    """The deadline has passed."""


@dataclass(frozen=True, slots=True)
class Deadline:
    """A time of the monotonic clock, in s; by default there is none."""

    at: float = inf

    @staticmethod
    def after(seconds: SupportsFloat | str | None) -> Deadline:
        """So many seconds from now; without a number there is none."""
        return Deadline() if seconds is None else Deadline(time.monotonic() + float(seconds))

    def check(self) -> None:
        """Raises `OutOfTime` once it has passed."""
        if time.monotonic() > self.at:
            raise OutOfTime


@dataclass(frozen=True, slots=True, kw_only=True)
class Listeners:
    """Who hears of a search, and until when it goes on.

    `progress` hears every step, `told` why there is no metric, before advice is looked for, `kept` what there is after
    every attempt. At the `deadline` what is proven by then is what comes out.
    """

    progress: Progress | None = None
    told: Callable[[Synthesised], None] | None = None
    kept: Callable[[Synthesised], None] | None = None
    deadline: Deadline = field(default_factory=Deadline)

    def __call__(self, step: Step) -> None:
        """Passes a step on; raises `OutOfTime` at the first one after the deadline."""
        self.deadline.check()
        if self.progress is not None:
            self.progress(step)


def cut_by(end: BaseException) -> Cut:
    """What ended a search: a deadline, or somebody who interrupted it."""
    return "deadline" if isinstance(end, OutOfTime) else "interrupted"


# -- how many claims of a certification are done, of all: told with the steps of its searches

METRIC: Final = "metric"
PLAN: Final = "plan"
_FIRST: Final = ("lower", "upper", "h_x", "h", "h_t", "h_initial", "plan_defect", "plan_defect_metric")
_SOUGHT: Final = (name for name in TABLE if name not in (*_FIRST, "initial_distance"))  # which has no search
# in the order in which they are bounded; one that is zero, or declared, is not looked for
_TUBE: Final = (*_FIRST, *_SOUGHT, "geodesics")


@dataclass(slots=True)
class Claims:
    """Adds to every step how many claims are done, of all."""

    shown: Progress
    names: tuple[str, ...]
    done: int = field(default=0)

    def __call__(self, step: Step) -> None:
        """A step of a search, a planner or the gains."""
        name = PLAN if step.phase is Phase.PLAN else step.name
        if name in self.names:
            self.done = max(self.done, self.names.index(name))
        self.shown(replace(step, done=self.done, of=len(self.names)))


def counted(question: Question) -> Question:
    """The question with a progress that counts claims."""
    if question.progress is None:
        return question
    return replace(question, progress=Claims(question.progress, claims_of(question.spec)))


def claims_of(spec: Spec) -> tuple[str, ...]:
    """What is proven in a certification, in its order, by the names that progress is told with."""
    widths = tuple(f"half width of {name}" for name in spec.states)
    limits = tuple(f"range of {name}" for name, _ in spec.limits)
    return (METRIC, PLAN, *_TUBE, *widths, *limits, *(kind.key for kind in KINDS))


def tell_gains(question: Question, recipe: type) -> None:
    """That gains are looked for now, of the kind with this recipe."""
    key = next((kind.key for kind in KINDS if kind.theorem.recipe is recipe), None)
    if question.progress is not None and key is not None:
        question.progress(Step(phase=Phase.GAINS, name=key))
