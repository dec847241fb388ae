"""The sums of the checker against the worst that signals do: an oracle in floats that shares nothing with it."""

import json
from collections import namedtuple
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from flint import arb, arb_mat, ctx
from sampled_files import SCALAR, SWING
from scipy.linalg import expm
from scipy.optimize import linprog

from tubecert.recheck.curve import Knots as Curved
from tubecert.recheck.document import Node
from tubecert.recheck.obstacles import Obstacle, apart
from tubecert.recheck.plans import Plan
from tubecert.recheck.sampled_loop import theorem
from tubecert.recheck.sampled_loop.record import Recipe, Stage
from tubecert.recheck.sampled_loop.remainders import Course, Remainders, Size, Slow, course_of
from tubecert.recheck.sampled_loop.theorem import Inequalities, Loop, Phase, phases_of
from tubecert.recheck.specification import read_sampled_specification
from tubecert.recheck.specified.trajectory import Tabled
from tubecert.spec import load_text
from tubecert.spec.canonical import canonical

Knots = namedtuple("Knots", "t u held", defaults=[True])
FINE = 12  # parts of a sample, of which whole numbers are late
SAMPLE = Fraction(1, 4)


def test_an_exponential_holds_every_entry():
    """Of [0 1; 1 0]: a remainder entry by entry would leave out those that the powers so far do not reach."""
    none = {"F": arb_mat(0, 0), "G": arb_mat(0, 2), "M": arb_mat(1, 0), "N": arb_mat(1, 2)}
    A, H, times = arb_mat([[0, 1], [1, 0]]), arb_mat([[1, 0], [0, 1]]), (Fraction(1), Fraction(0))
    loop = Loop(A, arb_mat(2, 1), H, [*none.values()], times)
    for t in (arb("0.4"), arb(0.4, 0.1), arb(0)):
        moved = loop.flow(t)
        for i in (0, 1):
            assert moved[i, i].overlaps(t.cosh())
            assert moved[i, 1 - i].overlaps(t.sinh())
            assert moved[i, 2 + i].overlaps(t.sinh())
            assert moved[i, 3 - i].overlaps(t.cosh() - 1)
    wide = loop.flow(arb(0.4, 0.1))[0, 1]
    assert wide.contains(arb("0.3").sinh())
    assert wide.contains(arb("0.5").sinh())


