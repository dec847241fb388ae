"""Plans of collocation planners: rows are in turn a knot and a point between two, u* is quadratic through the three."""

import json
import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from systems import plain_model

from tubecert import certificate, pipeline
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.errors import SpecError
from tubecert.expression import constant, symbol
from tubecert.recheck.document import CertificateError
from tubecert.recheck.run import recheck
from tubecert.report import planned
from tubecert.report.reach import excursion
from tubecert.spec import Knots, load
from tubecert.trajectory.pieces import piecewise_plan
from tubecert.trajectory.plan import Defect
from tubecert.tube import containment
from tubecert.verdict import Verdict

x, y = symbol("x"), symbol("y")
EYE = ((constant(1), constant(0)), (constant(0), constant(1)))
MODEL = replace(plain_model(("x", "y"), ("y", "-2*x - y"), [["0"], ["1"]]), W=EYE, rate=Fraction(1))
SPEC = """tubecert: 1
name: collocated
system: {states: [x, y], inputs: [u], f: [y, "-2*x - y"], B: [[0], [1]]}
safe_set: {x: [-2, 2], y: [-2, 2]}
uncertainty: {h: ["0.05*sin(t)"]}
trajectory: {kind: csv, file: plan.csv, interpolation: hermite-simpson}
metric: {rate: 0.4, dual_metric: [[1, -0.5], [-0.5, 1]]}
tube: {epsilon: 0.3, rho_a: 0.1}
conditions: {decides: "0"}
"""


def rows(count=9, step=Fraction(1, 4), uneven=False):
    """x = sin(t)/2 with the u that makes it a plan, at 12 digits; `uneven`: points that are not in the middle."""
    found = []
    for k in range(count):
        t = k * step + (step / 5 if uneven and k % 2 else 0)
        s, c = math.sin(t) / 2, math.cos(t) / 2
        found.append((t, *(Fraction(f"{value:.12g}") for value in (s, c, s + c))))
    return found


def knots(interpolation="hermite-simpson", **shape):
    found = rows(**shape)
    return Knots(
        t=tuple(row[0] for row in found),
        x=tuple(row[1:3] for row in found),
        u=tuple(row[3:] for row in found),
        interpolation=interpolation,
    )


def exactly(data, t):
    """(x*, y*, u*) at a time: Hermite's basis, Lagrange's parabola."""
    k = max(k for k in range(0, len(data.t) - 2, 2) if data.t[k] <= t)
    a, b, c = data.t[k : k + 3]
    h, s = c - a, (t - a) / (c - a)
    rate = [(row[1], -2 * row[0] - row[1] + u) for row, (u,) in zip(data.x, data.u, strict=True)]
    at = [
        data.x[k][i] * (2 * s**3 - 3 * s**2 + 1)
        + data.x[k + 2][i] * (3 * s**2 - 2 * s**3)
        + h * (rate[k][i] * (s**3 - 2 * s**2 + s) + rate[k + 2][i] * (s**3 - s**2))
        for i in range(2)
    ]
    u = [data.u[j][0] for j in range(k, k + 3)]
    value = (
        u[0] * (t - b) * (t - c) / ((a - b) * (a - c))
        + u[1] * (t - a) * (t - c) / ((b - a) * (b - c))
        + u[2] * (t - a) * (t - b) / ((c - a) * (c - b))
    )
    return [*at, value]


@pytest.mark.parametrize("uneven", [False, True])
@pytest.mark.parametrize("horizon", [None, Fraction(17, 10)])
def test_the_curve_is_the_cubic_and_the_parabola(uneven, horizon):
    data = knots(uneven=uneven)
    plan = piecewise_plan(MODEL, data, horizon)
    for n in range(0, 34):
        t = Fraction(n, 20)
        exact = exactly(data, t)
        at = np.array([float(t)])
        for width in (0.0, 0.03):
            states, inputs = plan.enclose(at, np.minimum(at + width, 2.0))
            ends = [*zip(states.lo[0], states.hi[0], strict=True), (inputs.lo[0, 0], inputs.hi[0, 0])]
            for value, (low, high) in zip(exact, ends, strict=True):
                assert low - 1e-12 <= value <= high + 1e-12
                assert high - low < (1e-12 if not width else 0.2)


def test_windows_contain_the_curve():
    data = knots(uneven=True)
    plan = piecewise_plan(MODEL, data)
    for low, high in ((0.1, 0.4), (0.3, 1.1), (0.0, 2.0)):
        states, inputs = plan.enclose(np.array([low]), np.array([high]))
        for t in np.linspace(low, high, 23):
            *at, u = exactly(data, Fraction(float(t)))
            assert all(a <= value <= b for value, a, b in zip(at, states.lo[0], states.hi[0], strict=True))
            assert inputs.lo[0, 0] <= u <= inputs.hi[0, 0]


