"""Recheck's own bounds of what exported C rounds: mistakes of the exporter's, other texts, and code that loses more."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from controllers import CONTROLLERS
from flint import arb, ctx
from followed import bounds, covered, in_recheck, predicting, predicting_path, texts
from tubecert.export.followed import DOUBLE
from tubecert.export.rounding import rounding_of
from tubecert.export.vectors import run, vectors
from tubecert.recheck.code.constants import of_tables, otherwise
from tubecert.recheck.code.examination import agreement
from tubecert.recheck.code.prediction import STEPS, Model, cut
from tubecert.recheck.code.reader import read_code
from tubecert.recheck.code.words import UnreadError

from tubecert.enclosure.interval import Interval
from tubecert.export import prediction as ahead
from tubecert.export import rounding as own
from tubecert.recheck.balls import between, exact
from tubecert.recheck.terms import function, number, variable

NAMES = ("feedback", "input", "estimate")


@cache
def followed(name, precision):
    """A controller about rounding, and recheck's bounds of its code."""
    c = covered(name)
    return c, bounds(c, in_recheck(name), texts(c, precision))


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("name", ["orbit", "steep"])
def test_both_bounds_are_near_to_each_other(name, precision):
    """They share nothing but the text: another analysis, other constants of (H.38), another cover of the plan."""
    c, found = followed(name, precision)
    theirs = rounding_of(c, precision)
    shares = [found[each] / float(getattr(theirs, each)) for each in NAMES]
    assert all(0.05 < share < 1 for share in shares), shares


def without(operation):
    """The exporter's step that forgets to round one kind of operations."""
    whole = own._Analysis._step

    def step(self, program, step, memory, given):
        found = whole(self, program, step, memory, given)
        if step.operation != operation:
            return found
        _, error = own.combined(operation, *(memory[place] for place in step.places))
        return replace(found, error=np.asarray(error.hi))

    return own._Analysis, "_step", step


def blind(operation, side):
    """The exporter's errors that do not know one of the operands."""
    whole = own.combined

    def combined(kind, *args):
        given = list(args)
        if kind == operation:
            given[side] = replace(given[side], error=0 * given[side].error)
        return whole(kind, *given)

    return own, "combined", combined


def exact_program(name):
    """The exporter that takes one program for exact."""
    whole = own._Analysis._run

    def run_(self, program, given, apart=None):
        found = whole(self, program, given, apart)
        if program.name != name:
            return found
        return {key: [replace(x, error=0 * x.error) for x in row] for key, row in found.items()}

    return own._Analysis, "_run", run_


def narrow():
    """A tube that is too small."""
    whole = own._Analysis.__init__

    def init(self, *args):
        whole(self, *args)
        self.widths = [width * Interval.of(Fraction(1, 2)) for width in self.widths]

    return own._Analysis, "__init__", init


def undivided():
    """R_q without its division by th."""
    whole = own._Analysis._estimated
    return own._Analysis, "_estimated", lambda self, *args: whole(self, *args) * Interval.of(self.c.share)


def exact_mean():
    """The mean of a u* through knots, and u* as it is played, without an error."""
    return own._Analysis, "_played", lambda self, us, written: [replace(u, error=0 * u.error) for u in us]


def halved():
    """A step whose remainder is taken for half of what it is."""
    whole = ahead._cut
    return ahead, "_cut", lambda *args: [own * Interval.of(Fraction(1, 2)) for own in whole(*args)]


def known_input():
    """A prediction that takes its input for the one of theorem H-P."""
    whole = ahead.off

    def off(c, given, follow):
        return whole(c, replace(given, wrong=Interval.of(0)), follow)

    return own, "off", off


