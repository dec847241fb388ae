"""The library: what it reads, what it gives, and that it says what the commands say."""

import copy
import dataclasses
import json
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sympy
import yaml
from commands import run
from hypothesis import given
from hypothesis import strategies as st
from systems import FLAT, SCALAR
from texts import ROOT

import tubecert as tc
from tubecert import asking
from tubecert.letters import NAMES
from tubecert.pipeline.listening import claims_of

CONFIGS = sorted((ROOT / "configs").glob("*.yaml"))
TEXT = FLAT.replace("name: flat", "name: cart").replace("[u],", "[u], units: {p: m<b>, v: m/s},")
DATA = {key: value for key, value in yaml.safe_load(TEXT).items() if key != "tubecert"}


def changed(**parts):
    """The data with some parts replaced, by path: `system__f`."""
    data = copy.deepcopy(DATA)
    for path, value in parts.items():
        *outer, last = path.split("__")
        place = data
        for key in outer:
            place = place[key]
        place[last] = value
    return data


@cache
def certified():
    """The certification of the data, made once."""
    return tc.certify(DATA)


def refused(code, function, *arguments, **options):
    """The only finding of the error."""
    with pytest.raises(tc.TubecertError) as caught:
        function(*arguments, **options)
    [finding] = caught.value.findings
    assert finding.code == code, finding
    return finding


@pytest.mark.slow
@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_a_mapping_is_the_same_system_as_its_file(path):
    data = yaml.load(path.read_text(encoding="utf-8"), Loader=yaml.BaseLoader)
    if data["trajectory"]["kind"] == "csv":
        pytest.skip("a plan in a file stands beside its specification")
    spec = tc.load(path)
    assert tc.specification(data).hash == spec.hash
    assert tc.load(data) == spec
    assert tc.specification(spec.data) == spec  # the effective specification is one


def test_a_ball_of_many_states_stays_one():
    names = "abcd"
    ball = tc.specification(
        {
            "name": "ball", "system": {"states": list(names), "inputs": list("uvwx"), "f": [f"-{x}" for x in names],
            "B": [[str(int(x == y)) for x in names] for y in names]},
            "safe_set": {x: ["-1", "1"] for x in names}, "uncertainty": {"h": ["0"] * 4},
            "trajectory": {"kind": "equilibrium", "at": ["0"] * 4}, "initial_state": {"at": ["0"] * 4},
            "metric": {"rate": "0.5", "dual_metric": [[str(int(x == y)) for x in names] for y in names]},
            "tube": {"epsilon": "0.1", "rho_a": "0.1", "coordinates": "identity"},
        }
    )  # fmt: skip
    again = tc.specification(ball.data)
    assert again == ball
    assert again.spec.tube.coordinates == "identity"


def test_a_text_is_one_too(tmp_path):
    (tmp_path / "cart.yaml").write_text(TEXT, encoding="utf-8")
    spec = tc.load(tmp_path / "cart.yaml")
    assert tc.specification(TEXT) == spec == tc.load(DATA) == tc.load(spec)
    assert hash(tc.specification(TEXT)) == hash(spec)
    assert spec != tc.load(changed(tube__rho_a=0.1))
    assert (spec.states, spec.inputs, spec.units["v"]) == (("p", "v"), ("u",), "m/s")


def test_values_of_python_are_exact():
    p, v, t = sympy.symbols("p v t")
    f = sympy.Matrix([v, -p - v])
    spec = tc.specification(
        changed(
            system__states=[p, v],
            system__f=f.T.tolist()[0],
            system__B=np.array([[0], [1]]),
            safe_set={p: [-2, 2], v: (Decimal("-2.0"), np.float64(2))},
            uncertainty__h=[sympy.sin(t) / 5],
            tube__rho_a=Fraction(1, 5),
            metric__dual_metric=np.array([[1, -0.5], [-0.5, 1]]),
        )
    )
    assert spec == tc.load(DATA)
    assert tc.specification(changed(tube__rho_a=1 / 3)).data["tube"]["rho_a"] == "0.3333333333333333"


