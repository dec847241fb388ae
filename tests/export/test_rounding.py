"""What exported code can lose to rounding: bounds against what it does lose, in 60 digits; and what is refused."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from controllers import GIVEN, KNOTS, PATH, machine, recipe, wandering
from tubecert.conditions.hardware import Rounding
from tubecert.export.accounted import Accounted
from tubecert.export.assembly import assembled
from tubecert.export.compiled import Memory, compiled, compiler
from tubecert.export.folder import exported
from tubecert.export.followed import FLOATS, UncoveredError
from tubecert.export.program import GREATEST, LEAST, Program
from tubecert.export.reference import Reference, _mean_on_pieces, execute
from tubecert.export.rounding import _Analysis, rounding_of, within

from tubecert.errors import TubecertError
from tubecert.expression import constant
from tubecert.model import build
from tubecert.spec import load_text
from tubecert.trajectory.pieces import piecewise_plan

NONE = Rounding(feedback=Fraction(0), input=Fraction(0), estimate=Fraction(0), prediction=Fraction(0))
ANY = Rounding(feedback=Fraction(1), input=Fraction(1), estimate=Fraction(1), prediction=Fraction(1))
DU = Fraction("6.302")  # of the orbit's metric, from above


def controller(name="orbit", lost=ANY, **values):
    given = GIVEN[name]
    return assembled(
        replace(given, recipe=replace(given.recipe, rounding=(lost,)), feedback_gain=DU, **values)
    )


def exactly(program: Program, *given):
    """What comes out of a program in 60 digits, by name; marked vectors too."""
    values = []
    inputs = {port.name: vector for port, vector in zip(program.inputs, given, strict=True)}
    with mpmath.workdps(60):
        for step in program.steps:
            args = [values[p] for p in step.places]
            match step.operation:
                case "input":
                    values.append(mpmath.mpf(inputs[step.name][step.index]))
                case "constant":
                    values.append(mpmath.mpf(step.value.numerator) / step.value.denominator)
                case "neg":
                    values.append(-args[0])
                case "call":
                    values.append(getattr(mpmath, step.name)(args[0]))
                case "choose":
                    values.append({LEAST: min, GREATEST: max}[step.name](*args))
                case "add" | "sub" | "mul" | "div":
                    a, b = args
                    values.append(
                        {"add": a + b, "sub": a - b, "mul": a * b}[step.operation]
                        if step.operation != "div"
                        else a / b
                    )
        ports = (*program.outputs, *program.marked)
        return {port.name: [values[p] for p in port.places] for port in ports}


def length(vector):
    return mpmath.sqrt(sum(x * x for x in vector))


def near_the_plan(c, count, real):
    """Times of samples, and what may be measured at them: in the tube, often very near to the plan."""
    generator = np.random.default_rng(5)
    W = np.linalg.inv(np.array([[float(q) for q in row] for row in c.metric]))
    root = np.linalg.cholesky(W)
    for k in generator.integers(0, int((c.horizon or 6) / c.sample_time), size=count):
        t = mpmath.mpf(int(k)) * c.sample_time.numerator / c.sample_time.denominator
        direction = generator.normal(size=len(c.states))
        share = 10.0 ** generator.uniform(-7, 0) * float(c.reach) * 0.999
        away = root @ (direction / np.linalg.norm(direction)) * share
        xs = exactly(c.plan, [t])["x"]
        y = np.array([float(a) + b for a, b in zip(xs, away, strict=True)]).astype(real)
        yield int(k), t, y


@pytest.mark.parametrize(("precision", "real"), [("single", np.float32), ("double", np.float64)])
def test_the_feedback_loses_no_more_than_is_said(precision, real):
    c = controller(held=True)
    bound = rounding_of(c, precision)
    worst_a = worst_u = mpmath.mpf(0)
    for k, t, y in near_the_plan(c, 60, real):
        now = np.asarray(real(k) * real(float(c.sample_time)))[None, None]
        xs, us = execute(c.plan, now, real=real)
        (f,), (vs,) = execute(c.drift, y[None], real=real), execute(c.flow, xs, us, real=real)
        kappa, _ = execute(c.law, y[None], f, xs, vs, us, real=real)
        given = [float(q) for q in y]
        plan = exactly(c.plan, [t])
        exact = exactly(
            c.law,
            given,
            exactly(c.drift, given)["f"],
            plan["x"],
            exactly(c.flow, plan["x"], plan["u"])["v"],
            plan["u"],
        )
        found = [mpmath.mpf(float(q)) for q in kappa[0]]
        with mpmath.workdps(60):
            told = exact["told"]
            limit = mpmath.mpf(DU.numerator) / DU.denominator * mpmath.sqrt(told[0])
            beyond = max(mpmath.mpf(0), length(found) - limit)
            inner = sum(a * b for a, b in zip(exact["c"], found, strict=True))
            worst_a = max(worst_a, told[1] + inner)
            off = beyond + length([mpmath.mpf(float(a)) - b for a, b in zip(us[0], plan["u"], strict=True)])
            worst_u = max(worst_u, off)
    assert worst_a <= mpmath.mpf(float(bound.feedback))
    assert worst_u <= mpmath.mpf(float(bound.input))
    assert worst_a > 5e-5 * float(bound.feedback)  # intervals take f(y) and f(x*) for independent


@pytest.mark.parametrize(("precision", "real"), [("single", np.float32), ("double", np.float64)])
def test_the_estimate_loses_no_more_than_is_said(precision, real):
    """q against (1 - th) q + th sigma, all of it exact, from the same numbers."""
    c = controller(held=True)
    bound, generator = rounding_of(c, precision), np.random.default_rng(6)
    samples = [y for _, _, y in near_the_plan(c, 40, real)]
    worst = mpmath.mpf(0)
    for y in samples:
        last = (y + generator.normal(size=2) * 1e-2).astype(real)
        held, before = (generator.uniform(-3, 3, size=1).astype(real) for _ in range(2))
        q = generator.uniform(-2, 2, size=1).astype(real)
        (f,), (last_f,) = (execute(c.drift, each[None], real=real) for each in (y, last))
        (mean,) = execute(c.applied, held[None], before[None], real=real)
        new, _ = execute(c.estimator, y[None], f, last[None], last_f, q[None], mean, real=real)
        own, old = [float(v) for v in y], [float(v) for v in last]
        with mpmath.workdps(60):
            exact = exactly(
                c.estimator,
                own,
                exactly(c.drift, own)["f"],
                old,
                exactly(c.drift, old)["f"],
                [float(v) for v in q],
                exactly(c.applied, [float(v) for v in held], [float(v) for v in before])["mean"],
            )["q"]
            th = 1 - mpmath.exp(-mpmath.mpf("75.96") / 500)
            worst = max(worst, abs(mpmath.mpf(float(new[0, 0])) - exact[0]) / th)
    assert 0.001 * float(bound.estimate) < worst <= float(bound.estimate)


@pytest.mark.parametrize(("precision", "real"), [("single", np.float32), ("double", np.float64)])
def test_the_estimate_loses_less_where_measurements_are_near_to_each_other(precision, real):
    """The difference of two measurements alone, over Ts and th, which had been what loses most."""
    c = controller(held=True, noise_size=Fraction(1))
    bound, generator = rounding_of(c, precision).estimate, np.random.default_rng(8)
    worst, direction = 0.0, generator.normal(size=(40, 2))
    for (_, _, y), own in zip(near_the_plan(c, 40, real), direction, strict=True):
        last = (y + own / np.linalg.norm(own) * float(c.moves[0]) * 0.999).astype(real)
        (f,), (last_f,) = (execute(c.drift, each[None], real=real) for each in (y, last))
        zero = np.zeros((1, 1), dtype=real)
        new, _ = execute(c.estimator, y[None], f, last[None], last_f, zero, zero, real=real)
        one, two = [float(v) for v in y], [float(v) for v in last]
        nothing = [mpmath.mpf(0)]
        slow = [exactly(c.drift, each)["f"] for each in (one, two)]
        exact = exactly(c.estimator, one, slow[0], two, slow[1], nothing, nothing)["q"][0]
        worst = max(worst, abs(float(mpmath.mpf(float(new[0, 0])) - exact)) / float(c.share))
    assert 0.01 * float(bound) < worst <= float(bound)


def test_a_measurement_moves_by_its_share_of_the_coordinates():
    """|y_i - last_i| <= |row i of S^-1| (Y Ts + 2 nu n_E), against directions at random."""
    c = assembled(replace(GIVEN["turning"], noise_size=Fraction(2)))
    S = np.array([[1, 0, 0], [0, 2, 0], [0, 1 / 3, 1]])
    own = GIVEN["turning"].recipe
    far = float(own.speed * own.sample_time + 4 * own.noise)
    directions = np.random.default_rng(2).normal(size=(4000, 3))
    reached = np.abs(np.linalg.solve(S, (directions / np.linalg.norm(directions, axis=1)[:, None]).T)).max(1)
    moves = np.array([float(q) for q in c.moves])
    assert np.all(reached * far <= moves)
    assert np.all(reached * far > 0.98 * moves)


def set_to(code, **rows):
    """What a compiled controller keeps, as it is wanted."""
    for name, row in rows.items():
        getattr(code._states[0], name)[:] = [float(value) for value in row]


@pytest.mark.skipif(compiler() is None, reason="no C compiler on PATH")
@pytest.mark.slow
def test_the_float_build_stays_within_what_is_accounted_for_at_every_sample():
    """Float and double, compiled, side by side from the same memory: what each sample loses against r_a, r_u, r_q."""
    c = controller(held=True)
    r, fine = rounding_of(c, "single"), rounding_of(c, "double")
    lost = {name: float(getattr(r, name) + getattr(fine, name)) for name in ("feedback", "input", "estimate")}
    measured = wandering(c, 40, 1, 7)[:, 0].astype(np.float32)
    low, high = (float(end) for end in GIVEN["held_orbit"].clip[0])
    worst = dict.fromkeys(lost, 0.0)
    with compiled(exported(c, precision="single")) as single, compiled(exported(c)) as double:
        single.start(measured[:1]), double.start(measured[:1])
        for k, y in enumerate(measured):
            one, two = single._states[0], double._states[0]
            set_to(double, **{name: getattr(one, name) for name in ("q", "feedback", "held", "before")})
            single.step(y[None]), double.step(y[None])
            assert one.sample == two.sample == k + 1
            q_off = abs(one.q[0] - two.q[0]) / float(c.share)
            plan, own = exactly(c.plan, [mpmath.mpf(k) / 500]), [float(q) for q in y]
            v = exactly(c.flow, plan["x"], plan["u"])["v"]
            exact = exactly(c.law, own, exactly(c.drift, own)["f"], plan["x"], v, plan["u"])
            square, half, _ = map(float, exact["told"])
            kappa, limit = one.feedback[0] - float(plan["u"][0]), float(DU) * np.sqrt(square)
            beyond = max(0.0, abs(kappa) - limit)
            written = abs(one.held[0] - (one.feedback[0] - min(max(one.q[0], low), high) * (k > 0)))
            size = abs(float(exact["c"][0]))
            assert half + float(exact["c"][0]) * kappa <= lost["feedback"] + size * lost["input"]
            assert beyond + written <= 2 * lost["input"]
            assert q_off <= lost["estimate"]
            worst = {
                "feedback": max(worst["feedback"], half + float(exact["c"][0]) * kappa),
                "input": max(worst["input"], beyond + written),
                "estimate": max(worst["estimate"], q_off),
            }
    assert worst["estimate"] > 1e-4 * lost["estimate"]
    assert worst["input"] > 1e-5 * lost["input"]


@pytest.mark.skipif(compiler() is None, reason="no C compiler on PATH")
@pytest.mark.slow
@pytest.mark.parametrize("name", ["seldom_orbit", "held_orbit"])
def test_every_sample_is_held_to_what_is_accounted_for(name):
    """As `simulate --controller` does; of what `double` may lose, `float` takes many times all of it."""
    c = controller(name)
    shares = []
    for lost in (rounding_of(c, "single"), rounding_of(c, "double")):
        accounted = Accounted(c, lost)
        with compiled(exported(c, precision="single"), lanes=2) as code:
            measured = wandering(c, 30, 2, 7)
            code.start(measured[0])
            for k, y in enumerate(measured):
                before = code.memory()
                code.step(y)
                accounted.sample(k, code.measured(y), before, code.memory())
        shares.append(accounted.share)
    assert 1e-4 < shares[0] <= 1
    assert shares[1] > 1e4


def test_a_clip_a_feedback_and_a_filter_that_are_off_are_seen():
    """Each against its own bound: what the code keeps is changed by twice that."""
    c = controller("held_orbit")
    lost = rounding_of(c, "single")
    y = wandering(c, 3, 2, 7)
    exact = Reference(controller=c)
    exact.start(y[0]), exact.step(y[0])
    names = ("y", "f", "q", "feedback", "held", "before")
    before = Memory(**{name: getattr(exact, name) for name in names})
    exact.step(y[1])
    after = Memory(**{name: getattr(exact, name) for name in names})

    def share(**values):
        accounted = Accounted(c, lost)
        accounted.sample(1, y[1], before, replace(after, **values))
        return accounted.share

    assert share() < 1e-6
    assert 1 < share(q=after.q + 2 * float(lost.estimate * c.share)) < 1e3
    assert 1 < share(held=after.held + 2 * float(lost.input)) < 3
    more = 2 * np.abs(after.feedback) + 10
    assert share(feedback=after.feedback + more, held=after.held + more) > 1e3
    assert share(feedback=after.feedback * np.nan) == np.inf


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["single", "double"])
def test_the_mean_of_a_moving_input_is_that_of_its_integral(precision):
    """Gauss's rule in exact arithmetic against quadrature in 60 digits: less than what r_q says of it."""
    c = controller()
    with mpmath.workdps(60):
        Ts = mpmath.mpf(1) / 500
        u = lambda t: exactly(c.plan, [t])["u"][0]  # noqa: E731
        found = mpmath.mpf(0)
        for k in (0, 700, 1500):
            begin = k * Ts
            nodes = [u(begin + Ts * q) for q in (mpmath.mpf("0.11270166537925831148"), mpmath.mpf(1) / 2)]
            nodes.append(u(begin + Ts * mpmath.mpf("0.88729833462074168852")))
            rule = (5 * nodes[0] + 8 * nodes[1] + 5 * nodes[2]) / 18
            found = max(found, abs(rule - mpmath.quad(u, [begin, begin + Ts]) / Ts))
        held = rounding_of(controller(held=True), precision).estimate
        assert found <= float(rounding_of(c, precision).estimate - held)


