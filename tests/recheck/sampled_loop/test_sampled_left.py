"""What the checker says is left of a plant that is not linear, against closed forms: never below, and near."""

import json
from fractions import Fraction
from math import ceil

import pytest
from flint import arb, arb_mat
from sampled_files import CART, SCALAR, changed, made, why_not
from small_loops import AT_ONE, RANGE, WAVE, scalar, text_of

from tubecert.recheck.cover import CONFIRMED
from tubecert.recheck.curve import Knots
from tubecert.recheck.document import Node
from tubecert.recheck.plans import Plan
from tubecert.recheck.sampled_loop.claims import Case
from tubecert.recheck.sampled_loop.record import Proven, Recipe, Stage, read_result
from tubecert.recheck.sampled_loop.remainders import Remainders, Size, course_of
from tubecert.recheck.sampled_loop.theorem import Loop
from tubecert.recheck.specification import read_sampled_specification
from tubecert.spec import load_text
from tubecert.spec.canonical import canonical
from tubecert.trajectory.make import unending

HOME = {"safe_set": "{x: [-50, 50]}"}


def asked(**sections):
    """The specification with some sections in place of those at home."""
    text = text_of(**{**HOME, **sections})
    return read_sampled_specification(Node(json.loads(json.dumps(canonical(load_text(text)))), "spec"))


def planned(given, knots=None) -> Plan:
    """Its plan, through knots if there are some."""
    return Plan(given.trajectory.kind, knots and given.trajectory.between, None, knots, None, None)


def left(*, A=0, E=(), slow=False, knots=None, **sections) -> Remainders:
    """Of x' = f + B u with some sections in place of those at home."""
    given = asked(**sections)
    nominal = arb_mat([[A]]), arb_mat([[1]]), arb_mat(1, len(E), list(E))
    return Remainders(course_of(given, planned(given, knots)), nominal, 256, slow=slow)


def case_of(stages, tables, *, lags=4, ranges=(), **sections) -> Case:
    """A case of n = 1 with stages (start, W, U, Z ..) and tables F, G, M, N, that nobody has proven."""
    given = asked(**sections)
    n, m, z = len(given.plant.states), len(given.plant.inputs), tables[0].nrows()
    own = tuple(
        Stage(k, (Fraction(W),) * n, (Fraction(U),) * m, (*map(Fraction, Z),)) for k, W, U, *Z in stages
    )
    return Case(
        given,
        Proven(
            nominal=(arb_mat(n, n), arb_mat(n, m, [1] * (n * m)), arb_mat(n, 0)),
            tables=dict(zip("FGMN", tables, strict=True)),
            stages=own,
            recipe=Recipe(lags, ((),) * (n + m + z), 1, 1, 8, slow=True),
            plan=planned(given),
            ranges=ranges,
            cleared=(),
            repeated={},
        ),
        2000,
    )


SILENT = arb_mat(0, 0), arb_mat(0, 1), arb_mat(1, 0), arb_mat([[0]])


BENT = scalar("0", "1 + 0.1*x")
RESTING = "{kind: equilibrium, at: [0], input: [0], horizon: 4}"
THROUGH = "{kind: ilqr, start: [0], target: [2], horizon: 2, knots: 3, goal: false}"
ROWS = ((Fraction(0),), (Fraction(1),), (Fraction(2),))
KNOTS = Knots(t=tuple(map(Fraction, (0, 1, 2))), x=ROWS, u=ROWS)
RISE = "{kind: expressions, x: ['t'], u: ['1'], horizon: 1}"
SPRING = 0.1 * sum(1 / (1 - 0.02 * k) ** 2 - 1 / (1 + 0.02 * k) ** 2 for k in range(1, 6)) / 5
KNOWN = "{bounds: {h: 3, h_x: 0.2, h_t: 1}}"


