"""The loops of a setting, with their gains: a certificate's, what replaces them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from tubecert.errors import TubecertError
from tubecert.findings import Finding
from tubecert.simulate.loops import DESIGNS, Controller
from tubecert.simulate.problem import LoopGains, LoopProblem
from tubecert.simulate.promise import Kind, kind_for, promise
from tubecert.simulate.setting import Loop, Setting

_LIMIT: Final = 100  # of the greatest radius: what is further away from the plan is not followed any more
_DEGREE: Final = 5  # of the polynomials that geodesics are
_EVEN, _EVEN_DEGREE = 1.01, 3  # where M varies by a factor of less over the tube, cubic ones are as near
CHOSEN: Final = "chosen, not certified"


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What the command line says about gains: which certificate, and what replaces its numbers."""

    source: str = "distance"
    bandwidth: Fraction | None = None
    adaptation_rate: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tuning:
    """The gains of a loop, the kind of certificate they belong to, and whether they are those that it proves.

    `words` say where they come from.
    """

    gains: LoopGains | None
    kind: Kind | None
    certified: bool
    words: str


def loop_of(setting: Setting, controller: Controller, choice: Choice) -> Loop:
    """A loop with its gains; raises `TubecertError` if there are none for it."""
    if setting.model.gained:
        raise TubecertError([_known_gains_only(setting)])
    tuning = _tuning(setting, controller, choice)
    covered = DESIGNS[controller].terms.predicts and tuning.certified
    problem = LoopProblem(
        model=setting.model,
        plan=setting.plan,
        controller=controller,
        horizon=setting.horizon,
        times=setting.times,
        gains=tuning.gains,
        limit=_LIMIT * setting.greatest_radius,
        degree=_EVEN_DEGREE if _even(setting) else _DEGREE,
        P=setting.S.T @ setting.S,
        E=setting.E,
        rest=setting.rest,
    )
    promised = promise(setting.certified, tuning.kind) if covered and tuning.kind else None
    return Loop(problem=problem, origin=tuning.words, promise=promised)


def _even(setting: Setting) -> bool:
    """Whether a S'S <= M <= A S'S with nearly the same a and A over the tube: geodesics hardly bend there."""
    own = setting.certified
    return own.upper is not None and own.upper <= _EVEN * (own.reach / own.rho) ** 2


def _known_gains_only(setting: Setting) -> Finding:
    return Finding(
        code="TC705",
        message="parameters known by ranges stand in B, and the loops are stated for a known B",
        location=setting.spec.location("system.B"),
        help="give each of them one value: --set system.parameters.NAME=VALUE",
    )


def _tuning(setting: Setting, controller: Controller, choice: Choice) -> _Tuning:
    design = DESIGNS[controller]
    if not design.terms.filters:
        return _Tuning(gains=None, kind=None, certified=False, words="no adaptation")
    kind = kind_for(controller, choice.source)
    wanted = {name: getattr(choice, name) for name in ("bandwidth", *design.needs)}
    replaced = {name: float(value) for name, value in wanted.items() if value is not None}
    section = setting.certified.proven(kind.name.key)
    found = {} if section is None else dict(section.recipe)
    missing = [name for name in wanted if name not in {**found, **replaced}]
    if missing:
        raise TubecertError([_no_gains(controller, kind, missing)])
    numbers = {**found, **replaced}
    gains = LoopGains(
        bandwidth=numbers["bandwidth"],
        projection_radius=numbers.get("projection_radius", _radius(setting)),
        predictor_gain=numbers.get("predictor_gain", numbers["bandwidth"]),
        adaptation_rate=numbers.get("adaptation_rate"),
        smooth=_smooth(setting, controller),
    )
    same = all(found.get(name) == value for name, value in replaced.items())
    words = f"certified by {kind.name}" if same else CHOSEN
    return _Tuning(gains=gains, kind=kind, certified=same, words=words)


def _no_gains(controller: Controller, kind: Kind, missing: list[str]) -> Finding:
    options = " and ".join(f"--{name.replace('_', '-')}" for name in missing)
    return Finding(
        code="TC705",
        message=f"{kind.name} certifies no gains for the controller {controller}",
        help=f"choose {options} (then nothing is covered by the certificate), or another --gains",
    )


def _radius(setting: Setting) -> float:
    """R_H where no certificate gives one: Dh, with what the smooth layer needs."""
    smooth = setting.spec.adaptation.smooth
    return setting.uncertainty.h * math.sqrt(1 + float(smooth or 0)) * (1 + 1e-6) or 1.0


def _smooth(setting: Setting, controller: Controller) -> float | None:
    smooth = setting.spec.adaptation.smooth
    return None if smooth is None or not DESIGNS[controller].terms.adapts else float(smooth)
