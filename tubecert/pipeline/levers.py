"""The knobs of a specification that could help where it is not certified, and the specification with each turned.

In: a specification and the plan's start. Out: `Lever`s, each with the values to try. Untrusted: what a turned
specification comes to is for a certification to say.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf, isfinite, sqrt

from tubecert.claims.advice import Knob
from tubecert.conditions.decimals import round_down, round_up
from tubecert.expression import Expression, to_text
from tubecert.spec import Spec
from tubecert.spec.types import Bounds, Term

_DIGITS = 2  # of a value that is advised
_MOST_TERMS = 4  # of the h of one input that are told apart
_NEAR = 1.1  # a change that is this near to the least is the least
_NARROWER = (Fraction(1, 2),)
_WIDER = (Fraction(2), Fraction(4))
_LESS = (Fraction(1, 2), Fraction(1, 10))
_TOWARDS = (Fraction(1, 2), Fraction(0))
_INSIDE = 0.9  # of the tube, for a start that is far outside
_STEEPER = Fraction(1005, 1000)  # what a metric must support beyond its rate


@dataclass(frozen=True, slots=True, kw_only=True)
class Lever:
    """A knob that stands at `now`, the values to try until one serves, and the specification with it `turned`.

    `input` and `term` as in `TurnKnob`; `steps`: whether values in between mean anything; `same_tube`: whether
    it changes nothing but h.
    """

    knob: Knob
    now: Fraction
    tries: tuple[Fraction, ...]
    turned: Callable[[Fraction], Spec]
    input: str | None = None
    term: str | None = None
    steps: bool = True
    same_tube: bool = False

    def between(self, good: Fraction, bad: Fraction) -> Fraction | None:
        """A value halfway, a short decimal nearer to the good one; None where they are close enough."""
        low, high = sorted((good, bad))
        if not self.steps or high <= _NEAR * low:
            return None
        middle = sqrt(low * high) if low else float(high) / 2
        value = shorter(middle, below=good < bad)
        return value if low < value < high else None


def shorter(value: Fraction | float, *, below: bool, digits: int = _DIGITS) -> Fraction:
    """A decimal of a few digits beside a value."""
    return round_down(value, digits) if below else round_up(value, digits)


def smaller_tube(spec: Spec, rates: bool) -> Iterator[Lever]:
    """A narrower tube; rho_a apart where the theorem splits the tube by `rates`."""
    yield from _tube(spec, _NARROWER, rates)


def wider_tube(spec: Spec, rates: bool) -> Iterator[Lever]:
    """A wider one."""
    yield from _tube(spec, _WIDER, rates)


def nearer_start(spec: Spec, middle: Sequence[float], share: float = 1.0) -> Iterator[Lever]:
    """A start nearer to the plan, which starts at `middle`; `share` of the tube is what it takes, if that is known."""
    centre = tuple(Fraction(repr(value)) for value in middle)

    def moved(factor: Fraction) -> Spec:
        if spec.within is not None:
            return replace(spec, within=spec.within * factor)
        box = tuple(
            (c + factor * (low - c), c + factor * (high - c))
            for c, (low, high) in zip(centre, spec.start_box, strict=False)
        )
        x0 = tuple(c + factor * (value - c) for c, value in zip(centre, spec.x0, strict=True))
        return replace(spec, x0=x0, start_box=box)

    apart = any(abs(float(a) - b) > 1e-9 for a, b in zip(spec.x0, middle, strict=True))
    if spec.within is not None or spec.start_box or apart:
        tries: tuple[Fraction, ...] = _TOWARDS if spec.within is None and not spec.start_box else _LESS
        if 1 / tries[0] < share < inf:  # half the way is outside of the tube
            inside = shorter(_INSIDE / share, below=True)
            tries = (inside, *(value for value in tries if value < inside))
        yield Lever(knob="start", now=Fraction(1), tries=tries, turned=moved)


def less_uncertainty(spec: Spec) -> Iterator[Lever]:
    """All of h smaller; by the user's own expression, where it has a single term."""
    terms = list(_terms(spec))
    same = spec.uncertainty.bounds is None
    if len(terms) == 1:
        yield from each_term_less(spec)
    else:
        yield replace(less_of_all(spec), same_tube=same)


def each_term_less(spec: Spec) -> Iterator[Lever]:
    """Each term of h smaller, by the user's own expression; none where bounds are declared of their sum."""
    for i, part in _terms(spec):
        yield replace(
            _of_uncertainty(lambda factor, i=i, part=part: _with_term(spec, i, part, factor)),  # type: ignore[misc]
            input=spec.inputs[i],
            term=to_text(part),
            same_tube=True,
        )


def less_of_all(spec: Spec) -> Lever:
    """All of h smaller."""
    return _of_uncertainty(lambda factor: with_uncertainty(spec, factor))


def _of_uncertainty(turned: Callable[[Fraction], Spec]) -> Lever:
    return Lever(knob="uncertainty", now=Fraction(1), tries=_LESS, turned=turned)


