"""The metric of a design: candidates by a surrogate of theorem H, of which the best few are certified in full.

Where W has to move with the state, or may and few states make it affordable, these are where the weights of sums of
squares begin (`joint`).
In: a specification, with or without a metric. Out: metrics as metric files, with how narrow a tube is proven with each.
Untrusted: a metric is proven before anything is certified with it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from decimal import Context, Decimal
from fractions import Fraction
from math import inf, isfinite
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import Expression, derivative
from tubecert.model import TIME, ControlAffineModel, build
from tubecert.pipeline import Options, certify, question_of
from tubecert.pipeline.climb import slow_scale
from tubecert.pipeline.joint import Joint, Judged, at_point
from tubecert.pipeline.width import Measure, size_of
from tubecert.progress import Phase, Progress, Step
from tubecert.search.metrics import Proposed, Sampled, Surrogate, metrics, sampled_slopes
from tubecert.spec import Spec
from tubecert.spec.metric_file import FORMAT, with_metric_text
from tubecert.stages.memory import Memory
from tubecert.stages.metric import ProvenMetric, prove_metric
from tubecert.trajectory.make import plan_of

_CERTIFIED: Final = 3  # candidates that are certified in full
_MOVING: Final = 2  # the same, of those that move
_DIGITS: Final = Context(prec=5)
_GAP: Final = Fraction(1, 20)
_ROOM: Final = 1.3  # of the tube in which a candidate is certified, over what the surrogate says
_TIMES: Final = 9
_INSTANTS: Final = 200
_LOWER: Final = (1.0, 0.97, 0.9)  # shares of the sampled rate that are tried


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A metric as a text of a metric file, what the surrogate says of it, and what it comes to; None: no proof."""

    text: str
    told: float
    size: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """Every candidate that was certified or tried to be, and the specification's own size, None if it has none."""

    candidates: tuple[Candidate, ...]
    own: float | None

    @property
    def best(self) -> Candidate | None:
        """The candidate of the narrowest proven tube, if it is narrower than the specification's own metric's."""
        proven = [each for each in self.candidates if each.size is not None]
        found = min(proven, key=lambda each: each.size or 0.0, default=None)
        return None if found is None or (self.own is not None and self.own <= (found.size or 0.0)) else found


def search(
    spec: Spec,
    scaled: Callable[[Spec, Fraction], Spec],
    measure: Measure,
    options: Options,
    progress: Progress | None = None,
) -> Found:
    """Metrics for the machine of a specification; `scaled` is it with a tube so many times as wide.

    `ValueError` where there can be none: the machine is not given, or no family of metrics moves with B.
    """
    model = build(replace(spec, metric=None, synthesis=None))
    rough = replace(options, gap=max(options.gap, _GAP), metric=None)
    memory = Memory()
    course = _course(spec, model)
    system = sampled_system(spec, model, course)

    def worth(widths: Array) -> float:
        return measure.of(dict(zip(spec.states, widths, strict=True)), float(np.linalg.norm(widths)))

    own = certify(spec, rough, progress, memory) if spec.metric is not None else None
    given = [] if spec.metric is None else [(_at_centre(build(spec), course), float(spec.metric.rate))]
    tell(progress, "metrics for the machine")
    surrogate = Surrogate(system, worth)
    proposed = metrics(surrogate, [W for W, _ in given], float(slow_scale(model, spec)))
    likely = [each for each in proposed if isfinite(each.widths[0])][:_CERTIFIED]
    starts = [*given, *((each.W, each.rate) for each in likely)]
    trial = Trial(spec=spec, scaled=scaled, measure=measure, options=rough, progress=progress)
    weights = Joint(spec=spec, model=model, measure=measure, options=rough, progress=progress)
    moving = weights.run(starts, course.mean(axis=0))
    still = [trial(each, worth(each.widths)) for each in likely if model.constant_input]
    return Found(
        candidates=(*still, *map(trial.again, moving[:_MOVING])),
        own=None if own is None else size_of(own, measure),
    )


def tell(progress: Progress | None, name: str) -> None:
    """A step without boxes."""
    if progress is not None:
        progress(Step(phase=Phase.DESIGN, name=name))


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """Certifies candidates for a specification."""

    spec: Spec
    scaled: Callable[[Spec, Fraction], Spec]
    measure: Measure
    options: Options
    progress: Progress | None

    def __call__(self, proposed: Proposed, told: float) -> Candidate:
        """A candidate with what is certified with it, in a tube of the size that it should need, or as asked."""
        for share in _LOWER:
            text = _text(proposed, share)
            held = with_metric_text(self.spec, text, "<searched>")
            if isinstance(prove_metric(question_of(held, self.options)), ProvenMetric):
                return Candidate(text=text, told=told, size=self._size(held, told))
        return Candidate(text=_text(proposed, _LOWER[-1]), told=told, size=None)

    def again(self, judged: Judged) -> Candidate:
        """A metric of the search over weights, in a tube of the size that it should need, or as asked."""
        held = with_metric_text(self.spec, judged.text, "<searched>")
        return Candidate(text=judged.text, told=judged.size, size=self._size(held, judged.size))

    def _size(self, held: Spec, told: float) -> float | None:
        asked = {name: float(width) for name, width in self.spec.tube.half_widths}
        ratio = told * _ROOM / self.measure.of(asked, _radius(self.spec))
        likely = (
            Fraction(_DIGITS.create_decimal(Decimal(ratio))) if isfinite(ratio) and ratio > 0 else Fraction(1)
        )
        for scale in dict.fromkeys((likely, Fraction(1))):
            result = certify(self.scaled(held, scale), self.options, self.progress)
            if (size := size_of(result, self.measure)) is not None:
                return size
        return None


