"""Plans through knots: what their enclosures contain, how their defect is bounded, and what a plan file may say."""

from contextlib import nullcontext
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proven import proven
from strategies import fractions
from systems import SMALL, plain_model

import tubecert
from tubecert.certificate import seal
from tubecert.checking.cache import key_of_system
from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.objective import SumOfNorms
from tubecert.errors import SpecError
from tubecert.expression import constant, cos, number_text, sin, symbol
from tubecert.expression.matrix import column
from tubecert.findings import Severity
from tubecert.pipeline import Options, certify, inspect
from tubecert.spec import Knots, canonical, load, load_text
from tubecert.spec.table import MAX_ROWS
from tubecert.trajectory.pieces import TAU, piecewise_plan
from tubecert.trajectory.plan import Defect
from tubecert.tube import Tube, containment
from tubecert.verdict import Verdict

x, y = symbol("x"), symbol("y")
EYE = ((constant(1), constant(0)), (constant(0), constant(1)))
POLYNOMIAL = replace(
    plain_model(("x", "y"), ("2*y - x", "-y**3/4 - 3*x + 4*y"), [["1/2"], ["-2"]]), W=EYE, rate=Fraction(1)
)
SWINGING = replace(
    POLYNOMIAL,
    f=(y, -sin(x) - y / 10),
    B=((constant(0),), (1 + cos(x) ** 2,)),
    W=((2 + sin(x), constant(0)), EYE[1]),
)


def knots(interpolation="hold"):
    """Five rough knots at uneven times that are no floats."""
    t = [Fraction(n, 10) for n in (0, 3, 4, 11, 13)]
    rows = [("1", "-0.5"), ("0.7", "0.1"), ("0.9", "0.3"), ("-0.2", "0.4"), ("-0.3", "-0.1")]
    u = ("0.3", "-1.1", "2", "-0.7", "0.4")
    return Knots(
        t=tuple(t),
        x=tuple(tuple(map(Fraction, row)) for row in rows),
        u=tuple((Fraction(v),) for v in u),
        interpolation=interpolation,
    )


def hermite(a, b, rising, falling, s):
    """The cubic with these ends and slopes there, and its slope, at a share of its length."""
    value = a * (2 * s**3 - 3 * s**2 + 1) + b * (3 * s**2 - 2 * s**3)
    slope = (a - b) * (6 * s**2 - 6 * s) + rising * (3 * s**2 - 4 * s + 1) + falling * (3 * s**2 - 2 * s)
    return value + rising * (s**3 - 2 * s**2 + s) + falling * (s**3 - s**2), slope


def one_sided(data: Knots, k: int, t: Fraction):
    """x*, x*' and u* on piece k of the plan of `POLYNOMIAL`, exactly, by the Hermite basis."""

    def rate(p, q):
        return (2 * p[1] - p[0] + q / 2, -(p[1] ** 3) / 4 - 3 * p[0] + 4 * p[1] - 2 * q)

    h = data.t[k + 1] - data.t[k]
    s = (t - data.t[k]) / h
    left, right = data.u[k][0], data.u[k if data.interpolation == "hold" else k + 1][0]
    m0, m1 = rate(data.x[k], left), rate(data.x[k + 1], right)
    value, slope = [], []
    for i in range(2):
        a, b = data.x[k][i], data.x[k + 1][i]
        at, rising = hermite(a, b, h * m0[i], h * m1[i], s)
        value.append(at)
        slope.append(rising / h)
    u = left + s * (right - left)
    return value, u, [d - r for d, r in zip(slope, rate(value, u), strict=True)]


def pieces_at(data: Knots, t: Fraction):
    return [k for k in range(len(data.t) - 1) if data.t[k] <= t <= data.t[k + 1]]


@pytest.mark.slow
@pytest.mark.parametrize("interpolation", ["hold", "linear"])
@given(ends=st.tuples(*[fractions(0, "13/10", 500)] * 3))
@settings(max_examples=60, deadline=None)
def test_windows_contain_every_point_and_both_sides_of_a_jump(interpolation, ends):
    data = knots(interpolation)
    plan = piecewise_plan(POLYNOMIAL, data)
    low, t, high = sorted(ends)
    window = np.nextafter(float(low), -np.inf), np.nextafter(float(high), np.inf)
    states, inputs = plan.enclose(np.array([window[0]]), np.array([window[1]]))
    for k in pieces_at(data, t):
        value, u, _ = one_sided(data, k, t)
        for i in range(2):
            assert Fraction(float(states.lo[0, i])) <= value[i] <= Fraction(float(states.hi[0, i]))
        assert Fraction(float(inputs.lo[0, 0])) <= u <= Fraction(float(inputs.hi[0, 0]))