@pytest.mark.parametrize(
    ("sections", "U", "through"),
    [
        ({"system": scalar("0.1*x**2")}, 0, (0.2 * 0.6 * 0.25, 0)),  # .1 W^2, in five levels
        ({"system": BENT}, 2, (0.1 * 0.6 * 2, 0)),
        ({"uncertainty": "{h: ['0.2*x']}"}, 0, (0, 0.1)),
        ({"uncertainty": "{h: ['0.2*x']}", "system": BENT}, 0, (0.05 * 0.1, 0.1)),
        ({"trajectory": WAVE, "uncertainty": "{h: ['0.2*x**2']}"}, 0, (0, 0.3 + 0.05)),
        ({"uncertainty": KNOWN}, 0, (0, 0.1)),
        ({"uncertainty": KNOWN, "system": BENT}, 0, (0.15, 0.1)),
        ({"uncertainty": "{bounds: {h: 3}}", "system": BENT}, 0, (0.15, 0)),
        ({"disturbance": "{E: [['1 + 0.2*x']], bound: [0.3]}", "E": [1]}, 0, (0.03, 0)),
        ({"disturbance": "{E: [['1 + 0.6*x', '1 + 0.8*x']], bound: 0.3}", "E": [1, 1]}, 0, (0.15, 0)),
        ({"trajectory": WAVE, "disturbance": "{E: [['1 + 0.2*x']], bound: 0.3}", "E": [1]}, 0, (0.09, 0.05)),
        ({"trajectory": "{kind: equilibrium, at: [0], input: [0.02]}"}, 0, (0.02, 0)),
        (
            {"trajectory": "{kind: equilibrium, at: [0], input: [1000]}", "system": scalar("-1000")},
            0,
            (0, 1000 * 2**-24),
        ),
        ({"trajectory": WAVE.replace("cos(t)'", "cos(t) + 0.02'")}, 0, (0.02, 0.05)),
        ({"trajectory": "{kind: expressions, x: ['0.1*t'], u: ['0.1'], horizon: 2, afterwards: rest}"}, 0, (0.1, 0)),
        ({**AT_ONE, "system": scalar("-p*x", more=RANGE), "A": -1}, 0, (0.1 + 0.05, 0)),
        ({**AT_ONE, "system": scalar("-p*x", more=RANGE), "A": -1, "slow": True}, 0, (0.05, 0)),
        # 2 x/p is from (2 - 2 a W)/1.1 to (2 + 2 a W)/.9, and A in the middle of that
        ({**AT_ONE, "system": scalar("(x**2 - 1)/p - 1", more=RANGE), "A": 70 / 33}, 0, (14 / 33, 0)),
    ],
)  # fmt: skip
def test_what_is_left(sections, U, through):
    own = left(**sections)
    found = own.rho([arb("0.5")], [arb(U)], own.slow([arb("0.5")]))
    for ball, exact in zip(found, through, strict=True):
        assert exact * (1 - 1e-9) <= float(ball.abs_upper()) <= exact * 1.03 + 1e-6


