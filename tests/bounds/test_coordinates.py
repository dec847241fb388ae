"""The tube in coordinates of its own: domain, half-widths and constants, against sampling and exact algebra."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import fractions
from systems import model_of

from tubecert.bounds.level import Proposed, greatest_level, least_level, settled
from tubecert.bounds.start import KnownStart, StartWithin
from tubecert.bounds.suprema import Suprema
from tubecert.coordinates import Coordinates, Fields, inverse
from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.interval import Interval
from tubecert.enclosure.objective import SumOfNorms
from tubecert.enclosure.pencil import scalar
from tubecert.expression import ZERO, parse, symbol
from tubecert.model import ControlAffineModel
from tubecert.search.coordinates import Wish, propose
from tubecert.trajectory import Plan, constant_plan
from tubecert.tube import Ellipsoid, Tube, sections

NAMES = ("x1", "x2", "x3")
SKEWED = Coordinates(
    tuple(tuple(map(Fraction, row)) for row in (("3", "0", "0"), ("-7/5", "1/2", "0"), ("2", "1/3", "11/10")))
)
BOX = ((Fraction(-9), Fraction(9)),) * 3
CENTRE = np.array([0.1, -0.2, 0.05])


def rows(data):
    return tuple(tuple(Fraction(value) for value in row) for row in data)


def model(**changes) -> ControlAffineModel:
    own = {
        "f": ["x2 - x1 + 0.3*sin(x1)", "x3 - 2*x2 + 0.2*x1*x3", "-3*x3 + x1**2"],
        "B": [["0.2", "0"], ["0.1", "1 + 0.2*x1"], ["1", "0.3*sin(x3)"]],
        "W": [["2 + 0.2*x1", "0.3", "0"], ["0.3", "1", "0.1*x3"], ["0", "0.1*x3", "0.7 + 0.1*x1**2"]],
        "h": ["0.2*sin(t)*x1 + 0.1*norm(x2, x3)", "0.3*x2"],
    } | changes
    places = {name: symbol(name) for name in (*NAMES, "t")}
    h = tuple(parse(text, symbols=places, kinks=True).expression for text in own["h"])
    return model_of(NAMES, own["f"], own["B"], own["W"], "1/2", h=h)  # so fast that it needs feedback


CONSTANT_W = [["2", "-0.2", "0.1"], ["-0.2", "0.04", "0"], ["0.1", "0", "30"]]


def suprema(own: ControlAffineModel, coordinates: Coordinates | None, **effort) -> Suprema:
    plan = constant_plan([Fraction(str(value)) for value in CENTRE], [Fraction(0)] * 2, None)
    return Suprema(own, plan, 0.0, (Fraction(0), Fraction(7)), Effort(**effort), coordinates=coordinates)


def wished(asked) -> Wish:
    """Half-widths, from a start on the plan."""
    box = np.array(BOX, dtype=float)
    return Wish(asked=asked, width=0.0, apart=np.zeros(3), within=0.0, box=box, outputs=np.zeros((0, 3)))


def points(coordinates: Coordinates, rho: float, sides: np.ndarray, count: int, seed: int = 0) -> np.ndarray:
    """Points of the domain around 0, many of them on its boundary."""
    rng = np.random.default_rng(seed)
    drawn = rng.normal(size=(count, 3))
    drawn /= np.linalg.norm(drawn, axis=1)[:, None]
    size = np.where(rng.random((count, 1)) < 0.6, 1.0, rng.random((count, 1)))
    y = rho * size * drawn @ np.linalg.inv(np.array(coordinates.rows, dtype=float)).T
    over = np.max(np.abs(y) / sides, axis=1, keepdims=True)
    return y / np.maximum(over, 1.0)


@pytest.mark.slow
@given(st.lists(fractions(-3, 3, 7), min_size=9, max_size=9))
def test_the_inverse_is_exact(values):
    own = tuple(tuple(values[3 * i : 3 * i + 3]) for i in range(3))
    found = inverse(own)
    if not found:
        assert abs(np.linalg.det(np.array(own, dtype=float))) < 1e-9
        with pytest.raises(ValueError, match="singular"):
            Coordinates(own)
        return
    for i in range(3):
        for j in range(3):
            assert sum(own[i][k] * found[k][j] for k in range(3)) == (i == j)


@pytest.mark.slow
def test_derivatives_are_by_the_components_of_z():
    """Each field of `Fields` is what one obtains by writing the system in z and differentiating there."""
    own = model()
    fields, step = Fields(own, SKEWED), 1e-6
    S = np.array(SKEWED.rows, dtype=float)
    from tubecert.enclosure.taylor import MatrixFunction

    def value(matrix, x):
        function = MatrixFunction([matrix])
        at = np.array([[x[NAMES.index(name)] for name in function.variables]])
        return function.floats(at)[0][0]

    for of_x, of_z in (
        (fields.f, [fields.f_x]),
        (fields.B, fields.B_x),
        (fields.W, fields.W_x),
        (fields.B_pinv, fields.B_pinv_x),
    ):
        slopes = [value(m, CENTRE) for m in of_z]
        if len(slopes) == 1:
            slopes = [slopes[0][:, [i]] for i in range(3)]
        for i, slope in enumerate(slopes):
            move = np.linalg.inv(S)[:, i] * step
            difference = (value(of_x, CENTRE + move) - value(of_x, CENTRE - move)) / (2 * step)
            assert slope == pytest.approx(difference, abs=1e-7)
    assert value(fields.B_pinv, CENTRE) == pytest.approx(np.linalg.pinv(value(fields.B, CENTRE)))


@settings(deadline=None, max_examples=40)
@given(
    which=st.sampled_from([[0], [1], [2], [0, 1], [2, 0], [1, 2], [0, 1, 2], [2, 1, 0]]),
    corner=st.lists(st.floats(-1, 1), min_size=3, max_size=3),
    width=st.lists(st.floats(0.001, 0.6), min_size=3, max_size=3),
    side=st.floats(0.05, 2),
)
def test_cuts_lose_no_point(which, corner, width, side):
    sides = np.array([side, 0.7, 0.4])
    section = Ellipsoid(SKEWED, 0.5, tuple(sides))
    inside = points(SKEWED, 0.5, sides, 4000)[:, which]
    lo = np.array(corner)[None, : len(which)]
    hi = lo + np.array(width)[None, : len(which)]
    new_lo, new_hi, alive = section.cut(which, lo, hi, Interval.exact(np.zeros((1, len(which)))))
    held = np.all((lo <= inside) & (inside <= hi), axis=1)
    kept = np.all((new_lo <= inside) & (inside <= new_hi), axis=1)
    assert alive[0] or not held.any()
    assert np.array_equal(held & kept, held)


@pytest.mark.parametrize("which", [[0], [2], [0, 1], [1, 2], [2, 0, 1]])
def test_points_called_inside_are_inside(which):
    sides = np.array([0.3, 0.7, 0.4])
    section = Ellipsoid(SKEWED, 0.5, tuple(sides))
    drawn = np.random.default_rng(1).normal(size=(500, 3))[:, which]
    moved, ok = section.pull(which, drawn, Interval.exact(np.zeros(drawn.shape)))
    assert ok.mean() > 0.9
    gram = np.array(SKEWED.gram, dtype=float)
    rest = [i for i in range(3) if i not in which]
    for y in moved[ok]:
        x = np.zeros(3)
        x[which] = y
        if rest:
            x[rest] = -np.linalg.solve(gram[np.ix_(rest, rest)], gram[np.ix_(rest, which)] @ y)
        assert x @ gram @ x <= 0.25 * (1 + 1e-12)
        assert np.all(np.abs(y) <= sides[which])


@pytest.mark.slow
def test_the_domain_is_sharp_in_every_direction():
    """sup c'x over the ellipsoid is rho |S^-T c|, whichever states c involves."""
    at_rest = constant_plan([Fraction(0)] * 3, [Fraction(0)], None)
    for c in ([1, 0, 0], [0, 0, 1], [1, -2, 0], [0, 1, 3], [1, 1, -1]):
        tube = Tube(at_rest, Ellipsoid(SKEWED, 0.5, (9.0,) * 3), states=NAMES, inputs=("u",), time=None)
        e = sum((weight * symbol(name) for weight, name in zip(c, NAMES, strict=True)), start=ZERO)
        found = supremum(scalar(e), tube, Effort(gap=1e-3))
        exact = 0.5 * np.linalg.norm(np.linalg.inv(np.array(SKEWED.rows, dtype=float)).T @ c)
        assert found.below <= exact * (1 + 1e-12)
        assert exact <= found.above <= exact * 1.002


