"""A specification with `hardware` -> a sealed certificate: tables are designed, stages proposed, and both examined.

What is designed and proposed here is untrusted; the verdict is that of `sampled_loop.theorem.check`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Final

import numpy as np

from tubecert.certificate.effective import Effective
from tubecert.certificate.file import digest
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.interval import Array
from tubecert.errors import SpecError
from tubecert.expression.matrix import identity
from tubecert.loop_design.design import Design, NoDesign, design, refuse_unmoved
from tubecert.loop_design.plant import plant_of, space_of
from tubecert.loop_design.proposal import explain, fitting, propose
from tubecert.model import ControlAffineModel, build
from tubecert.planner import propose as planner
from tubecert.progress import Phase, Progress, Step, Unit
from tubecert.sampled_loop.record import Certificate, Claim, Lack, Notes, Result, Source, Tables, seal
from tubecert.sampled_loop.remainders import Remainders
from tubecert.sampled_loop.setting import Loop
from tubecert.sampled_loop.theorem import check, refuted, undefined
from tubecert.spec import Knots, Spec, canonical
from tubecert.trajectory.make import Room, plan_of
from tubecert.verdict import Verdict

_WINDOWS: Final = 256
_DEFECT: Final = 1e-6  # of the safe set in a second: what of a plan's defect is of rounding alone
_TRIES: Final = 4  # designs with ever less room, where a proof needs more than floats


def certify(spec: Spec, report: Progress | None = None) -> Certificate:
    """The certificate of the sampled loop, which does not say yet how it came about (`run`).

    Raises `SpecError` for what makes the question meaningless.
    """
    remainders = ask(spec, report)
    if left := refuted(remainders.loop):
        return seal(replace(_result(remainders.loop), **left._asdict()), Notes(), {})
    if hopeless := tuple(_hopeless(remainders)):
        return seal(replace(_result(remainders.loop), lacks=hopeless), Notes(), {})
    return seal(*_answer(remainders, report), {})


def ask(spec: Spec, report: Progress | None = None) -> Remainders:
    """The loop whose tables are still to be found, with its suprema.

    Its matrices are in the middle of what its Jacobians are along the plan.
    """
    model = build(spec)
    knots = _knots(spec, model, report)
    n, m, k = len(spec.states), len(spec.inputs), len(model.E[0]) if model.E else 0
    A, B, E = (np.zeros((n, size)) for size in (n, m, k))
    about = partial(Loop, spec=spec, model=model, plan=plan_of(spec, model, knots), knots=knots)
    blank = about(A=A, B=B, E=E, slow=False)
    if findings := undefined(blank):
        raise SpecError(findings)
    rough = Remainders(blank, _WINDOWS)
    A, B, E = rough.middle()
    return Remainders(about(A=A, B=B, E=E, slow=rough.steep is not None), _WINDOWS)


def _knots(spec: Spec, model: ControlAffineModel, report: Progress | None) -> Knots | None:
    """The knots of a plan in a file, or the planner's where the specification asks for them."""
    if (table := spec.trajectory.table) is not None:
        return table.knots
    task = spec.trajectory.task
    if task is None:
        return None
    course = planner.course_of(spec, task, model, report)
    widest = min(high - low for low, high in spec.safe_set)
    # what a defect may cost is told by a metric and its rate: lengths in x, and 1/s
    whole = replace(model, W=identity(len(model.states)), rate=Fraction(1))
    room = Room(rho=widest / 100, lower=1.0, effort=Effort(gap=0.05, budget=20_000))
    return planner.knots_of(spec, course, whole, room, report)