@pytest.mark.parametrize(
    ("sections", "size", "rate", "first"),
    [
        ({"uncertainty": "{h: ['0.3*sin(2*t) + 0.2*x']}", "trajectory": WAVE}, 0.6, 0.8, 0),
        ({"uncertainty": "{h: ['0.3*cos(2*t)']}", "trajectory": WAVE}, 0.3, 0.6, 0.3),
        ({"uncertainty": "{h: ['0.3*sin(0.5*t)']}", "trajectory": WAVE}, 0.3, 0.15, 0),
        ({"uncertainty": "{h: ['0.1*t']}", "trajectory": RESTING}, 0.4, 0.1, 0),
        ({"uncertainty": "{h: ['0.1*t']}", "trajectory": THROUGH, "knots": KNOTS}, 0.2, 0.1, 0),
        ({"uncertainty": "{h: ['0.2 - 0.1*t']}", "trajectory": THROUGH, "knots": KNOTS}, 0.2, 0.1, 0.2),
        ({"uncertainty": KNOWN, "trajectory": WAVE}, 3, 1.2, 3),
        ({"disturbance": "{E: [[1]], bound: 0.3, rate: 2}", "E": [1]}, 0.3, 2, 0.3),
        ({"trajectory": WAVE, "system": scalar("(p - 1)*x**2", more=RANGE), "slow": True}, 0.1, 0.1, 0.1),
        ({"trajectory": WAVE, "system": scalar("0", "p", more=RANGE), "slow": True}, 0.1, 0.1, 0.1),
        ({"trajectory": RISE, "system": scalar("(p**6 - 1)*x", more=RANGE), "slow": True}, *[1.1**6 - 1] * 3),
        # a spring that the input holds: (u - x)/p^2 is 0 at p0, and no more known than p is on the way from there
        ({**AT_ONE, "system": scalar("-x/p", "1/p", more=RANGE), "slow": True}, SPRING, 0, SPRING),
    ],
)  # fmt: skip
def test_sizes_and_rates(sections, size, rate, first):
    (own,) = left(**sections).slow([arb("0.5")])
    for ball, exact in ((own.size, size), (own.rate, rate), (own.first, first)):
        assert exact * (1 - 1e-9) <= float(ball.abs_upper()) <= exact * 1.03 + 1e-6


@pytest.mark.parametrize("delay", ["0", "0.03", "0.1", "0.13"])
def test_rows_change_as_their_derivatives_say(delay):
    A, B, H = arb_mat([[0, 1], [-2, "0.3"]]), arb_mat([[0], [1]]), arb_mat([[1], [2]])
    tables = arb_mat([["0.5"]]), arb_mat([[1, 2]]), arb_mat([[3]]), arb_mat([[-1, -2]])
    text = SCALAR.replace("delay: 0.04", f"delay: {delay}")
    machine = read_sampled_specification(
        Node(json.loads(json.dumps(canonical(load_text(text)))), "spec")
    ).hardware
    loop = Loop(A, B, H, tables, (machine.sample_time, machine.delay))
    assert loop.waiting == ceil(float(delay) / 0.1)
    for s, later in ((arb("0.05"), True), (arb("0.02"), not loop.rest)):
        h = arb("1e-6")
        moved = (loop.error(s + h, later=later) - loop.error(s - h, later=later)) * (1 / (2 * h))
        for x, y in zip(moved.entries(), loop.error(s, 1, later=later).entries(), strict=True):
            assert abs(x - y) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("ends", [("-0.9", "2.9"), ("-2.9", "0.9")])
def test_a_range_holds_on_both_sides(ends):
    assert why_not(changed(made(SCALAR), "inputs", 0, "range", to=list(ends)))


@pytest.mark.slow
def test_a_part_of_no_length_in_floats_has_a_window():
    t = (
        Fraction(0),
        Fraction(1, 2),
        *(Fraction(1, 2) + k * Fraction(1, 10**330) for k in (1, 2)),
        Fraction(1),
    )
    u = ((Fraction(0),), (Fraction(0),), (Fraction(9),), (Fraction(0),), (Fraction(0),))
    given = asked(trajectory="{kind: ilqr, start: [0], target: [0], horizon: 1, goal: false}")
    own = course_of(given, planned(given, Knots(t=t, x=((Fraction(0),),) * 5, u=u)))
    assert max(float(window.u[0].abs_upper()) for window in own.windows(8)) >= 9


def test_h_is_defined_on_all_of_the_safe_set():
    h = ["0.2*sin(t) + 0.0000001*log(p + 5)"]
    assert why_not(changed(made(CART), "spec", "effective", "uncertainty", "h", to=h))