def test_a_factor_that_promises_too_much_is_given_up(monkeypatch):
    """What stands for S is proven to be no larger; a proposal that is larger is not believed."""
    sections.factor.cache_clear()
    honest = sections._proposed
    monkeypatch.setattr(sections, "_proposed", lambda *args: 1.5 * honest(*args))
    try:
        assert not sections.factor(SKEWED, (0, 1)).hi.any()
        sections.factor.cache_clear()
        monkeypatch.setattr(sections, "_proposed", lambda *args: 1.1 * honest(*args))
        assert sections.factor(SKEWED, (0, 1)).hi == pytest.approx(0.7 * 1.1 * honest(SKEWED, (0, 1)))
    finally:
        sections.factor.cache_clear()


@pytest.mark.slow
def test_a_moving_plan_carries_the_ellipsoid():
    t = symbol("t")
    plan = Plan((t, parse("sin(t)", symbols={"t": t}).expression, t * 0), (t * 0,), Fraction(1))
    tube = Tube(
        plan, Ellipsoid(SKEWED, 0.5, (9.0,) * 3), states=NAMES, inputs=("u",), time=(Fraction(0), Fraction(1))
    )
    found = supremum(scalar(symbol("x1") + symbol("x2")), tube, Effort(gap=1e-3))
    own = 0.5 * np.linalg.norm(np.linalg.inv(np.array(SKEWED.rows, dtype=float)).T @ [1, 1, 0])
    exact = 1 + np.sin(1) + own
    assert found.below <= exact * (1 + 1e-12)
    assert exact <= found.above <= exact * 1.002