def through_knots(**values):
    """The machine of "path", about rounding: a plan through knots, of which several meet one sample."""
    plan = piecewise_plan(build(load_text(PATH)), KNOTS)
    own = recipe(sample_time=Fraction(1, 100), feedback_time=Fraction(1, 100), rounding=(ANY,))
    given = machine(PATH, plan, recipe=own, horizon=Fraction("0.31"), feedback_gain=DU)
    return replace(given, **values)


def test_a_plan_through_knots_is_covered_while_its_input_goes_on():
    given = through_knots()
    held, played = (rounding_of(assembled(replace(given, held=own)), "double") for own in (True, False))
    assert held.input < Fraction(1, 10**11)
    assert held.estimate < played.estimate < Fraction(1, 10**12)
    jumping = piecewise_plan(build(load_text(PATH)), replace(KNOTS, interpolation="hold"))
    with pytest.raises(UncoveredError, match="jumps"):
        rounding_of(assembled(replace(given, plan=jumping, held=True)), "double")


def test_knots_that_a_type_cannot_tell_apart_are_not_covered():
    c = assembled(through_knots())
    with pytest.raises(UncoveredError, match="between knots"):
        rounding_of(replace(c, pieces=replace(c.pieces, most=c.pieces.most - 2)), "single")


@pytest.mark.parametrize(("precision", "real"), [("single", np.float32), ("double", np.float64)])
def test_the_mean_of_an_input_through_knots_is_that_of_its_integral(precision, real):
    """The code's shares and middles, in its type, against the integral over every sample in exact fractions."""
    c = assembled(through_knots())
    plan, Ts = c.pieces, c.sample_time
    analysis = _Analysis(c, FLOATS[precision])
    bound = analysis._mean_through_knots(plan, analysis._plan()[1][0]).error.max()
    ends = [*plan.start[1:], c.horizon]
    worst = 0.0
    for k in range(1, int(c.horizon / Ts) + 1):
        begin, end = (k - 1) * Ts, k * Ts
        exact = Fraction(0)
        for start, last, (row,) in zip(plan.start, ends, plan.u, strict=True):
            a, b = max(begin, start), min(end, last)
            if a < b:
                exact += (b - a) / Ts * (row[0] + ((a + b) / 2 - start) * row[1])
        step = real(float(Ts))
        found = _mean_on_pieces(plan, np.array([real(k - 1) * step]), np.array([real(k) * step]), real)
        worst = max(worst, abs(float(Fraction(float(found[0, 0])) - exact)))
    assert 2e-4 * bound < worst <= bound


