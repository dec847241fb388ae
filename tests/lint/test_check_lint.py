"""Lint: each finding where it belongs, and nothing said of good files."""

import math
import re
from fractions import Fraction
from pathlib import Path

import pytest
from texts import replaced

import tubecert
from tubecert import lint, pipeline
from tubecert.digits import near
from tubecert.findings import Finding, Severity
from tubecert.spec import Obstacle, canonical, load, load_text

PACKAGE = Path(tubecert.__file__).parent
ROOT = PACKAGE.parent
GOOD = [*sorted((ROOT / "configs").glob("*.yaml")), *sorted((PACKAGE / "templates").glob("*.yaml"))]

BASE = """\
tubecert: 1
name: base
system:
  states: [p, v]
  inputs: [u]
  parameters: {k: 2}
  f: [v, "-k*p - v"]
  B: [[0], [1]]
safe_set: {p: [-1, 1], v: [-2, 2]}
uncertainty:
  h: ["0.1*sin(2*t)"]
trajectory: {kind: equilibrium, at: [0, 0], input: [0], horizon: 10}
initial_state: {at: [0, 0]}
metric:
  rate: 0.4
  dual_metric: [[1, -0.5], [-0.5, 1]]
tube: {epsilon: 0.1, rho_a: 0.1}
"""

W = "  dual_metric: [[1, -0.5], [-0.5, 1]]"
HELD = "{kind: equilibrium, at: [0, 0], input: [0], horizon: 10}"
MOVING = '{kind: expressions, x: ["0.5*sin(t)", "0.5*cos(t)"], u: ["%s"], horizon: 5}'
ALONG = "initial_state: {at: [0, 0.5]}"
START = "initial_state: {at: [0, 0]}"
TUBE = "rho_a: 0.1}"
OF_TUBE = BASE[BASE.index("tube:") :]
FROM_METRIC = BASE[BASE.index("metric:") :]
MACHINE = "hardware: {rate: 500}\n"
WISHES = f"tube: {{half_widths: {{p: 0.1, s: 0.1}}}}\n{MACHINE}"
LOOP = BASE[BASE.index("uncertainty") : BASE.index("metric")]
CSV = "t,p,v,u\n0,0,0,0\n1,%s,0,0\n"

