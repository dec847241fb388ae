"""A specification with `hardware` -> a sealed certificate: tables are designed, stages proposed, and both examined.

What is designed and proposed here is untrusted; the verdict is that of `sampled_loop.theorem.check`.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from fractions import Fraction
from typing import Final

import numpy as np

from tubecert.certificate.effective import Effective
from tubecert.certificate.file import digest
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.interval import Array
from tubecert.errors import SpecError
from tubecert.expression.matrix import identity
from tubecert.findings import Finding
from tubecert.libraries import versions
from tubecert.loop_design.design import Design, design
from tubecert.loop_design.plant import Plant
from tubecert.loop_design.proposal import NoTubeError, propose
from tubecert.loop_design.shares import explain
from tubecert.loop_design.surrogate import fitted
from tubecert.loop_design.unfound import NoDesign
from tubecert.model import ControlAffineModel, build, domain_findings
from tubecert.planner import propose as planner
from tubecert.progress import Phase, Progress, Step, Unit
from tubecert.sampled_loop.file import seal
from tubecert.sampled_loop.record import (
    Certificate,
    Claim,
    HexMatrix,
    Lack,
    Nominal,
    Notes,
    PlanKnots,
    Result,
    Source,
)
from tubecert.sampled_loop.remainders import Remainders
from tubecert.sampled_loop.setting import Controller, Loop
from tubecert.sampled_loop.theorem import check
from tubecert.spec import Knots, Spec, canonical
from tubecert.trajectory.make import Room, plan_of
from tubecert.verdict import Verdict

_WINDOWS: Final = 256
_FEW: Final = 48  # windows for a search
_TRIES: Final = 4  # designs with ever less room, where a proof needs more than floats
_SHARE: Final = 0.05  # of the safe set: where the remainder is fitted
_ROOM: Final = 1.0  # of an input without limits, there


def certify(
    spec: Spec,
    *,
    settings: Mapping[str, str] | None = None,
    report: Progress | None = None,
    command: str = "tubecert.certify",
) -> Certificate:
    """The certificate of the sampled loop; raises `SpecError` for what makes the question meaningless."""
    started, clock = datetime.now(UTC), time.perf_counter()
    question = ask(spec, report)
    result, notes = _answer(question, dict(settings or {}), report)
    run = {
        "command": command,
        "started": started.isoformat(timespec="seconds"),
        "seconds": round(time.perf_counter() - clock, 3),
        "versions": versions(),
    }
    return seal(result, notes, run)


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """The loop whose tables are still to be found, and its suprema."""

    loop: Loop
    remainders: Remainders


def ask(spec: Spec, report: Progress | None = None) -> Question:
    """The loop of a specification, with matrices in the middle of what its Jacobians are along the plan."""
    model = build(spec)
    knots = _knots(spec, model, report)
    n, m, k = len(spec.states), len(spec.inputs), len(model.E[0]) if model.E else 0
    blank = Loop(
        spec=spec,
        model=model,
        plan=plan_of(spec, model, knots),
        knots=None
        if knots is None
        else PlanKnots(t=knots.t, x=knots.x, u=knots.u, interpolation=knots.interpolation),
        A=np.zeros((n, n)),
        B=np.zeros((n, m)),
        E=np.zeros((n, k)),
        slow=False,
    )
    _refuse(blank)
    rough = Remainders(blank, _WINDOWS)
    A, B, E = rough.middle()
    loop = replace(blank, A=A, B=B, E=E, slow=rough.smooth)
    return Question(loop=loop, remainders=Remainders(loop, _WINDOWS))


def _refuse(loop: Loop) -> None:
    """Raises `SpecError` for what no theorem is about."""
    spec = loop.spec
    try:
        times = loop.times
    except ValueError:
        text = "h depends on t for ever, without a period that can be seen"
        raise SpecError(
            [_finding(spec, "TC204", "uncertainty.h", text, "give trajectory.horizon, in s")]
        ) from None
    findings = domain_findings(spec, times, Effort(budget=200_000))
    if findings:
        raise SpecError(findings)
    if not loop.goes_on():
        text = (
            "the plan does not repeat: its ends differ, or its period is longer than the horizon or unknown"
        )
        help = "leave out afterwards, or give a plan whose period is not longer than trajectory.horizon"
        raise SpecError([_finding(spec, "TC204", "trajectory.afterwards", text, help)])


def _finding(spec: Spec, code: str, path: str, message: str, help: str) -> Finding:
    return Finding(code=code, message=message, location=spec.location(path), help=help)


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


def _answer(question: Question, settings: Mapping[str, str], report: Progress | None) -> tuple[Result, Notes]:
    """Tables, stages and what is proven of them; with less room for the inputs where the proof finds too little."""
    loop = question.loop
    plain = _result(loop, settings)
    notes = Notes()
    if hopeless := list(_hopeless(question)):
        return replace(plain, lacks=tuple(hopeless)), notes
    narrow = np.ones(loop.inputs)
    for _ in range(_TRIES):
        try:
            found = _tables(question, narrow, report)
            tables = Controller(found.F, found.G, found.M, found.N)
            inequalities, stages = propose(question.remainders, tables, _told(report, "tube"))
        except NoDesign as error:
            lack = Lack(
                kind=error.kind, where=_named(loop, error), needed=error.needed, allowed=error.allowed
            )
            return replace(plain, lacks=(lack,)), notes
        except NoTubeError as error:
            wide = int(np.argmax(error.W / _half(loop)))
            lack = Lack(kind="no_fixed_point", where=loop.model.states[wide])
            return replace(plain, lacks=(lack,)), notes
        checked = check(loop, tables, stages, inequalities.recipe, inequalities)
        notes = explain(inequalities, stages, found.evaluations)
        over = {lack.where: lack for lack in checked.lacks if lack.kind == "inputs"}
        result = replace(
            plain,
            verdict=checked.verdict,
            controller=tables.record(),
            tube=stages,
            inputs=checked.inputs,
            clearance=checked.clearance,
            recipe=inequalities.recipe,
            lacks=checked.lacks,
        )
        if not over or loop.spec.controller == "none":
            break
        narrow *= [
            0.98 * own.allowed / own.needed if (own := over.get(name)) and own.allowed and own.needed else 1.0
            for name in loop.model.inputs
        ]
    return result, notes


def _hopeless(question: Question) -> Iterator[Lack]:
    """What no controller could mend: a start outside of all that is allowed, a plan beyond the limits."""
    loop, own = question.loop, question.remainders
    wishes = dict(loop.spec.tube.half_widths)
    states = zip(loop.model.states, loop.start.reach, _space(loop, own), strict=True)
    for name, reach, space in states:
        most = min(space, float(wishes.get(name, np.inf)))
        if reach >= most:
            yield Lack(kind="start", where=name, needed=float(reach), allowed=float(most))
    limits = dict(loop.spec.limits)
    for name, low, high in zip(loop.model.inputs, *own.inputs_range, strict=True):
        least, most = map(float, limits.get(name, (-np.inf, np.inf)))
        if low < least or high > most:
            end, limit = (low, least) if low < least else (high, most)
            yield Lack(kind="plan", where=name, needed=float(end), allowed=limit)


def _half(loop: Loop) -> Array:
    return np.array([float(high - low) / 2 for low, high in loop.spec.safe_set])


def _named(loop: Loop, error: NoDesign) -> str:
    names = loop.model.inputs if error.kind == "inputs" else loop.model.states
    return names[error.where] if isinstance(error.where, int) else str(error.where or "")


def _told(report: Progress | None, name: str) -> Callable[[int, object], None] | None:
    if report is None:
        return None
    return lambda count, _: report(Step(phase=Phase.LOOP, name=name, count=count, unit=Unit.STEPS))


def _tables(question: Question, narrow: Array, report: Progress | None) -> Design:
    """What is designed; no controller has tables of nothing."""
    loop = question.loop
    n, m = loop.states, loop.inputs
    if loop.spec.controller == "none":
        return Design(
            F=np.zeros((0, 0)),
            G=np.zeros((0, n)),
            M=np.zeros((m, 0)),
            N=np.zeros((m, n)),
            W=np.zeros(n),
            U=np.zeros(m),
            evaluations=0,
        )
    return design(plant_of(question, narrow), _told(report, "controller"))


def plant_of(question: Question, narrow: Array) -> Plant:
    """The error equation in floats, with `narrow` (m,) of the room that the inputs have."""
    loop, own = question.loop, question.remainders
    n = loop.states
    low, high = own.inputs_range
    limits = dict(loop.spec.limits)
    room = np.array(
        [
            min(float(limits[name][1]) - high[j], low[j] - float(limits[name][0]))
            if name in limits
            else np.inf
            for j, name in enumerate(loop.model.inputs)
        ]
    )
    room = np.where(room > 0, room * narrow, 0.0)
    sizes = own.sizes(np.zeros(n))
    winds = loop.sudden
    asked = dict(loop.spec.tube.half_widths)
    return Plant(
        A=loop.A,
        B=loop.B,
        H=loop.H,
        E=np.hstack([np.zeros((n, 0)), *(columns for columns, _ in winds)]),
        sample_time=float(loop.sample_time),
        delay=float(loop.delay),
        noise=loop.noise.each,
        noise_ball=loop.noise.length,
        magnitude=sizes.size,
        rate=sizes.rate,
        eta_start=sizes.first,
        wind=np.concatenate([np.zeros(0), *(size.each for _, size in winds)]),
        wind_ball=len(winds) == 1 and winds[0][1].length,
        room=room,
        wishes=np.array([float(asked.get(name, np.inf)) for name in loop.model.states]),
        space=_space(loop, own),
        start=loop.start.reach,
        remainder=fitted(Remainders(loop, _FEW), _reach(loop, room)),
    )


def _space(loop: Loop, remainders: Remainders) -> Array:
    """How far the plan is from the ends of the safe set, (n,)."""
    ends = np.array([(float(low), float(high)) for low, high in loop.spec.safe_set])
    x = remainders.cells.x
    room = np.minimum(ends[:, 1] - x.hi.max(axis=0), x.lo.min(axis=0) - ends[:, 0])
    return np.asarray(np.maximum(room, 1e-300))


def _reach(loop: Loop, room: Array) -> Array:
    return np.concatenate([_SHARE * 2 * _half(loop), np.where(np.isfinite(room) & (room > 0), room, _ROOM)])


def _result(loop: Loop, settings: Mapping[str, str]) -> Result:
    """What is asked, before anything is found."""
    spec = loop.spec
    effective = canonical(spec)
    return Result(
        verdict=Verdict.UNDECIDED,
        spec=Source(
            effective=Effective.of(effective),
            effective_hash=digest(effective),
            file_hash="sha256:" + hashlib.sha256(spec.source.encode()).hexdigest(),
            settings=settings,
        ),
        claim=Claim(horizon=loop.horizon, afterwards=loop.afterwards, hold=loop.hold),
        planned=loop.knots,
        nominal=Nominal(A=HexMatrix(loop.A), B=HexMatrix(loop.B), E=HexMatrix(loop.E)),
    )