def test_expressions_of_sympy_mean_here_what_they_mean_there():
    """Whatever is read from them has the values that sympy gives."""
    from tubecert.enclosure.tape import Tape

    p, v = sympy.symbols("p v")
    chosen = [
        sympy.sin(p) ** 2 / (2 + sympy.cos(v)) - v / 3,
        -(p**2) * (v - 1) ** 3 * sympy.exp(-v) + sympy.pi * p,
        sympy.tanh(p / sympy.Rational(1, 7)) + (2 + p) ** (-2) + 0.1 * p,
    ]
    at = [0.37, -0.81]
    for expression in chosen:
        spec = tc.specification(changed(system__f=[v, expression])).spec
        tape = Tape([spec.f[1].expression], ("p", "v"))
        value = np.asarray(tape.run_floats([np.array([x]) for x in at], (1,))).ravel()[0]
        assert value == pytest.approx(float(expression.subs({p: at[0], v: at[1]})), rel=1e-12)


@pytest.mark.parametrize(
    "entry",
    [
        sympy.E * sympy.Symbol("p"),  # prints as a name
        sympy.Float("0.1", 40) * sympy.Symbol("p"),  # has more digits than are printed
        sympy.Symbol("p + v") * 2,  # prints as a sum
        sympy.Symbol("pi"),  # a name that is a number here
        sympy.I,
        sympy.oo,
        sympy.Piecewise((sympy.Symbol("p"), sympy.Symbol("p") > 0), (0, True)),
        1j,
        float,
        object(),
        b"p",
    ],
    ids=lambda entry: str(entry) if type(entry) is not object else "object",
)
def test_what_would_be_read_as_something_else_is_refused(entry):
    finding = refused("TC106", tc.specification, changed(system__f=["v", entry]))
    assert str(finding.location) == "system.f[1]"
    assert finding.help


def test_floats_in_expressions_stand_for_their_shortest_decimals():
    p, v = sympy.symbols("p v")
    third = 1 / 3
    spec = tc.specification(changed(system__f=[v, -p / 1.2 - third * v]))
    inverse = float(1 / sympy.Float(1.2))
    assert spec == tc.specification(changed(system__f=["v", f"-{inverse!r}*p - {third!r}*v"]))


def test_a_matrix_of_one_column_is_a_vector():
    p, v = sympy.symbols("p v")
    for f in (sympy.Matrix([v, -p - v]), sympy.Matrix([[v, -p - v]]), np.array([[v], [-p - v]])):
        assert tc.specification(changed(system__f=f, system__B=sympy.Matrix([0, 1]))) == tc.load(DATA)
    refused("TC107", tc.specification, changed(system__B=np.array([0, 1])))


def test_numbers_of_every_library_are_exact():
    told = {
        "3": np.int64(3), "0.1": np.float64(0.1), "0.5": np.float32(0.5), "0.10": Decimal("0.10"),
        "1/3": sympy.Rational(1, 3), "-1/3": Fraction(-2, 6),
    }  # fmt: skip
    assert [asking.text_of_number(value, "x") for value in told.values()] == [*told]
    for value in (10**5000, True, 1j, None, np.longdouble(1) / 3):
        refused("TC106", asking.text_of_number, value, "x")


def test_texts_that_no_file_can_hold_are_refused():
    for name in ("\ud800", "a\x00b", "a\u2028b", "x" * 2_000_000):
        with pytest.raises(tc.TubecertError):
            tc.specification(changed(name=name))


def test_a_value_that_holds_itself_and_keys_that_are_none_or_occur_twice_are_refused():
    loop, p = [], sympy.Symbol("p")
    loop.append(loop)
    for data in (
        changed(system__f=loop), {**DATA, 3: "x"}, changed(safe_set={"p": [-2, 2], p: [-1, 1], "v": [-2, 2]})
    ):  # fmt: skip
        refused("TC106", tc.specification, data)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_float_stands_for_its_shortest_decimal(value):
    assert float(Fraction(asking.text_of_number(value, "x"))) == value
    assert Fraction(asking.text_of_number(value, "x")) == Fraction(repr(value))