def test_the_defect_falls_with_the_order_of_the_method():
    def defect(data):
        return Defect.of(piecewise_plan(MODEL, data), MODEL, 0.1, Effort(gap=0.01)).in_state().above

    coarse, fine = (
        defect(knots(count=count, step=step)) for count, step in ((9, Fraction(1, 4)), (17, Fraction(1, 8)))
    )
    assert fine < coarse / 7  # of third order
    assert coarse < defect(replace(knots(), interpolation="linear")) / 2


def written(folder, lines=None, spec=SPEC):
    lines = rows() if lines is None else lines
    text = "\n".join(["t,x,y,u", *(",".join(f"{float(value):.12g}" for value in row) for row in lines)])
    (folder / "plan.csv").write_text(text + "\n")
    (folder / "spec.yaml").write_text(spec)
    return str(folder / "spec.yaml")


def test_an_even_number_of_rows_is_refused(tmp_path):
    with pytest.raises(SpecError, match="hermite-simpson needs an odd number of rows, not 8"):
        load(written(tmp_path, rows(count=8)))


def test_check_compares_such_a_plan_with_the_dynamics(tmp_path):
    assert pipeline.inspect(load(written(tmp_path))) == []
    wrong = [(t, *rest[:2], rest[2] + (k == 3)) for k, (t, *rest) in enumerate(rows())]
    [finding] = pipeline.inspect(load(written(tmp_path, wrong)))
    assert (finding.code, finding.location.line) == ("TC407", 4)


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_a_certificate_of_such_a_plan_is_confirmed_and_forgeries_are_not(tmp_path):
    result = pipeline.certify(load(written(tmp_path)), pipeline.Options())
    assert result.verdict is Verdict.CERTIFIED
    assert list(excursion(result)) == []
    drawn = replace(result.plan.samples, x=tuple((x + 0.1, y) for x, y in result.plan.samples.x))
    (line,) = excursion(replace(result, plan=replace(result.plan, samples=drawn)))
    assert line.startswith("between its knots the plan takes x 0.1")
    between = result.plan.exact_knots()
    far = tuple(("9", row[1]) if k % 2 else row for k, row in enumerate(result.plan.knots.x))
    beside = replace(result.plan, samples=drawn, knots=replace(result.plan.knots, x=far))
    assert list(excursion(replace(result, plan=beside))) == [line], (
        "x between two knots is no part of the curve"
    )
    t, (u,) = planned.inputs(result)
    assert len(t) > 4 * len(between.t) / 2
    for k in range(0, len(between.t) - 1, 2):
        rows = slice(k, k + 3)
        own = np.polyfit([float(s) for s in between.t[rows]], [float(v) for (v,) in between.u[rows]], 2)
        here = (t >= float(between.t[k])) & (t <= float(between.t[k + 2]))
        assert np.abs(u[here] - np.polyval(own, t[here])).max() < 1e-9
    data = certificate.dump(certificate.seal(result.to_json(), {}))
    assert checked(data) == "confirmed"

    def forged(change):
        own = json.loads(data)["result"]
        change(own["plan"])
        return certificate.dump(certificate.seal(own, {}))

    def other_input(plan):
        plan["knots"]["u"][3] = ["3"]

    def linear(plan):
        plan["interpolation"] = "linear"

    def shorter(plan):
        for key in ("t", "x", "u"):
            plan["knots"][key].append(plan["knots"][key][-1])
        plan["knots"]["t"][-1] = "3"

    assert checked(forged(other_input)) == "contradicted"
    for change in (linear, shorter):
        assert checked(forged(change)) in ("contradicted", "refused")


def checked(text):
    try:
        return str(recheck(text, "c.json").verdict)
    except CertificateError:
        return "refused"


def test_points_between_knots_are_no_points_of_the_curve():
    """Where slopes are not defined, knots outside refute the tube; what is between them says nothing of x*."""
    undefined = replace(MODEL, f=(y / x, x))
    box = ((Fraction(-1), Fraction(1)), (Fraction(-1), Fraction(1)))
    for k, verdict in ((1, Verdict.UNDECIDED), (2, Verdict.REFUTED)):
        data = knots()
        moved = tuple((Fraction(5), row[1]) if i == k else row for i, row in enumerate(data.x))
        plan = piecewise_plan(undefined, replace(data, x=moved))
        assert not plan.defined
        found = containment(plan, Fraction(1, 100), ("x", "y"), box, Effort())
        assert found.verdict is verdict