def other_parts(spec: Spec, largest_rate: float | None) -> Iterator[Lever]:
    """A faster rate where the metric supports it, a weaker wind, a family of better plans."""
    metric, wind, plan = spec.metric, spec.disturbance, spec.trajectory
    if metric is not None and largest_rate is not None and largest_rate > _STEEPER * metric.rate:
        doubled = [shorter(factor * metric.rate, below=False) for factor in _WIDER]
        most = shorter(largest_rate, below=True, digits=3) if isfinite(largest_rate) else doubled[-1]
        yield Lever(
            knob="rate",
            now=metric.rate,
            tries=tuple(rate for rate in (*doubled, most) if metric.rate < rate <= most),
            turned=lambda rate: replace(spec, metric=replace(metric, rate=rate)),
        )
    if wind is not None and wind.bound:
        yield Lever(
            knob="wind",
            now=wind.bound,
            tries=_values(wind.bound, _LESS),
            turned=lambda bound: replace(spec, disturbance=replace(wind, bound=bound)),
        )
    if (bundle := plan.bundle) is not None and bundle.defect:
        yield Lever(
            knob="defect",
            now=bundle.defect,
            tries=_values(bundle.defect, _LESS),
            turned=lambda defect: replace(
                spec, trajectory=replace(plan, bundle=replace(bundle, defect=defect))
            ),
        )


def more_knots(spec: Spec) -> Iterator[Lever]:
    """A plan with twice as many intervals."""
    plan, task = spec.trajectory, spec.trajectory.task
    if task is not None:
        yield Lever(
            knob="knots",
            now=Fraction(task.knots),
            tries=(Fraction(2 * task.knots - 1),),
            turned=lambda knots: replace(
                spec, trajectory=replace(plan, task=replace(task, knots=int(knots)))
            ),
            steps=False,
        )


def with_uncertainty(spec: Spec, factor: Fraction) -> Spec:
    """All of h times a factor, what is declared of it included."""
    own = spec.uncertainty
    h = None if own.h is None else tuple(_with(term, term.expression * factor) for term in own.h)
    return replace(spec, uncertainty=replace(own, h=h, bounds=_declared(own.bounds, factor)))


def _declared(bounds: Bounds | None, factor: Fraction) -> Bounds | None:
    if bounds is None:
        return None
    h, h_x, h_t = (None if each is None else each * factor for each in (bounds.h, bounds.h_x, bounds.h_t))
    return Bounds(h=h, h_x=h_x, h_t=h_t)


def _with_term(spec: Spec, i: int, part: Expression, factor: Fraction) -> Spec:
    """One term of h_i times a factor."""
    h = list(spec.uncertainty.h or ())
    h[i] = _with(h[i], h[i].expression + part * (factor - 1))
    return replace(spec, uncertainty=replace(spec.uncertainty, h=tuple(h)))


def _with(term: Term, expression: Expression) -> Term:
    return replace(term, expression=expression, text=to_text(expression))


def _terms(spec: Spec) -> Iterator[tuple[int, Expression]]:
    """(input, term): the summands of every h_i, or h_i itself where there are many."""
    if spec.uncertainty.h is None or spec.uncertainty.bounds is not None:
        return
    for i, term in enumerate(spec.uncertainty.h):
        whole = term.expression
        parts = _summands(whole)
        if not whole.is_constant or whole.fraction:
            yield from ((i, part) for part in (parts if len(parts) <= _MOST_TERMS else [whole]))


def _summands(e: Expression) -> list[Expression]:
    return [part for arg in e.args for part in _summands(arg)] if e.op == "add" else [e]


def _tube(spec: Spec, factors: tuple[Fraction, ...], rates: bool) -> Iterator[Lever]:
    own = spec.tube
    if own.half_widths:
        yield Lever(
            knob="half_widths",
            now=Fraction(1),
            tries=factors,
            turned=lambda factor: with_half_widths(spec, factor),
        )
    if own.epsilon is not None and not own.half_widths:
        yield Lever(
            knob="epsilon",
            now=own.epsilon,
            tries=_values(own.epsilon, factors),
            turned=lambda epsilon: replace(spec, tube=replace(own, epsilon=epsilon)),
        )
    if own.rho_a is not None and rates:
        yield Lever(
            knob="rho_a",
            now=own.rho_a,
            tries=_values(own.rho_a, factors),
            turned=lambda rho_a: replace(spec, tube=replace(own, rho_a=rho_a)),
        )


def with_half_widths(spec: Spec, factor: Fraction) -> Spec:
    """All half-widths times a factor."""
    scaled = tuple((name, width * factor) for name, width in spec.tube.half_widths)
    return replace(spec, tube=replace(spec.tube, half_widths=scaled))


def _values(now: Fraction, factors: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Short decimals on the far side of each factor."""
    return tuple(shorter(now * factor, below=factor < 1) for factor in factors)