def test_findings_show_the_entry():
    finding = refused("TC110", tc.specification, changed(system__f=["v", "-p - w"]))
    assert "-p - w" in finding.location.source
    assert finding.location.file == "<specification>"
    with pytest.raises(tc.SpecError, match=r"(?s)specification>:.*TC110.*-p - w.*\^") as caught:
        tc.specification(changed(system__f=["v", "-p - w"]))
    assert isinstance(caught.value, tc.TubecertError)


def test_a_plan_that_is_no_equilibrium_is_told_before_anything_is_certified():
    fine = tc.check(DATA)
    assert fine.fine
    assert str(fine).endswith("1 specification checked: 1 note")  # u has no unit
    off = tc.check(changed(trajectory__at=[0.5, 0]))  # -p is left over: no input holds it
    assert not off.fine
    assert "TC404" in {item.code for item in off.findings}
    assert "is no equilibrium" in str(off)
    assert "is no equilibrium" in off._repr_html_()
    assert tc.check(changed(trajectory__at=[0.5, 0], trajectory__input=[0.5])).fine


@pytest.mark.slow
def test_certify_says_what_the_command_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("cart.yaml").write_text(TEXT, encoding="utf-8")
    options = ["--rho-a", "0.3", "--conditions", "B", "--gap", "0.02", "-o", "command.json"]
    assert run("certify", "cart.yaml", *options).exit_code == 0
    result = tc.certify("cart.yaml", rho_a=0.3, conditions="B", gap=Fraction(1, 50))
    result.save("library.json")
    command, library = (Path(name).read_text("utf-8") for name in ("command.json", "library.json"))
    ours, theirs = json.loads(library), json.loads(command)
    assert ours["hash"] == theirs["hash"] == result.hash
    assert ours["run"].pop("command") == "tubecert.certify"
    for name in ("started", "seconds"):  # when it was made is no part of what is proven
        own, other = (f'  "{name}": {json.dumps(each["run"][name])}' for each in (ours, theirs))
        assert own in library
        library = library.replace(own, other)
    library = library.replace('"tubecert.certify"', json.dumps(theirs["run"]["command"]))
    assert library == command


@pytest.mark.slow
def test_what_is_saved_is_read_back(tmp_path):
    result = certified()
    result.save(tmp_path / "x.json")
    read = tc.read(tmp_path / "x.json")
    assert (read.text, read.hash, read.certified) == (result.text, result.hash, True)
    assert read.specification == tc.load(DATA)
    (tmp_path / "x.json").write_text(result.text.replace('"rho_a": 0.2', '"rho_a": 0.3'), encoding="utf-8")
    refused("TC601", tc.read, tmp_path / "x.json")


@pytest.mark.slow
def test_the_values_are_those_of_the_certificate():
    result, data = certified(), json.loads(certified().text)["result"]
    section = data["conditions_26"]
    assert (result.omega, result.Gamma) == (section["bandwidth"], section["adaptation_rate"])
    assert result.deciding.kind == "A"
    assert result.deciding.pair.bandwidth == Fraction(str(section["bandwidth"]))
    assert set(result.margins) == {"26a", "26b", "26c"}
    assert all(low > 0 for low, _ in result.margins.values())
    assert result.rho == data["tube"]["rho"]
    assert dict(result.half_widths) == data["tube"]["half_widths"]
    assert result.constants["h"].above == data["constants"]["h"]["above"]
    assert result.units == {"p": "m<b>", "v": "m/s"}
    assert result.curve("B").shape[1] == 2
    assert result.curve("B")[0, 0] == json.loads(result.text)["notes"]["distance"]["curve"][0]["bandwidth"]
    assert {gains.kind for gains in result.gains} <= {name.letter for name in NAMES}
    assert result.assumptions
    assert str(result).startswith("certified cart: the half-widths p ")