@pytest.mark.skipif(compiler() is None, reason="no C compiler on PATH")
@pytest.mark.slow
def test_the_float_build_of_a_plan_through_knots_loses_no_more_than_is_said():
    """Float beside double, compiled, from the same memory at every sample: what is off in q, against r_q."""
    c = assembled(through_knots())
    bound = sum(float(rounding_of(c, own).estimate) for own in ("single", "double"))
    worst = 0.0
    with compiled(exported(c, precision="single")) as single, compiled(exported(c)) as double:
        measured = wandering(c, 31, 1, 7)[:, 0].astype(np.float32)
        single.start(measured[:1]), double.start(measured[:1])
        for y in measured:
            one, two = single._states[0], double._states[0]
            set_to(double, **{name: getattr(one, name) for name in ("q", "feedback", "held", "before")})
            single.step(y[None]), double.step(y[None])
            worst = max(worst, abs(one.q[0] - two.q[0]) / float(c.share))
    assert 1e-4 * bound < worst <= bound


@pytest.mark.parametrize(("name", "why"), [("turning", "table"), ("predicting_path", "knots is played")])
def test_what_of_a_prediction_is_not_covered(name, why):
    with pytest.raises(UncoveredError, match=why):
        rounding_of(controller(name), "double")


def test_a_plan_without_end_is_not_covered():
    with pytest.raises(UncoveredError, match="without end"):
        rounding_of(controller(held=True, horizon=None), "double")


