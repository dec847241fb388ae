"""Random plans of a family: what a loop is made to follow where the specification asks for every plan in its boxes.

A plan is drawn segment by segment: from corner to corner u* is linear, x* follows the dynamics plus a part of the
defect that is allowed, and a segment counts only if x* keeps to its box. Of several the one is taken from which
the box can be kept for longest; where none is left, the last segments are drawn again. Untrusted: that the plan keeps
to boxes and defect is looked at in many points, not proven (`pipeline.membership` does that).
Where a planner is played that replans, a plan is given up half-way for one that starts where it is then.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.errors import TubecertError
from tubecert.findings import Finding
from tubecert.model import TIME, ControlAffineModel
from tubecert.simulate.replanning import Replanned, joined
from tubecert.spec import Knots, Spec
from tubecert.spec.types import Bundle
from tubecert.trajectory import Plan
from tubecert.trajectory.pieces import PiecewisePlan, piecewise_plan

if TYPE_CHECKING:
    from tubecert.simulate.program import Program

P = TypeVar("P")
_SEGMENTS: Final = (4, 40)  # of a plan, from corner to corner of u*
_KNOTS: Final = 400  # of a plan, about
_CANDIDATES: Final = 12  # corners that are tried at once
_AHEAD, _WAYS, _COARSE = 4, 8, 4  # so many segments are looked ahead, with so many inputs and steps each
_AGAIN: Final = 60  # segments that may be drawn again before a new start
_STARTS: Final = 20
_INSIDE: Final = 1e-3  # of a box, which curves between the points that are looked at stay within
_DEFECT: Final = 0.6  # of the limit, added at random: between knots the defect of a cubic is 3/2 of that
_DIGITS: Final = 10**9  # of numbers in a plan
_ROUNDING: Final = 1e-5  # of |x*'|: what a cubic may miss of the dynamics where no defect is allowed


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawing:
    """What plans are drawn for: the dynamics, the boxes as arrays (2, n) and (2, m), how long they last in s.

    `drift`, and `program` with its `memory`, are f + B u of states, inputs and t. `replan`: after so many s a plan is
    given up for a new one; None: never (f is free of t).
    """

    model: ControlAffineModel
    bundle: Bundle
    horizon: Fraction
    P: Array
    U: Array
    drift: Tape
    program: Program
    memory: Array
    replan: Fraction | None = None

    def speed(self, t: float | Array, x: Array, u: Array) -> Array:
        """f(t, x) + B(x) u for points (N, n) and (N, m), at one time or at N."""
        return np.asarray(self.drift.run_floats([*x.T, *u.T, np.broadcast_to(t, (len(x),))], (len(x),)).T)

    def walk(
        self, begin: float, x: Array, u: tuple[Array, Array], p: Array, length: float, steps: int
    ) -> Array:
        """x* (N, steps + 1, n) from `begin` on over a segment of a linear u* and a defect p, by RK4."""
        from tubecert.simulate.walking import Segment, trial, walk

        path = np.empty((len(x), steps + 1, x.shape[1]))
        path[:, 0] = x
        walk(self.program, Segment(begin, length, *u, p), trial(self.memory, x.shape[1]), path)
        return path

    def inside(self, path: Array) -> Array:
        """How many of the points of each path (N, K, n) lie in P before it leaves it for the first time."""
        kept = ((path >= self.P[0]) & (path <= self.P[1])).all(axis=2)
        return np.asarray(np.where(kept.all(axis=1), kept.shape[1], np.argmin(kept, axis=1)))


def drawing_of(
    spec: Spec, model: ControlAffineModel, horizon: float, replan: Fraction | None = None
) -> Drawing:
    """What plans of a family are drawn for."""
    bundle = spec.trajectory.bundle
    if bundle is None:
        raise ValueError("only a family of plans has members")
    from tubecert.simulate.program import assemble

    drift, names = [row[0] for row in model.drift_on_plan()], (*model.states, *model.inputs, TIME)
    program, memory = assemble(drift, names)
    return Drawing(
        model=model,
        bundle=bundle,
        horizon=Fraction(repr(horizon)),
        P=_inner(bundle.x),
        U=_inner(bundle.u, 0.0),
        replan=replan,
        drift=Tape(drift, names),
        program=program,
        memory=memory,
    )


def member(drawing: Drawing, seed: int, number: int) -> PiecewisePlan | Replanned:
    """Plan `number` of a seed; raises `TubecertError` if none is found that keeps to the boxes."""
    rng = np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=(2**30, number)))
    every = drawing.replan
    plan: PiecewisePlan | Replanned | None
    if every is not None and every < drawing.horizon:
        plan = _replanned(drawing, every, rng)
    else:
        plan = _some(lambda: _drawn(drawing, int(rng.integers(*_SEGMENTS, endpoint=True)), rng))
    if plan is None:
        raise TubecertError([_none(drawing, number)])
    return plan


def members_of(drawing: Drawing, seed: int, count: int) -> Iterator[tuple[Plan, float]]:
    """Plans 1, 2, ... count - 1 of a seed, with the defects that were seen."""
    for number in range(1, count):
        plan = member(drawing, seed, number)
        yield plan, defect_of(drawing, plan)


def defect_of(drawing: Drawing, plan: PiecewisePlan | Replanned) -> float:
    """The largest |x*' - f - B u*| in many points."""
    parts = plan.parts if isinstance(plan, Replanned) else (plan,)
    return max(float(_sampled(drawing, part)[0][0].max()) for part in parts)


