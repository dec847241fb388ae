"""How many claims of a certification are done, of all: told with the steps of its searches.

In: a question. Out: the same, whose progress counts. Nothing that is proven depends on it. Trusted: no.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

from tubecert.bounds.constants import TABLE
from tubecert.kinds.table import KINDS
from tubecert.progress import Phase, Progress, Step
from tubecert.spec import Spec
from tubecert.stages.question import Question

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