@pytest.mark.parametrize("rho", [Fraction(1, 3), Fraction(2, 3), Fraction(1, 10), Fraction(3, 7)])
def test_the_radius_is_rounded_up(rho):
    result = certified().result
    changed_ = dataclasses.replace(result, tube=dataclasses.replace(result.tube, rho=rho))
    given_ = dataclasses.replace(certified().certificate, result=changed_)
    told = dataclasses.replace(certified(), certificate=given_).rho
    assert rho <= Fraction(repr(told)) < rho + Fraction(1, 10**15)


@pytest.mark.slow
def test_what_is_not_certified_has_no_gains_to_use():
    result = tc.certify(DATA, bandwidth=1, adaptation_rate=10)
    assert not result.certified
    assert (result.omega, result.Gamma) == (None, None)
    assert result.reasons[0].message
    assert not [gains for gains in result.gains if gains.decides and gains.certified]
    assert "refuted" in result._repr_html_()


def test_results_are_frozen():
    result = certified()
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.text = "certified"
    with pytest.raises(TypeError):
        result.half_widths["p"] = 0
    with pytest.raises(TypeError):
        result.constants["h"] = 0
    with pytest.raises(ValueError, match="read-only"):
        result.curve("A")[0, 0] = 1
    with pytest.raises(ValueError, match="read-only"):
        result.plan.x[0, 0] = 1
    with pytest.raises((AttributeError, TypeError)):  # which one depends on the version of Python
        result.verdict = tc.Verdict.UNDECIDED


@pytest.mark.slow
def test_progress_is_told():
    told = []
    tc.certify(DATA, progress=told.append)
    assert told
    assert all(isinstance(step, tc.Step) and step.name for step in told)
    proven = [step for step in told if step.phase in (tc.Phase.CERTIFICATION, tc.Phase.PLAN, tc.Phase.GAINS)]
    assert [step.done for step in proven] == sorted(step.done for step in proven)
    assert {step.of for step in proven} == {len(claims_of(tc.specification(DATA).spec))}
    names = {step.name for step in proven if step.phase is not tc.Phase.PLAN}
    assert names <= {*claims_of(tc.specification(DATA).spec)}
    assert proven[-1].phase is tc.Phase.GAINS
    told.clear()
    claims = tc.recheck(certified(), progress=told.append).claims
    assert [(step.name, step.done, step.of) for step in told if step.count == 0] == [
        (claim.name, done, len(claims)) for done, claim in enumerate(claims)
    ]


@pytest.mark.parametrize(
    ("code", "options"),
    [
        ("TC112", {"rho_a": 0}),
        ("TC112", {"rho_a": -1.5}),
        ("TC108", {"rho_a": "a"}),
        ("TC108", {"rho_a": float("nan")}),
        ("TC106", {"rho_a": [1]}),
        ("TC112", {"budget": 1.5}),
        ("TC112", {"gap": 2}),
        ("TC112", {"conditions": "Z"}),
        ("TC112", {"bandwidth": 3}),
        ("TC112", {"adaptation_rate": 3}),
        ("TC100", {"metric": "nowhere.json"}),
        ("TC105", {"metric": {"rate": 1}}),
    ],
    ids=str,
)
def test_options_that_mean_nothing_are_refused(code, options):
    with pytest.raises(tc.TubecertError) as caught:
        tc.certify(DATA, **options)
    assert code in {finding.code for finding in caught.value.findings}, str(caught.value)


def test_everything_that_is_wrong_with_numbers_is_told_at_once():
    with pytest.raises(tc.SpecError) as caught:
        tc.certify(DATA, rho_a=-1, epsilon="x", budget=0)
    assert [str(item.location) for item in caught.value.findings] == ["rho_a", "epsilon", "budget"]