CASES = {
    "unused": ("TC130", "6:25", [("{k: 2}", "{k: 2, m: 1}")]),
    "unused but mentioned": ("TC130", "6:25", [("{k: 2}", "{k: 2, m: 1} # m is the mass")]),
    "unused definition": ("TC130", "7:20", [("{k: 2}", "{k: 2}\n  definitions: {d: p}")]),
    "negative mass": ("TC135", "6:27", [("{k: 2}", "{k: 2, m_1: -1/2}"), ("-k*p", "-k*p*m_1**2")]),
    "case": ("TC131", "6:25", [("{k: 2}", "{k: 2, K: 1}"), ("-k*p", "-k*K*p")]),
    "shape": ("TC131", "6:27", [("{k: 2}", "{l1: 2, II: 1}"), ("-k*p", "-l1*II*p")]),
    "function": ("TC131", "6:21", [("{k: 2}", "{Sin: 2}"), ("-k*p", "-Sin*p")]),
    "time": ("TC131", "6:19", [("{k: 2}", "{T: 2}"), ("-k*p", "-T*p")]),
    "units": ("TC132", "4:10", [("  states: [p, v]", "  units: {p: m}\n  states: [p, v]")]),
    "idle": ("TC133", "7:7", [("f: [v, ", "f: [0, ")]),
    "expect nothing": ("TC134", "9:9", [("safe_set", "expect: {}\nsafe_set")]),
    "a metric alone": ("TC136", "11:3", [(LOOP, ""), (OF_TUBE, "")]),
    "no uncertainty": ("TC205", "11:6", [('"0.1*sin(2*t)"', "0")]),
    "bounded by zero": ("TC205", "11:15", [('h: ["0.1*sin(2*t)"]', "bounds: {h: 0, h_x: 0, h_t: 0}")]),
    "unknown constant": ("TC205", "11:11", [('h: ["0.1*sin(2*t)"]', "bounds: {h: 1, h_x: 0, h_t: 0}")]),
    "loose": ("TC206", "12:15", [('t)"]', 't)"]\n  bounds: {h: 1}')]),
    "loose slope": ("TC206", "12:17", [('t)"]', 't)"]\n  bounds: {h_x: 1}')]),
    "broken": ("TC207", "12:17", [('t)"]', 't)"]\n  bounds: {h_t: 0.1}')]),
    "mode out of reach": ("TC208", "15:9", [('"-k*p - v"', "0"), ("[v, ", '["-0.1*p", '), ("{k: 2}", "{}")]),
    "indefinite": ("TC301", "16:16", [(W, "  dual_metric: [[1, 2], [2, 1]]")]),
    "indefinite somewhere": ("TC301", "16:16", [(W, "  dual_metric: [[p, 0], [0, 1]]")]),
    "too fast": ("TC302", "15:9", [("rate: 0.4", "rate: 0.6")]),
    "not compatible": ("TC303", "16:16", [(W, '  dual_metric: [["1 + v**2", 0], [0, 1]]')]),
    "loose metric": ("TC304", "17:19", [(W, W + "\n  bounds: {lower: 0.1, upper: 2}")]),
    "broken metric": ("TC305", "17:31", [(W, W + "\n  bounds: {lower: 0.6, upper: 1.9}")]),
    "held outside": ("TC403", "12:37", [("at: [0, 0]", "at: [2, 0]")]),
    "leaves": ("TC403", "12:36", [(HELD, MOVING.replace("0.5", "3") % "0"), (START, ALONG)]),
    "no equilibrium": ("TC404", "12:52", [("input: [0]", "input: [1]")]),
    "no input given": ("TC404", "12:37", [("at: [0, 0], input: [0]", "at: [0.1, 0]"), (START, "")]),
    "a rounded point": ("TC404", "12:52", [("input: [0]", "input: [0.0001]")]),
    "start": ("TC405", "13:22", [("{at: [0, 0]}", "{at: [3, 0]}")]),
    "no room": ("TC406", "17:7", [("epsilon: 0.1", "epsilon: 1")]),
    "no room for the start": ("TC406", "17:7", [("{at: [0, 0]}", "{at: [0.95, 0]}")]),
    "no room for a ball": ("TC406", "17:7", [("{at: [0, 0]}", "{within: 0.9}")]),
    "defect": ("TC407", "12:69", [(HELD, MOVING % "0"), (START, ALONG)]),
    "collision with a disc": ("TC408", "19:5", [(TUBE, TUBE + "\nobstacles:\n  - disc: {center: [0, 0], radius: 1}")]),
    "collision": ("TC408", "19:5", [(TUBE, TUBE + "\nobstacles:\n  - polygon: [[-1, -1], [1, -1], [0, 1]]")]),
    "start in a disc": ("TC408", "14:13", [("[0, 0]}", "[1, 0]}\nobstacles: [{disc: {center: [1, 0], radius: 0.1}}]")]),
    "input beyond": ("TC415", "12:52", [("[0], horizon", "[1], horizon"), (TUBE, TUBE + "\nlimits: {u: [-1/2, 2/3]}")]),
    "inputs beyond": ("TC415", "12:69", [(HELD, MOVING % "9*sin(t)"), (START, f"{ALONG}\nlimits: {{u: [-8, 9]}}")]),
    "an unknown gain": ("TC416", "6:15", [("{k: 2}", "{k: 2, m: [1, 2]}"), ("[1]]", "[1/m]]")]),
    "an output wished for": ("TC416", "15:33", [(FROM_METRIC, WISHES), ("  f: [", "  outputs: {s: p - v}\n  f: [")]),
    "a point that moves": ("TC404", "12:52", [(FROM_METRIC, MACHINE), ("input: [0]", "input: [1]")]),
    "held automatically": ("TC417", "12:37", [("at: [0, 0], input: [0]", "at: auto, near: [0.1, 0]")]),
    "an exact sensor": ("TC418", "14:30", [(FROM_METRIC, MACHINE.replace("rate: 500", "rate: 500, noise: {p: 1}"))]),
    "a start beyond a wish": ("TC405", "13:16", [(FROM_METRIC, WISHES.replace(", s", ", v")), (START, ALONG)]),
    "a start without room": ("TC405", "13:16", [(FROM_METRIC, MACHINE), ("{at: [0, 0]}", "{within: 1.2}")]),
    "far obstacle": ("TC409", "19:5", [(TUBE, TUBE + "\nobstacles:\n  - disc: {center: [9, 0], radius: 0.2}")]),
}  # fmt: skip