@pytest.mark.parametrize("kind", ["feedback", "input", "estimate"])
def test_code_that_can_lose_more_than_the_certificate_allows_is_not_written(kind):
    own = rounding_of(controller(), "double")
    assert within(controller(lost=own), "double")
    less = replace(own, **{kind: getattr(own, kind) * Fraction(999, 1000)})
    with pytest.raises(TubecertError, match="does not allow for what double loses"):
        exported(controller(lost=less))
    with pytest.raises(TubecertError, match="does not allow for what single loses"):
        exported(controller(lost=own), precision="single")


def test_the_files_say_what_is_covered():
    own = rounding_of(controller(), "double")
    assert all(
        "with the rounding of its arithmetic" in t
        for t in (exported(controller(lost=own)).files["README.md"],)
    )
    plain = exported(assembled(GIVEN["orbit"])).files
    assert "EXACT arithmetic" in plain["README.md"]
    assert "7.52316384526264e-37" not in plain["hardware_orbit.c"]  # as before: no limit of the feedback


def test_what_may_be_a_root_of_less_than_nothing_has_no_bound():
    """f with sqrt(1/4 - p), which the states of the tube reach: computed, it may be no number."""
    text = PATH.replace('v, "p - v/2"', 'v, "p - v/2 + sqrt(p + 1/5) - sqrt(1/5)"')
    own = recipe(rounding=(ANY,))
    given = machine(text, recipe=own, horizon=None, feedback_gain=DU)
    with pytest.raises(UncoveredError, match="overflows"):
        rounding_of(assembled(replace(given, reach=Fraction(1))), "double")
    assert rounding_of(assembled(replace(given, reach=Fraction(1, 50))), "double").estimate < Fraction(
        1, 10**9
    )


def test_samples_beyond_the_counter_are_not_covered():
    with pytest.raises(UncoveredError, match="counts"):
        rounding_of(controller(held=True, horizon=Fraction(10**8)), "double")


def test_units_in_which_the_feedback_leaves_the_type_are_not_covered():
    """|c|^2 overflows: in single the share would be 0, and no feedback were left."""
    given = GIVEN["held_orbit"]
    W = tuple(tuple(e * constant(Fraction(1, 10**22)) for e in row) for row in given.model.W)
    odd = replace(given, model=replace(given.model, W=W), recipe=replace(given.recipe, rounding=(ANY,)))
    with pytest.raises(UncoveredError, match="overflows"):
        rounding_of(assembled(replace(odd, feedback_gain=DU / 10**11, reach=given.reach * 10**11)), "single")


def test_a_number_that_single_has_not_is_not_covered():
    text = PATH.replace("[0], [1]", "[0], [1e39]")
    given = machine(text, recipe=recipe(rounding=(ANY,)), horizon=None, feedback_gain=DU)
    with pytest.raises(UncoveredError, match="too large"):
        rounding_of(assembled(given), "single")
