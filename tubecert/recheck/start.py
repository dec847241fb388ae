"""Claims about the start: the radius of the tube, d0, H0.

Implements: theory (2.6), 2.11. The segment from x*(0) to x0 is cut into pieces; on each, sqrt is concave, so that its
length is at most width times the root of the mean of g(s) = delta'M delta; that is at most g(mid) + w^2 sup|g''|/24.
"""

from __future__ import annotations

from fractions import Fraction
from functools import reduce
from itertools import product

from flint import arb, arb_mat

from tubecert.recheck.balls import Ball, between, exact, length, root, sharp_norm
from tubecert.recheck.cover import CONFIRMED, Boxed, Outcome, prove, stated, together
from tubecert.recheck.curve import Curve, Part
from tubecert.recheck.lipschitz import norms_below
from tubecert.recheck.metric import lower_bound, upper_bound
from tubecert.recheck.place import Place
from tubecert.recheck.program import Program
from tubecert.recheck.specified.numbers import TIME, Numbers, Range
from tubecert.recheck.system import System
from tubecert.recheck.terms import (
    NOUGHT,
    Matrix,
    Term,
    matrix_replaced,
    matrix_slopes,
    number,
    plus,
    variable,
)
from tubecert.recheck.tube import Round, Tube
from tubecert.recheck.wind import adapted, joins

_PIECES = (1, 16, 128, 1024, 4096)
_SHARES = 12
_SHARPER = 1 + Fraction(1, 10**15)
_GAP = 1 + Fraction(1, 500)  # more than the producer's gap
_ALONG = "r#"  # no state can have this name


def offset(place: Place) -> Ball:
    """|S (x0 - x*(0))|, an upper bound, as in theory 2.11."""
    s, coordinates = place.system, place.coordinates
    if s.within is not None:
        stretch = (
            arb(1) if coordinates is None else sharp_norm([[exact(q) for q in row] for row in coordinates.S])
        )
        return stretch * exact(s.within)
    sizes = []
    for point in points(s):
        apart = place.fields.vector([[d] for d in off_plan(point, place.curve)])
        sizes.append(length(Program([d for (d,) in apart], ()).run(())))
    return reduce(arb.max, sizes)


def points(s: System) -> list[Numbers]:
    """x0, or the corners of the box of starts, where everything that is convex in x(0) is largest."""
    if s.box is None:
        assert s.x0 is not None
        return [s.x0]
    return list(product(*(dict.fromkeys(s.box[name]) for name in s.states)))


def off_plan(x0: Numbers, curve: Curve) -> list[Term]:
    """x0 - x*(0), exact."""
    return [number(q) - x for q, x in zip(x0, curve.start, strict=True)]


def radius(place: Place, width: Fraction, lower: Fraction, upper: Fraction) -> Outcome:
    """rho >= sqrt(A/a)|S (x0 - x*(0))| + eps + rho_a for the true a and A over the tube, theory 2.11.

    `width` is eps + rho_a. What is printed are bounds, rounded outward. Where rho is too small for them it may still
    serve for the true values: then bounds that are as much sharper as needed are proven here.
    """
    rho = place.rho
    if lower <= 0 or upper <= 0 or rho <= 0:
        return stated(False, "the radius or a bound of the metric is not positive")
    room, distance = exact(rho - width), offset(place)
    needed = root(exact(upper / lower)) * distance
    if room >= needed:
        return CONFIRMED
    why = f"{float(needed.mid()) + float(width):.9g} is needed"
    if room <= 0 or not needed.is_finite():
        return Outcome(verdict="contradicted" if room < 0 or distance > 0 else "undecided", why=why)
    # A/a is too large by this factor
    excess = Fraction(float((needed / room * (needed / room)).upper())) * _SHARPER
    sharp = _sharpened(place, lower, upper, excess)
    if sharp.holds:
        return sharp
    # if bounds that are weaker by the gap are false at points, rho is too small for the values at these points
    if excess > _GAP**2 and all(
        item.verdict == "contradicted" for item in _bounds(place, lower * _GAP, upper / _GAP)
    ):
        return Outcome(verdict="contradicted", why=why)
    return Outcome(verdict="undecided", why=f"{why} for the bounds of the metric that are printed")