def _radius(spec: Spec) -> float:
    """The radius of the tube, without what the start takes, or the widest of its half-widths."""
    if spec.tube.half_widths:
        return float(max(width for _, width in spec.tube.half_widths))
    return float((spec.tube.epsilon or 0) + (spec.tube.rho_a or 0)) or inf


def _text(proposed: Proposed, share: float) -> str:
    """The metric as a metric file, W[0][0] being 1, to five digits."""
    W = proposed.W / proposed.W[0, 0]
    n = len(W)
    rows = [[_decimal(W[min(i, j), max(i, j)]) for j in range(n)] for i in range(n)]
    rate = Context(prec=3).create_decimal(Decimal(float(proposed.rate * share)))
    return json.dumps({"format": FORMAT, "rate": float(rate), "dual_metric": rows}, indent=1) + "\n"


def _decimal(value: float) -> str:
    return f"{_DIGITS.create_decimal(Decimal(float(value))):f}"


def _course(spec: Spec, model: ControlAffineModel) -> Array:
    """Points of the plan, (K, n); of one that is to be planned, its ends."""
    task = spec.trajectory.task
    if task is not None:
        return np.array([task.start, task.target], dtype=float)
    laid = plan_of(spec, model, None)
    end = 0.0 if laid.horizon is None else float(laid.horizon)
    t = np.zeros(1) if laid.is_constant else np.linspace(0.0, np.nextafter(end, 0.0), _TIMES)
    return laid.enclose(t, t)[0].mid


def sampled_system(spec: Spec, model: ControlAffineModel, centres: Array) -> Sampled:
    """A specification as numbers for the surrogate; `ValueError` where the machine is not all given."""
    machine, box = spec.hardware, np.array(spec.safe_set, dtype=float)
    if machine is None or machine.sample_time is None or machine.noise is None:
        raise ValueError("the machine is not given by numbers")
    n, room = len(spec.states), np.minimum(centres - box[:, 0], box[:, 1] - centres).min(axis=0)
    asked = dict(spec.tube.half_widths)
    reach = np.array(
        [float(asked.get(name, 0)) or 0.3 * free for name, free in zip(spec.states, room, strict=True)]
    )
    slopes, near, bends = sampled_slopes(model, centres, np.minimum(reach, room), box)
    noise = machine.noise if isinstance(machine.noise, tuple) else [float(machine.noise) / n**0.5] * n
    gusts = np.array(
        [[float(e.fraction) if e.is_constant else 1.0 for e in row] for row in model.E] or [[0.0]] * n
    )
    wind = float(model.wind_bound or 0)
    h, h_t, h_x, h_0 = _uncertainty(spec, model, centres)
    start = np.zeros(n) if spec.within is not None else np.array(spec.x0, dtype=float) - centres[0]
    return Sampled(
        slopes=slopes,
        near=near,
        bends=bends,
        B=at_point(model.B, model, centres.mean(axis=0)),
        wind=gusts * wind,
        noise=np.array(noise, dtype=float),
        h=h,
        h_t=h_t,
        h_0=h_0,
        h_x=h_x,
        start=start,
        room=np.maximum(room, 1e-9),
        sample_time=float(machine.sample_time),
        delay=float(machine.sample_time if machine.delay is None else machine.delay),
    )


def _uncertainty(spec: Spec, model: ControlAffineModel, centres: Array) -> tuple[float, float, Array, float]:
    """Sizes of h and of its slope in t, its slopes in the states (m, n), and its size at first; by samples."""
    m, n, bounds = len(spec.inputs), len(spec.states), spec.uncertainty.bounds
    if model.h is None:
        size, by_x, by_t = (float(getattr(bounds, key) or 0) for key in ("h", "h_x", "h_t"))
        return size, by_t, by_x * np.eye(m, n), size
    names = (*model.states, TIME)
    end = 10.0 if spec.trajectory.horizon is None else float(spec.trajectory.horizon)
    t = np.linspace(0.0, end, _INSTANTS)
    points = [np.interp(t, np.linspace(0.0, end, len(centres)), column) for column in centres.T]

    def values(entries: Sequence[Expression]) -> Array:
        with np.errstate(all="ignore"):
            return np.nan_to_num(np.abs(Tape(entries, names).run_floats([*points, t], (len(t),))))

    h = np.linalg.norm(values(model.h), axis=0)
    by_t = np.linalg.norm(values([derivative(e, TIME) for e in model.h]), axis=0)
    by_x = values([derivative(e, name) for e in model.h for name in model.states]).max(axis=1).reshape(m, n)
    return float(h.max()), float(by_t.max()), by_x, float(h[0])


def _at_centre(model: ControlAffineModel, centres: Array) -> Array:
    """The metric in the middle of the plan, (n, n)."""
    return at_point(model.W, model, centres.mean(axis=0))