def test_a_file_that_is_not_there():
    refused("TC100", tc.load, "nowhere.yaml")
    refused("TC600", tc.read, "nowhere.json")


@pytest.mark.slow
def test_a_metric_that_was_found_is_proven_again(tmp_path):
    found = tc.synth(DATA, rate="0.3")
    assert found.proven
    assert (found.rate, found.verdict) == (0.3, "certified")
    found.save(tmp_path / "m.json")
    verified = tc.verify(DATA, found)
    assert verified.proven
    assert verified.largest_rate.below >= 0.3
    by_file, by_value = (tc.certify(DATA, metric=m, conditions="B") for m in (tmp_path / "m.json", found))
    given_ = {"rate": found.rate, "dual_metric": found.dual_metric}
    by_data = tc.certify(DATA, metric=given_, conditions="B")
    assert by_file.certified
    assert by_file.omega == by_value.omega == by_data.omega
    assert by_value.text.count("given in code") == 1
    assert tc.recheck(by_value).confirmed


def test_a_metric_that_does_not_hold():
    verified = tc.verify(DATA, rate=3)
    assert (verified.verdict, verified.proven) == ("refuted", False)
    assert verified.reason
    refused("TC105", verified.save, "m.json")
    assert tc.verify({key: DATA[key] for key in ("name", "system", "safe_set", "metric")}).proven
    refused("TC105", tc.verify, {key: value for key, value in DATA.items() if key != "metric"})


def test_wishes_that_mean_nothing_are_refused():
    given_ = {"objective": "best", "degree": 9, "variables": ["w"], "solver": "none", "route": "x"}
    for options in (*({key: value} for key, value in given_.items()), {"objective": "rate", "rate": 1}):
        refused("TC112", tc.synth, DATA, **options)


@pytest.mark.slow
def test_a_certificate_is_examined_again(tmp_path):
    found = tc.recheck(certified())
    assert found.confirmed
    assert found.first_failing is None
    certified().save(tmp_path / "x.json")
    assert tc.recheck(tmp_path / "x.json").found == found.found


@pytest.mark.slow
def test_a_certificate_that_lies_is_not_confirmed():
    honest = certified()
    data = json.loads(honest.text)
    data["result"]["conditions_26"]["adaptation_rate"] = 1.0
    forged = dataclasses.replace(honest, text=json.dumps(data))
    assert not tc.recheck(forged).confirmed
    undecided = tc.certify(DATA, bandwidth="1/1000", adaptation_rate=1)
    assert not undecided.certified
    assert not tc.recheck(undecided).confirmed


@pytest.mark.slow
def test_a_page_is_that_of_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    certified().save("x.json")
    page = tc.report("x.json")
    assert run("report", "x.json", "-o", "x.html", "-o", "x.md").exit_code == 0
    assert page.html == tc.report(certified()).html == Path("x.html").read_text("utf-8")
    assert page.markdown == Path("x.md").read_text("utf-8")
    page.save("y.md")
    assert Path("y.md").read_text("utf-8") == page.markdown
    refused("TC120", page.save, "y.pdf")


@pytest.mark.slow
def test_a_simulation(tmp_path):
    told = []
    found = tc.simulate(certified(), runs=2, controllers="ccm,l1", progress=told.append)
    assert {step.of for step in told if step.phase is tc.Phase.SIMULATION} == {2, 1024}  # ccm is not attacked
    assert (found.outcome, found.falsified) == ("not falsified", False)
    assert found.controllers == ("ccm", "l1")
    assert found.run("l1").x.shape[0] == 1
    assert found.states("l1").shape == (len(found.run("l1").t), 2)
    assert found.figure("plane").axes
    with pytest.raises(KeyError):
        found.run("nominal")
    with pytest.raises(KeyError):
        found.figure("nothing")
    names = found.save(tmp_path / "runs")
    assert json.loads((tmp_path / "runs" / "summary.json").read_text("utf-8")) == found.summary
    assert {"runs.npz", "plane.png"} <= set(names)
    assert "not falsified" in found._repr_html_()