def _sharpened(place: Place, lower: Fraction, upper: Fraction, excess: Fraction) -> Outcome:
    """Whether a larger lower and a smaller upper bound, closer by the factor `excess` together, can be proven.

    What the one cannot bear the other has to: their shares are bisected.
    """
    low, high = Fraction(0), Fraction(1)
    boxes = 0
    for _ in range(_SHARES):
        share = (low + high) / 2
        raised = 1 + (excess - 1) * share
        below, above = _bounds(place, lower * raised, upper * raised / excess)
        boxes += below.boxes + above.boxes
        if below.holds and above.holds:
            return Outcome(verdict="confirmed", boxes=boxes)
        if below.holds == above.holds:
            break
        low, high = (share, high) if below.holds else (low, share)
    return Outcome(verdict="undecided", boxes=boxes)


def _bounds(place: Place, lower: Fraction, upper: Fraction) -> tuple[Outcome, Outcome]:
    """M >= lower S'S and M <= upper S'S over the tube."""
    system, budget, unit = place.system, place.budget, place.fields.unit
    return (
        lower_bound(system, lower, place.tube(), budget, unit),
        upper_bound(system, upper, place.tube(), budget, unit),
    )


def distance(place: Place, limit: Fraction, upper: Fraction) -> Outcome:
    """The segment from x*(0) to x0 is at most `limit` long; with a constant metric, that to every corner, (2.6)."""
    s = place.system
    if s.within is not None:
        known = place.coordinates is None and limit**2 >= upper * s.within**2
        if limit < 0 or known or not s.within:
            return stated(limit >= 0, "it is negative")
        # sqrt(A) r for the A of M in x; a segment that leaves the tube is at least dbar long, which is more than d0
        return upper_bound(s, (limit / s.within) ** 2, place.tube(), place.budget)
    if s.box is not None and not s.flat:
        return _from_centre(place, limit, upper, s.box)
    for point in points(s):
        found = _segment(place, point, limit)
        if not found.holds:
            return found
    return CONFIRMED


def _from_centre(place: Place, limit: Fraction, upper: Fraction, box: dict[str, Range]) -> Outcome:
    """d0 <= the segment to the centre of the box + sqrt(A) r, r its radius: a corner is no further from the centre.

    Theory 1a.3.
    """
    s = place.system
    sides = [box[name] for name in s.states]
    delta = off_plan(tuple((low + high) / 2 for low, high in sides), place.curve)
    first = arb(0)
    if not all(d is NOUGHT for d in delta):
        _, first = _Speed(s, place.curve, delta).over_pieces(_PIECES[-2])
    room = exact(limit) - first.upper()
    square = sum(((high - low) ** 2 / 4 for low, high in sides), start=Fraction(0))
    if not room > 0:
        return Outcome(
            verdict="undecided", why=f"the segment to the centre alone is {float(first.upper()):.9g} long"
        )
    if place.coordinates is None and room * room >= exact(upper * square):
        return CONFIRMED
    sharper = Fraction(float((room * room).lower())) * (1 - Fraction(1, 10**15)) / square
    found = upper_bound(s, sharper, place.tube(), place.budget)
    return CONFIRMED if found.holds else Outcome(verdict="undecided", why=found.why, boxes=found.boxes)


def _segment(place: Place, point: Numbers, limit: Fraction) -> Outcome:
    """The segment from x*(0) to one point."""
    s = place.system
    delta = off_plan(point, place.curve)
    if all(d is NOUGHT for d in delta):
        return stated(limit >= 0, "it is negative")
    speed = _Speed(s, place.curve, delta)
    for count in _PIECES[:1] if s.flat else _PIECES:
        low, high = speed.over_pieces(count)
        if high <= exact(limit):
            return CONFIRMED
        if low > exact(limit):
            return Outcome(verdict="contradicted", why=f"the segment is longer than {float(low.lower()):.9g}")
    return Outcome(verdict="undecided", why=f"the segment's length lies below {float(high.upper()):.9g}")