def _some(draw: Callable[[], P | None]) -> P | None:
    """The first of a few draws that leads somewhere."""
    return next((plan for _ in range(_STARTS) if (plan := draw()) is not None), None)


def _drawn(
    drawing: Drawing, segments: int, rng: np.random.Generator, start: Array | None = None
) -> PiecewisePlan | None:
    """A plan, from a state (n,) or from anywhere; None if this one leads nowhere."""
    found = _corners(drawing, segments, rng, start)
    if found is None:
        return None
    plan = piecewise_plan(drawing.model, _knots(drawing, segments, *found), drawing.horizon)
    return plan if _belongs(drawing, plan) else None


def _replanned(drawing: Drawing, every: Fraction, rng: np.random.Generator) -> Replanned | None:
    """Plans that follow each other, by some of several tries."""

    def draw() -> Replanned | None:
        parts: list[PiecewisePlan] = []
        left = drawing.horizon
        while left > 0:
            plan = _continued(replace(drawing, horizon=2 * every), rng, parts)
            if plan is None:
                return None
            parts.append(piecewise_plan(drawing.model, plan.data, min(every, left)))
            left -= every
        return joined(parts)

    return _some(draw)


def _continued(
    drawing: Drawing, rng: np.random.Generator, parts: Sequence[PiecewisePlan]
) -> PiecewisePlan | None:
    """A plan that starts at the knot in the middle of the one before, and has a knot in its own."""
    start = None
    if parts:
        before = parts[-1].data
        start = np.array([float(value) for value in before.x[len(before.t) // 2]])
    return _some(lambda: _drawn(drawing, 2 * int(rng.integers(1, _SEGMENTS[0], endpoint=True)), rng, start))


def _corners(
    drawing: Drawing, segments: int, rng: np.random.Generator, start: Array | None = None
) -> tuple[list[Array], list[Array]] | None:
    """u* (m,) at the corners, and x* (K, n) on the segments; None if it leads nowhere."""
    length = float(drawing.horizon) / segments
    steps = max(2, _KNOTS // segments)
    u = [_input(drawing, rng, 1)[0]]
    paths = [(_point(drawing, rng) if start is None else start)[None]]
    again = 0
    while len(paths) <= segments:
        x = np.repeat(paths[-1][-1:], _CANDIDATES, axis=0)
        corners, p = _input(drawing, rng, _CANDIDATES), _missed(drawing, rng, _CANDIDATES)
        now, begin = (
            np.repeat(u[-1][None], _CANDIDATES, axis=0),
            (len(paths) - 1) * length,
        )
        rough = drawing.walk(begin, x, (now, corners), p, length, _COARSE)
        kept = np.flatnonzero(drawing.inside(rough) == _COARSE + 1)
        ahead = _ahead(drawing, (begin + length, rough[kept, -1]), corners[kept], length, rng)
        if len(kept) and ahead.max() > 1:  # the next segment, too, can be kept to
            best = [kept[int(np.argmax(ahead + 0.5 * rng.random(len(kept))))]]
            path = drawing.walk(begin, x[best], (u[-1][None], corners[best]), p[best], length, steps)
            if drawing.inside(path)[0] == steps + 1:
                u.append(corners[best][0])
                paths.append(path[0])
                continue
        again += 1
        if again > _AGAIN:
            return None
        back = min(len(paths) - 1, int(rng.integers(1, 5)))
        del u[len(u) - back :], paths[len(paths) - back :]
    return u, paths[1:]


def _ahead(
    drawing: Drawing, at: tuple[float, Array], u: Array, length: float, rng: np.random.Generator
) -> Array:
    """For how many segments x* can be kept in its box from a time and each of the states (N, n) then, by the best of
    a few inputs.
    """
    begin, x = at
    if not len(x):
        return np.zeros(0)
    wishes = _input(drawing, rng, _WAYS)
    lanes, now = np.repeat(x, _WAYS, axis=0), np.repeat(u, _WAYS, axis=0)
    target = np.tile(wishes, (len(x), 1))
    first = drawing.walk(begin, lanes, (now, target), np.zeros_like(lanes), length, _COARSE)
    still, later = np.zeros_like(lanes), (_AHEAD - 1) * length
    rest = drawing.walk(begin + length, first[:, -1], (target, target), still, later, (_AHEAD - 1) * _COARSE)
    kept = drawing.inside(np.concatenate([first, rest[:, 1:]], axis=1)) / _COARSE
    return np.asarray(kept.reshape(len(x), _WAYS).max(axis=1))


def _input(drawing: Drawing, rng: np.random.Generator, count: int) -> Array:
    """Inputs (N, m) in U; every third entry at one of its ends."""
    part = rng.random((count, drawing.U.shape[1]))
    part = np.where(rng.random(part.shape) < 1 / 3, np.round(part), part)
    found = drawing.U[0] + part * (drawing.U[1] - drawing.U[0])
    rounded = np.round(found * _DIGITS) / _DIGITS
    return np.asarray(np.where((rounded < drawing.U[0]) | (rounded > drawing.U[1]), found, rounded))


def _point(drawing: Drawing, rng: np.random.Generator) -> Array:
    """A state (n,) in P."""
    return np.asarray(drawing.P[0] + rng.random(drawing.P.shape[1]) * (drawing.P[1] - drawing.P[0]))


def _missed(drawing: Drawing, rng: np.random.Generator, count: int) -> Array:
    """Defects (N, n): directions at random, as long as a cubic allows."""
    direction = rng.normal(size=(count, drawing.P.shape[1]))
    direction *= drawing.P[1] > drawing.P[0]
    length = np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-12)
    return np.asarray(_DEFECT * float(drawing.bundle.defect) * direction / length)


def _knots(drawing: Drawing, segments: int, u: list[Array], paths: list[Array]) -> Knots:
    """The plan, exact: corners of u* are what they are, values between two of them lie on a line."""
    steps = len(paths[0]) - 1
    corners = [tuple(Fraction(repr(float(value))) for value in row) for row in u]
    states = [paths[0][0], *(row for path in paths for row in path[1:])]
    count = segments * steps
    t = tuple(drawing.horizon * k / count for k in range(count + 1))
    return Knots(
        t=t,
        x=tuple(tuple(Fraction(float(value)) for value in row) for row in states),
        u=tuple(_between(corners, k, steps) for k in range(count + 1)),
        interpolation="linear",
    )


def _between(corners: list[tuple[Fraction, ...]], k: int, steps: int) -> tuple[Fraction, ...]:
    segment, part = divmod(k, steps)
    if not part:
        return corners[segment]
    share = Fraction(part, steps)
    return tuple(a + share * (b - a) for a, b in zip(corners[segment], corners[segment + 1], strict=True))


def _belongs(drawing: Drawing, plan: PiecewisePlan) -> bool:
    """Whether x* keeps to its box and the dynamics, in many points."""
    (defect, speed), x = _sampled(drawing, plan)
    low, high = np.array([[float(a), float(b)] for a, b in drawing.bundle.x]).T
    limit = float(drawing.bundle.defect) or _ROUNDING * float(speed.max())
    return bool((x >= low).all() and (x <= high).all() and defect.max() <= limit)


def _sampled(drawing: Drawing, plan: PiecewisePlan) -> tuple[tuple[Array, Array], Array]:
    """|x*' - f - B u*| and |x*'| (N,), and x* (N, n), at five points of every piece."""
    pieces = plan.pieces
    tau = pieces.length.mid[:, None] * np.linspace(0, 1, 5)
    c, u = pieces.x.mid[:, None], pieces.u.mid[:, None]  # (K, 1, n, 4), (K, 1, m, 2)
    s = tau[:, :, None]
    x = c[..., 0] + s * (c[..., 1] + s * (c[..., 2] + s * c[..., 3]))
    slope = c[..., 1] + s * (2 * c[..., 2] + 3 * s * c[..., 3])
    at = u[..., 0] + s * u[..., 1]
    x, slope, at = (part.reshape(-1, part.shape[2]) for part in (x, slope, at))
    t = (pieces.start.mid[:, None] + tau).ravel()
    missing = slope - drawing.speed(t, x, at)
    return (np.linalg.norm(missing, axis=1), np.linalg.norm(slope, axis=1)), x


def _inner(box: tuple[tuple[Fraction, Fraction], ...], share: float = _INSIDE) -> Array:
    """A box as an array (2, N), a little smaller."""
    low, high = np.array([[float(a), float(b)] for a, b in box]).T
    return np.stack([low + share * (high - low), high - share * (high - low)])


def _none(drawing: Drawing, number: int) -> Finding:
    return Finding(
        code="TC708",
        message=f"no random plan {number} was found that keeps x* and u* in their boxes for "
        f"{near(drawing.horizon)} s",
        help="give a plan of your own with --plan FILE, or a shorter --duration",
    )
