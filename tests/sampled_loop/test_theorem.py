"""The inequalities of the sampled loop against closed forms: one term at a time, never below, and at most 1 % above.

Mostly x' = u at Ts = .1 under delta = -e/Ts, which forgets within a sample, so that a bound is what one sample does.
"""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from math import exp, sqrt

import numpy as np
import pytest
from scipy.linalg import expm
from small_loops import AT_ONE, RANGE, WAVE, scalar, text_of

from tubecert.enclosure.interval import Interval
from tubecert.model import build
from tubecert.sampled_loop import responses
from tubecert.sampled_loop.cells import largest_jump, steepness
from tubecert.sampled_loop.matrices import product
from tubecert.sampled_loop.obstacles import cleared
from tubecert.sampled_loop.record import Recipe, Stage, Tables
from tubecert.sampled_loop.remainders import Remainders
from tubecert.sampled_loop.responses import Acting, Dynamics, Responses
from tubecert.sampled_loop.setting import Loop
from tubecert.sampled_loop.theorem import Boxes, Inequalities, _short, check
from tubecert.spec import Knots, load_text
from tubecert.trajectory.make import plan_of
from tubecert.trajectory.pieces import piecewise_plan

TS = 0.1
TWICE = "{kind: expressions, x: ['2*sin(t)'], u: ['2*cos(t)'], horizon: 7, afterwards: repeat}"
DOUBLE = {
    "system": "{states: [x, v], inputs: [u], f: [v, '0'], B: [[0], [1]]}",
    "safe_set": "{x: [-5, 5], v: [-5, 5]}",
    "trajectory": "{kind: equilibrium, at: [0, 0], input: [0]}",
    "initial_state": "{at: [0, 0]}",
}
OBSERVER = {"N": [[-2 / TS]], "F": [[1]], "G": [[-1 / TS]], "M": [[1]]}  # e_(k+1): what w has changed by


def loop_of(*, slow=False, A=((0,),), B=((1,),), E=None, **sections) -> Loop:
    spec = load_text(text_of(**sections))
    model = build(spec)
    plan = plan_of(spec, model)
    E = E if E is not None else [[1.0]] if spec.disturbance else np.zeros((len(A), 0))
    own = (np.array(each, dtype=float) for each in (A, B, E))
    return Loop(
        spec=spec, model=model, plan=plan, knots=None, slow=slow, **dict(zip("ABE", own, strict=True))
    )


def controller_of(N=((-1 / TS,),), F=(), G=(), M=()) -> Tables:
    N = np.atleast_2d(np.array(N, dtype=float))
    (m, n), z = N.shape, len(F)
    shaped = zip((F, G, M), ((z, z), (z, n), (m, z)), strict=True)
    return Tables(*(np.array(own, dtype=float).reshape(shape) for own, shape in shaped), N)


def asked(
    loop, tables=None, *, starts=(0,), lags=5, cut=None, pieces=2, panels=4, windows=64
) -> Inequalities:
    """`cut`: one lag for all; by default nothing is cut."""
    tables = tables or controller_of()
    outputs = loop.states + loop.inputs + tables.size
    cuts = ((lags if cut is None else cut,) * loop.H.shape[1],) * outputs
    recipe = Recipe(
        lags=lags,
        cuts=cuts,
        pieces=pieces,
        panels=panels,
        windows=windows,
        parameters="slow" if loop.slow else "sudden",
    )
    made = Responses(loop, tables, lags=lags, pieces=pieces, panels=panels)
    return Inequalities(tables, recipe, starts, made, Remainders(loop, windows))


def bounds(loop, W=1e-3, U=1e-3, Z=1e-3, tables=None, **recipe) -> Boxes:
    """What follows for boxes that are the same in all states, inputs and memories, or one for each stage."""
    own = asked(loop, tables, **recipe)
    g, z = len(own.starts), own.controller.size
    n, m = loop.states, loop.inputs
    each = zip((W, U, Z), (n, m, z), strict=True)
    return own.of(
        Boxes(*(np.array(np.broadcast_to(np.reshape(x, (-1, 1)), (g, k)), dtype=float) for x, k in each))
    )


def close(found, exact, above=0.01):
    """Not below, and not far above."""
    found, exact = np.ravel(found), np.ravel(exact)
    assert found.shape == exact.shape
    assert (found >= exact * (1 - 1e-12) - 1e-30).all(), (found, exact)
    assert (found <= exact * (1 + above) + 1e-12).all(), (found, exact)


def test_noise():
    found = bounds(loop_of(hardware="{sample_time: 0.1, noise: {x: 0.01}}"))
    close(found.W, 0.01)
    close(found.U, 0.02 / TS)


@pytest.mark.parametrize(("noise", "both"), [("{x: 0.003, v: 0.004}", 0.007), ("0.005", sqrt(2) * 0.005)])
def test_noise_by_components_and_by_length(noise, both):
    """delta = n_x + n_v and nothing else: v moves by what one sample adds to the last L of them."""
    loop = loop_of(
        **DOUBLE, hardware=f"{{sample_time: 0.1, noise: {noise}}}", A=[[0, 1], [0, 0]], B=[[0], [1]]
    )
    own = asked(loop, controller_of([[1, 1]]))
    blank = Boxes(*(np.zeros((1, k)) for k in (2, 1, 0)))
    b = own.terms(blank)[0]
    close(b[0, -1], both, 1e-6)