class _Speed:
    """g(s) = delta'M(x*(0) + s delta) delta and its second derivative."""

    def __init__(self, s: System, curve: Curve, delta: list[Term]) -> None:
        self._n = len(delta)
        clock = variable(_ALONG)
        line = {name: a + clock * d for name, a, d in zip(s.states, curve.start, delta, strict=True)}
        W = matrix_replaced(s.W, line)
        slope = matrix_slopes(W, _ALONG)
        bend = matrix_slopes(slope, _ALONG)
        self._program = Program([e for m in (W, slope, bend) for row in m for e in row], [_ALONG])
        self._delta = arb_mat([[d] for d in Program(delta, ()).run(())])

    def over_pieces(self, count: int) -> tuple[Ball, Ball]:
        """The length of the segment from below and above, (2.6)."""
        low, high, width = arb(0), arb(0), arb(1) / count
        for k in range(count):
            ends = arb(k) / count, arb(k + 1) / count
            try:
                middle, _ = self._at((ends[0] + ends[1]) / 2)
                whole, bend = self._at(between(ends[0].lower(), ends[1].upper()))
            except ZeroDivisionError:
                return arb(0), arb("nan")
            low = low + width * root(whole.lower())
            high = high + width * root(middle + bend.abs_upper() * width * width / 24)
        return low, high

    def _at(self, s: Ball) -> tuple[Ball, Ball]:
        n, out = self._n, self._program.run([s])
        W, slope, bend = (arb_mat(n, n, out[k * n * n : (k + 1) * n * n]) for k in range(3))
        eta = W.solve(self._delta)
        turned = slope * eta
        back = W.solve(turned)
        g = (self._delta.transpose() * eta)[0, 0]
        second = 2 * (turned.transpose() * back)[0, 0] - (eta.transpose() * bend * eta)[0, 0]
        return g, second


def uncertainty(place: Place, limit: Fraction) -> Outcome:
    """|h(0, x(0))| <= limit, and where a bound of |h| is declared, that bound."""
    s, more, known = place.system, adapted(place), _at_first(joins(place))
    beside, outcomes = [] if more is None else [more], []
    if "h" in s.declared:
        room = limit - s.declared["h"]
        parts = beside if known is None else [*beside, known]
        outcomes.append(stated(room >= 0, "it is below the declared bound of |h|"))
        if outcomes[-1].holds and parts:
            outcomes.append(_norms(place, parts, room))
    if s.h is not None:
        at_start = matrix_replaced(s.h, {TIME: NOUGHT})
        own = at_start if known is None else plus(at_start, known)
        outcomes.append(_norms(place, [own, *beside], limit))
    assert outcomes, "h is given, or a bound of it is declared"
    return together(outcomes)


def _at_first(known: Matrix | None) -> Matrix | None:
    """What joins h, at t = 0."""
    return None if known is None else matrix_replaced(known, {TIME: NOUGHT})


def _norms(place: Place, at_start: list[Matrix], limit: Fraction) -> Outcome:
    """The sum of the norms at every x(0)."""
    s = place.system
    if s.x0 is not None:
        point = dict(zip(s.states, map(number, s.x0), strict=True))
        fixed = [matrix_replaced(a, point) for a in at_start]
        return prove(norms_below(fixed, limit), Boxed(s.ranges), place.budget if s.ranges else 1)
    if s.box is not None:
        known = {name: number(low) for name, (low, high) in s.box.items() if low == high}
        free = [matrix_replaced(a, known) for a in at_start]
        return prove(norms_below(free, limit), Boxed({**s.box, **s.ranges}), place.budget)
    assert s.within is not None
    curve = place.curve
    still = curve
    if not curve.ranges:
        still = Curve(curve.start, (), (Part(Fraction(0), arb(0), {}),), None, curve.start)
    around = Tube(still, Round(s.within), s.states, (), s.ranges)
    return prove(norms_below(at_start, limit), around, place.budget)