def found(text: str) -> list[Finding]:
    return pipeline.inspect(load_text(text, "base.yaml", "question"))


def changed(*changes: tuple[str, str]) -> str:
    return replaced(BASE, *changes)


def test_nothing_is_said_of_the_base():
    assert found(BASE) == []


@pytest.mark.parametrize("path", GOOD, ids=lambda path: path.stem)
def test_nothing_is_said_of_good_files(path):
    assert pipeline.inspect(load(str(path))) == []


@pytest.mark.parametrize("name", list(CASES))
def test_each_finding_where_it_belongs(name):
    code, where, changes = CASES[name]
    findings = found(changed(*changes))
    own = [item for item in findings if item.code == code]
    assert own, "\n".join(map(str, findings))
    assert own[0].location is not None
    line, column = own[0].location.line, own[0].location.column
    assert f"{line}:{column}" == where, own[0]
    assert own[0].help or code == "TC205"  # there is nothing to write instead


def test_every_code_is_met():
    met = {code for code, _, _ in CASES.values()} | {case[0] for case in TABLES.values()}
    assert met == {code for code in vars(lint.codes).values() if str(code).startswith("TC")}


def table(times=1.0, names="t,p,v,u", wrong=(), steps=60):
    """p = sin(t)/2 with the u that makes it a plan, as a file; `wrong` rows have another p."""
    lines = [names]
    for k in range(steps + 1):
        t = 0.05 * k
        p, v = math.sin(t) / 2, math.cos(t) / 2
        lines.append(f"{t * times:.12g},{p + 0.2 * (k in wrong):.12g},{v:.12g},{p + v:.12g}")
    return "\n".join(lines) + "\n"


TABLES = {
    "ms": ("TC413", "1:1", "ms", table(times=1e3)),
    "us": ("TC413", "1:1", "us", table(times=1e6)),
    "exchanged": ("TC414", "1:1", "columns p and v", table(names="t,v,p,u")),
    "a row": ("TC407", "22:1", "t = 1 s does not belong", table(wrong=(20,))),
    "rows, and a blank line": ("TC407", "32:1", "t = 1.45 s", table(wrong=(29,)).replace("\n0.05,", "\n\n0.05,")),
    "another plan": ("TC407", "25:1", "between t = 1.15 s", table(names="t,p,u,v")),
}  # fmt: skip


def inspected(folder, text, interpolation="linear"):
    (folder / "plan.csv").write_text(text)
    path = folder / "spec.yaml"
    plan = f"{{kind: csv, file: plan.csv, interpolation: {interpolation}}}"
    path.write_text(changed((HELD, plan), (START, ALONG)))
    return pipeline.inspect(load(str(path)))


@pytest.mark.parametrize("name", list(TABLES))
def test_a_plan_file_is_compared_with_the_dynamics(tmp_path, name):
    code, where, words, text = TABLES[name]
    own = [item for item in inspected(tmp_path, text) if item.code in ("TC407", "TC413", "TC414")]
    assert [item.code for item in own] == [code]
    assert own[0].severity is Severity.WARNING
    assert words in own[0].message
    assert str(own[0].location) == f"{tmp_path / 'plan.csv'}:{where}"