def test_wind():
    found = bounds(loop_of(disturbance="{E: [[1]], bound: 0.3}"))
    close(found.W, 0.3 * TS)
    close(found.U, 0.3)


def test_winds_add():
    found = bounds(loop_of(disturbance="{E: [[1]], bound: 0.3}", uncertainty="{bounds: {h: 0.2}}"))
    close(found.W, 0.5 * TS)


def test_wind_of_a_length_is_less_than_that_of_its_components():
    E = "[['0.6', '0.8']]"
    for bound, size in (("0.5", 0.5), ("[0.5, 0.5]", 0.7)):
        close(bounds(loop_of(disturbance=f"{{E: {E}, bound: {bound}}}", E=[[0.6, 0.8]])).W, size * TS)


def test_wind_with_a_rate_counts_by_its_rate():
    loop = loop_of(disturbance="{E: [[1]], bound: 9, rate: 0.4}")
    found = bounds(loop, tables=controller_of(**OBSERVER), starts=(0, 6), lags=40)
    close(found.W[1], 0.4 * TS**2 + 0.4 * (TS / 2) ** 2 / 8)


def test_wind_with_a_rate_is_cut():
    """delta_k = m_(k-2) - 2 m_(k-1) of means of w: w itself two samples ago, and since then its rate."""
    loop = loop_of(disturbance="{E: [[1]], bound: 0.5, rate: 0.4}")
    for cut, size in ((0, 3 * 0.5), (2, 0.5 + 2.5 * 0.4 * TS), (1, 2 * 0.5 + 0.4 * TS + 0.5)):
        close(bounds(loop, tables=controller_of(**OBSERVER), cut=cut, starts=(0, 3)).U[1], size)


def test_h_that_began_at_0_has_its_size_once_it_is_cut():
    loop = loop_of(uncertainty="{h: ['0.5*sin(0.8*t)']}")
    found = bounds(loop, tables=controller_of(**OBSERVER), cut=2, lags=9, starts=(0, 3, 5, 10, 11))
    close(found.U[1:], [0.5 + 2.5 * 0.4 * TS] * 4)


def test_h_begins_as_it_is_at_the_start():
    for h, first in (("0.3*sin(2*t)", 0), ("0.3*cos(2*t)", 0.3)):
        found = bounds(
            loop_of(uncertainty=f"{{h: ['{h}']}}"), tables=controller_of(**OBSERVER), starts=(0, 2)
        )
        close(found.U[0], 2 * first + 0.6 * TS)


def test_start():
    for start, size in (
        ("{at: [-0.02]}", 0.02),
        ("{within: 0.02}", 0.02),
        ("{box: {x: [-0.01, 0.02]}}", 0.02),
    ):
        found = bounds(loop_of(initial_state=start), W=0.03, starts=(0, 1))
        close(found.W, [size, 1e-30], 1e-6)
        close(found.U, [size / TS, 1e-30], 1e-6)


def test_a_memory_is_bounded_from_the_first_sample_on():
    """zeta_(k+1) = e_k, and e is forgotten within a sample; zeta_0 = 0."""
    tables = controller_of([[-1 / TS]], [[0]], [[1]], [[0]])
    found = bounds(loop_of(initial_state="{at: [0.02]}"), W=0.03, tables=tables, starts=(0, 1, 2))
    close(found.Z, [0, 0.02, 1e-30], 1e-6)


def test_a_start_has_signs_a_box_has_none_and_a_ball_its_length():
    """delta = 3 x + 4 v."""
    for start, size in (("{at: [4, -3]}", 0), ("{box: {x: [-1, 1], v: [-1, 1]}}", 7), ("{within: 1}", 5)):
        loop = loop_of(**{**DOUBLE, "initial_state": start}, A=[[0, 1], [0, 0]], B=[[0], [1]])
        close(asked(loop, controller_of([[3, 4]])).first(np.arange(2))[0, -1], size)


def test_a_start_lasts_up_to_the_last_lag():
    """e_(k+1) = e_k/2 under delta = -5 e."""
    first = asked(loop_of(initial_state="{at: [1]}"), controller_of([[-5]]), lags=2).first(np.arange(4))
    close(first[:3, -1], [5, 2.5, 1.25], 1e-6)
    assert first[3, -1] == 0


def test_tail():
    """e_(k+1) = e_k/2 + what wind adds: three lags, and an eighth of the box."""
    loop = loop_of(disturbance="{E: [[1]], bound: 0.3}")
    close(bounds(loop, W=0.8, tables=controller_of([[-5]]), lags=3).W, 1.75 * 0.03 + 0.1)


def test_how_a_plan_s_input_is_held():
    for hold, error in (("middle", TS / 2), ("left", TS), ("continuous", 2**-24)):
        loop = loop_of(trajectory=WAVE, hardware=f"{{sample_time: 0.1, hold: {hold}}}")
        close(Remainders(loop, 256).held, error)
        if hold != "continuous":
            close(bounds(loop, windows=256).W, error * TS)