@pytest.mark.slow
def test_a_plan_in_a_file_is_looked_for_beside_its_specification(tmp_path, monkeypatch):
    (tmp_path / "there").mkdir()
    monkeypatch.chdir(tmp_path / "there")
    Path("plan.csv").write_text("t,p,v,u\n0,0,0,0\n4,0,0,0\n", encoding="utf-8")
    plan = {"kind": "csv", "file": "plan.csv", "interpolation": "linear", "horizon": 4}
    tc.certify(changed(trajectory=plan), bandwidth=50, adaptation_rate=1e9).save("x.json")
    assert tc.read("x.json").specification == tc.load(changed(trajectory=plan))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(tc.SpecError, match="spec=") as caught:
        tc.simulate("there/x.json")
    assert "plan.csv" in str(caught.value)


def test_a_simulation_is_refused():
    refused("TC112", tc.simulate, certified(), controllers="l2")
    refused("TC112", tc.simulate, certified(), gains="Z")
    refused("TC112", tc.simulate, certified(), runs=-1)
    refused("TC604", tc.simulate, certified(), spec=changed(system__f=["v", "-2*p - v"]))


@pytest.mark.slow
def test_texts_are_escaped_in_notebooks(tmp_path):
    spec, result = tc.load(DATA), certified()
    metric = tmp_path / "<script>.json"
    metric.write_text('{"format": "tubecert-metric/1", "rate": 0.4, "dual_metric": [[1, -0.5], [-0.5, 1]]}')
    for shown in (spec, result, tc.recheck(result), tc.report(result), tc.verify(DATA, metric)):
        html = shown._repr_html_()
        assert "m<b>" not in html
        assert "<script" not in html
    assert "m&lt;b&gt;" in result._repr_html_()
    assert "&lt;script&gt;" in tc.verify(DATA, metric)._repr_html_()
    shown = tc.verify(DATA, DATA["metric"])._repr_html_()
    assert '<b class="certified">certified</b> <b>given in code</b>: rate' in shown
    assert "no noise, delay or saturation" in result._repr_html_()  # what it assumes is not hidden
    framed = tc.report(result)._repr_html_()
    assert framed.startswith("<iframe srcdoc=")
    assert framed.count('"') == 6  # nothing ends the attribute
    assert "m&amp;lt;b&amp;gt;" in framed


@pytest.mark.slow
def test_figures_are_drawn_into_the_axes_that_are_given():
    from matplotlib.figure import Figure

    result = certified()
    one, other = Figure().subplots(1, 2)
    assert result.plot_tube(one) is one
    assert result.plot_tradeoff(other) is other
    assert one.get_xlabel() == "p (m<b>)"
    labels = one.get_legend_handles_labels()[1]
    assert {"safe set", "tube"} <= set(labels)
    [curve] = [line for line in other.lines if line.get_label() == "B distance"]
    np.testing.assert_array_equal(np.column_stack(curve.get_data()), result.curve("B"))
    [chosen] = [line for line in other.lines if line.get_label() == "decides the verdict"]
    assert (chosen.get_xdata()[0], chosen.get_ydata()[0]) == (result.omega, result.Gamma)
    axes = Figure().subplots()
    result.plot_tube(axes, states=("v", "p"))
    assert axes.get_xlabel() == "v (m/s)"
    refused("TC112", result.plot_tube, axes, states=("p", "q"))


@pytest.mark.slow
def test_the_tube_that_is_drawn_is_as_wide_as_it_is():
    from matplotlib.figure import Figure

    result, axes = certified(), Figure().subplots()
    result.plot_tube(axes)
    [tube] = [patch for patch in axes.patches if patch.get_label() == "tube"]
    widest = np.abs(tube.get_path().vertices).max(axis=0)
    expected = [min(result.rho, result.half_widths[name]) for name in ("p", "v")]
    np.testing.assert_allclose(widest, expected, rtol=2e-3)


