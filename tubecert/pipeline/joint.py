"""Metrics that move with the state, for a machine: the weights of sums of squares, chosen by what H comes to.

W is to be as near to a target as C1 and C2 permit (in a frame that C3 permits). The target and the rate are the
weights; what a metric of theirs comes to is a certification with H, so that nothing is chosen by a condition number.
The coordinates of the tube follow the metric, and so the target as well. In: a specification and targets to begin
with. Out: proven metrics, those of the narrowest tubes first. Untrusted: they are certified again by whoever asks.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, log
from typing import Final

import numpy as np

from tubecert.digits import near
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.errors import SpecError
from tubecert.expression import to_text
from tubecert.expression.matrix import Matrix
from tubecert.kinds.hardware import HardwareData
from tubecert.model import ControlAffineModel
from tubecert.pipeline import question_of
from tubecert.pipeline.candidates import ending, machine_section
from tubecert.pipeline.width import Measure, need_of
from tubecert.progress import Phase, Progress, Step
from tubecert.records import exact_json
from tubecert.search.weights import Weights, descend, moves
from tubecert.spec import Spec
from tubecert.spec.metric_file import FORMAT, with_metric_text
from tubecert.stages.memory import Memory
from tubecert.stages.options import Options
from tubecert.synthesis.decimals import digits_below
from tubecert.synthesis.family import FamilyError, MetricFamily, metric_family, suggested
from tubecert.synthesis.problem import SynthesisProblem
from tubecert.synthesis.rounding import VerifiedMetric, shortest_proven
from tubecert.synthesis.sos import propose_sos
from tubecert.verdict import Verdict

_BACK_OFFS: Final = (6e-3, 3e-4)  # of the rate: what the proof may need
_UP: Final = 1 + 1e-9  # so that a rate of three digits stays what it is
_EVALUATIONS: Final = 20
_BOXES: Final = 20_000  # what each claim may cost here
_MOST_STATES: Final = 3  # for which W is let to move where it need not
_DEGREE: Final = 2
_UNCERTIFIED, _NO_METRIC = 20.0, 60.0  # costs that lead back


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """A proven metric as a text of a metric file, and how wide a tube H proves with it; by that they are compared."""

    text: str
    size: float


@dataclass(slots=True, kw_only=True)
class Joint:
    """What metrics of every weight come to, for the machine of a specification; `model` is built without a metric.

    `found` are those that H certifies.
    """

    spec: Spec
    model: ControlAffineModel
    measure: Measure
    options: Options
    progress: Progress | None = None
    found: dict[str, Judged] = field(default_factory=dict)
    memory: Memory = field(default_factory=Memory)
    _families: list[MetricFamily] = field(default_factory=list)

    def run(self, starts: Sequence[tuple[Array, float]], centre: Array) -> list[Judged]:
        """The narrowest tube first. None where W need not move, and would be dear.

        `starts`: dual metrics (n, n) at `centre` (n,), with rates in 1/s. `ValueError` where C3 leaves no family.
        """
        family = self.family
        if family.flat and not family.degree:
            return []
        inverse = np.linalg.inv(at_point(family.frame, self.model, centre))
        inputs = inverse @ at_point(self.model.B, self.model, centre)
        begun = [Weights(target=inverse @ W @ inverse.T, rate=rate) for W, rate in starts]
        costs = [self.cost(own) for own in begun]
        if begun:
            descend(begun[int(np.argmin(costs))], self.cost, moves(inputs), _EVALUATIONS)
        return sorted(self.found.values(), key=lambda each: each.size)

    @property
    def family(self) -> MetricFamily:
        """The family in which metrics are looked for; `ValueError` where C3 leaves none."""
        if not self._families:
            degree = _degree(self.spec, self.model)
            try:
                self._families.append(metric_family(self.model, degree=degree, safe_set=self.spec.safe_set))
            except FamilyError as error:
                raise ValueError("no family of metrics is known that moves with B") from error
        return self._families[0]

    def cost(self, own: Weights) -> float:
        """The logarithm of the proven width; above that of all widths, by how much H is not certified."""
        metric = self._metric(own)
        if metric is None:
            return _NO_METRIC + own.rate
        content = {"format": FORMAT, "rate": exact_json(metric.rate), "dual_metric": _texts(metric)}
        text = json.dumps(content, indent=1) + "\n"
        section = self._section(text, metric)
        need = None if section is None else need_of(section, self.measure)
        if section is None or need is None or not isfinite(need):
            return _NO_METRIC
        if section.verdict is not Verdict.CERTIFIED:
            return _UNCERTIFIED + log(need)
        self.found[text] = Judged(text=text, size=need)
        return log(need)

    def _metric(self, own: Weights) -> VerifiedMetric | None:
        """The member of the family that is nearest to the target, proven."""
        rate = digits_below(own.rate * _UP, 3)
        problem = SynthesisProblem(
            model=self.model,
            safe_set=self.spec.safe_set,
            family=self.family,
            rate=float(rate),
            coordinates="auto",
            target=own.target,
        )
        for back_off in _BACK_OFFS:
            tried = replace(problem, rate=problem.rate * (1 + back_off))
            try:
                outcome = shortest_proven(tried, propose_sos(tried), rate, Effort(gap=0.05, budget=_BOXES))
            except (ArithmeticError, ValueError, RuntimeError):  # a solver that breaks down has found nothing
                continue
            if isinstance(outcome, VerifiedMetric):
                return outcome
        return None

    def _section(self, text: str, metric: VerifiedMetric) -> HardwareData | None:
        if self.progress is not None:
            self.progress(
                Step(phase=Phase.DESIGN, name=f"weights of the metric: rate {near(metric.rate, 3)}")
            )
        try:
            held = with_metric_text(self.spec, text, "<searched>")
        except SpecError:  # too long for a file
            return None
        options = replace(self.options, budget=min(self.options.budget, _BOXES))
        question = question_of(held, options, memory=self.memory)
        return machine_section(question, ending(question, metric))


def _degree(spec: Spec, model: ControlAffineModel) -> int:
    """Of W: the one that is asked for; else 0 where W moves with B, or where more would be dear."""
    if spec.synthesis is not None and spec.synthesis.degree is not None:
        return spec.synthesis.degree
    few = len(model.states) <= _MOST_STATES
    return _DEGREE if model.constant_input and few and suggested(model) else 0


def _texts(metric: VerifiedMetric) -> list[list[str]]:
    return [[to_text(e) for e in row] for row in metric.dual_metric]


def at_point(rows: Matrix, model: ControlAffineModel, centre: Array) -> Array:
    """A matrix of n rows at a point (n,)."""
    tape = Tape([e for row in rows for e in row], model.states)
    return np.asarray(tape.run_floats(list(centre[:, None]), (1,)), dtype=float).reshape(len(rows), -1)
