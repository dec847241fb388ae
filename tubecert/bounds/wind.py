"""What acts beside the known drift and the inputs: a wind E w, and parameters of which only ranges are known.

What the inputs can reach of it, B^+ E w (where w has a rate) and B^+ (f(x, theta) - f0(x)), is a part of the
uncertainty h; the rest pushes. In: suprema over a tube. Out: the constants of both, in the coordinates of the tube.
Trusted: yes. Implements: theory section 7.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from tubecert.bounds.constants import Constant, ResidualConstants, WindConstants
from tubecert.bounds.start import InitialState
from tubecert.bounds.suprema import Suprema
from tubecert.coordinates import Fields
from tubecert.enclosure.interval import Interval
from tubecert.enclosure.pencil import Pencil
from tubecert.expression import ZERO, Expression, constant, derivatives, free_symbols, is_zero
from tubecert.expression.matrix import Matrix, column, combine, multiply, transpose
from tubecert.model import TIME

Entries = tuple[Expression, ...]


@dataclass(frozen=True)
class Beside:
    """E and f(x, theta) - f0(x) in the coordinates of the tube, each split by B^+; what vanishes is zero exactly."""

    fields: Fields

    @cached_property
    def reached(self) -> Matrix:
        """B^+ E, (m, k): what of the wind an input can make; empty without wind."""
        return self._split(self.fields.model.E)[0]

    @cached_property
    def unreached(self) -> Matrix:
        """(I - B B^+) E, (n, k)."""
        return self._split(self.fields.model.E)[1]

    @cached_property
    def known(self) -> Entries:
        """What of unknown parameters joins h, B^+ (f(x, theta) - f0(x)), (m,); empty without any."""
        return tuple(row[0] for row in self._split(self._unknown_drift)[0])

    @cached_property
    def residual(self) -> Matrix:
        """(I - B B^+)(f(x, theta) - f0(x)), (n, 1)."""
        return self._split(self._unknown_drift)[1]

    @property
    def _unknown_drift(self) -> Matrix:
        model = self.fields.model
        return combine(1, column(model.drift), -1, column(model.f)) if model.drift else ()

    def _split(self, field: Matrix) -> tuple[Matrix, Matrix]:
        """B^+ v and v - B B^+ v of fields v, the columns of a matrix."""
        if not field:
            return (), ()
        fields = self.fields
        own = fields.of_vector(field)
        reached = _exact(multiply(fields.B_pinv, own))
        return reached, _exact(combine(1, own, -1, multiply(fields.B, reached)))

    @property
    def blown(self) -> Matrix:
        """B^+ E times the bound of |w|, where B^+ E w is a part of h; empty where it is not."""
        model = self.fields.model
        if not model.E or model.wind_bound is None or model.wind_rate is None or _vanishes(self.reached):
            return ()
        return _times(model.wind_bound, self.reached)

    @property
    def rate(self) -> Fraction:
        """The bound of |w'|."""
        return self.fields.model.wind_rate or Fraction(0)

    @property
    def joins_uncertainty(self) -> bool:
        """Whether h is more than the specification's own."""
        return bool(self.blown) or any(e is not ZERO for e in self.known)


def _exact(rows: Matrix) -> Matrix:
    """Entries that are proven to vanish, written as 0."""
    return tuple(tuple(ZERO if is_zero(e) is True else e for e in row) for row in rows)


def _vanishes(rows: Matrix) -> bool:
    return all(e is ZERO for row in rows for e in row)


def beside_of(suprema: Suprema) -> Beside:
    """What joins h in the loop of a plan."""
    return Beside(suprema.fields)


def wind_constants(suprema: Suprema, beta: Constant) -> WindConstants | None:
    """What E w does per |w|; None without wind. `beta` is that of the tube.

    The push is the smaller of sup smax(Theta E) and beta eps_w + sup smax(Theta (I - B B^+) E): (7.2).
    """
    model, beside = suprema.model, Beside(suprema.fields)
    if not model.E:
        return None
    if model.wind_rate is not None:
        return WindConstants(
            push=_push(suprema, "wind_push", beside.unreached),
            size=suprema.norms("wind_size", [beside.unreached]),
            explained=Constant.exactly(0.0),
        ).printable()
    whole = suprema.fields.of_vector(model.E)
    push, size = _push(suprema, "wind_push", whole), suprema.norms("wind_size", [whole])
    explained = Constant.exactly(0.0)
    if not _vanishes(beside.reached):
        explained = suprema.norms("wind_explained", [beside.reached])
        split = _sum(_product(beta, explained), _push(suprema, "wind_push", beside.unreached))
        push = Constant(
            below=min(push.below, split.below),
            above=min(push.above, split.above),
            at=push.at if push.above <= split.above else None,
        )
    return WindConstants(push=push, size=size, explained=explained).printable()


