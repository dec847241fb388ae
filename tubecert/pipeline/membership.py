"""Whether a plan belongs to a family of plans: x* and u* in its boxes, its defect, its horizon.

Everything is proven over the whole horizon; nothing is decided at samples.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from math import isfinite
from pathlib import Path

from tubecert.digits import near
from tubecert.enclosure.branch_and_bound import Effort, Supremum, supremum
from tubecert.enclosure.objective import SumOfNorms
from tubecert.enclosure.pencil import scalar
from tubecert.errors import SpecError
from tubecert.expression import ZERO, Expression, constant, derivatives, free_symbols
from tubecert.findings import Finding, Severity
from tubecert.model import TIME, ControlAffineModel, build
from tubecert.printable import visible
from tubecert.spec import Bundle, Knots, Spec, canonical, load, load_text
from tubecert.trajectory import Plan
from tubecert.trajectory.make import plan_of
from tubecert.trajectory.pieces import TAU
from tubecert.trajectory.plan import Defect

NO_MEMBER, UNDECIDED = "TC411", "TC412"
_FINE = 1e-9  # relative to the range: how closely a curve is looked at
_GAPS = (0.2, 0.01, 1e-4)  # of the defect, until it is decided


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """One thing that a member has to keep to; None where that could not be decided."""

    kept: bool | None
    words: str

    def finding(self, name: str) -> Finding:
        """That it is not kept, or could not be decided."""
        code, said = NO_MEMBER, f"{name} is no plan of the family"
        help = "make the boxes or the defect of the family larger and certify again, or plan within them"
        if self.kept is None:
            code, said = UNDECIDED, f"could not decide whether {name} is of the family"
            help = "a box or a defect that is larger by a hair decides it"
        return Finding(code=code, message=f"{said}: {self.words}", help=help)


def membership(spec: Spec, family: Spec, name: str) -> list[Finding]:
    """What keeps the plan of `spec` from being one of `family`, or a note that it is one.

    Both have the same states and inputs; the dynamics are those of the family. Raises `ValueError` for a family that is
    none, and for a plan that a planner has still to make.
    """
    bundle = family.trajectory.bundle
    if bundle is None or not spec.trajectory.known:
        raise ValueError("a plan is compared with a family of plans")
    model = build(replace(family, metric=None, synthesis=None))
    plan = plan_of(spec, model)
    if not plan.defined:
        part = _Part(kept=None, words="f or B is not defined at one of its knots")
        return [part.finding(name)]
    if (knots := plan.knots) and len({*zip(knots.x, knots.u, strict=True)}) == 1:
        point = Plan(tuple(map(constant, knots.x[0])), tuple(map(constant, knots.u[0])), plan.horizon)
        if all(row[0] is ZERO for row in point.defect(model)):  # exactly at rest
            plan = point
    parts = [*_horizon(plan, spec, family), *_boxes(plan, family, bundle), *_held(plan, family, bundle)]
    parts.append(_defect(plan, model, bundle.defect))
    missed = [part.finding(name) for part in parts if not part.kept]
    if missed:
        return missed
    message = f"{name} is a plan of the family: {parts[-1].words}"
    help = f"the state must start within {near(family.within or 0)} of where the plan starts"
    return [Finding(code=NO_MEMBER, severity=Severity.NOTE, message=message, help=help)]


def _horizon(plan: Plan, spec: Spec, family: Spec) -> Iterator[_Part]:
    limit = family.trajectory.horizon
    if spec.trajectory.afterwards != "nothing" and not plan.is_constant:
        words = "it goes on after its horizon, and only what is before is proven: leave afterwards out"
        yield _Part(kept=False, words=words)
    if limit is not None and (plan.horizon is None or plan.horizon > limit):
        words = f"it lasts longer than the {near(limit)} s that the family is certified for"
        yield _Part(kept=False, words=words)


def _boxes(plan: Plan, family: Spec, bundle: Bundle) -> Iterator[_Part]:
    """Every state and every input, at both ends of its range."""
    for name, curve, (low, high) in zip(family.states, plan.x, bundle.x, strict=True):
        yield _stays(f"{name}*", curve, plan, high)
        yield _stays(f"{name}*", -curve, plan, -low)
    for j, (name, (low, high)) in enumerate(zip(family.inputs, bundle.u, strict=True)):
        if plan.knots is None or plan.knots.interpolation == "hermite-simpson":
            yield _stays(f"{name}*", plan.u[j], plan, high)
            yield _stays(f"{name}*", -plan.u[j], plan, -low)
        else:  # held or linear between knots: no further out than at one of them
            yield _at_knots(f"{name}*", plan.knots, plan.horizon, [u[j] for u in plan.knots.u], high)
            yield _at_knots(f"{name}*", plan.knots, plan.horizon, [-u[j] for u in plan.knots.u], -low)


def _held(plan: Plan, family: Spec, bundle: Bundle) -> Iterator[_Part]:
    """Beside hardware: |u*'| is within its rate; where there is none, u* changes only when a command begins to act."""
    machine, knots, rates = family.hardware, plan.knots, bundle.input_rate
    if machine is None or (len(set(knots.u)) == 1 if knots else not free_symbols(plan.u)):
        return
    held = knots is not None and knots.interpolation == "hold"
    changes = pairwise(zip(knots.t, knots.u, strict=True)) if knots is not None and held else ()
    jumps = [t for (_, before), (t, after) in changes if before != after and t != plan.horizon]
    if rates is None:
        late = [(t - machine.delayed) / machine.sample_time for t in jumps]
        words = "u* changes while an input is held, which a family without input_rate does not allow"
        yield _Part(kept=held and all(k >= 0 and k.denominator == 1 for k in late), words=words)
    elif held:
        yield _Part(kept=not jumps, words="u* jumps, and input_rate does not allow it")
    else:
        slopes = derivatives(plan.u, TAU if knots else TIME)
        for name, slope, rate in zip(family.inputs, slopes, rates, strict=True):
            yield _stays(f"{name}*'", slope, plan, rate)
            yield _stays(f"{name}*'", -slope, plan, rate)