def test_half_widths_of_a_constant_metric_are_exact():
    own = model(W=CONSTANT_W)
    start = suprema(own, None)
    wish = wished((Fraction(3, 20), None, None))
    coordinates, proposed = propose(own, start.plan, wish)
    found = greatest_level(replace(start, coordinates=coordinates), BOX, wish.asked, proposed)
    W = np.array(CONSTANT_W, dtype=float)
    assert found.upper.above == pytest.approx(found.lower.below, rel=1e-6)  # no overshoot
    assert float(found.rho) == pytest.approx(1, rel=1e-6)  # |z| = 1 at the rim
    assert [float(side) for side in found.sides] == pytest.approx(
        0.15 * np.sqrt(np.diag(W) / W[0, 0]), rel=1e-6
    )
    assert found.sides[0] <= Fraction(3, 20)


def test_states_that_are_not_asked_for_stay_in_the_safe_set():
    """A tube that would leave it through x3, 3.9 times as wide as x1, is as much narrower; one that fits is not."""
    own = model(W=CONSTANT_W)
    wish, plan = wished((Fraction(5), None, None)), suprema(own, None).plan
    W = np.array(CONSTANT_W, dtype=float)
    sides = np.array([float(side) for side in propose(own, plan, wish)[1].sides])
    assert sides[2] == pytest.approx(0.97 * (9 - CENTRE[2]))
    assert sides == pytest.approx(sides[2] * np.sqrt(np.diag(W) / W[2, 2]))
    asked = propose(own, plan, wished((None, None, Fraction(8))))[1].sides
    assert float(asked[2]) == pytest.approx(8)