@pytest.mark.slow
def test_h_is_as_large_as_on_the_widest_stage():
    document = made(SCALAR.replace("limits:", "uncertainty: {h: ['0.1*x']}\nlimits:"), base=SCALAR)
    widths = [float(stage["half_widths"]["x"]) for stage in document["result"]["tube"]]
    found = read_result(Node(document["result"], "result"))
    (own,) = Case(found.specification, found.proven, 2000).slow
    assert max(widths) > 2 * min(widths)
    assert 0.1 * max(widths) <= float(own.size.abs_upper()) <= 0.101 * max(widths)


@pytest.mark.parametrize("at", [0.3, 3.1, 6.8])
def test_a_plan_misses_what_it_misses_most(at):
    """x* = 0 and u* = .02 at one time, and next to nothing elsewhere."""
    trajectory = f"{{kind: expressions, x: ['0'], u: ['0.02/(1 + 100*(t - {at})**2)'], horizon: 7}}"
    given = asked(trajectory=trajectory)
    (found,) = course_of(given, planned(given)).defect()
    assert 0.02 * (1 - 1e-9) <= float(found.upper()) < 0.0202


@pytest.mark.parametrize(("arithmetic", "unit"), [("single", 2**-24), ("double", 2**-53)])
def test_rounding_of_a_controller(arithmetic, unit):
    """x* = 1000 and u* = 5, |e| <= 2, |n| <= 3, |zeta| <= 9; c = z + n + 3 products and sums (theory, D.8)."""
    tables = arb_mat([[0.5]]), arb_mat([[3]]), arb_mat([[7]]), arb_mat([[-10]])
    case = case_of(
        [(0, 2, 1, 9)],
        tables,
        trajectory="{kind: equilibrium, at: [1000], input: [5]}",
        initial_state="{at: [1000]}",
        safe_set="{x: [0, 2000]}",
        hardware=f"{{sample_time: 0.1, arithmetic: {arithmetic}}}",
    )
    found = case._rounding(Size.of((Fraction(3),), 1), [arb(2)], [arb(9)])
    y = 2**-24 * 1000 + 2 * unit * (2 * 1000 + 2 + 3)
    exact = y, 5 * unit * (5 + 7 * 9 + 10 * (5 + y)), 5 * unit * (0.5 * 9 + 3 * (5 + y))
    for ball, least in zip(found, exact, strict=True):
        assert least * (1 - 1e-9) <= float(ball.abs_upper()) <= least * 1.00001


@pytest.mark.parametrize(
    ("sections", "starts", "lags", "last"),
    [
        ({"trajectory": WAVE.replace("7, afterwards: repeat", "1.01")}, (0,), 50, 10),
        ({"trajectory": WAVE.replace("7, afterwards: repeat", "1")}, (0,), 50, 9),
        ({"trajectory": WAVE.replace("7, afterwards: repeat", "1")}, (0,), 3, 4),
        ({"hardware": "{sample_time: 0.1, delay: 0.25}"}, (0, 9), 7, 9 + 2 + 1 + 7),
    ],
)
def test_samples_up_to_the_last_that_differs(sections, starts, lags, last):
    case = case_of([(k, 1, 1) for k in starts], SILENT, lags=lags, **sections)
    assert case.inequalities.last == last


@pytest.mark.parametrize(
    ("wave", "horizon", "goes_on"),
    [
        ("sin(t)", "2*pi", True),
        ("sin(t)", "6.28318530717958647692528676655900577", True),
        ("sin(t)", "6.28318530717958647692528676655900576", False),
        ("sin(6*pi*t)", "1/3", True),
        ("sin(6*pi*t)", "0.33333333333333333333333333333333", False),
        ("sin(pi*t)*cos(t)", "100", False),
    ],
)
def test_the_exact_period_is_one_that_goes_on(wave, horizon, goes_on):
    """2*pi and 1/3 were refused, as they are no floats; both who make a plan and who check it decide so."""
    plan = f"{{kind: expressions, x: ['{wave}'], u: ['0'], horizon: {horizon}, afterwards: repeat}}"
    spec = load_text(text_of(trajectory=plan, initial_state="{at: [0]}"))
    assert [item.code for item in unending(spec, None)] == ["TC204"] * (not goes_on)
    given = asked(trajectory=plan)
    if "cos" not in wave:
        assert course_of(given, planned(given)).goes_on is goes_on