def test_a_window_that_begins_or_ends_at_a_jump_holds_both_sides():
    data = replace(knots(), t=tuple(Fraction(n, 4) for n in range(5)))  # times that are floats
    plan = piecewise_plan(POLYNOMIAL, data)
    for k in (1, 2, 3):
        t = float(data.t[k])
        for low, high in ((t, t), (t, t + 0.1), (t - 0.1, t)):
            _, inputs = plan.enclose(np.array([low]), np.array([high]))
            assert inputs.lo[0, 0] <= min(data.u[k - 1][0], data.u[k][0])
            assert inputs.hi[0, 0] >= max(data.u[k - 1][0], data.u[k][0])


def test_a_supremum_along_the_plan_reaches_the_ends_of_its_pieces():
    data = knots("linear")
    data = replace(data, u=(*data.u[:-1], (Fraction(-7),)))
    plan = piecewise_plan(POLYNOMIAL, data)
    found = supremum(SumOfNorms([column(plan.u)], plan.fixed), plan.domain, Effort())
    assert found.below == pytest.approx(7, rel=1e-9)
    assert found.above >= 7
    assert plan.moment(found.at) == pytest.approx(1.3)
    names = plan.domain.variables((TAU, "x0#0"))
    lo, hi = plan.domain.inside(names, np.array([[9.0, 0.0, 2.0], [-1.0, 0.0, 0.0]]))
    assert lo[:, 0] == pytest.approx([0.7, 0])  # the points are moved into their pieces
    assert hi[0, 0] <= Fraction(7, 10)
    assert lo[0, 1] <= data.x[2][0] <= hi[0, 1]


@pytest.mark.slow
def test_windows_are_tight():
    data = knots()
    plan = piecewise_plan(POLYNOMIAL, data)
    times = [Fraction(n, 2000) * Fraction(13, 10) for n in range(2001)]
    for low, high, factor in ((0, 2000, 3), (700, 800, 1.2), (700, 720, 1.06), (900, 901, 1.05)):
        seen = np.array(
            [one_sided(data, pieces_at(data, t)[0], t)[0] for t in times[low : high + 1]], dtype=float
        )
        found, _ = plan.enclose(np.array([float(times[low])]), np.array([float(times[high])]))
        width = seen.max(axis=0) - seen.min(axis=0)
        assert ((found.hi - found.lo)[0] <= factor * width + 1e-9).all()


def test_the_hull_of_many_pieces_is_found_by_halves():
    count = 300
    t = tuple(Fraction(k, 7) for k in range(count + 1))
    x = tuple((Fraction(k * k % 101, 50), Fraction(-(k % 17))) for k in range(count + 1))
    plan = piecewise_plan(
        POLYNOMIAL, Knots(t=t, x=x, u=((Fraction(0),),) * (count + 1), interpolation="hold")
    )
    rng = np.random.default_rng(0)
    ends = np.sort(rng.uniform(0, count / 7, (200, 2)), axis=1)
    wide, _ = plan.enclose(ends[:, 0], ends[:, 1])
    whole = plan.pieces._levels[0]  # each piece by itself
    for (low, high), lo, hi in zip(ends, wide.lo, wide.hi, strict=True):
        inner = [k for k in range(count) if low <= float(t[k]) and float(t[k + 1]) <= high]
        if inner:
            assert (lo <= whole.lo[inner].min(axis=0)[:2]).all()
            assert (hi >= whole.hi[inner].max(axis=0)[:2]).all()
        touched = [k for k in range(count) if float(t[k + 1]) >= low - 1e-9 and float(t[k]) <= high + 1e-9]
        assert (lo >= whole.lo[touched].min(axis=0)[:2] - 1e-9).all()
        assert (hi <= whole.hi[touched].max(axis=0)[:2] + 1e-9).all()


