"""What recheck says of the text of hand-made controllers: its bounds of their rounding, and their formulas."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import controllers
from controllers import GIVEN, SLOW
from flint import arb_mat, ctx
from tubecert.conditions.hardware import Rounding
from tubecert.export.assembly import assembled
from tubecert.export.controller import Controller
from tubecert.export.folder import exported
from tubecert.recheck.code.about import About
from tubecert.recheck.code.examination import model_of, moves_of, read_by
from tubecert.recheck.code.losses import lost_by
from tubecert.recheck.code.reader import read_code
from tubecert.recheck.continuous import Adapted, OfFamily
from tubecert.recheck.controller import Machine
from tubecert.recheck.controller import OfFamily as OfPlans
from tubecert.recheck.sampling import SampledGains

from tubecert import certificate
from tubecert.recheck.balls import exact, root
from tubecert.recheck.curve import Knots, hermite
from tubecert.recheck.document import read
from tubecert.recheck.specification import read_specification
from tubecert.recheck.system import curve_of, system_of
from tubecert.spec import load_text
from tubecert.spec.canonical import canonical

ANY = Rounding(feedback=Fraction(1), input=Fraction(1), estimate=Fraction(1), prediction=Fraction(1))
DU = Fraction("6.302")  # of the orbit's metric, from above

TEXTS = {
    "orbit": (controllers.CONFIGS / "hardware_orbit.yaml").read_text("utf-8"),
    "turning": controllers.TURNING,
    "path": controllers.PATH,
    "steep": controllers.STEEP,
    "bent": controllers.BENT,
}
LOOPED = {
    "orbit": (controllers.CONFIGS / "two_state_orbit.yaml").read_text("utf-8"),
    "family": controllers.ANY,
}


def in_recheck(name: str) -> Machine:
    """The machine of a hand-made controller, as recheck reads it."""
    kind = name.removeprefix("held_").removeprefix("seldom_").removeprefix("predicting_")
    given = controllers.SLOW if name == "steep" else controllers.GIVEN[name]
    controller = controllers.assembled(given)
    case = _case(TEXTS[kind], given, knotted=kind == "path")
    section = SimpleNamespace(predict=controller.predicts, clip=given.clip)
    return Machine(case, section, given.recipe, held=given.held)


def family_in_recheck(name: str) -> OfPlans:
    """The machine of a hand-made controller of a family, as recheck reads it."""
    given = controllers.of_family(name)
    case = _case(controllers.ANY, given, knotted=False)
    section = SimpleNamespace(predict=False, clip=given.clip)
    return OfPlans(case, section, given.recipe, held=given.held)


def adapted_in_recheck(name: str) -> Adapted:
    """The loop of a hand-made controller of certificate C, as recheck reads it."""
    given = controllers.looped(name)
    own = given.recipe
    gains = SampledGains(own.sample_time, own.bandwidth, own.predictor_gain, own.projection_radius)
    case = _case((TEXTS | LOOPED)[name], given, knotted=name == "path")
    case.metric = SimpleNamespace(lower=SimpleNamespace(below=Fraction(1)))
    case.tube.rho = given.reach
    return (OfFamily if given.boxes else Adapted)(case, gains)


def _case(text: str, given: Any, *, knotted: bool) -> SimpleNamespace:
    data = {"format": certificate.FORMAT, "spec": canonical(load_text(text))}
    read_again = read_specification(read(json.dumps(data), "spec").closed("format", "spec")["spec"])
    system = system_of(read_again)
    knots = None
    if knotted:
        own = controllers.KNOTS
        knots = Knots(t=own.t, x=own.x, u=own.u, held=False)
        curve = hermite(knots, [row[0] for row in system.drift], system.states, system.inputs, own.t[-1])
    else:
        curve = curve_of(read_again, SimpleNamespace(knots=None), system)
    rows = given.coordinates
    S = None if rows is None else tuple(tuple(map(Fraction, row)) for row in rows)
    return SimpleNamespace(
        system=system,
        curve=curve,
        tube=SimpleNamespace(coordinates=S),
        result=SimpleNamespace(plan=SimpleNamespace(knots=knots), specification=read_again),
        bound={"feedback_gain": given.feedback_gain}.__getitem__,
    )


def covered(name: str = "held_orbit", **values: Any) -> Controller:
    """A controller that is about rounding, and may lose whatever it loses."""
    given = SLOW if name == "steep" else GIVEN[name]
    return assembled(
        replace(given, recipe=replace(given.recipe, rounding=(ANY,)), feedback_gain=DU, **values)
    )


def texts(c: Controller, precision: str) -> tuple[str, str]:
    """Header and source."""
    files = exported(c, precision=precision).files
    return files[f"{c.name}.h"], files[f"{c.name}.c"]


def bounds(c: Controller, formulas: Any, files: tuple[str, str]) -> dict[str, float]:
    """Recheck's, by their names; `formulas` is the machine as recheck reads it."""
    with ctx.workprec(128):
        W = arb_mat(formulas.metric).inv()
        about = About(
            curve=formulas.case.curve,
            inputs=len(c.inputs),
            metric=formulas.metric,
            widths=[root(W[i, i]) for i in range(len(c.states))],
            reach=exact(c.reach),
            gain=exact(c.feedback_gain),
            estimate=exact(c.estimate),
            radius=exact(formulas.recipe.clip_radius),
            share=exact(c.share),
            sample_time=c.sample_time,
            held=formulas.held,
            moves=moves_of(formulas, exact(1)) if c.moves else (),  # n_E of noise that is known by its length
            model=model_of(formulas),
            tables=read_by(formulas),
        )
        found = lost_by(read_code(*files), about)
        names = ("feedback", "input", "estimate", *(("prediction",) if c.predicts else ()))
        return {name: float(getattr(found, name).upper()) for name in names}


def predicting(delay: str, *, held: bool) -> tuple[Controller, Machine]:
    """The orbit's controller with a prediction, about rounding, and the machine as recheck reads it."""
    time = max(Fraction(delay), Fraction(1, 500))
    given = GIVEN["held_orbit" if held else "orbit"]
    own = replace(
        given.recipe, delay=Fraction(delay), prediction=Fraction(1, 100), sample_time=time, feedback_time=time
    )
    section = SimpleNamespace(predict=True, clip=given.clip)
    c = assembled(replace(given, recipe=replace(own, rounding=(ANY,)), feedback_gain=DU))
    return c, replace(in_recheck("orbit"), recipe=own, section=section, held=held)


def predicting_path() -> tuple[Controller, Machine]:
    """The same of a plan through knots, whose u* is held."""
    given = GIVEN["predicting_path"]
    c = assembled(replace(given, held=True, recipe=replace(given.recipe, rounding=(ANY,)), feedback_gain=DU))
    section = SimpleNamespace(predict=True, clip=given.clip)
    return c, replace(in_recheck("path"), recipe=given.recipe, section=section, held=True)


def with_a_table() -> tuple[Controller, Machine]:
    """The controller "turning" without its prediction, about rounding, and the machine as recheck reads it."""
    given = GIVEN["turning"]
    own = replace(given.recipe, prediction=None)
    c = assembled(replace(given, recipe=replace(own, rounding=(ANY,)), feedback_gain=DU))
    section = SimpleNamespace(predict=False, clip=given.clip)
    return c, replace(in_recheck("turning"), recipe=own, section=section)