BUGS = {
    "the unit of the other type": (
        "steep",
        "single",
        lambda: (own, "FLOATS", dict.fromkeys(own.FLOATS, DOUBLE)),
    ),
    "functions of math.h are exact": ("steep", "double", lambda: (own, "_LIBRARY", 0)),
    "a slope of 0": ("held_orbit", "double", lambda: (own, "steepest", lambda name, x: 0 * x.hi)),
    "additions are exact": ("steep", "double", lambda: without("add")),
    "subtractions are exact": ("held_orbit", "double", lambda: without("sub")),
    "products are exact": ("steep", "double", lambda: without("mul")),
    "the second factor is exact": ("steep", "double", lambda: blind("mul", 1)),
    "the first summand is exact": ("steep", "double", lambda: blind("add", 0)),
    "the second summand is exact": ("steep", "double", lambda: blind("add", 1)),
    "what is subtracted from is exact": ("steep", "double", lambda: blind("sub", 0)),
    "what is subtracted is exact": ("held_orbit", "double", lambda: blind("sub", 1)),
    "a tube of half the width": ("steep", "double", narrow),
    "time is exact": ("held_orbit", "double", lambda: (own._Analysis, "_late", lambda self: Interval.of(0))),
    "the plan is exact": ("held_orbit", "double", lambda: exact_program("plan")),
    "f is exact": ("steep", "double", lambda: exact_program("drift")),
    "f + B u is exact": ("steep", "double", lambda: exact_program("flow")),
    "the feedback is exact": ("held_orbit", "double", lambda: exact_program("law")),
    "the estimator is exact": ("steep", "double", lambda: exact_program("estimator")),
    "not over th": ("held_orbit", "double", undivided),
    "the mean through knots is exact": ("path", "single", exact_mean),
}


@pytest.mark.slow
@pytest.mark.parametrize("bug", sorted(BUGS))
def test_a_mistake_in_the_exporters_analysis_is_noticed(bug, monkeypatch):
    """Its bounds, as what a certificate allows for, are not those that recheck can confirm."""
    name, precision, made = BUGS[bug]
    c, found = followed(name, precision)
    monkeypatch.setattr(*made())
    theirs = rounding_of(c, precision)
    assert any(found[each] > float(getattr(theirs, each)) for each in NAMES)


@pytest.mark.slow
def test_another_order_of_operations_has_another_bound():
    """(y - last)/Ts as y/Ts - last/Ts: what the exporter followed is not what stands there."""
    c, found = followed("held_orbit", "double")
    header, source = texts(c, "double")
    changed = source.replace("500.0 * (y[0] - last_y[0])", "(500.0 * y[0]) - (500.0 * last_y[0])")
    assert changed != source
    other = bounds(c, in_recheck("held_orbit"), (header, changed))
    assert other["estimate"] > 1.02 * found["estimate"]


@pytest.mark.slow
def test_single_loses_more_than_double_may():
    c, found = followed("held_orbit", "single")
    theirs = rounding_of(c, "double")
    assert all(found[each] > 1e6 * float(getattr(theirs, each)) for each in NAMES)


@pytest.mark.slow
@pytest.mark.parametrize("held", [True, False])
def test_a_plan_through_knots_is_followed_piece_by_piece(held):
    c = covered("path", held=held)
    found = bounds(c, replace(in_recheck("path"), held=held), texts(c, "double"))
    theirs = rounding_of(c, "double")
    # a certificate allows for twice the exporter's
    assert all(0.02 < found[each] / float(getattr(theirs, each)) < 2 for each in NAMES)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
def test_what_is_measured_moves_little_from_one_sample_to_the_next(precision):
    """Y Ts + 2 nu n_E bounds the difference that is divided by Ts: both bounds fall, and a wrong one is noticed."""
    c, anywhere = covered("held_orbit", noise_size=Fraction(1)), covered("held_orbit")
    assert [float(q) for q in c.moves] == pytest.approx([8.1 / 500 + 2e-3] * 2)
    theirs, found = rounding_of(c, precision), bounds(c, in_recheck("held_orbit"), texts(c, precision))
    assert theirs.estimate < rounding_of(anywhere, precision).estimate / 20
    assert 0.3 < found["estimate"] / float(theirs.estimate) < 1
    less = rounding_of(replace(c, moves=tuple(q / 4 for q in c.moves)), precision)
    assert found["estimate"] > float(less.estimate)