def test_nothing_is_said_of_a_plan_file_that_is_one(tmp_path):
    assert inspected(tmp_path, table()) == []
    assert inspected(tmp_path, table(steps=3)) == []


def test_many_bad_rows_are_named_and_counted(tmp_path):
    own = inspected(tmp_path, table(wrong=range(5, 60, 9)))
    assert [item.location.line for item in own] == [7, 16, 25]
    assert "4 more" in own[0].message


def test_knots_outside_are_found(tmp_path):
    (tmp_path / "plan.csv").write_text(CSV % "5")
    path = tmp_path / "spec.yaml"
    path.write_text(changed((HELD, "{kind: csv, file: plan.csv}")))
    [finding] = [item for item in pipeline.inspect(load(str(path))) if item.code == "TC403"]
    assert "p = 5" in finding.message
    assert "t = 1" in finding.message


def test_obstacles_that_are_far_in_floats_are_not_compared_exactly(tmp_path, monkeypatch):
    """10 000 knots and 20 obstacles took 1.7 s."""
    asked = []
    monkeypatch.setattr(Obstacle, "contains", lambda self, *at: asked.append(at) or float(at[0]) > 0.4)
    (tmp_path / "plan.csv").write_text(table())
    obstacle = "\nobstacles: [{disc: {center: [0.6, 0], radius: 0.2}}]"
    (tmp_path / "spec.yaml").write_text(
        changed((HELD, "{kind: csv, file: plan.csv}"), (START, ALONG + obstacle))
    )
    findings = pipeline.inspect(load(str(tmp_path / "spec.yaml")))
    assert [item.message for item in findings] == ["the plan meets the obstacle at t = 1.2 s"]
    assert [type(at[0]) for at in asked] == [Fraction]


@pytest.mark.parametrize("unit", ["deg", "degrees", "\u00b0"])
def test_degrees_in_a_sine_are_told(unit):
    """V10: certified without a word."""
    text = changed(("  states: [p, v]", f"  units: {{p: {unit}, v: {unit}/s, u: N}}\n  states: [p, v]"))
    assert found(text) == []  # nothing but sums
    [note] = found(text.replace("-k*p", "-k*sin(p)").replace("rate: 0.4", "rate: 0.3"))
    assert (note.code, note.severity, str(note.location)[-4:]) == ("TC132", Severity.NOTE, "4:14")
    assert "sin(p) takes radians" in note.message
    assert found(text.replace("-k*p", "-k*sin(pi/180*p)").replace("rate: 0.4", "rate: 0.1")) == []


def test_a_set_that_reads_as_degrees_is_told():
    """[-45, 45] beside a sine was taken for seven turns without a word."""
    text = changed(("-k*p", "-k*sin(p)"), ("p: [-1, 1]", "p: [-45, 45]"))
    [note] = [item for item in found(text) if item.code == "TC132"]
    assert (note.severity, str(note.location)[-4:]) == (Severity.WARNING, "9:15")
    assert "7.2 turns" in note.message
    assert "[-45 deg, 45 deg]" in note.help
    for good in (("sin(p)", "p"), ("sin(p)", "sin(p/50)"), ("45", "7"), ("sin(p)", "sin(pi*p/180)")):
        assert not [item for item in found(text.replace(*good)) if item.code == "TC132"]


