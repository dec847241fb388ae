"""What a route of synthesis is asked, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Final, Literal

from tubecert.enclosure.interval import Array
from tubecert.expression import free_symbols
from tubecert.model import ControlAffineModel
from tubecert.progress import Progress
from tubecert.synthesis.family import Choice, Coordinates, MetricFamily, coordinates, input_size

Floor = Literal["identity", "input"]
FLOORS: Final[tuple[Floor, ...]] = ("identity", "input")


@dataclass(frozen=True, slots=True, kw_only=True)
class SynthesisProblem:
    """Find the member of `family` with the least kappa such that on the safe set (n pairs, in the order of the states)

    - floor <= W(x) <= kappa I, where the floor is I (kappa bounds the condition number sup lmax(W)/inf lmin(W)), or
      `input`: B B' <= W (kappa bounds (beta/sqrt(a))^2; W is kept definite by a small multiple of I as well), B being
      measured by its size in these coordinates;
    - N'(-d_f W + f_x W + W f_x' + 2 rate W)N <= 0, N = B_perp(x); `rate` in 1/s, any margin included.

    I is meant in the `coordinates`, which are made of the `half_widths` (without any, of those of the safe set). W and
    the rate of `model` are not used. Above `limit` the answer is of no use, and after so many `rounds` none is asked
    for. `sharp`: kappa is wanted to .1 %. `progress` is told a route's steps.
    """

    model: ControlAffineModel = field(repr=False)
    safe_set: tuple[tuple[Fraction, Fraction], ...]
    family: MetricFamily = field(repr=False)
    rate: float
    floor: Floor = "identity"
    limit: float | None = None
    solver: str = "clarabel"
    coordinates: Choice = "identity"
    half_widths: tuple[Fraction, ...] = ()
    rounds: int | None = None
    sharp: bool = False
    progress: Progress | None = field(default=None, repr=False)

    @property
    def scaled(self) -> Coordinates:
        """The coordinates in which I is meant, B B' is measured and C2 is written."""
        found = coordinates(self.coordinates, self.family, self.safe_set, self.half_widths)
        if self.coordinates == "identity":
            return found
        size = input_size(self.model, found.states, self.safe_set)
        return replace(found, input=size, rate=self.rate)


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """What a route found: nothing in it is believed.

    `coefficients`: V_k as floats, (K, n, n), None if there are none; `kappa`: what the route claims; `bound`: a bound
    of kappa from below for this family as far as the solver may be trusted; `feasible`: the solver's opinion, None if
    it has none; `status`: its words.
    """

    route: str
    coefficients: Array | None
    kappa: float
    bound: float = 0.0
    feasible: bool | None
    status: str
    rounds: int = 1


# the largest that was seen to end has nine states, of which three move; a chain of ten, one that moves
_STATES: Final = 10
_MOVING: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """Slopes depend on `moving` states, in which a box has `vertices`; `entries`: unknown numbers of a constant W."""

    states: int
    entries: int
    moving: int
    vertices: int


def beyond(model: ControlAffineModel) -> Size | None:
    """The size of a search that is out of reach; None if it is not known to be."""
    n = len(model.states)
    if n < _STATES:  # slopes are not asked for in vain
        return None
    moving = len(free_symbols(e for row in (*model.f_x, *model.B) for e in row) & {*model.states})
    if moving < _MOVING:
        return None
    return Size(states=n, entries=n * (n + 1) // 2, moving=moving, vertices=2**moving)