def _answer(remainders: Remainders, report: Progress | None) -> tuple[Result, Notes]:
    """Tables, stages and what is proven of them; with less room for the inputs where the proof finds too little."""
    loop = remainders.loop
    plain, narrow = _result(loop), np.ones(loop.inputs)
    for _ in range(_TRIES):
        try:
            found = _tables(remainders, narrow, report)
            inequalities, stages = propose(remainders, found.tables, _told(report, "tube"))
        except NoDesign as error:
            names = loop.model.inputs if error.kind == "inputs" else loop.model.states
            where = "" if error.where is None else names[error.where]
            lack = Lack(kind=error.kind, where=where, needed=error.needed, allowed=error.allowed)
            if error.kind == "no_fixed_point" and error.where is not None and error.allowed is not None:
                # without what is not linear
                beyond = error.allowed - float(space_of(remainders)[error.where])
                lack = lack if beyond < 0 else Lack(kind="safe_set", where=where, needed=beyond)
            missed = (remainders.defect > _DEFECT * space_of(remainders)).any()
            return replace(plain, lacks=(lack,)), Notes(missed=fitting(loop) if missed else None)
        checked = check(loop, found.tables, stages, inequalities.recipe)
        over = {lack.where: lack for lack in checked.lacks if lack.kind == "inputs"}
        proposed = replace(plain, controller=found.tables, tube=stages, recipe=inequalities.recipe)
        result = replace(proposed, **checked._asdict())
        if not over or loop.spec.controller == "none":
            break
        narrow *= [
            0.98 * own.allowed / own.needed if (own := over.get(name)) and own.allowed and own.needed else 1.0
            for name in loop.model.inputs
        ]
    return result, explain(inequalities, stages, found.evaluations)


def _hopeless(remainders: Remainders) -> Iterator[Lack]:
    """What no controller could mend: a start outside of all that is allowed, a plan beyond the limits."""
    loop = remainders.loop
    wishes, limits = dict(loop.spec.tube.half_widths), dict(loop.spec.limits)
    for name, reach, space in zip(loop.model.states, loop.start.reach, space_of(remainders), strict=True):
        most = min(space, float(wishes.get(name, np.inf)))
        if reach >= most:
            yield Lack(kind="start", where=name, needed=float(reach), allowed=float(most))
    for name, low, high in zip(loop.model.inputs, *remainders.inputs_range, strict=True):
        least, most = map(float, limits.get(name, (-np.inf, np.inf)))
        if low < least or high > most:
            end, limit = (low, least) if low < least else (high, most)
            yield Lack(kind="plan", where=name, needed=float(end), allowed=limit)


def _told(report: Progress | None, name: str) -> Callable[[int, object], None] | None:
    if report is None:
        return None
    return lambda count, _: report(Step(phase=Phase.LOOP, name=name, count=count, unit=Unit.STEPS))


def _tables(remainders: Remainders, narrow: Array, report: Progress | None) -> Design:
    """What is designed; no controller has tables of nothing, and for ever every mode has to die away."""
    loop = remainders.loop
    if loop.spec.controller != "none":
        return design(plant_of(remainders, narrow), _told(report, "controller"))
    n, m = loop.states, loop.inputs
    if loop.horizon is None:
        half = np.array([float(high - low) / 2 for low, high in loop.spec.safe_set])
        refuse_unmoved(loop.A * half / half[:, None], np.zeros((n, 1)))
    none = Tables(*map(np.zeros, ((0, 0), (0, n), (m, 0), (m, n))))
    return Design(none, np.zeros(n), np.zeros(m), evaluations=0)


def _result(loop: Loop) -> Result:
    """What is asked, before anything is found."""
    spec, effective = loop.spec, canonical(loop.spec)
    return Result(
        verdict=Verdict.UNDECIDED,
        spec=Source(
            effective=Effective.of(effective),
            effective_hash=digest(effective),
            file_hash="sha256:" + hashlib.sha256(spec.source.encode()).hexdigest(),
            settings=dict(spec.settings),
        ),
        claim=Claim(horizon=loop.horizon, afterwards=loop.afterwards, hold=loop.hold),
        planned=loop.knots,
        nominal=loop.nominal,
    )