def test_inputs_that_jump_across_the_end_of_a_plan_that_repeats():
    """Up at .95, up again at 1.02: two jumps within half of a sample."""
    rows = (0, 0, 0), ("0.02", 0, 1), ("0.3", "0.28", 0), ("0.67", "0.28", -1), ("0.95", 0, 0), (1, 0, 0)
    t, x, u = zip(*(map(Fraction, row) for row in rows), strict=True)
    knots = Knots(t=t, x=tuple((a,) for a in x), u=tuple((a,) for a in u), interpolation="hold")
    loop = loop_of(trajectory=WAVE, hardware="{sample_time: 0.2}")
    loop.plan = piecewise_plan(loop.model, knots)
    assert 2 <= largest_jump(loop)[0] <= 3


def rho(loop, W, U=0.0, size=()):
    """What is left of x' = .. on the tube, through I and through B; the plan has 64 windows."""
    own = Remainders(loop, 64)
    W, U = np.full(loop.states, W, dtype=float), np.full(loop.inputs, U, dtype=float)
    return own.rho(W, U, np.array(size, dtype=float))


@pytest.mark.parametrize(
    ("sections", "W", "U", "size", "through"),
    [
        ({"system": scalar("0.1*x**2")}, 0.5, 0, (), (0.125 * 0.25, 0)),  # .1 W^2, in four levels
        ({"system": scalar("0", "1 + 0.1*x")}, 0.5, 2, (), (0.1 * 0.625 * (0.5 * 2 + 2 * 0.5), 0)),
        ({"uncertainty": "{h: ['0.2*x']}"}, 0.5, 0, [0.1], (0, 0.1)),
        ({"trajectory": WAVE, "uncertainty": "{h: ['0.2*x**2']}"}, 0.5, 0, [1], (0, 0.3 + TS / 2)),
        ({"uncertainty": "{h: ['0.2*x']}", "system": scalar("0", "1 + 0.1*x")}, 0.5, 0, [3], (0.15, 0.1)),
        ({"uncertainty": "{bounds: {h: 3, h_x: 0.2, h_t: 1}}"}, 0.5, 0, [3], (0, 0.1)),
        ({"uncertainty": "{bounds: {h: 3}}", "system": scalar("0", "1 + 0.1*x")}, 0.5, 0, (), (0.15, 0)),
        (
            {"trajectory": WAVE, "uncertainty": "{bounds: {h: 3}}", "system": scalar("0", "1 + 0.1*x")},
            0.5, 0, (), (0.45 + 0.05 + 0.1 * (0.5 * (1 + TS / 2) + 0.625 * 0.5 * TS / 2), TS / 2),
        ),
        ({"disturbance": "{E: [['1 + 0.2*x']], bound: 0.3}"}, 0.5, 0, (), (0.03, 0)),
        ({"disturbance": "{E: [['1 + 0.2*x']], bound: 0.3, rate: 1}"}, 0.5, 0, [0.3], (0.03, 0)),
        ({"trajectory": WAVE, "disturbance": "{E: [['1 + 0.2*x']], bound: 0.3}"}, 0.5, 0, (), (0.09, TS / 2)),
        ({"disturbance": "{E: [['1 + 0.6*x', '1 + 0.8*x']], bound: 0.3}", "E": [[1, 1]]}, 0.5, 0, (), (0.15, 0)),
        ({"trajectory": "{kind: equilibrium, at: [0], input: [0.02]}"}, 0.5, 0, (), (0.02, 2**-24 * 0.02)),
        (
            {"trajectory": "{kind: expressions, x: ['0.1*t'], u: ['0.1'], horizon: 2, afterwards: rest}"},
            0.5, 0, (), (0.1, 2**-24 * 0.1),
        ),
        ({"trajectory": WAVE.replace("cos(t)'", "cos(t) + 0.02'")}, 0.5, 0, (), (0.02, TS / 2)),
        (
            {"trajectory": WAVE, "system": scalar("0", "1 + 0.1*x"), "hardware": "{sample_time: 1}"},
            0.5, 0, (), (0.05 * (sqrt(2) + 0.8125) + 0.05, 0.5),
        ),
        ({**AT_ONE, "system": scalar("-p*x", more=RANGE), "A": [[-1]]}, 0.5, 0, (), (0.1 + 0.05, 2**-24)),
        ({**AT_ONE, "system": scalar("-p*x", more=RANGE), "A": [[-1]], "slow": True}, 0.5, 0, [0.1], (0.05, 2**-24)),
        ({**AT_ONE, "system": scalar("-x", "p", more=RANGE), "A": [[-1]], "slow": True}, 0.5, 4, [0.1], (0.4, 2**-24)),
        (
            {"trajectory": "{kind: any, x: {x: [-1, 1]}, u: {u: [-2, 2]}, defect: 0.03, input_rate: 4}",
             "system": scalar("0.1*x**2"), "initial_state": "{within: 0.1}"},
            0.5, 0, (), ((0.2 + 0.2 * 0.5 * 0.625) * 0.5 + 0.03, 0.2),
        ),
    ],
)  # fmt: skip
def test_what_is_left(sections, W, U, size, through):
    close(rho(loop_of(**sections), W, U, size), through, 0.03)


