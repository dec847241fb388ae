"""The specification: what loads, what is refused (with code, line and column), and nothing else."""

import copy
import itertools
import json
import os
import pickle
import re
from fractions import Fraction
from pathlib import Path

import pytest
import yaml
from texts import ROOT

from tubecert.errors import ExitCode, SpecError, TargetError, TubecertError
from tubecert.expression import RESERVED, free_symbols, to_text
from tubecert.findings import Finding
from tubecert.recheck.document import Node
from tubecert.recheck.specification import read_specification
from tubecert.recheck.system import system_of
from tubecert.spec import canonical, codes, load, load_text
from tubecert.spec.canonical import as_file

OK = sorted((ROOT / "tests/specs/ok").glob("*.yaml"))
CONFIGS = sorted((ROOT / "configs").glob("*.yaml"))
BAD = sorted((ROOT / "tests/specs/bad").glob("*.yaml"))
MINIMAL = (ROOT / "tests/specs/ok/minimal.yaml").read_text()
UNLIKE = """tubecert: 1
name: unlike
system:
  states: [x, y]
  inputs: [u]
  f: [y, -x]
  B: [[0], [1]]
  UNITS
safe_set: {x: [-1, 1], y: [-1, 1]}
uncertainty: {h: ["0.1*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, 0]}
metric: {dual_metric: [[1, -0.5], [-0.5, 1]], rate: 0.4}
"""
EXPECT = re.compile(r'# expect: (TC\d+) (\d+:\d+) "(.*)"')


def findings(text: str) -> list[Finding]:
    with pytest.raises(TubecertError) as caught:
        load_text(text, "file.yaml")
    return list(caught.value.findings)


def place(finding: Finding) -> str:
    assert finding.location is not None
    return f"{finding.location.line}:{finding.location.column}"


def minimal(old: str, new: str) -> str:
    assert old in MINIMAL
    return MINIMAL.replace(old, new)


@pytest.mark.parametrize("path", OK + CONFIGS, ids=lambda path: path.stem)
def test_good_files_load(path: Path) -> None:
    spec = load(str(path), reads="question")
    assert spec.path == str(path)
    assert all(location.file == str(path) for location in spec.locations.values())


@pytest.mark.parametrize("path", OK + CONFIGS, ids=lambda path: path.stem)
def test_the_canonical_form_is_a_specification_of_the_same_system(path: Path) -> None:
    data = canonical(load(str(path), reads="question"))
    said = json.dumps(as_file(data))
    again = load_text(said, "canonical.json", "question")
    assert canonical(again) == data
    assert canonical(load_text(yaml.safe_dump(json.loads(said)), "canonical.yaml", "question")) == data


@pytest.mark.parametrize(
    ("units", "chosen"),
    [
        ("", "identity"),
        ("units: {x: m, y: m, u: N}", "identity"),
        ("units: {x: m, u: N}", "identity"),
        ("units: {x: m, y: m/s}", "auto"),
    ],
)
def test_states_of_unlike_units_are_not_measured_by_a_ball(units: str, chosen: str) -> None:
    text = UNLIKE.replace("UNITS", units)
    assert load_text(text).tube.coordinates == chosen
    assert load_text(text + "tube: {epsilon: 0.1, coordinates: identity}").tube.coordinates == "identity"
    assert ("coordinates" in canonical(load_text(text))["tube"]) == (chosen == "auto")


@pytest.mark.parametrize("path", BAD, ids=lambda path: path.stem)
def test_bad_files_are_refused_where_they_say(path: Path) -> None:
    text = path.read_text()
    header = [line for line in text.splitlines() if line.startswith("# expect:")]
    expected = [match.groups() for match in map(EXPECT.fullmatch, header) if match]
    assert expected, 'a bad file begins with lines like: # expect: TC103 7:3 "did you mean"'
    with pytest.raises(SpecError) as caught:
        load(str(path))
    found = caught.value.findings
    assert caught.value.exit_code == ExitCode.INVALID
    for code, where, fragment in expected:
        matching = [f for f in found if f.code == code and place(f) == where]
        assert matching, f"no {code} at {where} in\n" + "\n".join(map(str, found))
        assert any(fragment in f"{f.message} / {f.help}" for f in matching)
    if "# expect: more" not in header:
        assert len(found) == len(expected), "\n".join(map(str, found))