@pytest.mark.slow
def test_half_widths_are_those_of_the_domain_itself():
    """(1.7), by samples: no W_ii of the domain is above what its half-widths allow, nor M below a."""
    own = model()
    start = suprema(own, None)
    asked = (None, Fraction(1, 2), Fraction(2, 5))
    wish = wished(asked)
    coordinates, proposed = propose(own, start.plan, wish)
    found = greatest_level(replace(start, coordinates=coordinates), BOX, asked, proposed)
    sides = np.array([float(side) for side in found.sides])
    assert all(w is None or side <= w for w, side in zip(asked, found.sides, strict=True))
    assert max(sides[1] / 0.5, sides[2] / 0.4) > 0.99  # and none is given away
    x = CENTRE + points(coordinates, float(found.rho), sides, 20_000)
    W = _dual(x)
    S = np.array(coordinates.rows, dtype=float)
    least = 1 / np.linalg.eigvalsh(S @ W @ S.T)[:, -1].max()
    assert found.lower.below <= least * (1 + 1e-12)
    reach = np.sqrt(found.lower.below) * float(found.rho)
    needed = reach * np.sqrt(np.diagonal(W, axis1=1, axis2=2).max(axis=0))
    assert np.all(needed <= sides * (1 + 1e-12))
    assert np.all(sides <= needed * 1.01)


def _dual(x):
    x1, x3 = x[:, 0], x[:, 2]
    W = np.zeros((len(x), 3, 3))
    W[:, 0, 0], W[:, 1, 1], W[:, 2, 2] = 2 + 0.2 * x1, 1, 0.7 + 0.1 * x1**2
    W[:, 0, 1] = W[:, 1, 0] = 0.3
    W[:, 1, 2] = W[:, 2, 1] = 0.1 * x3
    return W


@pytest.mark.slow
def test_what_is_proposed_is_not_believed():
    """Half-widths that are too narrow are raised, those that are too wide are lowered, until they are proven."""
    own = model()
    start = replace(suprema(own, None), coordinates=SKEWED)
    fair = settled(start, BOX, Proposed(rho=Fraction(3, 10), sides=(Fraction(1, 10),) * 3))
    for sides in ((Fraction(1, 1000),) * 3, (Fraction(1, 2), Fraction(1, 500), Fraction(1, 10))):
        found = settled(start, BOX, Proposed(rho=Fraction(3, 10), sides=sides))
        assert found.contained.verdict == "certified"
        assert [float(side) for side in found.sides] == pytest.approx(
            [float(side) for side in fair.sides], rel=3e-3
        )


def test_half_widths_that_leave_the_safe_set_are_refused():
    start = replace(suprema(model(), None), coordinates=SKEWED)
    narrow = (BOX[0], (Fraction(-21, 100), Fraction(9)), BOX[2])
    found = settled(start, narrow, Proposed(rho=Fraction(3, 10), sides=(Fraction(1, 10),) * 3))
    assert found.lower is None
    assert (found.contained.state, found.contained.side) == ("x2", "lower")


@pytest.mark.slow
def test_the_least_level_holds_the_start_and_the_radii():
    own, x0 = model(), (Fraction(3, 10), Fraction(-1, 10), Fraction(1, 20))
    apart = np.array(x0, dtype=float) - CENTRE
    wish = replace(wished(None), width=0.1, apart=apart)
    coordinates, proposed = propose(own, suprema(own, None).plan, wish)
    start = replace(suprema(own, None), coordinates=coordinates)
    known = KnownStart(x0)
    S = np.array(coordinates.rows, dtype=float)
    offset = known.offset(start)
    assert offset.lo <= np.linalg.norm(S @ apart) * (1 + 1e-12)
    assert np.linalg.norm(S @ apart) <= offset.hi * (1 + 1e-12)
    ball = StartWithin(Fraction(1, 10))
    assert float(ball.offset(start).hi) == pytest.approx(0.1 * np.linalg.norm(S, 2))
    found = least_level(start, BOX, offset, Fraction(1, 10), proposed)
    overshoot = np.sqrt(found.upper.above / found.lower.below) * np.linalg.norm(S @ apart)
    assert overshoot + 0.1 <= float(found.rho) <= (overshoot + 0.1) * 1.001
    # d0 of a ball of starts: the longest segment in the metric
    reach = ball.distance(start.with_radius(found.rho, found.sides), (found.lower, found.upper))
    x = CENTRE + points(coordinates, float(found.rho), np.array([float(s) for s in found.sides]), 20_000)
    stretch = 1 / np.sqrt(np.linalg.eigvalsh(_dual(x))[:, 0].min())
    assert 0.1 * stretch <= reach.above * (1 + 1e-12)
    assert reach.above <= 0.1 * stretch * 1.02