def test_what_is_left_acts_as_a_wind_does_through_its_columns():
    """x' = v, v' = u: of a defect of v nothing but half of Ts^2 comes to x within a sample."""
    loop = loop_of(**DOUBLE, A=[[0, 1], [0, 0]], B=[[0], [3]])
    own = Responses(loop, controller_of([[0, 0]]), lags=1, pieces=1, panels=16)
    close(own.direct[-1][:, own.passing - 3 : own.passing], [[TS, TS**2 / 2, 3 * TS**2 / 2], [0, TS, 3 * TS]])


def test_rounding_of_singles():
    """x* = 1000, W = 2, noise 3: y, dy and what is sent, one unit of 2^-24 each, and the plan itself."""
    at = {"trajectory": "{kind: equilibrium, at: [1000], input: [5]}", "initial_state": "{at: [1000]}"}
    loop = loop_of(**at, hardware="{sample_time: 0.1, arithmetic: single, noise: {x: 3}}")
    boxes = Boxes(np.array([[2.0], [0.1]]), np.zeros((2, 1)), np.array([[3.0], [9.0]]))
    unit = 2**-24
    y = unit * 1000 + 2 * unit * 2005
    off = asked(loop)._rounding(boxes._replace(Z=np.zeros((2, 0))))
    close(off, [y, 4 * unit * (5 + 5 * unit + 10 * 5)], 1e-3)
    off = asked(loop, controller_of([[-10]], [[0.5]], [[3]], [[7]]))._rounding(boxes)
    close(off, [y, 5 * unit * (5 + 7 * 9 + 10 * 5), 5 * unit * (0.5 * 9 + 3 * 5)], 1e-3)
    moving = loop_of(trajectory=WAVE, hardware="{sample_time: 1, arithmetic: single}")
    nothing = Boxes(np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 0)))
    for N in (0, 1e7):
        off = asked(moving, controller_of([[N]]))._rounding(nothing)
        close(off, [5 * unit, 4 * unit * (1.5 + N * 5 * unit)], 1e-3)
    still = loop_of(**at, hardware="{sample_time: 0.1, arithmetic: single}")
    found, held = bounds(still, W=2.0), 5 * (1 + unit)  # x' = u, at rest under 5: a defect
    y, u = unit * 1000 + 2 * unit * 2002, 4 * unit * 25
    assert y + TS * u + held * TS - 1e-9 <= found.W[0, 0] <= (y + TS * u + held * TS) * 1.0001
    assert (
        (2 * y + TS * u + held * TS) / TS + u - 2e-6
        <= found.U[0, 0]
        <= ((2 * y + TS * u + held * TS) / TS + u) * 1.0001
    )


@pytest.mark.parametrize("whole", [0, 1, 2])
@pytest.mark.parametrize("rest", ["0", "0.03"])
def test_a_sample_is_that_of_the_plant(whole, rest):
    """xi and e by the loop in 20 parts of a sample, with every signal that enters at a sample."""
    rng = np.random.default_rng(whole)
    A, B, E = rng.normal(size=(2, 2)), rng.normal(size=(2, 1)), rng.normal(size=(2, 1))
    machine = f"{{sample_time: 0.1, delay: {whole / 10 + float(rest):g}}}"
    wind = {"disturbance": "{E: [['1'], ['1']], bound: 1, rate: 1}"}
    loop = loop_of(**{**DOUBLE, "hardware": machine}, **wind, A=A, B=B, E=E)
    c = controller_of(
        rng.normal(size=(1, 2)), rng.normal(size=(3, 3)), rng.normal(size=(3, 2)), rng.normal(size=(1, 3))
    )
    own = Dynamics(loop, c)
    step, nodes = own.step(), 10
    e, zeta, past, w, n = (
        rng.normal(size=2),
        rng.normal(size=3),
        list(rng.normal(size=whole + 1)),
        rng.normal(),
        rng.normal(size=2),
    )
    du, dz = rng.normal(size=1), rng.normal(size=3)
    xi = np.concatenate([e, zeta, past])
    delta = c.M @ zeta + c.N @ (e + n) + du
    queue = [*delta, *past]
    h = TS / nodes
    full = expm(np.block([[A, np.hstack([B, E])], [np.zeros((2, 4))]]) * h)
    for k in range(nodes):
        acting = queue[whole] if k * h >= float(rest) - 1e-9 else queue[whole + 1]
        now = np.concatenate([xi, [w], n, du, dz])
        assert np.allclose(own.error(loop.sample_time * k / nodes).mid @ now, e, rtol=1e-9)
        moved = own.slope(loop.sample_time * (2 * k + 1) / (2 * nodes)).mid @ now
        middle = expm(np.block([[A, np.hstack([B, E])], [np.zeros((2, 4))]]) * h / 2) @ np.array(
            [*e, acting, w]
        )
        assert np.allclose(moved, A @ middle[:2] + B[:, 0] * acting + E[:, 0] * w, rtol=1e-9)
        e = (full @ np.array([*e, acting, w]))[:2]
    after = np.concatenate([e, c.F @ zeta + c.G @ (xi[:2] + n) + dz, queue[: whole + 1], [w]])
    assert np.allclose(step.mid @ now, after, rtol=1e-9)
    assert step.rad.max() < 1e-12


