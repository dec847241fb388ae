"""Certification from a specification to a result: the rooms in their order.

In: a `Spec` and `Options`. Out: the `Result` of a certificate, for every verdict. Trusted: yes, for the order.

| module | what it does |
|---|---|
| `checks` | what makes the question meaningless, as findings |
| `certification` | stage after stage, with what planners and searches propose |
| `gaps` | how closely each constant is enclosed, where its effect decides |
| `reasons` | why a verdict about gains is what it is |
| `synthesis`, `synthesised` | a metric where none is given: objectives, its file |
| `unfound` | why there is none, and what would help |
| `climb`, `candidates` | rates from slow to fast, and what each comes to in the end |
| `listening` | who hears of a search, and until when it goes on |
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from tubecert.certificate.result import Result
from tubecert.executor import Executor
from tubecert.letters import ALONE
from tubecert.metric.verify import Proofs
from tubecert.pipeline.certification import answer, question_of, result
from tubecert.pipeline.checks import inspect, missing_sections, sound_time, unsearchable
from tubecert.pipeline.listening import Deadline, Listeners, OutOfTime, counted
from tubecert.progress import Progress
from tubecert.spec import Spec, Synthesis
from tubecert.stages.question import Memory, Options, Question, Stopped, overridden
from tubecert.stages.result import Stage

if TYPE_CHECKING:
    from tubecert.pipeline.synthesised import Synthesised

__all__ = [
    "Deadline",
    "Listeners",
    "Memory",
    "Options",
    "OutOfTime",
    "Result",
    "certify",
    "inspect",
    "synthesise",
]


def certify(
    spec: Spec,
    options: Options,
    progress: Progress | None = None,
    memory: Memory | None = None,
    *,
    listeners: Listeners | None = None,
    workers: Executor | None = None,
    brief: bool = False,
) -> Result:
    """The result for a specification; raises `SpecError` for what makes the question meaningless.

    With a `memory` that is shared between calls, what does not depend on what changed is not proven again. `listeners`
    are those of a metric that is looked for, beside `progress`. `workers` search parts of long suprema: what comes out
    does not depend on them. `brief`: the verdict, and the gains of what decides; no curves, no other kinds, and nothing
    that explains.
    """
    question = replace(question_of(spec, options, progress, memory), workers=workers, brief=brief)
    return result(_end(question, replace(listeners or Listeners(), progress=question.progress)))


def _end(question: Question, listeners: Listeners) -> Stage | Stopped:
    """How the certification ends."""
    spec = question.spec
    if spec.metric is not None or spec.synthesis is None:
        return answer(counted(question))
    found = synthesise(
        spec,
        spec.synthesis,
        question.options,
        listeners,
        enough=(question.options.conditions or spec.decides) in (None, ALONE.option),
        proofs=question.memory.proofs,
    )
    if found.cut == "interrupted":
        raise KeyboardInterrupt
    question = replace(question, spec=found.spec or spec, synthesis=found.data())
    return answer(counted(question)) if found.reason is None else Stopped(at=question, reason=found.reason)


def synthesise(
    spec: Spec,
    wanted: Synthesis,
    options: Options,
    listeners: Listeners | None = None,
    *,
    table: bool = False,
    enough: bool = False,
    proofs: Proofs | None = None,
) -> Synthesised:
    """A proven metric for a specification, or why there is none; with `table` others over a range of rates beside it.

    At a deadline, and at an interruption, the best that was proven by then is what comes out (`Synthesised.cut`).
    `proofs` of metrics are taken from there, and kept there. `enough`: a metric whose tube needs no adaptation is.
    Raises `SpecError` for what makes the question meaningless, and for a solver that is not installed.
    """
    from tubecert.pipeline.synthesis import SynthesisRun  # solvers, only where they are needed
    from tubecert.synthesis.conic import required

    required(wanted.solver)
    spec = replace(overridden(spec, options), metric=None, synthesis=None)
    sound_time(spec, options, lambda own: [*unsearchable(own), *missing_sections(own, wanted)])
    run = SynthesisRun(spec, wanted, options, listeners or Listeners(), enough=enough, proofs=proofs)
    return run.run(table=table)