def test_a_unit_of_time_that_is_no_second_is_told():
    """S24: a file in minutes is reported in rad/s and s."""
    minutes = ("  states: [p, v]", "  units: {p: m, v: m/min, u: N}\n  states: [p, v]")
    [note] = found(changed(minutes))
    assert (note.code, note.severity, str(note.location)[-4:]) == ("TC132", Severity.NOTE, "4:20")
    assert "the time of this file is in min" in note.message
    [warning] = found(changed(minutes, (FROM_METRIC, MACHINE)))
    assert warning.severity is Severity.WARNING  # a rate of 500 is meant in Hz
    assert "samples per min" in warning.help
    for v in ("m/s", "1/min"):
        assert not found(changed(("  states: [p, v]", f"  units: {{p: m, v: {v}, u: N}}\n  states: [p, v]")))


def test_a_plan_file_in_degrees_is_taken_for_one(tmp_path):
    (tmp_path / "plan.csv").write_text(CSV % "-17.2")
    for f, told in (("-k*p", False), ("-k*sin(p)", True)):
        (tmp_path / "spec.yaml").write_text(changed((HELD, "{kind: csv, file: plan.csv}"), ("-k*p", f)))
        findings = pipeline.inspect(load(str(tmp_path / "spec.yaml")))
        [finding] = [item for item in findings if item.code == "TC403"]
        assert ("{p: {scale: 1 deg}}" in finding.help) is told


def test_a_target_outside_is_found_before_planning():
    plan = "{kind: ilqr, target: [0, 9], horizon: 5}"
    assert "TC403" in {item.code for item in found(changed((HELD, plan)))}
    free = "{kind: ilqr, target: [0, 9], horizon: 5, goal: false}"
    assert "TC403" not in {item.code for item in found(changed((HELD, free)))}


def test_a_file_that_expects_to_be_refuted_is_not_blamed():
    text = changed(("rate: 0.4", "rate: 0.6"), ("safe_set", "expect: {verdict: refuted}\nsafe_set"))
    [finding] = found(text)
    assert (finding.code, finding.severity) == ("TC302", Severity.NOTE)


def test_a_rounded_point_is_told_to_be_one():
    """It was told to be no equilibrium, in the words of an input that is forgotten."""
    [finding] = found(changed(("input: [0]", "input: [0.0001]")))
    assert (finding.code, finding.severity) == ("TC404", Severity.NOTE)
    assert re.search(r"equilibrium up to a rounding.*\(moves v by \S+ per s\), 0\.\d+ % of", finding.message)
    assert finding.help.startswith("nothing is wrong")
    assert "more digits (input: [" in finding.help
    [finding] = found(changed(("input: [0]", "input: [1]")))
    assert (finding.severity, "no equilibrium" in finding.message) == (Severity.WARNING, True)


TANKS = """
tubecert: 1
name: tanks
system:
  states: [a, b]
  inputs: [u]
  f: ["-0.5*sqrt(a)", "0.5*sqrt(a) - 0.4*sqrt(b)"]
  B: [[1], [0]]
safe_set: {a: [1, 5], b: [1, 7]}
uncertainty: {h: ["0.01*sin(t)"]}
tube: {epsilon: 0.5, rho_a: 0.1}
trajectory: {kind: equilibrium, at: [3.18, 4.96], input: [0.892]}
"""


def test_the_equilibrium_near_a_point_is_written_out():
    """V6: levels of three digits, which no input holds; the point beside them is one to the last digit."""
    [finding] = [item for item in found(TANKS) if item.code == "TC404"]
    new = re.search(r"at: \[(.*?), (.*?)\], input: \[(.*?)\]", finding.help)
    a, b, u = map(float, new.groups())
    assert abs(a - 3.18) + abs(b - 4.96) < 0.02
    assert abs(u - 0.5 * a**0.5) + abs(u - 0.4 * b**0.5) < 1e-11
    written = found(TANKS.replace("at: [3.18, 4.96], input: [0.892]", new[0]))
    again = [item for item in written if item.code == "TC404"]
    assert [item.severity for item in again] in ([], [Severity.NOTE])
    assert not [item for item in again if new[0] in item.help], "what is written already is no remedy"
    arm = BASE.replace('"-k*p - v"', '"19.62*sin(p)"').replace("[[0], [1]]", "[[0], [4]]")
    there = "at: [0.08902199108, 0], input: [-0.436076355268]"  # 12 digits leave 2e-12
    told = found(arm.replace("at: [0, 0], input: [0]", there))
    helps = [item.help for item in told if item.code == "TC404"]
    assert helps == ["nothing is wrong: the proof counts it in; expressions (input: [m*g]) help"]
    [finding] = found(changed(("input: [0]", "input: [1]")))
    assert "write input: [0];" in finding.help  # the point is held, by another input