@pytest.mark.parametrize("length", [False, True])
def test_integrals_of_kernels(length):
    """Of a wind, of rho, of h that jumps and of its rate, through rows of e and of eta."""
    rng = np.random.default_rng(3)
    A, E, rows, plus = rng.normal(size=(2, 2)) * 3, rng.normal(size=(2, 3)), rng.normal(size=(4, 2)), 0.3
    bound = "2" if length else "[1, 2, 3]"
    loop = loop_of(
        **DOUBLE,
        uncertainty="{h: ['0.1*sin(t)']}",
        disturbance=f"{{E: [['0', '0', '0'], ['1', '1', '1']], bound: {bound}}}",
        A=A,
        B=[[0], [1]],
        E=E,
    )
    dynamics = Dynamics(loop, controller_of([[0, 0]]))
    s = (np.arange(200) + 0.5) / 200 * TS
    phi = np.array([expm(A * t) for t in s])
    whole = np.array([expm(np.block([[A, np.eye(2)], [np.zeros((2, 4))]]) * t)[:2, 2:] for t in s])
    wind = size_of(rows @ phi @ E, length) @ ([2.0] if length else [1.0, 2.0, 3.0])
    others = np.concatenate([rows @ phi @ loop.R, rows @ phi @ loop.B, rows @ whole @ loop.B + plus], axis=2)
    exact = np.concatenate([wind[:, :, None], np.abs(others)], axis=2).mean(axis=0) * TS * (1 - 1e-3)
    close(Acting(dynamics, loop.sample_time, 16).of(rows, np.full((4, 1), plus)), exact, 0.02)
    assert (Acting(dynamics, loop.sample_time, 1).of(rows, np.full((4, 1), plus)) >= exact).all()


def size_of(value, length):
    return np.linalg.norm(value, axis=-1, keepdims=True) if length else np.abs(value)


@pytest.mark.parametrize("size", [1, 3, 40])
def test_products_hold_what_their_ends_come_to_exactly(size):
    """Of numbers themselves as of intervals; the sums are rounded 2 size - 1 times."""
    rng = np.random.default_rng(size)
    a, b = (rng.normal(size=(2, size)) * 10.0 ** rng.integers(-9, 9, (2, size)) for _ in "ab")
    for reach in (0.0, 1e-3):
        A, B = (Interval(m, m + reach * np.abs(m)) for m in (a, b.T))
        found = product(A, B)
        for left, right in ((A.lo, B.lo), (A.hi, B.hi), (A.lo, B.hi)):
            exact = np.vectorize(Fraction)(left) @ np.vectorize(Fraction)(right)
            assert (np.vectorize(Fraction)(found.lo) <= exact).all()
            assert (np.vectorize(Fraction)(found.hi) >= exact).all()


def test_exponentials_of_any_length():
    A = np.array([[0.0, 40.0], [-30.0, -2.0]])
    own = Dynamics(loop_of(**DOUBLE, A=A, B=[[0], [1]]), controller_of([[0, 0]])).exponential
    for t in (Fraction(1, 1000), Fraction(1, 10), Fraction(3, 10)):
        phi, whole = own.at(t)
        exact = expm(np.block([[A, np.eye(2)], [np.zeros((2, 4))]]) * float(t))
        for found, part in ((phi, exact[:2, :2]), (whole, exact[:2, 2:])):
            assert (np.abs(found.mid - part) <= found.rad + 1e-12).all()
            assert (found.rad <= 1e-10).all()


@pytest.mark.parametrize("at_once", [1, 400_000])
def test_what_the_rows_miss_is_counted(monkeypatch, at_once):
    """Rows are floats: all that they differ by from the last one times AA, exactly, and how far outputs are off."""
    monkeypatch.setattr(responses, "_AT_ONCE", at_once)
    loop = loop_of(**DOUBLE, A=[[0.3, 1], [-0.7, 0.1]], B=[[0], [1]], uncertainty="{h: ['0.1*sin(t)']}")
    own = Responses(loop, controller_of([[-3.3, -4.7]]), lags=9, pieces=1, panels=1)
    step = np.vectorize(Fraction)(own.dynamics.step().mid[:, : own.dynamics.width])
    first, rows = own.dynamics.error(own.nodes[-1]), np.vectorize(Fraction)(own.rows)
    missed = sum(abs(a @ step - b) for a, b in pairwise(rows))
    xi = own.now[:, own.passing : own.passing + own.dynamics.width]
    assert missed.max() > 0
    assert missed[:, -1].max() > 0
    assert (missed <= xi * (1 + 1e-11)).all()
    assert (
        missed[2:4] + np.vectorize(Fraction)(first.rad[:, : own.dynamics.width]) <= xi[2:4] * (1 + 1e-11)
    ).all()