@pytest.mark.slow
@pytest.mark.parametrize(
    "coordinates", [SKEWED, Coordinates(rows(np.diag([1, 2, 5]).tolist()))], ids=["skewed", "diagonal"]
)
def test_constants_in_z_are_above_sampled_ones(coordinates):
    own, rho = model(), Fraction(3, 10)
    sides = (Fraction(1, 10), Fraction(1, 4), Fraction(3, 10))
    start = suprema(own, coordinates, gap=0.02, budget=60_000).with_radius(rho, sides)
    found = constants_of(start)
    x = CENTRE + points(coordinates, 0.3, np.array([float(side) for side in sides]), 8000)
    sampled = sampled_in_z(x, np.array(coordinates.rows, dtype=float))
    assert found.pop("lower").below <= sampled.pop("lower") * (1 + 1e-9)
    assert set(sampled) == set(found)
    for name, value in sampled.items():
        assert value <= found[name].above * (1 + 1e-6), name
        assert found[name].below <= found[name].above
        if name != "h_x":  # where its norm vanishes, only a structural bound of it is known
            assert found[name].above <= 1.04 * max(value, 0.0) + 1e-3, name


def constants_of(s):
    fields = s.fields
    lower, upper = s.metric_bounds()
    h, h_x, _ = s.uncertainty()
    of_fields = {
        "f": [fields.f], "f_x": [fields.f_x], "B": [fields.B], "B_x": fields.B_x, "b_x": fields.b_x,
        "B_pinv": [fields.B_pinv], "B_pinv_x": fields.B_pinv_x,
    }  # fmt: skip
    found = {name: s.norms(name, matrices) for name, matrices in of_fields.items()}
    found |= {"M_x": s.metric_slope(), "lower": lower, "upper": upper, "drift_on_plan": s.drift_on_plan()}
    return found | {"h": h, "h_x": h_x, "feedback_gain": s.feedback_gain()}