MEANS = {
    "a middle": ("0.5 * (begin + until)", "0.25 * (begin + until)", "another way"),
    "a share": ("(until - begin) / length", "(until - begin) * length", "another way"),
    "a knot": ("START[k + 1] < end ?", "START[k + 1] <= end ?", "another way"),
    "a piece less": ("j < 3;", "j < 2;", "more pieces"),
}


@pytest.mark.parametrize("change", sorted(MEANS))
def test_a_mean_that_is_computed_in_another_way_is_refused(change):
    c = covered("path")
    header, source = texts(c, "double")
    old, new, why = MEANS[change]
    assert source.count(old) == 1
    with pytest.raises(UnreadError, match=why):
        bounds(c, in_recheck("path"), (header, source.replace(old, new)))


def measured(c, count, precision):
    y = np.array(vectors(c, single=precision == "single").y[:count])
    return y.astype(np.float32).astype(float) if precision == "single" else y


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("name", sorted(CONTROLLERS))
def test_what_a_computer_answers_is_within_the_bounds_at_every_sample(name, precision):
    """The reference of the exporter in this very type, and the text in balls, against the formulas."""
    c = CONTROLLERS[name]()
    y = measured(c, 28, precision)[np.r_[0:4, 24:28]]  # near the plan, then where the clip acts
    answered = run(c, y, np.float32 if precision == "single" else float).tolist()
    with ctx.workprec(200):
        rows = [[exact(Fraction(value)) for value in row] for row in y.tolist()]
        difference, share = agreement(read_code(*texts(c, precision)), in_recheck(name), rows, answered)
    assert difference > 0
    assert 1e-5 < share <= 1


# of the text of the orbit: what is changed, and into what
CHANGES = {
    "sign": ("out_kappa[0] = -", "out_kappa[0] = "),
    "digit": ("0.24834955778683296", "0.24834955778783296"),
    "gain": ("0.14094299744758143", "0.14094299744769143"),
    "index": ("y[1] - xs[1]", "y[0] - xs[1]"),
    "clip": ("r3 < 1.9 ? r3 : 1.9", "r3 < 1.9000001 ? r3 : 1.9000001"),
    "no value": ("u[i] = kappa[i];", "kappa[i] = u[i];"),
    "delay": ("(0.75 * held[0]) + (0.25 * before[0])", "(0.75 * before[0]) + (0.25 * held[0])"),
    "memory": ("c->before[i] = c->held[i];", "c->before[i] = c->feedback[i];"),
    "node": ("0.00022540333075851663", "0.00032540333075851663"),
    "loop": ("c->q[i] = q[i];", "c->q[i] = estimate[i];"),
    "time": (
        "(real)c->sample * HARDWARE_ORBIT_SAMPLE_TIME;\n",
        "(real)(c->sample - 1) * HARDWARE_ORBIT_SAMPLE_TIME;\n",
    ),
    "order": ("c->sample++;", "c->sample += 2;"),
}


@pytest.mark.slow
@pytest.mark.parametrize("change", sorted(CHANGES))
def test_a_text_that_computes_something_else_is_noticed(change):
    """Without a compiler: far below what compiled code could be compared to."""
    c = CONTROLLERS["orbit"]()
    header, source = texts(c, "double")
    assert source.count(CHANGES[change][0]) >= 1
    y = measured(c, 40, "double")
    y = y[np.r_[0:4, 24:34]]  # near the plan, then where the clip acts
    with ctx.workprec(200):
        rows = [[exact(Fraction(value)) for value in row] for row in y.tolist()]
        code = read_code(header, source.replace(*CHANGES[change], 1))
        try:
            _, share = agreement(code, in_recheck("orbit"), rows)
        except UnreadError:
            return
    assert share > 1


@pytest.mark.slow
def test_a_feedback_at_every_third_sample_loses_what_one_at_all_of_them_does():
    (_, all_of_them), (_, third) = followed("orbit", "double"), followed("seldom_orbit", "double")
    assert third == all_of_them