def test_at_auto_is_the_equilibrium_near_a_point_in_exact_numbers():
    """V6: nobody's trim is exact; the certificate is about the numbers that are found, as if they were written."""
    auto = TANKS.replace("at: [3.18, 4.96]", "at: auto, near: [3.18, 4.96]")
    assert not [item for item in found(auto) if item.code == "TC404"]
    told = canonical(load_text(auto))["trajectory"]
    (a, b), (u,) = ([Fraction(text) for text in told[key]] for key in ("at", "input"))
    assert abs(a - Fraction("3.18")) + abs(b - Fraction("4.96")) < Fraction("0.01")
    assert abs((2 * u) ** 2 - a) + abs((5 * u / 2) ** 2 - b) < Fraction(1, 10**18)
    written = f"at: [{told['at'][0]}, {told['at'][1]}], input: [{told['input'][0]}]"
    assert canonical(load_text(TANKS.replace("at: [3.18, 4.96], input: [0.892]", written))) == canonical(
        load_text(auto)
    )
    [note] = [item for item in found(auto) if item.code == "TC417"]
    moved = (
        f"which moves a by {near(float(a) - 3.18, 2)}, b by {near(float(b) - 4.96, 2)} from trajectory.near"
    )
    assert (note.severity, note.message.partition(", ")[2][-len(moved) :]) == (Severity.NOTE, moved)
    middle = canonical(load_text(TANKS.replace("at: [3.18, 4.96], input: [0.892]", "at: auto")))
    assert abs(Fraction(middle["trajectory"]["at"][0]) - 3) < Fraction("0.3")
    near_by = ("at: [0, 0], input", "at: auto, near: [0.1, 0], input")
    held = load_text(changed(("-k*p - v", "19.62*sin(p)"), near_by, (START, ""))).trajectory
    assert [term.expression.fraction for term in held.x] == [Fraction(1, 10), 0], "its input holds it"
    assert abs(float(held.u[0].expression.fraction) + 19.62 * math.sin(0.1)) < 1e-15


def test_a_machine_needs_no_rank():
    lost = ("[[0], [1]]", "[[0], [p]]")
    assert "TC203" in [item.code for item in found(changed(lost))]
    assert "TC203" not in [item.code for item in found(changed(lost, (FROM_METRIC, MACHINE)))]


CAR = """
tubecert: 1
name: car
system:
  states: [x, y, a]
  inputs: [w]
  f: ["3*cos(a)", "3*sin(a)", 0]
  B: [[0], [0], [1]]
safe_set: {x: [-1, 20], y: [-1, 1], a: [-0.7, 0.7]}
uncertainty: {h: ["0.01*sin(t)"]}
trajectory: {kind: expressions, x: ["3*t", 0, 0], u: [0], horizon: 5}
metric: {synthesise: {}}
tube: {epsilon: 0.1, rho_a: 0.05}
"""


def test_a_direction_that_no_input_reaches_along_a_plan_is_told_before_a_search():
    """V8: 66 attempts ended with "lower the rate", and no rate can help."""
    [finding] = found(CAR)
    assert (finding.code, finding.severity) == ("TC208", Severity.WARNING)
    assert "along the plan, no input reaches x, which does not decay by itself" in finding.message
    turned = CAR.replace('["3*t", 0, 0]', '["9*t/5", "12*t/5", "atan(4/3)"]').replace("0.7]", "1]")
    turned = turned.replace("y: [-1, 1]", "y: [-1, 15]") + "initial_state: {at: [0, 0, 0.927]}\n"
    [finding] = [item for item in found(turned) if item.code == "TC208"]
    assert "no input reaches 0.75*x + y, which" in finding.message
    sampled = CAR.partition("metric")[0] + "hardware: {rate: 50}"
    assert [(item.code, item.severity) for item in found(sampled)] == [("TC208", Severity.NOTE)]


