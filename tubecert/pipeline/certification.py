"""A certification: stage after stage, with what planners and searches propose, until one ends it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from math import isfinite, sqrt
from typing import Any

import numpy as np

from tubecert.certificate.result import Result
from tubecert.claims.advice import MendPlan
from tubecert.claims.family import Reason
from tubecert.conditions.problem import TubeProblem
from tubecert.kinds.table import KINDS, kind_of
from tubecert.lint.codes import NOTABLE_DEFECT
from tubecert.pipeline.checks import missing_parts, sound_time
from tubecert.pipeline.gaps import enclosed
from tubecert.pipeline.listening import tell_gains
from tubecert.pipeline.reasons import input_reasons, obstacle_reasons, reasons
from tubecert.progress import Progress
from tubecert.search.coordinates import Wish, propose
from tubecert.search.proposers import PROPOSERS, Explained, Proposer
from tubecert.spec import Spec, canonical
from tubecert.stages.bounded import Bounded, Enclosed, bound
from tubecert.stages.judged import Judged, deciding, judge_all
from tubecert.stages.metric import ProvenMetric, prove_metric
from tubecert.stages.question import Memory, Options, Question, Stopped, overridden
from tubecert.stages.result import Explanation, Stage, result_of
from tubecert.stages.tube import Planned, TubeFound, asked_half_widths, find_tube, lay, radii, room_of
from tubecert.trajectory.make import remedy
from tubecert.verdict import Verdict


def question_of(
    spec: Spec, options: Options, progress: Progress | None = None, memory: Memory | None = None
) -> Question:
    """The question that options make of a specification; raises `SpecError` if it is meaningless."""
    spec = overridden(spec, options)
    return Question(
        spec=spec,
        options=options,
        time=sound_time(spec, options, missing_parts),
        progress=progress,
        memory=Memory() if memory is None else memory,
    )


def answer(question: Question) -> Stage | Stopped:
    """The last stage that is reached; the first claim that is not proven ends it."""
    steps: tuple[Callable[[Any], Stage | Stopped], ...] = (
        prove_metric,
        plan,
        tube,
        enclosed,
        bound,
        judge,
    )
    stage: Stage | Stopped = question
    for step in steps:
        stage = step(stage)
        if isinstance(stage, Stopped):
            break
    return stage


def result(end: Stage | Stopped) -> Result:
    """The result of a certificate, with what explains it."""
    return result_of(end, explain(end) if isinstance(end, Judged) else Explanation())


def plan(metric: ProvenMetric) -> Planned:
    """The plan, proposed by the planner where the specification asks for one."""
    question = metric.question
    spec, model, task, show = question.spec, question.model, question.spec.trajectory.task, question.progress
    if task is None:
        return lay(metric)
    from tubecert.planner.propose import course_of, knots_of  # only where they are needed

    whole = canonical(spec)
    depends_on = {key: whole[key] for key in ("system", "trajectory")}
    course = question.memory.recall("plan", depends_on, lambda: course_of(spec, task, model, show))
    room = room_of(metric)
    knots = question.memory.recall(
        "knots", question.ground, lambda: knots_of(spec, course, model, room, show)
    )
    return lay(metric, knots)


def tube(planned: Planned) -> TubeFound | Stopped:
    """The tube, in coordinates that a search proposes where the specification asks for some."""
    question = planned.question
    spec = question.spec
    if not spec.tube.auto:
        return find_tube(planned)
    centre = np.array([float(value) for value in planned.plan.enclose(np.zeros(1), np.zeros(1))[0].mid[0]])
    asked = asked_half_widths(question)
    wish = Wish(
        asked=asked,
        width=0.0 if asked is not None else float(sum(radii(question), Fraction(0))),
        apart=np.zeros(len(centre)) if spec.within is not None else np.array(spec.x0, dtype=float) - centre,
        within=float(spec.within or 0),
        box=np.array(spec.safe_set, dtype=float),
        outputs=np.array([output.row for output in spec.outputs], dtype=float).reshape(-1, len(spec.states)),
    )
    return find_tube(planned, propose(question.model, planned.plan, wish))


def judge(bounded: Bounded) -> Judged:
    """The verdict on what every search proposes."""
    problem, question = bounded.problem, bounded.question
    asked = question.options.asked(curve=not question.brief)
    only = [kind_of(key).theorem.recipe for key in deciding(question)] if question.brief else PROPOSERS
    proposals = {}
    for recipe, each in PROPOSERS.items():
        if recipe not in only:
            continue
        tell_gains(bounded.question, recipe)
        proposals[recipe] = each.propose(problem, asked)
    return judge_all(bounded, proposals)


def explain(judged: Judged) -> Explanation:
    """What the gains depend on, and why the verdict is what it is."""
    explained = {kind.key: _explained(judged, kind.key, PROPOSERS[kind.theorem.recipe]) for kind in KINDS}
    told = [reason for key in judged.deciding for reason in reasons(judged.sections[key], explained[key])]
    return Explanation(
        reasons=[*_advised(judged, told), *obstacle_reasons(judged.bounded), *input_reasons(judged)],
        elasticities={
            key: {name: slope for name, slope in each.slopes.items() if isfinite(slope)}
            for key, each in explained.items()
            if each.slopes is not None
        },
    )


def _explained(judged: Judged, key: str, proposer: Proposer) -> Explained:
    """What explains the section of a kind."""
    if judged.question.brief:
        return Explained()
    section = judged.sections[key]

    def at(role: str) -> object:
        found = section.at(role)
        return None if found is None else found.recipe

    return proposer.explain(judged.bounded.problem, at)


def _advised(judged: Judged, told: list[Reason]) -> list[Reason]:
    """Where gains are missing and the plan's defect takes a part of the tube that matters, that is said too."""
    share = defect_share(judged.bounded.problem)
    if judged.bounded.enclosed.tube.plan.allowance is not None:
        return told  # nobody's plan: the specification allows its defect
    if all(reason.verdict is Verdict.CERTIFIED for reason in told) or share < NOTABLE_DEFECT:
        return told
    mend = mending(judged.bounded.enclosed)
    return [
        reason if reason.verdict is Verdict.CERTIFIED else replace(reason, relax=(*reason.relax, mend))
        for reason in told
    ]


def mending(enclosed: Enclosed) -> MendPlan:
    """How far the plan misses the dynamics, and what would mend it."""
    tube, defect = enclosed.tube, enclosed.problem.constants.plan_defect
    return MendPlan(
        defect=defect.above,
        t=None if defect.at is None else defect.at.t,
        share=defect_share(enclosed.problem),
        remedy=remedy(tube.plan, tube.question.model, room_of(tube.planned.metric)),
    )


def defect_share(problem: TubeProblem) -> float:
    """How much of the tube the plan's defect alone takes in the long run: delta/(lambda dbar)."""
    constants = problem.constants
    reach = float(problem.rate) * sqrt(constants.lower.below) * float(problem.rho)
    return constants.plan_defect_metric.above / reach