def test_how_far_from_the_chord():
    """x' = v, v' = u, whose input is held: x is a parabola, Ts^2/8 |delta| off; as all of xi and n may have it."""
    loop = loop_of(**DOUBLE, A=[[0, 1], [0, 0]], B=[[0], [1]], uncertainty="{h: ['0.1*sin(t)']}")
    own = Responses(loop, controller_of([[-3, -4]]), lags=1, pieces=1, panels=1)
    arc = TS**2 / 8
    close(own.pieces[0][:, own.passing :][:, :4], [[3 * arc, 4 * arc, 0, arc], [0, 0, 0, 0]])
    close(own.pieces[0][:, 2:5], [[3 * arc, 4 * arc, arc], [0, 0, 0]])
    late = loop_of(
        **{**DOUBLE, "hardware": "{sample_time: 0.1, delay: 0.04}"}, A=[[0, 1], [0, 0]], B=[[0], [1]]
    )
    own = Responses(late, controller_of([[-3, -4]]), lags=1, pieces=1, panels=1)
    first, last = own.pieces[:, :, own.passing :][:, :, :3]
    close(first, [[0, 0, 0.04**2 / 8], [0, 0, 0]])
    close(last, [[3 * 0.06**2 / 8, 4 * 0.06**2 / 8, 0], [0, 0, 0]])


def test_how_far_from_the_chord_of_a_later_piece():
    """x' = 3 x: x'' = 9 e^(3 s) x(0)."""
    own = Responses(loop_of(system=scalar("3*x"), A=[[3]]), controller_of([[0]]), lags=1, pieces=2, panels=1)
    close(own.pieces[:, 0, own.passing], [9 * exp(3 * end) * (TS / 2) ** 2 / 8 for end in (TS / 2, TS)])


def test_chords_meet_the_box_and_noise():
    machine = "{sample_time: 0.1, noise: {x: 0.01, v: 0.02}}"
    loop = loop_of(**{**DOUBLE, "hardware": machine}, A=[[0, 1], [0, 0]], B=[[0], [1]])
    own = asked(loop, controller_of([[-3, -4]]), pieces=1)
    boxes = Boxes(np.array([[0.5, 0.7]]), np.array([[9.0]]), np.zeros((1, 0)))
    size, noise = own.phases(boxes)[1][0], 0.01 * 3 + 0.02 * 4
    size[2:5] = 0.1, 0.2, 0.4
    close(own.responses.pieces[0] @ size, [(3 * 0.6 + 4 * 0.9 + 0.4 + noise) * TS**2 / 8, 1e-30])


def test_a_stage_begins_before_the_plan_ends():
    loop = loop_of(trajectory=WAVE.replace("repeat", "nothing").replace("horizon: 7", "horizon: 1.01"))
    recipe = asked(loop, lags=4).recipe
    stage = Stage(start=0, half_widths={"x": Fraction(1)}, deviations={"u": Fraction(9)}, memory=())
    for starts, verdict in (((0,), "certified"), ((0, 10), "certified"), ((0, 11), "undecided")):
        stages = [replace(stage, start=k) for k in starts]
        assert check(loop, controller_of(), stages, recipe).verdict.value == verdict


@pytest.mark.parametrize(("early", "verdict"), [(3, "undecided"), (30, "certified")])
def test_a_stage_begins_where_its_inequalities_do(early, verdict):
    """x' = -x from 1: e^-3 after 30 samples, and not before."""
    loop = loop_of(A=[[-1]], system=scalar("-x"), initial_state="{at: [1]}")
    own = asked(loop, controller_of(((0,),)), starts=(0, 30), lags=60)
    stages = [
        Stage(start=k, half_widths={"x": Fraction(W)}, deviations={"u": Fraction(1)}, memory=())
        for k, W in ((0, "1.1"), (early, "0.1"))
    ]
    assert check(loop, own.controller, stages, own.recipe).verdict.value == verdict


def test_what_was_sent_in_a_stage_is_met_in_the_next():
    """x' = -x + u, Ts = tau = 1, delta = -e, e(0) = -1: .368 at 1, and -.497 at 2."""
    loop = loop_of(
        A=[[-1]], system=scalar("-x"), initial_state="{at: [-1]}", hardware="{sample_time: 1, delay: 1}"
    )
    for lags in (1, 6):
        found = bounds(
            loop,
            [1.01, 0.4, 0.6],
            [1.01, 0.4, 0.6],
            tables=controller_of([[-1]]),
            lags=lags,
            starts=(0, 1, 2),
        )
        assert found.W[2, 0] >= 1 - exp(-1) - exp(-2)
    W = np.array([[1.0], [0.4], [0.6]])
    own = asked(loop, controller_of([[-1]]), starts=(0, 4, 20))
    starts, sizes, _ = own.phases(Boxes(W, W, np.zeros((3, 0))))
    assert starts == [0, 4, 6, 20, 22]
    xi = sizes[:, own.responses.passing :][:, :2]
    assert xi.tolist() == [[1, 1], [0.4, 1], [0.4, 0.4], [0.6, 0.6], [0.6, 0.6]]


def test_a_command_acts_in_its_own_stage():
    """Without delay: the first of a stage with larger ones acts at once."""
    W, U = np.array([[1.0], [1.0]]), np.array([[0.4], [1.0]])
    own = asked(loop_of(), starts=(0, 4))
    starts, sizes, _ = own.phases(Boxes(W, U, np.zeros((2, 0))))
    assert starts == [0, 4, 5]
    assert sizes[:, own.responses.passing + 1].tolist() == [0.4, 1, 1]