def test_what_is_reached_somewhere_along_a_plan_is_no_such_direction():
    curve = CAR.replace('["3*t", 0, 0], u: [0]', '["3*sin(t/2)*2", "6 - 6*cos(t/2)", "t/2"], u: [0.5]')
    assert not [item for item in found(curve) if item.code == "TC208"]
    slow = CAR.replace("3*cos(a)", "3*cos(a) - 0.5*x").replace('["3*t"', '["6 - 6*exp(-t/2)"')
    for rate, told in (("0.4", 0), ("0.6", 1)):
        text = slow.replace("synthesise: {}", f"synthesise: {{rate: {rate}}}")
        assert sum("decays by itself at 0.5 1/s" in item.message for item in found(text)) == told


def test_where_there_is_no_equilibrium_none_is_named():
    text = changed(("[v, ", "[1 + v**2, "))
    [finding] = [item for item in found(text) if item.code == "TC404"]
    assert "f(at) + B(at) input = 0" in finding.help


@pytest.mark.parametrize(("after", "said"), [("repeat", ["TC204"]), ("rest", []), ("nothing", [])])
def test_a_plan_that_does_not_begin_again_is_told_before_certifying(tmp_path, after, said):
    """`check` passed what `certify` refused."""
    (tmp_path / "plan.csv").write_text("t,p,v,u\n0,0,0,0\n1,0.1,0,0\n")
    plans = ['{kind: expressions, x: ["0.1*t", "0.1"], u: ["0.2*t + 0.1"]', "{kind: csv, file: plan.csv"]
    for plan in plans:
        told = f"{plan}, horizon: 1, afterwards: {after}}}"
        (tmp_path / "base.yaml").write_text(changed((HELD, told), (START, ""), (FROM_METRIC, MACHINE)))
        findings = pipeline.inspect(load(str(tmp_path / "base.yaml")))
        assert [item.code for item in findings if item.code == "TC204"] == said, findings
    round_trip = changed((HELD, MOVING.replace("5}", f"7, afterwards: {after}}}") % "0"), (START, ""))
    findings = found(round_trip.replace(FROM_METRIC, MACHINE))
    assert not [item for item in findings if item.code == "TC204"]


def test_who_has_no_metric_is_told_that_a_computer_needs_none():
    """The keys of a metric alone were named."""
    told = pipeline.checks.missing_parts(load_text(changed((FROM_METRIC, "")), "base.yaml"))
    assert told[0].message == "metric is needed to certify"
    assert "hardware: {rate: 500}" in told[0].help


def test_the_rate_that_a_point_allows_is_named():
    [finding] = found(changed(("rate: 0.4", "rate: 0.6")))
    assert re.search(r"supports 0\.5 at most", finding.message)


@pytest.mark.parametrize("value", ["1e300", "1e-300", "-1e300", "1e200/3", "1e150*1e150"])
@pytest.mark.parametrize(
    "place", ["k: 2", "rate: 0.4", "at: [0, 0]", "epsilon: 0.1", "[-2, 2]", "[0], [1]", 't)"]']
)
def test_extreme_numbers_are_no_trouble(value, place):
    new = {
        "[-2, 2]": f"[-1, {value.lstrip('-')}]",
        "at: [0, 0]": f"at: [{value}, 0]",
        "[0], [1]": f"[0], [{value}]",
    }
    new['t)"]'] = f't)"]\n  bounds: {{h: {value.lstrip("-")}, h_t: {value.lstrip("-")}}}'
    value = value.lstrip("-") if place in ("rate: 0.4", "epsilon: 0.1") else value
    text = BASE.replace(place, new.get(place, f"{place.split(':')[0]}: {value}"))
    for item in found(text):
        assert item.code