def _at_knots(
    name: str, knots: Knots, horizon: Fraction | None, values: list[Fraction], limit: Fraction
) -> _Part:
    """Whether all values that are reached are at most a limit; the last one of a held input is not."""
    held, end = knots.interpolation == "hold", knots.t[-1] if horizon is None else horizon
    reached = [value for t, value in zip(knots.t, values, strict=True) if t < end or (t == end and not held)]
    if max(reached) > limit:
        return _exactly(name, max(reached), limit)
    beyond = next((value for t, value in zip(knots.t, values, strict=True) if t > end), limit)
    if beyond > limit and not held:  # the horizon cuts the way there
        return _Part(kept=None, words=f"{name} leaves its range behind the horizon or before it")
    return _Part(kept=True, words="")


def _exactly(name: str, most: Fraction, limit: Fraction) -> _Part:
    words = f"{name} goes {near(most - limit, 3)} beyond its range"
    return _Part(kept=most <= limit, words=words)


def _stays(name: str, curve: Expression, plan: Plan, limit: Fraction) -> _Part:
    """Whether a curve stays below a limit along the plan."""
    if curve.is_constant:
        return _exactly(name, curve.fraction, limit)
    width = _FINE * max(1.0, abs(float(limit)))
    fine = Effort(gap=_FINE, absolute=width)
    found = supremum(scalar(curve, plan.fixed), plan.domain, fine)
    t = plan.moment(found.at)
    where = "" if t is None else f" at t = {near(t, 4)} s"
    return _Part(
        kept=_kept(found, limit),
        words=f"{name} goes {near(max(0.0, found.below - float(limit)), 3)} beyond its range{where}",
    )


def _defect(plan: Plan, model: ControlAffineModel, limit: Fraction) -> _Part:
    p = plan.defect(model)
    if all(row[0] is ZERO for row in p):
        return _Part(kept=True, words="it satisfies the dynamics exactly")
    objective = SumOfNorms([p], plan.fixed)
    domain = Defect.of(plan, model, 0.0, Effort()).domain
    for gap in _GAPS if limit else _GAPS[:1]:  # of what is not exactly 0 closer bounds tell no more
        found = supremum(objective, domain, Effort(gap=gap, absolute=gap * float(limit) or _FINE))
        kept = _kept(found, limit)
        if kept is not None:
            break
    t = plan.moment(found.at)
    where = "" if t is None or kept else f" at t = {near(t, 4)} s"
    size = found.above if kept else found.below
    words = f"it misses x' = f + B u by {'at most' if kept else 'up to'} {near(size, 3)}{where}"
    return _Part(kept=kept, words=f"{words}, {near(limit, 3)} is allowed")


def _kept(found: Supremum, limit: Fraction) -> bool | None:
    """Whether a supremum is at most a limit; None where that is not decided."""
    if isfinite(found.above) and Fraction(found.above) <= limit:
        return True
    return False if isfinite(found.below) and Fraction(found.below) > limit else None


def member(path: str, family: Spec) -> Spec:
    """The specification of a plan in a file that is proven to be one of the family; raises `SpecError` if not."""
    own = member_spec(path, family)
    findings = membership(own, family, visible(path))
    if missed := [item for item in findings if item.severity is Severity.ERROR]:
        raise SpecError(missed)
    return own


def member_spec(path: str, family: Spec) -> Spec:
    """The family's system with one plan; raises `SpecError` if the file has none that fits."""
    if Path(path).suffix.lower() == ".csv":
        bundle, table = family.trajectory.bundle, {"kind": "csv", "file": Path(path).name}
        if family.hardware is not None and bundle is not None and bundle.input_rate is None:
            table["interpolation"] = "hold"
        kept = ("tubecert", "name", "system", "safe_set", "uncertainty")
        own = {key: value for key, value in canonical(family).items() if key in kept} | {"trajectory": table}
        return load_text(json.dumps(own), str(Path(path).with_name("family")))
    spec = load(path)
    if _system(spec) != _system(family):
        message = f"{visible(path)} is about another system than the family"
        help = "states, inputs, parameters, f and B must be the same"
        raise SpecError([Finding(code="TC604", message=message, location=spec.location("system"), help=help)])
    if not spec.trajectory.known:
        message = f"{visible(path)} has no plan that could be compared"
        help = "give a plan with its own x and u: expressions, an equilibrium or a CSV file"
        location = spec.location("trajectory.kind")
        raise SpecError([Finding(code="TC411", message=message, location=location, help=help)])
    return replace(family, trajectory=spec.trajectory)


def _system(spec: Spec) -> object:
    """What must be the same for a plan to be compared: names, f and B."""
    B = [[term.expression for term in row] for row in spec.B]
    return spec.states, spec.inputs, [term.expression for term in spec.f], B