@pytest.mark.slow
@pytest.mark.parametrize(
    "change", [("_EVERY 3 ", "_EVERY 4 "), ("c->since = 0;\n    }", "c->since = 1;\n    }")]
)
def test_a_feedback_at_other_samples_is_noticed(change):
    files = texts(CONTROLLERS["seldom_orbit"](), "double")
    changed = [text.replace(*change) for text in files]
    assert changed != list(files)
    y = measured(CONTROLLERS["seldom_orbit"](), 8, "double")
    with ctx.workprec(200):
        rows = [[exact(Fraction(value)) for value in row] for row in y.tolist()]
        code, formulas = read_code(*changed), in_recheck("seldom_orbit")
        assert agreement(code, formulas, rows)[1] > 1
        if "EVERY" in change[0]:
            assert next(otherwise(code, formulas)) == "EVERY"


def test_a_text_whose_numbers_have_no_bound_is_not_said_to_differ():
    c = CONTROLLERS["orbit"]()
    header, source = texts(c, "double")
    changed = source.replace("r2 > (-2.0)", "(r2 / (r2 - r2)) > (-2.0)").replace(
        "? r2 : (-2.0)", "? (r2 / (r2 - r2)) : (-2.0)"
    )
    with ctx.workprec(200):
        rows = [[exact(Fraction(value)) for value in row] for row in measured(c, 4, "double").tolist()]
        code, formulas = read_code(header, changed), in_recheck("orbit")
        with pytest.raises(UnreadError, match="no bound"):
            agreement(code, formulas, rows)


UNKNOWN = {
    "another loop": ("for (i = 0; i < M; i++) {", "while (i < M) {"),
    "a pointer": ("real x[N];", "real *x;"),
    "a number of another type": ("0.75 * held[0]", "0.75f * held[0]"),
    "a whole number": ("0.75 * held[0]", "3 * held[0]"),
    "a function": ("sin(t[0])", "lgamma(t[0])"),
    "no contraction": ("#pragma STDC FP_CONTRACT OFF\n", ""),
    "a macro": ("typedef hardware_orbit_real real;", "#define real float"),
    "an entry beyond": ("y[1] - xs[1]", "y[2] - xs[1]"),
    "another feedback": ("(r11 < r10 ? r11 : r10)", "r11"),
    "another norm": ("sqrt(r8 >", "sqrt(r4 >"),
    "no end": ("i < M; i++", "0 < M; i++"),
}


@pytest.mark.slow
@pytest.mark.parametrize("change", sorted(UNKNOWN))
def test_what_is_not_understood_is_refused(change):
    c = covered("orbit")
    header, source = texts(c, "double")
    changed = source.replace(*UNKNOWN[change])
    assert changed != source
    with pytest.raises(UnreadError):
        bounds(c, in_recheck("orbit"), (header, changed))


@pytest.mark.slow
def test_a_plan_without_end_and_code_of_another_loop_are_not_followed():
    c, formulas = predicting("0.0005", held=True)
    formulas.case.curve = replace(formulas.case.curve, horizon=None)
    with pytest.raises(UnreadError, match="without end"):
        bounds(c, formulas, texts(c, "double"))
    with pytest.raises(UnreadError, match="do not agree"):
        bounds(covered("orbit"), formulas, texts(covered("orbit"), "double"))


PREDICTED = {
    "the rule is exact": ("0.01", lambda: (ahead, "_cut", lambda c, x, *_: [0 * own for own in x])),
    "half of it": ("0.01", halved),
    "nothing is rounded": ("0.0005", lambda: (ahead, "length_of", lambda row: Interval.of(0))),
    "its input is exact": ("0.0005", known_input),
}


@pytest.mark.slow
@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("delay", ["0.0005", "0.01"])
def test_both_bounds_of_a_prediction_are_near_to_each_other(delay, held):
    c, formulas = predicting(delay, held=held)
    for precision in ("double", "single"):
        found, theirs = bounds(c, formulas, texts(c, precision)), rounding_of(c, precision)
        # a certificate allows for twice the exporter's
        assert all(0.05 < found[each] / float(getattr(theirs, each)) < 1.2 for each in (*NAMES, "prediction"))