def test_the_stages_that_may_last_at_a_time_of_the_plan():
    """They begin at 0, 1 and 2.5 s; the plan ends after 2 s."""
    stages = [(0, "0.1", 1), (10, "0.2", 1), (25, "0.3", 1)]
    for afterwards, spans in (
        ("nothing", ((0, 0.9, 0.1), (0.5, 1, 0.2), (1.5, 2, 0.2))),
        ("rest", ((0, 0.9, 0.1), (0.5, 1, 0.2), (1.5, 1.9, 0.2), (1.5, 2, 0.3), (1.5, 2 - 1e-12, 0.3))),
        ("repeat", ((0, 0.9, 0.3),)),
    ):
        plan = f"{{kind: expressions, x: ['0.1*t'], u: ['0'], horizon: 2, afterwards: {afterwards}}}"
        case = case_of(stages, SILENT, trajectory=plan)
        for begin, end, widest in spans:
            assert [*map(float, case._widths(begin, end))] == [widest], (afterwards, begin, end)
    assert [*map(float, case_of(stages, SILENT)._widths(0.0, 0.5))] == [0.3]


TWO = {
    "system": "{states: [x, y], inputs: [u, v], f: ['0', '0'], B: [[1, 0], [0, 1]]}",
    "safe_set": "{x: [-50, 50], y: [-50, 50]}",
    "trajectory": "{kind: equilibrium, at: [0, 0], input: [0, 0]}",
    "initial_state": "{at: [0, 0]}",
}


def test_a_plan_of_two_inputs_rests():
    trajectory = "{kind: expressions, x: ['t', '0'], u: ['t', '1'], horizon: 1, afterwards: rest}"
    given = asked(**{**TWO, "trajectory": trajectory})
    last = course_of(given, planned(given)).windows(4)[-1]
    assert [*map(float, last.u)] == [1, 1]
    assert [*map(float, last.steepness)] == [0, 0]


def test_a_plan_that_misses_less_for_longer_misses_what_it_misses_most():
    """.019 about 1, and .02 with what is left of that, .019/17, for a moment at 5."""
    u = "0.019/(1 + (t - 1)**2) + 0.02*exp(-400*(t - 5)**2)"
    given = asked(trajectory=f"{{kind: expressions, x: ['0'], u: ['{u}'], horizon: 7}}")
    (found,) = course_of(given, planned(given)).defect()
    assert 0.02 + 0.019 / 17 <= float(found.upper()) < 0.0213


def test_every_input_is_within_its_limits():
    for ranges, kept in (
        (((-2, 2), (-2, 3)), True),
        (((-2, 2), (-4, 2)), False),
        (((-2, 4), (-2, 2)), False),
    ):
        own = tuple((Fraction(a), Fraction(b)) for a, b in ranges)
        silent = arb_mat(0, 0), arb_mat(0, 2), arb_mat(2, 0), arb_mat(2, 2)
        case = case_of([(0, 1, 1)], silent, ranges=own, limits="{u: [-3, 3], v: [-3, 3]}", **TWO)
        assert (case.follows().verdict == CONFIRMED.verdict) is kept


def test_no_controller_has_no_memory_and_adds_nothing():
    for z, gain, kept in ((0, 0, True), (0, 0.5, False), (1, 0, False)):
        tables = arb_mat(z, z), arb_mat(z, 2), arb_mat(2, z), arb_mat([[0, gain], [0, 0]])
        case = case_of([(0, 1, 1, *[1] * z)], tables, controller="none", **TWO)
        assert (case.single().verdict == CONFIRMED.verdict) is kept