class Case:
    """A loop with random tables, its signals, and the floats of both."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.n, self.z, self.late = int(rng.integers(1, 3)), int(rng.integers(0, 3)), int(rng.integers(0, 31))
        n, z = self.n, self.z
        self.A = rng.normal(size=(n, n)).round(2)
        self.B = rng.normal(size=(n, 1)).round(2)
        self.H, self.E = self.B.copy(), rng.normal(size=(n, 1)).round(2)
        self.F, self.G = 0.4 * rng.normal(size=(z, z)), 0.5 * rng.normal(size=(z, n))
        self.M, self.N = 0.5 * rng.normal(size=(1, z)), 0.5 * rng.normal(size=(1, n))
        self.noise, self.wind = rng.uniform(0.01, 0.1, size=n), float(rng.uniform(0.1, 1))
        self.length = seed % 2 == 1 and n > 1  # the noise is one
        if self.length:
            self.noise[:] = self.noise[0]
        self.size, self.rate = 1.0, float(rng.uniform(0.1, 4))
        self.first, self.start = float(rng.uniform(0, 1)), rng.normal(size=n)
        self.lags = 9
        self.cuts = tuple((int(rng.integers(0, 10)),) for _ in range(n + 1 + z))

    def inequalities(self) -> Inequalities:
        delay = SAMPLE * Fraction(self.late, FINE)
        named = {
            name: arb_mat(getattr(self, name).tolist())
            if getattr(self, name).size
            else arb_mat(*getattr(self, name).shape)
            for name in "ABHFGMN"
        }
        A, B, H, *tables = named.values()
        loop = Loop(A, B, H, tables, (SAMPLE, delay))
        noise, wind = Size([*map(arb, self.noise)], length=self.length), Size([arb(self.wind)], length=False)
        eta = Slow([*map(arb, self.H[:, 0])], *map(arb, (self.size, self.rate, self.first)))
        n, z = self.n, self.z
        stage = Stage(0, (Fraction(10**6),) * n, (Fraction(10**6),), (Fraction(10**6),) * z)
        phase = Phase(0, stage, [arb(1)] * loop.width + [arb(0)] * (n + 1 + z), [arb(0)] * (n + 1))
        recipe = Recipe(self.lags, self.cuts, 2, 8, 1, True)
        start, winds = [*map(arb, self.start)], [(arb_mat(self.E.tolist()), wind)]
        return Inequalities(loop, recipe, [phase], noise, winds, [eta], start, arb(0), self.lags)

    def responses(self, k: int, part: int, state: int | None) -> dict[str, np.ndarray]:
        """What e_state at a part of sample k, or delta_k, answers to every signal, part by part."""
        count = k * FINE + part
        block = np.zeros((self.n + 3, self.n + 3))
        block[: self.n] = np.hstack([self.A, self.B, self.H, self.E])
        step = expm(block * float(SAMPLE) / FINE)[: self.n]
        n, z = self.n, self.z
        inputs = n + (k + 1) * n + 2 * max(count, 1) + 1  # start, noise, eta (at every end of a part), wind
        e, zeta, sent = np.zeros((n, inputs)), np.zeros((z, inputs)), []
        e[:, :n] = np.eye(n)
        eta, wind = n + (k + 1) * n, n + (k + 1) * n + count + 1
        held = np.zeros((1, inputs))
        for i in range(count + (state is None)):
            if i % FINE == 0:
                heard = e.copy()
                heard[:, n + (i // FINE) * n : n + (i // FINE + 1) * n] += np.eye(n)
                sent.append(self.M @ zeta + self.N @ heard)
                zeta = self.F @ zeta + self.G @ heard
                if i == count:
                    break
            due = (i - self.late) // FINE
            held = sent[due] if due >= 0 else np.zeros((1, inputs))
            e = step[:, :n] @ e + step[:, n : n + 1] @ held
            e[:, eta + i] += 0.5 * step[:, n + 1]
            e[:, eta + i + 1] += 0.5 * step[:, n + 1]
            e[:, wind + i] += step[:, n + 2]
        row = sent[-1][0] if state is None else e[state]
        return {
            "start": row[:n],
            "noise": row[n:eta].reshape(-1, n),
            "eta": row[eta:wind],
            "wind": row[wind:],
        }

    def worst(self, k: int, part: int, state: int | None) -> float:
        own = self.responses(k, part, state)
        noise = np.linalg.norm(own["noise"], axis=1)[:, None] if self.length else np.abs(own["noise"])
        fixed = abs(own["start"] @ self.start) + (noise @ self.noise[: noise.shape[1]]).sum()
        return float(fixed + np.abs(own["wind"]).sum() * self.wind + self.slow(own["eta"]))

    def slow(self, weights: np.ndarray) -> float:
        """Sup of weights eta with |eta| <= size, |eta'| <= rate, |eta(0)| <= first: a linear program."""
        count = len(weights)
        if count < 2:
            return float(np.abs(weights).sum() * self.first)
        steps = np.diff(np.eye(count), axis=0)
        most = np.full(2 * (count - 1), self.rate * float(SAMPLE) / FINE)
        bounds = [(-self.first, self.first), *[(-self.size, self.size)] * (count - 1)]
        return float(-linprog(-weights, A_ub=np.vstack([steps, -steps]), b_ub=most, bounds=bounds).fun)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_no_signal_does_more_than_the_sums_say_and_the_worst_does_nearly_as_much(seed):
    """Delays of 0 to 2.5 samples, cuts at random: e at the nodes and between them, delta, at every sample."""
    case = Case(seed)
    made = case.inequalities()
    with ctx.workprec(53):
        assert made.bounds(0, 0)
    nodes = [float(s / SAMPLE) * FINE for s in made.nodes]
    shares = []
    for k in (0, 1, 2, 4, 8):
        for i in range(case.n):
            for a, (begin, end) in enumerate(pairwise(nodes)):
                bound = float(made.bounds(i, k)[a].upper())
                for part in range(int(np.ceil(begin - 1e-9)), int(end + 1e-9) + 1):
                    attained = case.worst(k, part, i)
                    assert attained <= bound * (1 + 2e-3), (k, i, part)
        attained, delta = case.worst(k, 0, None), float(made.bounds(case.n, k)[0].upper())
        assert attained <= delta * (1 + 2e-3), k
        shares.append(attained / max(delta, 1e-300))
    assert max(shares) > 0.9