def test_floats_say_nothing_about_an_ill_conditioned_metric():
    flat = "  dual_metric: [[1e-9, -0.5e-9], [-0.5e-9, 1e3]]"
    assert "TC302" not in {item.code for item in found(changed((W, flat), ("rate: 0.4", "rate: 0.6")))}


def test_a_notation_is_told_in_one_line():
    """V12: four warnings on the areas A1 and a1 of four tanks."""
    known, product = "A1: 1, a1: 2, A2: 1, a2: 2, A3: 1, a3: 2", "-a1*p*A1*a2*A2*a3*A3"
    [warning] = found(changed(("{k: 2}", f"{{{known}}}"), ("-k*p", product), ("rate: 0.4", "rate: 0.1")))
    assert warning.message == "a1 is easily taken for A1, a2 for A2, a3 for A3"


def test_customary_names_are_not_confusable():
    """U7: a cart M, a pendulum m of length l with an inertia I: every cart-pole."""
    names = changed(("{k: 2}", "{M: 1, m: 0.2, l: 0.5, I: 0.1, i_max: -1}"), ("-k*p", "-M*p*m*l*I*i_max**2"))
    assert found(names) == []
    names = changed(("{k: 2}", "{l1: 1, I1: 0.2, l2: 0.5, I2: 0.1}"), ("-k*p", "-l1*p*I1*l2*I2"))
    assert found(names) == []
    names = changed(("{k: 2}", "{l1: 1, I_1: 0.2, ll: 2}"), ("-k*p", "-l1*p*I_1*ll"))
    assert [item.code for item in found(names)] == ["TC131"]  # ll looks like l1


def test_a_note_names_the_states_that_are_measured_exactly_unless_that_is_written():
    for noise, said in (("{p: 0.01}", ["measured exactly: v"]), ("{p: 0.01, v: 0}", []), ("0.01", [])):
        machine = MACHINE.replace("rate: 500", f"rate: 500, noise: {noise}")
        findings = found(changed((FROM_METRIC, machine)))
        assert [item.message.partition(";")[0] for item in findings if item.code == "TC418"] == said


def test_what_misses_its_equations_names_the_one_that_is_missed_most(tmp_path):
    """A length of m/s, rad/s^2 and A/s says little."""
    units = ("  states: [p, v]", "  units: {p: m, v: m/s, u: N}\n  states: [p, v]")
    for changes, words in (
        ([(HELD, MOVING % "0"), (START, ALONG)], "most in v' by 0.707 m/s per s at t ="),
        ([("input: [0]", "input: [1]")], "(moves v by 1 m/s per s)"),
    ):
        assert any(words in item.message for item in found(changed(units, *changes))), changes
    (tmp_path / "plan.csv").write_text("t,p,v,u\n0,0,0,0\n1,0.5,0,0\n")
    told = changed(units, (HELD, "{kind: csv, file: plan.csv}"), (START, ""))
    (tmp_path / "base.yaml").write_text(told)
    [finding] = [i for i in pipeline.inspect(load(str(tmp_path / "base.yaml"))) if i.code == "TC407"]
    assert "most in p' by" in finding.message


def test_a_start_outside_of_the_safe_set_is_located_in_the_plan_that_has_it(tmp_path):
    (tmp_path / "plan.csv").write_text("t,p,v,u\n0,2000,0,0\n1,2000,0,0\n")
    (tmp_path / "base.yaml").write_text(changed((HELD, "{kind: csv, file: plan.csv}"), (START, "")))
    [finding] = [i for i in pipeline.inspect(load(str(tmp_path / "base.yaml"))) if i.code == "TC405"]
    assert str(finding.location) == f"{tmp_path / 'plan.csv'}:2:1"