@pytest.mark.slow
@pytest.mark.parametrize("path", BAD, ids=lambda path: path.stem)
def test_the_parser_without_c_agrees(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """PyYAML may come without its C part; only the wording about malformed YAML may then differ."""

    def said() -> list[tuple[str, str]]:
        with pytest.raises(SpecError) as caught:
            load(str(path))
        return [(f.code, "" if f.code == "TC101" else f.message) for f in caught.value.findings]

    before = said()
    monkeypatch.delattr(yaml, "CSafeLoader", raising=False)
    assert said() == before


def test_every_code_is_met_and_explained() -> None:
    met = {match[0] for path in BAD for match in EXPECT.findall(path.read_text())}
    assert met == {code for name, code in vars(codes).items() if name.isupper()}


def test_three_state() -> None:
    spec = load(str(ROOT / "configs/three_state.yaml"))
    assert spec.states == ("x1", "x2", "x3")
    assert spec.f[1].expression is not None
    assert to_text(spec.f[1].expression) == "x1**2 - 2*x1*x3 - x2 + x3"
    assert spec.safe_set == ((Fraction(-1, 10), Fraction(1, 10)),) * 3
    assert spec.x0 == (Fraction(1, 100), Fraction(-1, 100), Fraction(1, 100))
    assert spec.metric is not None
    assert spec.metric.rate == Fraction(9999, 10000)
    assert spec.metric.lower is None
    assert spec.tube.epsilon == spec.tube.rho_a == Fraction(1, 100)
    assert spec.adaptation.predictor_gain == 1
    assert spec.trajectory.kind == "equilibrium"
    assert spec.trajectory.horizon is None
    assert spec.uncertainty.h is not None
    assert free_symbols([spec.uncertainty.h[0].expression]) == {"t"}
    assert "# A three-state system" in spec.source


def test_defaults() -> None:
    spec = load_text(MINIMAL)
    assert (spec.metric, spec.expect) == (None, None)
    assert (spec.tube.epsilon, spec.tube.rho_a) == (None, None)
    assert (spec.adaptation.predictor_gain, spec.adaptation.smooth) == (None, None)
    assert spec.x0 == (0,)
    assert [term.expression.fraction for term in spec.trajectory.u] == [0]


def test_parameters_are_exact_and_may_use_earlier_ones() -> None:
    spec = load(str(ROOT / "tests/specs/ok/declared_bounds.yaml"))
    assert dict(spec.parameters) == {
        "m": Fraction(1, 2),
        "g": Fraction(981, 100),
        "weight": Fraction(981, 200),
        "third": Fraction(1, 3),
    }
    assert spec.B[1][0].expression.fraction == 2
    assert spec.safe_set[0] == (Fraction(-1, 3), Fraction(1, 3))
    assert spec.uncertainty.h is None
    assert spec.uncertainty.bounds is not None
    assert spec.uncertainty.bounds.h_t == Fraction(1, 5)
    assert dict(spec.units) == {"x1": "m", "x2": "m/s", "u": "N"}


def test_a_plan_starts_where_it_starts() -> None:
    spec = load(str(ROOT / "tests/specs/ok/plan.yaml"))
    assert spec.x0 == (1, 0)
    assert spec.trajectory.horizon == 14
    assert spec.adaptation.smooth == Fraction(1, 10)
    assert spec.metric is not None
    assert (spec.metric.lower, spec.metric.upper) == (Fraction(1, 10), 10)


def test_expectations_are_kept() -> None:
    spec = load(str(ROOT / "tests/specs/ok/both_bounds.yaml"))
    assert spec.expect is not None
    assert spec.expect.verdict == "certified"
    assert dict(spec.expect.ranges) == {"rho": (Fraction(1, 10), Fraction(1, 5)), "bandwidth": (1, 1000)}


def test_obligations_know_their_places() -> None:
    path = ROOT / "tests/specs/ok/domain.yaml"
    lines = path.read_text().splitlines()
    spec = load(str(path))
    terms = [*spec.f, *(term for row in spec.B for term in row)]
    owed = [pair for term in terms for pair in term.owed()]
    assert [(o.kind, to_text(o.argument), o.text) for o, _ in owed] == [
        ("nonzero", "cos(x)", "tan(x)"),
        ("nonzero", "x", "x/x"),
        ("positive", "y + 1", "sqrt(1 + y)"),
        ("nonzero", "x", "x**-2"),
        ("nonzero", "2 - y", "1/(2 - y)"),
    ]
    for obligation, location in owed:
        assert lines[location.line - 1][location.column - 1 :].startswith(obligation.text)


def test_locations_answer_for_any_path() -> None:
    spec = load(str(ROOT / "configs/three_state.yaml"))
    lines = spec.source.splitlines()
    for path, begins in {
        "metric.rate": "0.9999",
        "system.f[1]": "x1**2 - 2",
        "safe_set.x2": "[-0.1, 0.1]",
        "metric.dual_metric[1][2]": '"-0.00566 + 0.00998',
        "metric.bounds.lower": "rate:",
    }.items():
        location = spec.location(path)
        assert location is not None
        assert lines[location.line - 1][location.column - 1 :].startswith(begins)
    assert spec.location("nothing.of.this") is None


STYLES = {
    "plain": "-x + zz",
    "single": "'-x + zz'",
    "double": '"-x + zz"',
    "spaces": "'-x    +    zz'",
    "folded": ">\n    -x +\n    zz",
    "folded, stripped": ">-   # a comment\n\n    -x\n    +\n\n    zz",
    "literal": "|\n    -x\n      + zz",
    "several plain lines": "-x\n    +\n    zz",
    "several quoted lines": '"-x\n    + zz"',
    "carriage returns": "|\r\n    -x +\r\n    zz\r\n",
}


@pytest.mark.parametrize("style", STYLES)
def test_a_finding_points_into_any_kind_of_text(style: str) -> None:
    head = "tubecert: 1\nname: minimal\nsystem:\n  f:\n  - "
    rest = MINIMAL[MINIMAL.index("safe_set") :]
    text = f"{head}{STYLES[style]}\n  states: [x]\n  inputs: [u]\n  B: [[1]]\n{rest}"
    (finding,) = findings(text)
    index = text.index("zz")
    line = text.count("\n", 0, index) + 1
    column = index - (text.rfind("\n", 0, index) + 1) + 1
    assert place(finding) == f"{line}:{column}"


def test_an_escaped_text_is_located_at_its_start() -> None:
    text = minimal("f: [-x]", r'f: ["\x2dx + zz"]')
    (finding,) = findings(text)
    assert finding.location is not None
    assert finding.location.source[finding.location.column - 1] == '"'


def test_equal_systems_have_equal_canonical_forms() -> None:
    """Spacing, quotes, order of operands and spelling of numbers do not count."""
    other = minimal("f: [-x]", 'f: [" x * -1.0 "]').replace("h: [0]", 'h: ["0*t"]')
    other = other.replace("[-1, 1]", "['-1.00', 10/10]")
    assert canonical(load_text(other)) == canonical(load_text(MINIMAL))
    changed = minimal("f: [-x]", "f: [-1.0000001*x]")
    assert canonical(load_text(changed)) != canonical(load_text(MINIMAL))


HIDDEN = ["0*sqrt(x - 5)", "0/x", "x*x**-1 - 1", "0*tan(x)", "(1/x)**0 - 1", "sin(0/(x + 3))"]


@pytest.mark.parametrize("dropped", HIDDEN)
@pytest.mark.parametrize(("key", "text"), [("f", "-x"), ("B", "1"), ("h", "0"), ("dual_metric", "2")])
def test_what_must_hold_is_part_of_the_canonical_form(key: str, text: str, dropped: str) -> None:
    """Folding to the same graph makes no equal systems: whoever reads the canonical form meets every obligation."""
    plain = minimal("f: [-x]", 'f: ["-x"]').replace("B: [[1]]", 'B: [["1"]]').replace("h: [0]", 'h: ["0"]')
    plain += 'metric: {rate: 1, dual_metric: [["2"]]}\ntube: {epsilon: 0.1, rho_a: 0.1}\n'
    assert f'{key}: ["{text}"]' in plain or f'{key}: [["{text}"]]' in plain
    spec = load_text(plain.replace(f'["{text}"]', f'["{text} + {dropped}"]'))
    data = canonical(spec)
    assert data != canonical(load_text(plain))
    again = load_text(json.dumps(data))
    assert canonical(again) == data
    read = [system_of(read_specification(Node(form, "spec"))) for form in (canonical(load_text(plain)), data)]
    owed = [len(system.duties) + len(system.uncertainty.duties) for system in read]
    assert owed == [0, 1]


def test_long_constants_survive_the_canonical_form() -> None:
    text = minimal("inputs: [u],", "inputs: [u], parameters: {a: 0.1234567890123456789, b: a**12/7},")
    data = canonical(load_text(text.replace("f: [-x]", "f: [-b*x]")))
    assert canonical(load_text(json.dumps(data))) == data


def test_specs_are_values() -> None:
    spec = load_text(MINIMAL)
    assert spec == load_text(MINIMAL)
    with pytest.raises(AttributeError):
        spec.name = "other"  # type: ignore[misc]


def test_every_problem_is_reported_at_once_in_the_order_of_the_file() -> None:
    text = """tubecert: 1
name: a b
system:
  states: [x, y]
  inputs: [u]
  f: ["-x^2", "2y"]
  B: [[0], [q]]
safe_set: {x: [1, -1], y: [-1, 1]}
uncertainty: {h: ["abs(z)"]}
trajectory: {kind: equilibrium, at: [0]}
tube: {epsilon: -1, rhoa: 2}
metric: {rate: fast, dual_metric: [[1, x], [y, 1]]}
adaptation: {A_m: 2}
"""
    found = findings(text)
    assert [f.code for f in found] == [
        *("TC111", "TC109", "TC109", "TC110", "TC112", "TC110"),
        *("TC107", "TC112", "TC103", "TC110", "TC116", "TC117"),
    ]
    positions = [(f.location.line, f.location.column) for f in found if f.location]
    assert positions == sorted(positions)


def test_a_finding_reads_well() -> None:
    (finding,) = findings(minimal("f: [-x]", 'f: ["-x^2"]'))
    assert str(finding) == (
        "file.yaml:3:43: error TC109: ^ is not allowed in an expression\n"
        '    system: {states: [x], inputs: [u], f: ["-x^2"], B: [[1]]}\n'
        "                                              ^\n"
        "  help: write ** for a power"
    )


@pytest.mark.parametrize("make", [
    lambda tmp: tmp / "missing.yaml",
    lambda tmp: tmp,
    lambda tmp: tmp / "missing" / "file.yaml",
    lambda tmp: "",
    lambda tmp: "nul\x00name.yaml",
    lambda tmp: tmp / ("long" * 200),
], ids=["missing", "directory", "parent", "empty", "nul", "long"])  # fmt: skip
def test_targets_that_cannot_be_read(make, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(TargetError) as caught:
        load(str(make(tmp_path)))
    assert [f.code for f in caught.value.findings] == ["TC100"]
    assert caught.value.exit_code == ExitCode.INVALID


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root reads everything")
def test_a_file_without_permission(tmp_path: Path) -> None:
    path = tmp_path / "secret.yaml"
    path.write_text(MINIMAL)
    path.chmod(0)
    with pytest.raises(TargetError):
        load(str(path))


def test_files_that_are_not_text(tmp_path: Path) -> None:
    for name, data in {
        "latin": MINIMAL.encode() + "# \u00e4".encode("latin-1"),
        "utf16": MINIMAL.encode("utf-16"),
        "binary": bytes(range(256)),
        "nul": b"tubecert: 1\x00",
    }.items():
        path = tmp_path / name
        path.write_bytes(data)
        with pytest.raises(SpecError) as caught:
            load(str(path))
        assert len(caught.value.findings) == 1


def _bomb() -> str:
    names = "abcdefghi"
    lines = [f"{a}: &{a} [{', '.join([f'*{b}'] * 9)}]" for b, a in itertools.pairwise(names)]
    return "a: &a [lol]\n" + "\n".join(lines) + "\n"


def _with_f(entry: str) -> str:
    return minimal("f: [-x]", f'f: ["{entry}"]')


HOSTILE = {
    "flow brackets": "[" * 200_000,
    "closed flow brackets": "a: " + "[" * 200_000 + "]" * 200_000,
    "braces": "{a: " * 100_000,
    "masked brackets": "a: " + "[ #]\n" * 150_000,
    "quoted closers": "a: " + '["]", ' * 100_000,
    "dashes": "- " * 200_000,
    "question marks": "? " * 200_000,
    "staircase": "\n".join(" " * i + f"k{i}:" for i in range(1_300)),
    "mixed staircase": "".join(f"{' ' * i}- - ? x{i}:\n" for i in range(600)),
    "alias bomb": _bomb(),
    "many aliases": "x: &x 1\ny: [" + "*x, " * 100_000 + "]",
    "many unknown keys": "\n".join(f"k{i}: 1" for i in range(20_000)),
    "many duplicate keys": "name: a\n" * 20_000,
    "many states": minimal("[x], inputs", f"[{', '.join(f's{i}' for i in range(50_000))}], inputs"),
    "many entries": minimal("f: [-x]", f"f: [{'-x, ' * 50_000}]"),
    "wide matrix": minimal("B: [[1]]", f"B: [[{'1, ' * 40_000}]]"),
    "many numbers": minimal("at: [0]", f"at: [{'0, ' * 40_000}]"),
    "big file": "# " + "x" * 1_100_000,
    "long plain text": "a: " + "word " * 150_000,
    "long quoted text": 'name: "' + "\\n" * 300_000 + '"',
    "long key": "k" * 500_000 + ": 1",
    "unclosed quote": 'a: "' + "x\n" * 100_000,
    "percent": "%" * 300_000,
    "colons": ":" * 300_000,
    "colon spaces": ": " * 200_000,
    "ampersands": "&" * 300_000,
    "tags": "!" * 300_000,
    "tabs": "\t" * 300_000,
    "documents": "---\n" * 80_000,
    "minus signs": _with_f("-" * 50_000 + "x"),
    "parentheses": _with_f("(" * 10_000 + "x" + ")" * 10_000),
    "power tower": _with_f("9**9**9"),
    "import": _with_f("__import__('os').system('true')"),
    "attributes": _with_f("x.__class__.__mro__"),
    "exponent": minimal("[-1, 1]", "[-1, 1e10000000]"),
    "digits": minimal("[-1, 1]", f"[-1, {'9' * 100_000}]"),
    "parameters that grow": minimal(
        "inputs: [u],",
        "inputs: [u], parameters: {p0: 1e300, " + ", ".join(f"p{i + 1}: p{i}*p{i}" for i in range(60)) + "},",
    ),
}


@pytest.mark.slow
@pytest.mark.timeout(30)
@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused(name: str) -> None:
    found = findings(HOSTILE[name])
    assert found
    assert len(found) <= 201
    assert all(f.location is not None and len(str(f)) < 2_000 for f in found)


@pytest.mark.slow
def test_large_but_honest_files_load() -> None:
    n = 32
    names = [f"s{i}" for i in range(n)]
    rows = "\n".join(f"    - [{', '.join('1' if i == j else '0' for j in range(n))}]" for i in range(n))
    text = f"""tubecert: 1
name: large
system:
  states: [{", ".join(names)}]
  inputs: [u]
  f: [{", ".join(f"-{name} + sin({name})/2" for name in names)}]
  B: [{", ".join(f"[{int(i == 0)}]" for i in range(n))}]
safe_set: {{{", ".join(f"{name}: [-1, 1]" for name in names)}}}
uncertainty: {{h: [0]}}
trajectory: {{kind: equilibrium, at: [{", ".join(["0"] * n)}]}}
metric:
  rate: 1
  dual_metric:
{rows}
adaptation: {{A_m: -3}}
"""
    assert len(load_text(text).states) == n


@pytest.mark.parametrize("word", sorted({"t", *RESERVED, *(word.lower() for word in RESERVED)}))
@pytest.mark.parametrize("old", ["states: [x]", "inputs: [u]", "inputs: [u],"])
def test_a_name_hides_no_other_meaning(old: str, word: str) -> None:
    """States, inputs, parameters: pi would be the constant, True a number, sin a function, t the time."""
    key = old.split("[", maxsplit=1)[0]
    new = f"inputs: [u], parameters: {{'{word}': 2}}," if old.endswith(",") else f"{key}['{word}']"
    found = findings(minimal(old, new))
    assert [f for f in found if f.code == "TC111" and place(f)[:2] == "3:"], found


@pytest.mark.parametrize(
    "number", ["1e308", "1e-999999999", "9" * 4000, "1e300*1e9", "-1e-300/1e9", "9" * 40 + "e300"]
)
@pytest.mark.parametrize(
    "key", ["at: [{}]", "x: [-1, '{}']", "h: ['{}*x']", "f: ['-x + {}']", "parameters: {{a: {}}}, f: [-x]"]
)
def test_numbers_are_bounded_before_anything_is_computed(key: str, number: str) -> None:
    old = next(
        old for old in ("at: [0]", "x: [-1, 1]", "h: [0]", "f: [-x]") if old.split(":")[0] + ":" in key
    )
    found = findings(minimal(old, key.format(number)))
    assert {f.code for f in found} <= {"TC102", "TC108"}, found
    assert all(f.location is not None for f in found)


@pytest.mark.parametrize("path", OK + CONFIGS, ids=lambda path: path.stem)
def test_a_specification_travels(path: Path) -> None:
    """Pickled or copied it is equal, with the very same expressions, and knows where its keys stand."""
    spec = load(str(path), reads="question")
    for other in (pickle.loads(pickle.dumps(spec)), copy.deepcopy(spec), copy.copy(spec)):
        assert other == spec
        assert other.locations == spec.locations
        assert all(a.expression is b.expression for a, b in zip(spec.f, other.f, strict=True))
        assert canonical(other) == canonical(spec)


def test_the_problems_of_a_file_travel() -> None:
    with pytest.raises(SpecError) as caught:
        load_text(minimal("f: [-x]", "f: [-z]"))
    error = SpecError(caught.value.findings, ExitCode.UNDECIDED)
    other = pickle.loads(pickle.dumps(error))
    assert (other.findings, other.exit_code) == (error.findings, ExitCode.UNDECIDED)
