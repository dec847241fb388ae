"""A sweep: the points that are missing are certified by an executor, in any order; what is there is used."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from tubecert.errors import TubecertError
from tubecert.executor import Executor
from tubecert.progress import Phase, Progress, Step
from tubecert.spec import Spec
from tubecert.sweep.folder import identity, prepare, tidy
from tubecert.sweep.grid import Axis, points
from tubecert.sweep.point import Failed, Kept, Point, Task, certify_point, outcome


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """A sweep with its points; raises `TubecertError` where no point has a specification that can be read."""

    task: Task
    axes: tuple[Axis, ...]
    points: tuple[Point, ...]

    @classmethod
    def of(cls, task: Task, axes: Sequence[Axis]) -> Sweep:
        """The product of the axes."""
        settings = points(axes)
        width = max(4, len(str(len(settings))))
        named = tuple(
            Point(number=i, name=f"{i:0{width}}", settings=each) for i, each in enumerate(settings, 1)
        )
        return cls(task=task, axes=tuple(axes), points=named)

    def run(self, executor: Executor, told: Progress | None = None) -> None:
        """Certify what is missing. Raises `TargetError`, and `TubecertError` if no point can be read at all."""
        spec = self.first()
        table = spec.trajectory.table
        prepare(self.task.folder, identity(self.task, self.axes, None if table is None else table.sha256))
        missing = [point for point in self.points if not _done(outcome(self.task, point))]
        done = len(self.points) - len(missing)

        def ready(place: int, certified: object) -> None:
            nonlocal done
            del place, certified  # it is on disk
            done += 1
            if told is not None:
                told(Step(phase=Phase.SWEEP, done=done, of=len(self.points)))

        if told is not None:
            told(Step(phase=Phase.SWEEP, done=done, of=len(self.points)))
        executor.map(partial(certify_point, self.task), missing, ready)
        tidy(self.task.folder)

    def outcomes(self) -> Iterator[tuple[Point, Kept]]:
        """What is kept of each point, in the order of the points."""
        for point in self.points:
            found = outcome(self.task, point)
            if found is None:
                raise ValueError(f"the point {point.name} is gone")
            yield point, found

    def first(self) -> Spec:
        """The first specification that can be read: a mistake that all points share is told before any work."""
        for point in self.points:
            with contextlib.suppress(TubecertError):
                return self.task.load(point.settings)
        return self.task.load(self.points[0].settings)


def _done(found: Kept | None) -> bool:
    """Whether a point need not be certified again: a defect may have been mended meanwhile."""
    return found is not None and not (isinstance(found, Failed) and found.broken)