def plain(A, E, start: list[float], wind: float) -> Inequalities:
    """e' = A e + E w from a point, nothing else; samples of 1 s, one piece, one panel, the box no larger than it."""
    n = len(A)
    nothing = {"F": arb_mat(0, 0), "G": arb_mat(0, n), "M": arb_mat(1, 0), "N": arb_mat(1, n)}
    loop = Loop(arb_mat(A), arb_mat(n, 1), arb_mat(n, 0), [*nothing.values()], (Fraction(1), Fraction(0)))
    winds = [(arb_mat([[x] for x in E]), Size([arb(wind)], length=False))]
    stage, noise = Stage(0, (Fraction(1),) * n, (Fraction(1),), ()), Size([arb(0)] * n, length=False)
    box = [arb(max(abs(x), 1e-9)) for x in start]
    phase = Phase(0, stage, [*box, *[arb(0)] * (n + 1)], [arb(0)] * (n + 1))
    recipe = Recipe(2, ((),) * (n + 1), 1, 1, 1, True)
    return Inequalities(loop, recipe, [phase], noise, winds, [], [*map(arb, start)], arb(0), 2)


def test_an_error_between_samples_is_seen():
    """sin(pi t) is 0 at every sample, from a start at the end of the box; so is what a wind does in the trapezoid."""
    swinging = [[0.0, 1.0], [-(np.pi**2), 0.0]]
    assert plain(swinging, [0, 0], [0.0, np.pi], 0.0).bounds(0, 0)[0].upper() >= 1
    (within,) = plain(swinging, [0, 1], [0.0, 0.0], 1.0).bounds(0, 1)
    assert within.upper() >= 2 / np.pi**2


def test_what_acts_within_a_sample_may_be_above_its_chord():
    """p' = v + w, v' = -w from (1, -.5): sup |p(s)| = 1 - s/2 + s - s^2/2 is 1 at both ends, and 1.125 between."""
    (found,) = plain([[0.0, 1.0], [0.0, 0.0]], [1, -1], [1.0, -0.5], 1.0).bounds(0, 0)
    assert 1.125 <= found.upper() < 1.3


def test_every_panel_is_bent():
    """x' = x + w: d^3/12 e^s is at most so much on either half of a sample."""
    halved = plain([[1.0]], [1], [0.0], 1.0)
    halved = replace(halved, recipe=replace(halved.recipe, panels=2))
    bent, exact = float(halved._kernels(Fraction(1))[-1][0, 2].abs_upper()), (np.exp(0.5) + np.e) / 96
    assert exact <= bent <= 1.2 * exact


def test_no_more_is_kept_than_there_is_room_for(monkeypatch):
    """Three rows, two lags, two phases."""
    own = plain([[0.0]], [1], [0.5], 0.1)
    own = replace(own, phases=[*own.phases, replace(own.phases[0], start=1)])
    monkeypatch.setattr(theorem, "_MOST_TERMS", 12)
    assert own.bounds(0, 0)
    monkeypatch.setattr(theorem, "_MOST_TERMS", 11)
    with pytest.raises(ArithmeticError, match="too many"):
        replace(own).bounds(0, 0)


def test_what_is_no_number_bounds_nothing():
    for wind in (float("nan"), float("inf")):
        (found,) = plain([[0.0]], [1], [0.5], wind).bounds(0, 1)
        assert not found < 1e300


def test_phases_hold_the_commands_that_wait():
    stages = [Stage(k, (Fraction(1),), (Fraction(u),), ()) for k, u in ((0, 5), (10, 3), (11, 1))]
    found = [(begin, stage.start, most) for begin, stage, (most,) in phases_of(stages, 2)]
    assert found == [(0, 0, 5), (10, 10, 5), (11, 11, 5), (12, 11, 3), (13, 11, 1)]


def test_a_box_keeps_away_from_a_disc_as_far_as_its_corner():
    """Corner at (0, 0), middle at (.18, .24): .3 apart."""
    box = [(Fraction(-1), Fraction(0))] * 2
    for radius, away in (("0.31", False), ("0.3", False), ("0.29", True)):
        disc = Obstacle(("p", "v"), (), (Fraction("0.18"), Fraction("0.24")), Fraction(radius), decides=True)
        assert apart(disc, box) is away


def test_a_box_keeps_away_from_a_polygon_by_an_axis_or_by_a_line():
    corners = tuple((Fraction(x), Fraction(y)) for x, y in ((1, 0), (3, 0), (3, 2)))
    polygon = Obstacle(("p", "v"), corners, None, None, decides=True)
    for x, y, away in (
        (0, 1, True),
        (1, 1, True),
        (2, 0, False),
        (3, 1, False),
        (1, -1, False),
        (4, 0, True),
    ):
        box = [(Fraction(x), Fraction(x) + Fraction(3, 4)), (Fraction(y) + Fraction(1, 2), Fraction(y) + 1)]
        assert apart(polygon, box) is away, (x, y)


def read_spec(text):
    return read_sampled_specification(Node(json.loads(json.dumps(canonical(load_text(text)))), "spec"))