@pytest.mark.slow
def test_a_single_state_is_drawn_over_time():
    from matplotlib.figure import Figure

    axes = tc.certify(tc.specification(SCALAR)).plot_tube(Figure().subplots())
    assert axes.get_xlabel() == "t (s)"


@pytest.mark.slow
def test_a_room_with_the_name_of_a_function_never_hides_it():
    code = """
import tubecert.report.page, tubecert.recheck, tubecert.sweep.grid
import inspect, pydoc
import tubecert as tc
from tubecert import *
for name in ("sweep", "report", "recheck"):
    own = getattr(tc, name)
    assert inspect.isfunction(own) and own is globals()[name]
    assert pydoc.plain(pydoc.render_doc(own)).splitlines()[2].startswith(f"{name}(")
from tubecert.report import page
from tubecert.recheck import run
assert inspect.ismodule(page) and inspect.ismodule(run)
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


RIGHT = """
from pathlib import Path

import tubecert as tc

spec: tc.Specification = tc.load("plant.yaml")
same = tc.specification({"name": "x", "safe_set": {"x": [-1, 1.5]}})
steps: list[tc.Step] = []
result = tc.certify(spec, rho_a=0.05, progress=steps.append)
metric = tc.synth(spec, rate=1)
run = tc.simulate(result, runs=3)
page = tc.report(result)
page.save(Path("x.html"))
assert isinstance(result, tc.Certification) and isinstance(run, tc.Simulation)  # else there is a computer in the loop
omega: float | None = result.omega
width: float = result.half_widths["x"]
x: float = result.curve("B")[0, 0]
ok: bool = tc.recheck(result).confirmed and tc.verify(spec, metric).proven
axes = result.plot_tube()
axes.plot(run.states("l1")[:, 0])
loop = tc.read("loop.json")
assert isinstance(loop, tc.SampledCertification)
u: float = loop.controller()(0.0, [0.1, 0.2])[0]
"""
WRONG = """
import tubecert as tc
tc.certfy("plant.yaml")
tc.certify("plant.yaml", rho="0.1")
tc.simulate(3)
hash: int = tc.read("x.json").hash
"""


@pytest.fixture
def scripts(tmp_path):
    """A user's script without, and one with a mistake in each line from the third."""
    for name, text in (("right.py", RIGHT), ("wrong.py", WRONG)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_mypy_checks_the_script_of_a_user(scripts, monkeypatch):
    """With the project's options, hence with what its own check of the package has kept beside it."""
    from mypy import api

    root = Path(__file__).parents[2]
    monkeypatch.chdir(root)
    monkeypatch.setenv("MYPYPATH", str(root))
    options = ["--strict", "--no-error-summary", "--config-file", "pyproject.toml"]
    said, _, _ = api.run([*options, str(scripts / "right.py"), str(scripts / "wrong.py")])
    errors = [Path(line.split(": ")[0]).name for line in said.splitlines() if "error" in line]
    assert errors == ["wrong.py:3", "wrong.py:4", "wrong.py:5", "wrong.py:6"], said


@pytest.mark.slow
def test_pyright_checks_the_script_of_a_user(scripts):
    paths = [str(Path(tc.__file__).parents[1])]
    options = {"include": ["."], "extraPaths": paths, "typeCheckingMode": "standard"}
    (scripts / "pyrightconfig.json").write_text(json.dumps(options), encoding="utf-8")
    command = [sys.executable, "-m", "basedpyright", "--outputjson", "--project", str(scripts)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    found = json.loads(run.stdout)["generalDiagnostics"]
    errors = sorted((Path(item["file"]).name, item["range"]["start"]["line"] + 1) for item in found)
    assert errors == [("wrong.py", line) for line in (3, 4, 5, 6)], found


@pytest.mark.slow
def test_keys_that_are_set_stand_in_place_of_those_of_the_specification():
    spec = tc.load(DATA, settings={"tube.rho_a": 0.3, "initial_state": {"at": [0, Fraction(1, 20)]}})
    assert spec == tc.load(changed(tube__rho_a=0.3, initial_state__at=[0, 0.05]))
    again = tc.load(spec, settings={"tube.epsilon": 0.1})
    assert again == tc.load(changed(tube__rho_a=0.3, tube__epsilon=0.1, initial_state__at=[0, 0.05]))
    result = tc.certify(again, bandwidth=50, adaptation_rate=1e9)
    assert result.certified
    assert set(result.result.overrides.settings) == {"tube.rho_a", "tube.epsilon", "initial_state"}
    assert tc.recheck(result).confirmed
    refused("TC104", tc.certify, again, rho_a=0.2)
    refused("TC104", tc.certify, tc.load(DATA, settings={"metric.rate": 0.3}), metric=DATA["metric"])
    refused("TC104", tc.synth, again, epsilon=0.2)
    refused("TC104", tc.load, again, settings={"tube.epsilon": 0.2})
    refused("TC103", tc.load, DATA, settings={"tube.width": 0.2})
    refused("TC106", tc.load, DATA, settings={"tube.rho_a": object()})


def test_nothing_is_written_over_what_is_another_file(tmp_path):
    """`r.save("plant.yaml")` took the place of the specification, a comparison that of its certificate."""
    spec, sealed, table, mine = (tmp_path / name for name in ("a.yaml", "a.json", "a.csv", "a.metric.json"))
    result, metric = certified(), tc.verify(DATA)
    spec.write_text(TEXT, encoding="utf-8")
    table.write_text("t,p,v,u\n", encoding="utf-8")
    mine.write_text('{"format": "tubecert-metric/1", "rate": "1", "dual_metric": [["1"]]}', encoding="utf-8")
    for _ in range(2):  # over its own kind
        result.save(sealed)
        metric.save(tmp_path / "b.metric.json")
    sides = tc.compare(result, sealed)
    before = [path.read_bytes() for path in (spec, sealed, table, mine)]
    refused("TC120", result.save, spec)
    assert "a.json is no comparison that" in refused("TC120", sides.save, sealed).message
    refused("TC120", sides.save, table)
    refused("TC120", metric.save, mine)
    refused("TC120", metric.save, sealed)
    refused("TC106", result.save, None)
    assert [path.read_bytes() for path in (spec, sealed, table, mine)] == before


def test_a_certification_ends_at_its_deadline():
    """It ended when it was done: only the search for a metric looked at the time."""
    with pytest.raises(tc.TubecertError, match="the deadline has passed") as caught:
        tc.certify(DATA, deadline=1e-6)
    assert caught.value.exit_code == 4
    assert tc.certify(DATA, conditions="a", deadline=100).certified


@pytest.mark.parametrize(
    ("code", "ask"),
    [
        ("TC106", lambda: tc.load(DATA, settings=3)),
        ("TC106", lambda: tc.load(DATA, settings=["a"])),
        ("TC106", lambda: tc.verify(DATA, np.eye(2))),
        ("TC106", lambda: tc.certify(DATA, metric=3)),
        ("TC106", lambda: tc.certify(DATA, progress=3)),
        ("TC106", lambda: tc.sweep(DATA, {"tube.epsilon": 0.1}, folder="x")),
        ("TC106", lambda: certified().plot_tube("x")),
        ("TC120", lambda: tc.report(certified()).save_figures(__file__)),
        ("TC112", lambda: certified().curve("X")),
        ("TC112", lambda: certified().constants["hh"]),
        ("TC112", lambda: certified().limits["u"]),
    ],
)
def test_what_a_user_can_cause_is_an_error_of_tubecert(code, ask):
    """These were errors of Python, which say nothing of the question."""
    assert refused(code, ask).message


def test_names_that_there_are_not_are_told_those_that_there_are():
    with pytest.raises(KeyError, match=r"nothing called 'hh'(.|\n)*did you mean h\?"):
        certified().constants["hh"]
    assert "hh" not in certified().constants