@pytest.mark.parametrize(
    ("sections", "size", "rate", "first"),
    [
        ({"uncertainty": "{h: ['0.3*sin(2*t) + 0.2*x']}", "trajectory": WAVE}, 0.3 + 0.2 * 1.5, 0.8, 0),
        ({"uncertainty": "{h: ['0.3*cos(2*t)']}", "trajectory": WAVE}, 0.3, 0.6, 0.3),
        ({"uncertainty": "{bounds: {h: 3, h_x: 0.2, h_t: 1}}", "trajectory": WAVE}, 3, 1.2, 3),
        ({"uncertainty": "{bounds: {h: 3, h_x: 0.2, h_t: 1}}", "trajectory": TWICE}, 3, 1.4, 3),
        ({"disturbance": "{E: [[1]], bound: 0.3, rate: 2}"}, 0.3, 2, 0.3),
        (
            {"uncertainty": "{bounds: {h: 3, h_x: 0.2, h_t: 1}}", "initial_state": "{within: 0.1}",
             "trajectory": "{kind: any, x: {x: [-1, 1]}, u: {u: [-2, 1]}, defect: 0.5, input_rate: 4}"},
            3, 1 + 0.2 * 2.5, 3,
        ),
        ({"trajectory": WAVE, "system": scalar("(p - 1)*x", more=RANGE), "slow": True}, 0.1, 0.1, 0.1),
        ({"trajectory": WAVE, "system": scalar("0", "p", more=RANGE), "slow": True}, 0.1, 0.1, 0.1),
        ({"trajectory": WAVE, "system": scalar("(p - 1)*x**2", more=RANGE), "slow": True}, 0.1, 0.1, 0.1),
    ],
)  # fmt: skip
def test_sizes_and_rates(sections, size, rate, first):
    found = Remainders(loop_of(**sections), 512).sizes(np.array([0.5]))
    for own, exact in ((found.size, size), (found.rate, rate), (found.first, first)):
        close(own, exact, 0.03)


def test_a_plan_that_rests_is_at_rest_only_as_far_as_it_is():
    trajectory = "{kind: expressions, x: ['0.1*t'], u: ['0.1'], horizon: 2, afterwards: rest}"
    loop = loop_of(trajectory=trajectory)
    assert loop.samples is None
    close(Remainders(loop, 8).defect, 0.1)


@pytest.mark.parametrize(("rate", "steep"), [("", None), (", input_rate: 4", 4)])
def test_inputs_of_a_family_are_held_by_the_planner_or_have_a_rate(rate, steep):
    trajectory = f"{{kind: any, x: {{x: [-1, 1]}}, u: {{u: [-1, 1]}}, defect: 0.1{rate}}}"
    loop = loop_of(trajectory=trajectory, initial_state="{within: 0.1}")
    found = steepness(loop, 3)
    assert found is None if steep is None else found == [steep]
    close(Remainders(loop, 4).held, (steep or 0) * TS / 2 + 2**-24)


def test_rows_up_to_the_last_that_differs():
    late = loop_of(hardware="{sample_time: 0.1, delay: 0.25}")
    assert asked(late, starts=(0, 9), lags=7).last == 9 + 2 + 1 + 7
    ends = loop_of(trajectory=WAVE.replace("repeat", "nothing").replace("horizon: 7", "horizon: 1.01"))
    assert (ends.samples, asked(ends, lags=50).last) == (11, 10)


def test_matrices_are_proposed_in_the_middle_of_the_slopes_along_the_plan():
    """F = x^2 + (1 + x/10) u, where 1 <= x* <= 3 and |u*| <= 1, and E = x/2."""
    loop = loop_of(
        system=scalar("x**2", "1 + 0.1*x"),
        trajectory="{kind: any, x: {x: [1, 3]}, u: {u: [-1, 1]}, defect: 0.1}",
        initial_state="{within: 0.1}",
        disturbance="{E: [['0.5*x']], bound: 1}",
    )
    for found, exact in zip(Remainders(loop, 4).middle(), (4, 1.2, 1), strict=True):
        assert np.abs(found - exact).max() < 1e-9


@pytest.mark.parametrize(("limits", "room"), [("[-1.5, 3]", 0.5), ("[-3, 1.25]", 0.25)])
def test_an_input_may_go_as_far_as_the_nearer_limit(limits, room):
    found = Remainders(loop_of(trajectory=WAVE, limits=f"{{u: {limits}}}"), 256).room
    assert found <= room
    assert found > room - 0.01
    assert Remainders(loop_of(trajectory=WAVE), 8).room == np.inf


def judged(loop, tables, *stages, cut=0):
    """The judgement on stages (start, W, U); one cut for all."""
    own = [
        Stage(
            start=start,
            half_widths=dict(zip(loop.model.states, map(Fraction, W), strict=True)),
            deviations=dict.fromkeys(loop.model.inputs, Fraction(U)),
            memory=(),
        )
        for start, W, U in stages
    ]
    recipe = replace(
        asked(loop, tables).recipe, cuts=((cut,) * loop.H.shape[1],) * (loop.states + loop.inputs)
    )
    return check(loop, tables, own, recipe)