def test_a_plan_of_a_family_moves_as_the_plant_does_and_by_its_defect():
    text = SCALAR.replace(
        "{kind: equilibrium, at: [0], input: [0]}",
        "{kind: any, x: {x: [-1, 1]}, u: {u: [-2, 2]}, defect: 0.25, input_rate: 3}",
    ).replace("{at: [0.3]}", "{within: 0.1}")
    spec = read_spec(text)
    course = course_of(spec, Plan("any", None, None, None, None, None))
    (window,) = course.windows(1)
    assert window.speed[0].contains(arb(0, "2.75"))
    assert window.steepness[0].contains(arb(0, 3))
    assert course.held([window])[0] >= arb("0.15").lower()
    assert course.defect()[0].contains(arb("0.25"))


def test_inputs_that_jump_between_knots():
    """Up at .95, up again at 1.02, across the end; and jumps where commands begin to act."""
    text = SWING.replace("rate: 10, delay: one sample, hold: left", "rate: 5")
    spec = read_spec(text)
    t, u = ("0", "0.02", "0.3", "0.67", "0.95", "1"), (0, 1, 0, -1, 0, 0)
    for times, rows, most in ((t, u, 2), (("0", "0.2", "0.4", "0.6", "0.8", "1"), (0, 1, 0, 1, 0, 0), 0)):
        knots = Knots(tuple(map(Fraction, times)), tuple((Fraction(x),) for x in rows))
        assert Course(spec, None, knots).held([]) == [most]
    left = replace(spec, hardware=replace(spec.hardware, hold="left"))
    assert Course(left, None, knots).held([]) == [1]
    once = replace(left, afterwards="nothing")
    for times, rows, most in (((0, 1), (1, 2), 0), ((0, "0.3", "0.5001", 1), (0, 1, 3, 3), 3)):
        knots = Knots(tuple(map(Fraction, times)), tuple((Fraction(x),) for x in rows))
        assert Course(once, None, knots).held([]) == [most]


def test_a_plan_through_knots_begins_again_where_it_ends():
    text = SWING.replace("rate: 10, delay: one sample, hold: left", "rate: 5")
    zero, one = (Fraction(0),), (Fraction(1),)
    for end, x, u, goes_on in (("1", zero, zero, True), ("1", one, zero, False), ("1", zero, one, False),
                               ("1.1", zero, zero, False)):  # fmt: skip
        spec = replace(read_spec(text), trajectory=Tabled("linear", Fraction(end)))
        knots = Curved(t=(Fraction(0), Fraction(end)), x=(zero, x), u=(zero, u), held=False)
        assert Course(spec, None, knots).goes_on is goes_on
    longer = Curved(t=(Fraction(0), Fraction("1.2")), x=(zero, zero), u=(zero, zero), held=False)
    assert not Course(replace(spec, trajectory=Tabled("linear", Fraction(1))), None, longer).goes_on


def test_a_wind_through_a_row_is_a_length_or_its_components():
    row = [arb(3, 1), arb(-4)]
    for bound, most in ((Fraction(2), 2 * 32**0.5), ((Fraction(1), Fraction(2)), 12)):
        assert abs(float(Size.of(bound, 2).through(row).upper()) - most) < 1e-6


def test_what_is_not_linear_and_what_shakes_add_up():
    """f = x/2 + x^2/10 where |e| <= .1: .2 x (.2 + .4 + .6 + .8 + 1)/5 a step; E = 1 + x/10 with |w| <= .2."""
    text = SCALAR.replace("0.5*x", "0.5*x + 0.1*x**2").replace("E: [[1]]", 'E: [["1 + 0.1*x"]]')
    course = course_of(read_spec(text), Plan("equilibrium", None, None, None, None, None))
    nominal = arb_mat([[0.5]]), arb_mat([[1]]), arb_mat([[1]])
    found = Remainders(course, nominal, 1, slow=True).rho([arb(0.1)], [arb(0.5)], [])
    assert 0.0032 <= float(found[0].upper()) < 0.00321


def test_a_plan_that_rests_misses_what_the_plant_does_where_it_ends():
    """x* = t and u* = 2 t: |1 - 2.5 t| is at most 1.5 while it moves, and then |F| is 2.5."""
    text = SCALAR.replace(
        "{kind: equilibrium, at: [0], input: [0]}",
        '{kind: expressions, x: ["t"], u: ["2*t"], horizon: 1, afterwards: rest}',
    )
    course = course_of(read_spec(text), Plan("expressions", None, None, None, None, None))
    last = course.windows(4)[-1]
    assert [float(x) for x in (*last.x, *last.u, *last.speed, *last.steepness)] == [1, 2, 0, 0]
    assert abs(float(course.defect()[0].upper()) - 2.5) < 1e-9