def sampled_in_z(x, S):
    """The largest value of every constant's function at points, by finite differences in z."""
    T, eps = np.linalg.inv(S), 1e-5
    norm = lambda a: np.linalg.norm(a, 2, axis=(-2, -1))  # noqa: E731
    f_z = lambda x: (S @ _f(x)[..., None])[..., 0]  # noqa: E731
    B_z = lambda x: S @ _B(x)  # noqa: E731
    pinv = lambda x: np.linalg.pinv(B_z(x))  # noqa: E731
    M_z = lambda x: np.linalg.inv(S @ _dual(x) @ S.T)  # noqa: E731

    def slopes(of, x):
        return [(of(x + eps * T[:, i]) - of(x - eps * T[:, i])) / (2 * eps) for i in range(3)]

    B_x = slopes(B_z, x)
    h_x = [np.stack(slopes(lambda x, t=t: _h(x, t), x), axis=-1) for t in np.linspace(0, 7, 29)]
    f_x = np.stack(slopes(f_z, x), axis=-1)
    W = S @ _dual(x) @ S.T
    W_f = sum((S @ d @ S.T) * _f(x)[:, i, None, None] for i, d in enumerate(_dual_slopes(x)))
    F = -W_f + f_x @ W + W @ np.swapaxes(f_x, 1, 2) + W
    return {
        "f": np.linalg.norm(f_z(x), axis=1).max(),
        "f_x": norm(f_x).max(),
        "B": norm(B_z(x)).max(),
        "B_x": sum(map(norm, B_x)).max(),
        "b_x": sum(norm(np.stack([d[:, :, j] for d in B_x], axis=-1)) for j in range(2)).max(),
        "B_pinv": norm(pinv(x)).max(),
        "B_pinv_x": sum(map(norm, slopes(pinv, x))).max(),
        "M_x": sum(map(norm, slopes(M_z, x))).max(),
        "lower": np.linalg.eigvalsh(M_z(x))[:, 0].min(),
        "upper": np.linalg.eigvalsh(M_z(x))[:, -1].max(),
        "drift_on_plan": np.linalg.norm(f_z(x), axis=1).max(),
        "h": max(np.linalg.norm(_h(x, t), axis=1).max() for t in np.linspace(0, 7, 200)),
        "h_x": max(norm(a).max() for a in h_x),
        "feedback_gain": _gain(F, B_z(x), W),
    }


def _gain(F, B, W):
    """v'Fv/(2 |B'v| |v|_W): at every point by random directions, then by ever closer ones to the best."""
    rng, best = np.random.default_rng(2), np.zeros((len(F), 1, 3))
    for size in (1.0, 0.3, 0.1, 0.03):
        v = best + size * rng.normal(size=(len(F), 60, 3))
        v /= np.linalg.norm(v, axis=-1, keepdims=True)
        form, length = (np.einsum("nki,nij,nkj->nk", v, of, v) for of in (F, W))
        found = form / (2 * np.linalg.norm(v @ B, axis=-1) * np.sqrt(length))
        best = np.take_along_axis(v, found.argmax(axis=1)[:, None, None], axis=1)
    return found.max()


def _f(x):
    a, b, c = x.T
    return np.stack([b - a + 0.3 * np.sin(a), c - 2 * b + 0.2 * a * c, -3 * c + a**2], axis=-1)


def _B(x):
    B = np.zeros((len(x), 3, 2))
    B[:, 0, 0], B[:, 1, 0], B[:, 2, 0] = 0.2, 0.1, 1
    B[:, 1, 1], B[:, 2, 1] = 1 + 0.2 * x[:, 0], 0.3 * np.sin(x[:, 2])
    return B


def _h(x, t):
    return np.stack([0.2 * np.sin(t) * x[:, 0] + 0.1 * np.hypot(x[:, 1], x[:, 2]), 0.3 * x[:, 1]], axis=-1)


def _dual_slopes(x):
    d1, d3 = np.zeros((len(x), 3, 3)), np.zeros((len(x), 3, 3))
    d1[:, 0, 0], d1[:, 2, 2] = 0.2, 0.2 * x[:, 0]
    d3[:, 1, 2] = d3[:, 2, 1] = 0.1
    return d1, np.zeros_like(d1), d3


@pytest.mark.slow
def test_the_identity_by_the_new_path_is_the_old_path():
    own = model()
    eye = Coordinates(rows(np.eye(3, dtype=int).tolist()))
    ball = suprema(own, None, gap=0.01, budget=60_000).with_radius(Fraction(1, 4))
    new = suprema(own, eye, gap=0.01, budget=60_000).with_radius(Fraction(1, 4), (Fraction(9),) * 3)
    old, found = constants_of(ball), constants_of(new)
    for name in old:  # both enclose the same number
        assert max(old[name].below, found[name].below) <= min(old[name].above, found[name].above), name
        assert found[name].above == pytest.approx(old[name].above, rel=0.011, abs=1e-12), name


LINKS = ("x2", "2*x1 + x3 - 3*sin(x1)", "0.5*x2 - x3 + x1**2")