def test_the_state_that_is_too_wide_is_named_and_inputs_are_those_of_the_widest_stage():
    loop = loop_of(**{**DOUBLE, "initial_state": "{at: [0, 0.5]}"}, A=[[0, 1], [0, 0]], B=[[0], [1]])
    own = controller_of([[-3, -4]])
    found = judged(loop, own, (0, (1, 0.4), 3), (2, (1, 0.4), 4))
    assert [(lack.kind, lack.where) for lack in found.lacks] == [("no_fixed_point", "v")]
    assert [float(end) for end in found.inputs[0].range] == pytest.approx([-4, 4])


@pytest.mark.parametrize(("ends", "lacks"), [("[-1.6, 3]", []), ("[-1.6, 1.4]", ["x"]), ("[-1.4, 3]", ["x"])])
def test_a_tube_keeps_to_both_ends_of_the_safe_set(ends, lacks):
    found = judged(loop_of(safe_set=f"{{x: {ends}}}", trajectory=WAVE), controller_of(), (0, [0.5], 9))
    over = [(lack.where, lack.needed) for lack in found.lacks if lack.kind == "safe_set"]
    assert over == [(name, pytest.approx(0.1, rel=0.05)) for name in lacks]


@pytest.mark.parametrize(("entry", "verdict"), [(-10, "certified"), (-10.1, "undecided")])
def test_tables_are_of_single_precision(entry, verdict):
    assert judged(loop_of(), controller_of([[entry]]), (0, [1], 9)).verdict.value == verdict


def test_an_error_stays_strictly_within_its_box_and_what_is_sent_may_fill_its_own():
    found = bounds(loop := loop_of(hardware="{sample_time: 0.1, noise: {x: 0.01}}"))
    assert _short(loop, found, found)
    assert not _short(loop, found, found._replace(W=np.nextafter(found.W, 9)))


@pytest.mark.parametrize("name", ["windows", "pieces", "panels", "lags"])
def test_a_recipe_has_one_of_each_or_more(name):
    loop, own = loop_of(), controller_of()
    one = Stage(start=0, half_widths={"x": Fraction(1)}, deviations={"u": Fraction(9)}, memory=())
    for many, verdict in ((0, "undecided"), (1, "certified")):
        found = check(loop, own, [one], replace(asked(loop, cut=0).recipe, **{name: many}))
        assert found.verdict.value == verdict


def test_cuts_are_lags():
    loop = loop_of(uncertainty="{h: ['0.1*sin(t)']}")
    for cut, verdict in ((-1, "undecided"), (0, "certified"), (6, "undecided")):
        assert judged(loop, controller_of(), (0, [1], 9), cut=cut).verdict.value == verdict
    recipe = asked(loop, cut=0).recipe
    one = Stage(start=0, half_widths={"x": Fraction(1)}, deviations={"u": Fraction(9)}, memory=())
    for cuts, verdict in (
        (((0,), (0,)), "certified"),
        (((0,), (6,)), "undecided"),
        (((-1,), (0,)), "undecided"),
    ):
        found = check(loop, controller_of(), [one], replace(recipe, cuts=cuts))
        assert found.verdict.value == verdict


def test_every_stage_has_samples_of_its_own():
    stages = (0, [1], 9), (3, [1], 9), (3, [0.5], 9)
    assert judged(loop_of(), controller_of(), *stages[:2]).verdict.value == "certified"
    assert judged(loop_of(), controller_of(), *stages).verdict.value == "undecided"


def test_inputs_are_those_of_the_plan_and_what_feedback_adds():
    loop = loop_of(**AT_ONE, system=scalar("-x"), A=[[-1]], limits="{u: [-2, 3.9]}")
    found = judged(loop, controller_of([[-9]]), (0, [0.2], 2))
    assert [float(end) for end in found.inputs[0].range] == pytest.approx([-1, 3])
    assert found.verdict.value == "certified"


@pytest.mark.parametrize(
    ("obstacle", "verdict"),
    [
        ("polygon: [[1, 1], [2, 1], [1, 2]]", "certified"),
        ("polygon: [[-3, -3], [3, -3], [0, 4]]", "undecided"),  # around it
        ("polygon: [['-0.05', 1], [1, '-0.05'], [1, 1]]", "certified"),  # its box is met, and no edge
        ("polygon: [['0.05', 1], ['0.05', -4], [1, 1]]", "undecided"),
        ("disc: {center: [1, 0], radius: 0.89}", "certified"),
        ("disc: {center: [1, 0], radius: 0.91}", "undecided"),
        ("disc: {center: [0, 0], radius: 3}", "undecided"),
    ],
)
def test_obstacles_keep_out_of_boxes_about_the_plan(obstacle, verdict):
    loop = loop_of(**DOUBLE, A=[[0, 1], [0, 0]], B=[[0], [1]], obstacles=f"[{{{obstacle}}}]")
    (found,) = cleared(loop, np.array([[0.1, 0.2]]), [0])
    assert found.verdict == verdict


def test_the_obstacle_that_is_in_the_way_is_named():
    far, near = (f"{{disc: {{center: [{x}, 0], radius: 0.5}}}}" for x in (4, 1))
    loop = loop_of(**DOUBLE, A=[[0, 1], [0, 0]], B=[[0], [1]], obstacles=f"[{far}, {near}]")
    lacks = judged(loop, controller_of([[-3, -4]]), (0, (0.6, 1), 3)).lacks
    assert [lack.where for lack in lacks if lack.kind == "obstacle"] == ["2"]