def residual_constants(suprema: Suprema) -> ResidualConstants | None:
    """What unknown parameters do that no input can; None if all are known."""
    rest = Beside(suprema.fields).residual
    if not rest:
        return None
    return ResidualConstants(
        push=_push(suprema, "residual_push", rest), size=suprema.norms("residual_size", [rest])
    ).printable()


def _push(suprema: Suprema, name: str, field: Matrix) -> Constant:
    """sup smax(Theta G), the root of the largest eigenvalue of the pencil (G G', W)."""
    if _vanishes(field):
        return Constant.exactly(0.0)
    return suprema.root_of(name, Pencil(multiply(field, transpose(field)), suprema.fields.W))


def uncertainty_constants(
    suprema: Suprema, start: InitialState, declared: Mapping[str, Constant]
) -> dict[str, Constant]:
    """The constants of h with what joins it: h + B^+ (f(x, theta) - f0(x)) + B^+ E w, (7.1).

    What is declared is about the specification's own h.
    """
    beside = beside_of(suprema)
    known = beside.known or (ZERO,) * len(suprema.model.inputs)
    total, blown = joined(suprema)

    def size(name: str, entries: Entries) -> Constant:
        """sup (|v| + |w| |B^+ E|): attained where there is one input."""
        found = suprema.norms(name, [column(entries), *([blown] if blown else [])])
        if not blown or len(entries) == 1:
            return found
        return Constant(below=suprema.norms(name, [column(entries)]).below, above=found.above)

    def grown(first: Constant, second: Constant) -> Constant:
        """The sum bounds; that it is attained is not known."""
        return Constant(below=first.below, above=_sum(first, second).above, at=first.at)

    first, slope, by_time = (declared.get(name) for name in ("h", "h_x", "h_t"))
    whole = size("h", total) if first is None else _sum(first, size("h", known))
    lipschitz = suprema.lipschitz(total) if slope is None else _sum(slope, suprema.lipschitz(known))
    if by_time is None:
        in_time = suprema.norms("h_t", [column(derivatives(total, TIME))])
    elif TIME in free_symbols(known):
        in_time = _sum(by_time, suprema.norms("h_t", [column(derivatives(known, TIME))]))
    else:
        in_time = by_time
    if blown:
        lipschitz = grown(lipschitz, suprema.norms("h_x", suprema.fields.slopes(blown)))
        in_time = grown(in_time, suprema.norms("h_t", [_times(beside.rate, beside.reached)]))
    at_start = whole if first is not None else _at_start(suprema, start, total, blown)
    return {"h": whole, "h_x": lipschitz, "h_t": in_time, "h_initial": at_start}


def joined(suprema: Suprema) -> tuple[Entries, Matrix]:
    """H = v + G w/|w|: its entries v without wind, of what is given as expressions, and G (empty without wind).

    (7.1).
    """
    beside, own = beside_of(suprema), suprema.model.h
    known = beside.known or (ZERO,) * len(suprema.model.inputs)
    total = known if own is None else tuple(a + b for a, b in zip(own, known, strict=True))
    return total, beside.blown


def _at_start(suprema: Suprema, start: InitialState, total: Entries, blown: Matrix) -> Constant:
    """H0 of (7.1); attained where there is one input."""
    if not blown:
        return start.largest(suprema, [column(total)])
    found = start.largest(suprema, [column(total), blown])
    own = found if len(total) == 1 else start.largest(suprema, [column(total)])
    return Constant(below=own.below, above=found.above)


def _times(factor: Fraction, rows: Matrix) -> Matrix:
    scale = constant(factor)
    return tuple(tuple(scale * e for e in row) for row in rows)


def _sum(first: Constant, second: Constant) -> Constant:
    total = Interval(first.below, first.above) + Interval(second.below, second.above)
    return Constant(below=float(total.lo), above=float(total.hi), at=first.at)


def _product(first: Constant, second: Constant) -> Constant:
    found = (Interval(first.below, first.above) * Interval(second.below, second.above)).sanitised()
    return Constant(below=float(found.lo), above=float(found.hi))