@pytest.mark.slow
@pytest.mark.parametrize("f", [LINKS, ("1 + x2", "4*x3", "x1 - x2"), ("x2 + sin(t)", "x1**3", "x3")])
def test_what_is_affine_needs_no_search(f):
    """The norm over the rest of the states, exactly: as by boxes in all of them, and as by samples."""
    own = model(W=CONSTANT_W)
    names = {name: symbol(name) for name in (*NAMES, "t")}
    v = tuple((parse(text, symbols=names).expression,) for text in f)
    start = suprema(own, SKEWED, gap=0.01, budget=200_000).with_radius(Fraction(3, 10), (Fraction(9),) * 3)
    moved = start.fields.of_vector(v)
    whole = start._over_rest([moved])
    assert whole is not None
    assert len(set(whole.variables) - {"t"}) < 3
    found, exact = start.norms("f", [moved]), start.over_tube("f", whole)
    tube = Tube(start.plan, start.section, states=NAMES, inputs=(), time=start.time)
    boxes = supremum(SumOfNorms([moved]), tube, start.effort)
    assert max(found.below, boxes.below) <= min(found.above, boxes.above)
    x = CENTRE + points(SKEWED, 0.3, np.full(3, 9.0), 40_000)
    S = np.array(SKEWED.rows, dtype=float)

    def value(x, t):
        space = dict(zip(NAMES, x.T, strict=True)) | {"t": t}
        return np.stack([eval(text, {"sin": np.sin}, space) for text in f], axis=-1) @ S.T

    moments = np.linspace(0, 7, 60) if f[0].endswith("sin(t)") else (0.0,)
    largest = max(np.linalg.norm(value(x, t), axis=1).max() for t in moments)
    assert largest <= exact.above <= found.above <= 1.015 * largest
    # and it is attained where the certificate says so, at a point of the tube
    at = np.array(found.at.x)
    assert np.linalg.norm(S @ (at - CENTRE)) <= 0.3 * (1 + 1e-9)
    assert np.linalg.norm(value(at, found.at.t or 0.0)) >= found.below * (1 - 1e-9)


def test_half_widths_that_cut_the_ellipsoid_are_searched():
    start = suprema(model(), SKEWED).with_radius(
        Fraction(3, 10), (Fraction(9), Fraction(1, 100), Fraction(9))
    )
    v = tuple((parse(text, symbols={name: symbol(name) for name in NAMES}).expression,) for text in LINKS)
    assert start._over_rest([v]) is None


@pytest.mark.slow
def test_what_is_affine_needs_no_search_along_a_plan_either():
    t = symbol("t")
    names = {name: symbol(name) for name in (*NAMES, "t")}
    x = tuple(parse(text, symbols=names).expression for text in ("0.5*t", "sin(2*t)", "0.2 - t**2"))
    plan = Plan(x, (t, 1 - t), Fraction(1))
    own = model(f=LINKS, B=[["0", "0"], ["1", "0"], ["0", "2"]], W=CONSTANT_W)
    start = Suprema(own, plan, 0.0, None, Effort(gap=0.05, budget=200_000), coordinates=SKEWED)
    start = start.with_radius(Fraction(3, 10), (Fraction(9),) * 3)
    found = start.drift_on_plan()
    assert start._over_rest([start.fields.drift_on_plan()]).variables == ("t", "u1", "u2", "x1")
    S, largest = np.array(SKEWED.rows, dtype=float), 0.0
    y = points(SKEWED, 0.3, np.full(3, 9.0), 20_000)
    for now in np.linspace(0, 1, 60):
        x1, x2, x3 = (np.array([0.5 * now, np.sin(2 * now), 0.2 - now**2]) + y).T
        f = np.stack([x2, 2 * x1 + x3 - 3 * np.sin(x1) + now, 0.5 * x2 - x3 + x1**2 + 2 * (1 - now)], axis=1)
        largest = max(largest, float(np.linalg.norm(f @ S.T, axis=1).max()))
    assert largest <= found.above <= 1.08 * largest