def test_nothing_beyond_the_horizon_counts():
    data = knots("linear")
    data = replace(data, u=(*data.u[:-1], (Fraction(-7),)))
    plan = piecewise_plan(POLYNOMIAL, data, Fraction(12, 10))
    found = supremum(SumOfNorms([column(plan.u)], plan.fixed), plan.domain, Effort())
    assert found.above == pytest.approx(3.85, rel=1e-9)  # half way from -0.7 to -7
    assert found.below == pytest.approx(3.85, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("interpolation", ["hold", "linear"])
def test_the_defect_lies_between_its_bounds(interpolation):
    data = knots(interpolation)
    found = Defect.of(piecewise_plan(POLYNOMIAL, data), POLYNOMIAL, 1.0, Effort()).in_state()
    worst = Fraction(0)
    for k in range(4):
        for n in range(201):
            t = data.t[k] + Fraction(n, 200) * (data.t[k + 1] - data.t[k])
            worst = max(worst, sum(p * p for p in one_sided(data, k, t)[2]))
    seen = float(worst) ** 0.5
    assert seen * (1 - 1e-12) <= found.above <= 1.01 * found.below
    assert found.below <= seen * (1 + 1e-4)
    at = piecewise_plan(POLYNOMIAL, data).moment(found.at)
    there = max(
        float(sum(p * p for p in one_sided(data, k, Fraction(at))[2])) ** 0.5
        for k in pieces_at(data, Fraction(at))
    )
    assert there == pytest.approx(found.below, rel=1e-6)


def floats(data: Knots, f, count: int):
    """Samples of x*, x*' and u* in floats, (3 arrays of (samples, .)), for dynamics f(x, u)."""
    found = []
    for k in range(len(data.t) - 1):
        a, b = (np.array(data.x[j], dtype=float) for j in (k, k + 1))
        h = float(data.t[k + 1] - data.t[k])
        left = np.array(data.u[k], dtype=float)
        right = left if data.interpolation == "hold" else np.array(data.u[k + 1], dtype=float)
        m0, m1 = f(a, left), f(b, right)
        for s in np.linspace(0, 1, count):
            at, slope = hermite(a, b, h * m0, h * m1, s)
            found.append((at, slope / h, left + s * (right - left)))
    return (np.array(column) for column in zip(*found, strict=True))


def swing(p, q):
    return np.array([p[1], -np.sin(p[0]) - p[1] / 10 + (1 + np.cos(p[0]) ** 2) * q[0]])


@pytest.mark.slow
@pytest.mark.parametrize("interpolation", ["hold", "linear"])
def test_the_defect_in_a_metric_that_depends_on_the_state(interpolation):
    data = knots(interpolation)
    found = Defect.of(piecewise_plan(SWINGING, data), SWINGING, 1.0, Effort()).in_metric()
    at, slope, u = floats(data, swing, 2001)
    p = slope - np.array([swing(a, b) for a, b in zip(at, u, strict=True)])
    seen = np.sqrt(p[:, 0] ** 2 / (2 + np.sin(at[:, 0])) + p[:, 1] ** 2).max()
    assert seen <= found.above * (1 + 1e-12)
    assert found.below <= seen * (1 + 1e-5)
    assert found.above <= 1.01 * found.below


def test_a_curve_that_is_a_solution_has_no_defect_to_speak_of():
    model = replace(POLYNOMIAL, f=(y, constant(0)), B=((constant(0),), (constant(1),)))
    t = [Fraction(0), Fraction(1, 3), Fraction(2, 3)]
    data = Knots(  # x'' = 6 t: a cubic, which a piece reproduces
        t=tuple(t), x=tuple((s**3, 3 * s**2) for s in t), u=tuple((6 * s,) for s in t), interpolation="linear"
    )
    found = Defect.of(piecewise_plan(model, data), model, 1.0, Effort()).in_state()
    assert found.above < 1e-12


@pytest.mark.parametrize("interpolation", ["hold", "linear"])
def test_inputs_that_jump_together_are_not_mixed(interpolation):
    """sup |f + B u*| over the tube of a plan whose two inputs jump at the same times, against samples."""
    model = replace(POLYNOMIAL, inputs=("u", "v"), f=(sin(y), -x), B=EYE)
    u = ("1", "-2"), ("-2", "1"), ("1.5", "-1"), ("-0.5", "2"), ("3", "0")
    rough = replace(knots(interpolation), u=tuple(tuple(map(Fraction, row)) for row in u))
    plan = piecewise_plan(model, rough)
    tube = Tube(plan, 0.3, states=("x", "y"), inputs=("u", "v"), time=(Fraction(0), Fraction(13, 10)))
    found = supremum(SumOfNorms([model.drift_on_plan()]), tube, Effort())
    assert found.above <= 1.01 * found.below
    angles = np.linspace(0, 2 * np.pi, 241)
    ball = 0.3 * np.stack([np.cos(angles), np.sin(angles)])
    seen = 0.0
    at, _, u = floats(rough, lambda p, q: np.array([np.sin(p[1]) + q[0], -p[0] + q[1]]), 201)
    for centre, held in zip(at, u, strict=True):
        p = centre[:, None] + ball
        seen = max(seen, float(np.hypot(np.sin(p[1]) + held[0], held[1] - p[0]).max()))
    assert seen <= found.above
    assert found.below <= seen * (1 + 1e-3)


@pytest.mark.slow
def test_a_curve_may_leave_between_its_knots():
    ends, rest, u = (Fraction(0), Fraction(1)), ((Fraction(0),) * 2,) * 2, ((Fraction(4),),) * 2
    data = Knots(t=ends, x=rest, u=u, interpolation="hold")
    # the slope at both knots is (2, -8): a wave that goes out and comes back
    plan = piecewise_plan(POLYNOMIAL, data)
    box = ((Fraction(-4, 5), Fraction(4, 5)),) * 2
    found = containment(plan, Fraction(1, 10), ("x", "y"), box, Effort())
    assert found.verdict == "refuted"
    assert found.state == "y"
    top = 8 / (6 * 3**0.5)  # of |8 t (1 - t) (1 - 2 t)|
    assert found.excess == pytest.approx(top + 0.1 - 0.8, abs=1e-5)
    wide = containment(plan, Fraction(1, 10), ("x", "y"), ((Fraction(-2), Fraction(2)),) * 2, Effort())
    assert wide.verdict == "certified"


# -- plan files ------------------------------------------------------------------------------------------------

SPEC = """tubecert: 1
name: line
system: {states: [p, q], inputs: [u], f: ["q - p", "-q"], B: [[0], [1]]}
safe_set: {p: [-2, 2], q: [-2, 2]}
uncertainty: {h: ["0.05*sin(t)"]}
metric: {rate: 0.5, dual_metric: [[1, 0], [0, 1]]}
tube: {epsilon: 0.5, rho_a: 0.1}
trajectory: {kind: csv, file: FILE}
"""


def written(folder: Path, table: str | bytes, more: str = "") -> Path:
    """A specification in a folder of its own, beside its plan file."""
    data = table.encode() if isinstance(table, str) else table
    (folder / "plan.csv").write_bytes(data)
    path = folder / "spec.yaml"
    path.write_text(SPEC.replace("FILE", f"plan.csv{more}"), encoding="utf-8")
    return path


def table_of(path: Path):
    table = load(str(path)).trajectory.table
    assert table is not None
    return table


@pytest.mark.parametrize(
    "text",
    [
        "t,p,q,u\n0,1,0,0.5\n0.1,0.9,0.05,-1e-1\n",
        "u,q,t,p\n0.5,0,0,1\n-.1,5E-2,+0.1,.9\n",
        "# t, p, q, u\r\n 0 , 1 , 0 , 0.5 \r\n 0.10 ,0.9, 0.05,-0.1\r\n\r\n",
        '\ufeff"t","p","q","u"\n"0","1.","0","0.5"\n\n1.000e-01,9.0e-1,0.05,-0.1',
    ],
    ids=["plain", "permuted", "numpy", "quoted"],
)
def test_a_plan_file_is_read_exactly(tmp_path, text):
    data = table_of(written(tmp_path, text)).knots
    assert data.t == (0, Fraction(1, 10))
    assert data.x == ((1, 0), (Fraction(9, 10), Fraction(1, 20)))
    assert data.u == ((Fraction(1, 2),), (Fraction(-1, 10),))
    assert data.interpolation == "linear"


SOLVED = [
    ("t,p,q,u\n0,1,0,0.5\n0.1,0.9,0.05,-0.1\n0.2,1,1,\n", ""),
    ("t,p,q,u\n0,1,0,0.5\n0.1,0.9,0.05,-0.1\n0.2,1,1\n\n", ""),
    ("t,p,q,u\n12.5,1,0,0.5\n12.6,0.9,0.05,-0.1\n12.7,1,1,NaN\n", ""),
    (
        ",ms,x[0],q,x_1,u,status\n7,20,1000,50,0,-1,ok\n8,120,900,50,0.05,.2,ok\n9,220,1000,50,1,nan,ok\n",
        ", columns: {t: {name: ms, scale: 1/1000}, p: {name: 'x[0]', scale: 1/1000}, q: x_1, u: {scale: -1/2}}",
    ),
]


@pytest.mark.parametrize(("text", "more"), SOLVED, ids=["empty", "absent", "nan, later", "named and scaled"])
def test_plans_of_solvers_are_read_as_they_are_written(tmp_path, text, more):
    data = table_of(written(tmp_path, text, more)).knots
    assert data.t == (0, Fraction(1, 10), Fraction(1, 5))
    assert data.x == ((1, 0), (Fraction(9, 10), Fraction(1, 20)), (1, 1))
    assert data.u == ((Fraction(1, 2),), (Fraction(-1, 10),), (Fraction(-1, 10),))


def test_columns_are_no_part_of_what_is_proven(tmp_path):
    text, more = SOLVED[-1]
    named, plain = load(str(written(tmp_path, text, more))), load(str(written(tmp_path, SOLVED[0][0])))
    assert canonical(named) == canonical(plain)
    turned = load(str(written(tmp_path, text, more.replace("-1/2", "1/2"))))
    assert canonical(turned) == canonical(plain)
    ask = Fraction(1, 100), 100
    assert key_of_system(turned, *ask) != key_of_system(named, *ask)  # the same bytes are another plan


def test_degrees_of_a_plan_are_decimals(tmp_path):
    text = "t,p,q,u\n0,180,0,0\n1,1,0,0\n"
    data = table_of(written(tmp_path, text, ", columns: {p: {scale: 1 deg}}")).knots
    assert [number_text(row[0]) for row in data.x] == ["3.14159265358979323846", "0.0174532925199432957692"]


@pytest.mark.parametrize(
    ("text", "more", "words"),
    [
        ("t,p,q,u\n0,1,0,\n1,1,0,0\n", "", "an input is missing in this row"),
        ("t,p,q,u\n0,1,0,1\n1,1,0,nan\n2,1,0,0\n", "", "an input is missing in this row"),
        ("t,p,q,u\n0,1,0,0\n1,1,,0\n", "", "a number is missing"),
        ("t,p,q,u\n0,1,0,0\n1,1\n", "", "the row has 2 cells"),
        ("t,p,q,u\n0,1,0,0\n1,1e-299,0,0\n", ", columns: {p: {scale: 1e-9}}", "in its scale is nearer to 0"),
        ("t,p,q,u\n0,1,0,0\n1,1,0,0\n", ", columns: {t: {scale: -1}}", "columns.t.scale is -1"),
        ("t,p,q,u\n0,1,0,0\n1,1,0,0\n", ", columns: {p: {scale: 0}}", "columns.p.scale is 0"),
        ("t,p,v,u\n0,1,0,0\n1,1,0,0\n", ", columns: {}", "lacks a column q"),
        ("time,p,v,u\n0,1,0,0\n", "", r"(?s)lacks columns t, q and has time, v, .*columns: \{t: time\}"),
        ("t,p,q,u\n0,5,1,0,0,0,0,0\n1,0,1,0,0,0,0,0\n", "", "(?s)8 cells, twice(?!.*8 cells)"),
        (
            "user,name,secret,more\na,b,c,d\n",
            ", columns: {t: user, p: name, q: secret, u: more}",
            "this cell",
        ),
    ],
)
def test_what_is_missing_elsewhere_is_a_finding(tmp_path, text, more, words):
    with pytest.raises(SpecError, match=words) as caught:
        load(str(written(tmp_path, text, more)))
    assert not any(item.location and "a,b,c" in item.location.source for item in caught.value.findings)


def test_a_plan_that_begins_later_is_told(tmp_path):
    path = written(tmp_path, "t,p,q,u\n12.5,0,0,0\n13,0,0,0\n")
    (note,) = [item for item in inspect(load(str(path))) if item.code == "TC119"]
    assert (note.severity, str(note.location)) == (Severity.NOTE, f"{tmp_path / 'plan.csv'}:2:1")
    assert "begins at t = 12.5 s" in note.message


def test_the_file_is_found_beside_its_specification_and_its_bytes_are_hashed(tmp_path, monkeypatch):
    import hashlib

    path = written(tmp_path, "t,p,q,u\n0,0,0,0\n1,0,0,0\n", ", interpolation: hold")
    monkeypatch.chdir(tmp_path.parent)
    table = table_of(path)
    assert table.file == "plan.csv"
    assert table.sha256 == hashlib.sha256((tmp_path / "plan.csv").read_bytes()).hexdigest()
    assert table.knots.interpolation == "hold"


def test_findings_of_a_plan_file_point_into_it(tmp_path):
    path = written(tmp_path, "t,p,q,u\n0,0,0,0\n1,0,inf,0\n1,0,0,0\n")
    with pytest.raises(SpecError) as caught:
        load(str(path))
    places = [str(item.location) for item in caught.value.findings]
    assert places == [f"{tmp_path / 'plan.csv'}:3:5"]
    (finding,) = caught.value.findings
    assert finding.location.source == "1,0,inf,0"


@pytest.mark.slow
def test_a_plan_file_of_too_many_rows_or_bytes_is_refused(tmp_path):
    rows = "".join(f"{k},0,0,0\n" for k in range(MAX_ROWS + 1))
    with pytest.raises(SpecError, match="at most 10,001 rows") as caught:
        load(str(written(tmp_path, "t,p,q,u\n" + rows)))
    assert caught.value.findings[0].location.line == MAX_ROWS + 2
    with pytest.raises(SpecError, match="larger than 10,000,000 bytes"):
        load(str(written(tmp_path, "t,p,q,u\n" + " " * 10_000_000)))


def test_many_mistakes_are_not_all_listed(tmp_path):
    rows = "".join(f"{k},nan,0,0\n" for k in range(1000))
    with pytest.raises(SpecError) as caught:
        load(str(written(tmp_path, "t,p,q,u\n" + rows)))
    assert len(caught.value.findings) <= 25


def resting(count: int) -> str:
    return "t,p,q,u\n" + "".join(f"{k / 10},0.5,0.5,0.5\n" for k in range(count))


@pytest.mark.slow
def test_a_plan_from_a_file_is_certified_and_recorded(tmp_path):
    result = certify(load(str(written(tmp_path, resting(21)))), Options(conditions="all")).to_json()
    assert result["verdict"] == "certified"
    assert result["constants"]["plan_defect"]["above"] < 1e-12
    assert result["constants"]["u_star"]["above"] == pytest.approx(0.5)
    plan = result["plan"]
    assert plan["kind"] == "csv"
    assert plan["interpolation"] == "linear"
    assert plan["file"] == "plan.csv"
    assert plan["file_hash"].startswith("sha256:")
    assert plan["knots"]["t"][:3] == ["0", "0.1", "0.2"]
    assert plan["knots"]["x"][7] == ["0.5", "0.5"]
    assert result["spec"]["effective"]["trajectory"]["horizon"] == "2"


@pytest.mark.slow
def test_a_certificate_does_not_take_a_file_for_another_plan(tmp_path, monkeypatch):
    """It holds the knots, and not the scale of a column."""
    monkeypatch.chdir(tmp_path)
    for more, same in (("", True), (", columns: {p: {scale: 1/2}, q: {scale: 1/2}, u: {scale: 1/2}}", False)):
        own = tubecert.certify(str(written(tmp_path, resting(21), more)), conditions="A")
        own.save(tmp_path / "one.json")
        found = tubecert.read(tmp_path / "one.json")
        with (
            nullcontext()
            if same
            else pytest.raises(SpecError, match="is another one than that of the certificate")
        ):
            assert found.specification.spec.trajectory.table


@pytest.mark.slow
def test_the_initial_state_is_the_first_row_unless_it_is_given(tmp_path):
    path = written(tmp_path, resting(3))
    assert load(str(path)).x0 == (Fraction(1, 2), Fraction(1, 2))
    text = path.read_text(encoding="utf-8") + "initial_state: {at: [0.6, 0.5]}\n"
    spec = load_text(text, str(path))
    result = certify(spec, Options()).to_json()
    assert result["constants"]["initial_distance"]["above"] == pytest.approx(0.1)


@pytest.mark.slow
def test_a_plan_outside_the_safe_set_is_refuted_with_time_and_point(tmp_path):
    rows = "t,p,q,u\n0,0,0,0\n1,0,1.7,0\n2,0,0,0\n"
    result = certify(load(str(written(tmp_path, rows))), Options()).to_json()
    assert result["verdict"] == "refuted"
    assert Verdict(result["verdict"]).exit_code == 1
    (reason,) = result["reasons"]
    assert reason["claim"] == "tube_in_safe_set"
    assert 0.5 < reason["at"]["t"] < 1.5
    assert reason["at"]["x"][1] > 2


def test_a_plan_that_goes_where_the_dynamics_are_undefined_is_refuted_at_a_knot(tmp_path):
    rows = "t,p,q,u\n0,0,0,0\n1,-5,0,0\n2,0,0,0\n"
    text = written(tmp_path, rows).read_text(encoding="utf-8").replace('"q - p"', '"q - p - sqrt(3 + p)"')
    result = certify(load_text(text, str(tmp_path / "spec.yaml")), Options()).to_json()
    assert result["verdict"] == "refuted"
    (reason,) = result["reasons"]
    assert reason["at"]["t"] == 1
    assert reason["claim"] == "plan_in_safe_set"
    assert reason["at"]["x"][0] == -5  # the plan itself, not its tube


@pytest.mark.slow
@pytest.mark.parametrize(
    "rows",
    [
        "0,0,0,0\n1e-300,0.1,0,0\n1,0,0,0\n",
        "0,0,0,0\n1,1e300,0,-1e300\n2,0,0,0\n",
        "0,0,0,0\n1e-299,0,0,1e300\n1e300,0,0,0\n",
        "0,1e-300,0,1e-300\n1,0,0,0\n2,0,1e-299,0\n",
    ],
)
def test_extreme_plans_are_judged_without_an_exception(tmp_path, rows):
    result = certify(load(str(written(tmp_path, "t,p,q,u\n" + rows))), Options(budget=100_000)).to_json()
    assert result["verdict"] in {"refuted", "undecided", "certified"}
    assert result["reasons"]
    seal(result, {})


@pytest.mark.slow
def test_a_rough_plan_says_by_how_much_it_is_too_rough(tmp_path):
    rows = "t,p,q,u\n0,0,0,0\n1,1,1,0\n2,-1,-1,0\n"
    result = certify(load(str(written(tmp_path, rows))), Options(conditions="distance")).to_json()
    assert result["verdict"] == "refuted"
    assert result["distance"]["shortfalls"][0]["condition"] == "plan_defect"
    (reason,) = result["reasons"]
    assert reason["needed"] > reason["allowed"]
    assert reason["relax"][-1]["remedy"] == {"id": "more_knots"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("drift", "horizon", "greatest"),
    [("0.01*t", "2", 0.02), ("0.02*sin(t/2)", "2", 0.02 * np.sin(1)), ("0.005 - 0.005*sin(t)", None, 0.01)],
)
def test_a_plan_that_rests_is_off_by_what_f_does_at_any_time(drift, horizon, greatest):
    """Where x' = 0 is no solution, it is most wrong at the end of the horizon, or somewhere in a period."""
    until = "" if horizon is None else f", horizon: {horizon}"
    text = SMALL.replace('"-x + y"', f'"-x + y + {drift}"').replace("input: [0]}", f"input: [0]{until}}}")
    found = proven(text, bare=True, conditions="none")["result"]["constants"]
    stretch = np.sqrt(2 / (2 * 1 - 0.3**2))  # of M = W^-1, along x
    for name, expected in (("plan_defect", greatest), ("plan_defect_metric", greatest * stretch)):
        assert found[name]["below"] <= expected <= found[name]["above"] <= 1.05 * expected