@pytest.mark.slow
def test_a_prediction_along_a_plan_through_knots_is_followed_where_its_input_is_held():
    c, formulas = predicting_path()
    found, theirs = bounds(c, formulas, texts(c, "double")), rounding_of(c, "double")
    # a certificate allows for twice the exporter's
    assert all(0.02 < found[each] / float(getattr(theirs, each)) < 1.6 for each in (*NAMES, "prediction"))


@pytest.mark.slow
@pytest.mark.parametrize("bug", sorted(PREDICTED))
def test_a_mistake_in_the_exporters_prediction_is_noticed(bug, monkeypatch):
    delay, made = PREDICTED[bug]
    c, formulas = predicting(delay, held=True)
    precision = "single" if "rounded" in bug else "double"
    found = bounds(c, formulas, texts(c, precision))["prediction"]
    monkeypatch.setattr(*made())
    assert found > float(rounding_of(c, precision).prediction)


@pytest.mark.slow
@pytest.mark.parametrize("change", [None, ("(2.0 * r", "(2.000000000001 * r"), ("k < 4;", "k < 3;")])
def test_another_rule_of_integration_is_noticed(change):
    """With losses in the certificate the rule itself is what the text is compared with, to its last digits."""
    c, formulas = predicting("0.01", held=False)
    header, source = texts(c, "double")
    if change is not None:
        assert change[0] in source
        source = source.replace(*change)
    with ctx.workprec(200):
        rows = [[exact(Fraction(value)) for value in row] for row in measured(c, 6, "double").tolist()]
        _, share = agreement(read_code(header, source), replace(formulas, steps=STEPS), rows)
    assert (share <= 1) == (change is None)


@pytest.mark.slow
@pytest.mark.parametrize("change", [None, ("(-0.01), ", "(-0.0100000001), "), ("{0.02, ", "{0.020000001, ")])
def test_every_number_of_a_table_is_that_of_the_certificate(change):
    header, source = texts(CONTROLLERS["turning"](), "double")
    if change is not None:
        assert source.count(change[0]) >= 1
        source = source.replace(*change, 1)
    found = list(of_tables(read_code(header, source), in_recheck("turning")))
    assert found == ([] if change is None else ["at_bend" if change[0].startswith("(") else "cubic_bend"])


def _rows(c):
    return [[exact(Fraction(float(q))) for q in row] for row in vectors(c).given]


def test_an_honest_controller_along_knots_agrees_within_its_horizon():
    """Its last samples are later: there code goes on along its last piece, and nothing is claimed."""
    c = covered("path")
    with ctx.workprec(200):
        _, share = agreement(read_code(*texts(c, "double")), in_recheck("path"), _rows(c))
    assert share <= 1


def test_a_piece_more_than_the_plan_has_is_refused():
    """Within the last one, with another x*: found at some times, and at none where stations are looked at."""

    def more(text):
        return text.replace("#define PIECES 4", "#define PIECES 5")

    c = covered("path")
    header, source = texts(c, "double")
    source = source.replace("0.0, 0.013, 0.02, 0.3,\n", "0.0, 0.013, 0.02, 0.3, 0.302,\n")
    for table, row in (
        ("X[][N][4]", "{{5.0, 0.0, 0.0, 0.0}, {7.0, 0.0, 0.0, 0.0}}"),
        ("U[]", "{{9.0, 0.0}}"),
    ):
        end = source.index("};", source.index(f"static const real {table}"))
        source = source[:end] + f"    {row},\n" + source[end:]
    source = source.replace("for (k = 0; k < 2; k++) {", "for (k = 0; k < 3; k++) {", 1)
    with pytest.raises(UnreadError, match="tables of the plan"):
        bounds(c, in_recheck("path"), (more(header), more(source)))


def test_a_steep_function_in_a_prediction_has_no_bound_and_is_no_error_of_the_program():
    """tanh(y/0.02) was an internal error: on a wide box a divisor of its series may vanish."""
    steep = function("tanh", variable("y") * number(500))
    model = Model(states=("y",), f=(steep,), B=((number(1),),), delay=Fraction(1, 1000))
    with ctx.workprec(200), pytest.raises(UnreadError, match="has no bound here"):
        cut(model, [between(-1, 1)], [between(-1, 1)], arb(1), arb(0))
