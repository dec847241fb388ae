"""Certificate C as code: one arithmetic in three languages, recheck's own reading, mutations, and the loop itself."""

from __future__ import annotations

import ctypes
import json
import re
import subprocess
import types
from dataclasses import replace
from fractions import Fraction

import controllers
import numpy as np
import proven
import pytest
from controllers import CONTINUOUS
from flint import ctx
from followed import adapted_in_recheck, texts
from tubecert.export.assembly import controller_of
from tubecert.export.compiled import COMPILERS, FLAGS, compiler
from tubecert.export.continuous.assembly import together
from tubecert.export.continuous.compiled import compiled
from tubecert.export.continuous.driven import driven
from tubecert.export.continuous.reference import Reference
from tubecert.export.continuous.vectors import instants, parts, run, vectors
from tubecert.export.continuous.words import operations
from tubecert.export.controller import Continuous, Controller
from tubecert.export.driven import Given
from tubecert.export.folder import exported
from tubecert.export.reference import Handed, execute
from tubecert.recheck.code.continuous import _answers, otherwise
from tubecert.recheck.code.examination import apart
from tubecert.recheck.code.reader import read_code
from typer.testing import CliRunner

from tubecert import certificate
from tubecert.cli.app import app
from tubecert.errors import TubecertError
from tubecert.library.certification import certification_of
from tubecert.simulate.certified import adopted
from tubecert.simulate.setting import setting_of
from tubecert.spec import load_text

needs_cc = pytest.mark.skipif(
    compiler() is None, reason=f"no C compiler on PATH (one of {', '.join(COMPILERS)})"
)


@pytest.fixture(scope="module", params=sorted(CONTINUOUS))
def name(request):
    return request.param


@pytest.fixture(scope="module")
def controller(name):
    return CONTINUOUS[name]()


def module_of(text):
    module = types.ModuleType("own")
    exec(text, module.__dict__)
    return module


def in_python(controller):
    return exported(controller, "python").files[f"{controller.name}.py"]


def rows_of(values):
    return [[Fraction(float(q)) for q in row] for row in values]


@pytest.mark.slow
def test_python_computes_what_the_reference_computes(controller):
    module = module_of(in_python(controller))
    expected = run(controller, np.array(module.GIVEN))
    assert np.abs(module.answers() - expected).max() <= 1e-12 * np.abs(expected).max()
    assert module.self_test() <= module.TOLERANCE
    assert controller.hash == module.CERTIFICATE


@pytest.mark.slow
def test_recheck_reads_the_same_theorem(name, controller):
    given = instants(controller, 4)
    with ctx.workprec(200):
        found = list(adapted_in_recheck(name).answers(rows_of(given)))
    values, own = np.array([[float(ball.mid()) for ball in row] for row in found]), run(controller, given)
    assert np.abs(values - own).max() < 1e-11 * np.abs(own).max()
    assert max(float(ball.rad()) for row in found for ball in row) < 1e-30


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
def test_recheck_follows_the_text(name, controller, precision):
    code, formulas = read_code(*texts(controller, precision)), adapted_in_recheck(name)
    given = rows_of(instants(controller, 3).astype(np.float32 if precision == "single" else float))
    with ctx.workprec(200):
        expected = list(formulas.answers(given))
        _, share = apart(code.real, expected, _answers(code, formulas, given), None)
        assert share < 1
        assert not list(otherwise(code, formulas))


# what is changed in the text of C, and its replacement
MUTATIONS = {
    "sign of the feedback": (r"out_kappa\[0\] = -", "out_kappa[0] = "),
    "sign of the estimate": (r"const real r3 = -r2;", "const real r3 = r2;"),
    "gain of the estimate": (r"-\(85\.6", "-(85.5"),
    "clip": (r"0\.9 / r", "0.91 / r"),
    "bandwidth": (r"25\.5 ", "25.4 "),
    "index": (r"const real r0 = xhat\[0\] - x\[0\]", "const real r0 = xhat[1] - x[0]"),
    "age": (r"\* ORBIT_SAMPLE_TIME \+ since", "* ORBIT_SAMPLE_TIME"),
    "u_a": (r"u\[i\] = u\[i\] \+ u_a\[i\]", "u[i] = u[i] - u_a[i]"),
    "memory": (r"c->u_a\[i\] = u_a\[i\]", "c->u_a[i] = 0.0"),
    "predictor": (r"out_rate\[0\] = \(v\[0\] \+ s\[0\]\)", "out_rate[0] = (v[0] - s[0])"),
    "flow": (r"flow\(x, u, v\);", "flow(xhat, u, v);"),
}


def orbit():
    return replace(CONTINUOUS["orbit"](), name="orbit")


@pytest.mark.slow
@pytest.mark.parametrize("what", sorted(MUTATIONS))
def test_a_mutation_is_met_by_the_self_test_and_by_recheck(what, tmp_path):
    own = orbit()
    files = dict(exported(own).files)
    files["orbit.c"], count = re.subn(*MUTATIONS[what], files["orbit.c"], count=1)
    assert count == 1
    with ctx.workprec(200):
        code, formulas = read_code(files["orbit.h"], files["orbit.c"]), adapted_in_recheck("orbit")
        given = rows_of(instants(own, 4))
        expected = list(formulas.answers(given))
        _, share = apart("double", expected, _answers(code, formulas, given), None)
    assert share > 1
    if compiler() is not None:
        for file, text in files.items():
            (tmp_path / file).write_text(text, "utf-8")
        assert built(tmp_path, "-O0").returncode == 0
        assert self_tested(tmp_path).returncode == 1


def test_another_number_is_named():
    header, source = texts(orbit(), "double")
    with ctx.workprec(200):
        _numbers_of_others(header, source)


def _numbers_of_others(header, source):
    formulas = adapted_in_recheck("orbit")
    assert not list(otherwise(read_code(header, source), formulas))
    for old, new, name in (
        ("SAMPLE_TIME 0.01 ", "SAMPLE_TIME 0.010000000000000002 ", "SAMPLE_TIME"),
        ("HORIZON 6.3 ", "HORIZON 6.300000000000001 ", "HORIZON"),
        ("REACH 0.19 ", "REACH 0.1899999 ", "REACH"),
        ("0.9 / r", "0.9000000000000001 / r", None),  # of another form: two radii
        ("6.302 * (sqrt", "6.302000000000001 * (sqrt", "the gain"),
    ):
        changed = [text.replace(old, new) for text in (header, source)]
        assert changed != [header, source], old
        if name is None:
            with pytest.raises(ValueError, match="another form"):
                list(otherwise(read_code(*changed), formulas))
        else:
            assert list(otherwise(read_code(*changed), formulas)) == [name]


# the same of the module in Python
IN_PYTHON = {
    "sign": (r"        -\(\(\(r", "        (((r"),
    "clip": (r"0\.9 / r", "0.91 / r"),
    "bandwidth": (r"25\.5 ", "25.4 "),
    "age": (r"\* SAMPLE_TIME \+ since", "* SAMPLE_TIME"),
    "u_a": (r"\(k \+ p\) \+ q", "(k + p) - q"),
    "memory": (r"self\.u_a = filtered\(", "filtered("),
    "start": (r"np\.array\(x, dtype=float\)", "0.0 * np.array(x, dtype=float)"),
    "sample": (r"self\.sample \+= 1", "self.sample += 2"),
}


@pytest.mark.parametrize("what", sorted(IN_PYTHON))
def test_the_self_test_in_python_meets_a_mutation(what):
    text, count = re.subn(*IN_PYTHON[what], in_python(orbit()), count=1)
    assert count == 1
    with pytest.raises(ValueError, match=r"self-test|elsewhere"):
        module_of(text).self_test()


def built(folder, *flags):
    sources = sorted(str(path) for path in folder.glob("*.c"))
    command = [compiler(), *FLAGS, *flags, *sources, "-o", str(folder / "test"), "-lm"]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def self_tested(folder):
    return subprocess.run([str(folder / "test")], capture_output=True, text=True, check=False)


@needs_cc
@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
def test_a_strict_compiler_has_nothing_to_say(controller, precision, tmp_path):
    exported(controller, precision=precision).save(str(tmp_path))
    done = built(tmp_path, "-Wshadow", "-Wconversion")
    assert done.returncode == 0, done.stderr
    done = self_tested(tmp_path)
    assert done.returncode == 0, done.stdout
    assert "passes" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("x", "u", "status"), [([0.9, -0.5], [1.9], 0), ([0.91, 0.0], [0.0], 8), ([0, 0], [2], 8)]
)
def test_a_plan_outside_of_its_boxes_is_told(x, u, status):
    module = module_of(in_python(CONTINUOUS["family"]()))
    own = module.Controller()
    own.start(x)
    own.law(0.001, x, x, u)
    assert own.status == status
    if compiler() is not None:
        with compiled(exported(CONTINUOUS["family"]())) as code:
            code.start(np.array([x]))
            code.handed = Handed(np.array([x]), np.array([u]), np.array([u]))
            code.answer(0.001, np.array([x], dtype=float), np.array([x], dtype=float))
            assert code.status[0] == status


@needs_cc
@pytest.mark.slow
def test_c_computes_what_the_reference_computes(controller):
    given = instants(controller, 12)
    expected = run(controller, given)
    with compiled(exported(controller)) as own:
        found = own.answers(given)
        assert ctypes.sizeof(own._states) > 0
    assert np.abs(found - expected).max() <= 1e-12 * np.abs(expected).max()


@pytest.mark.slow
def test_the_vectors_meet_every_branch(controller):
    given, own = np.array(vectors(controller).given), Reference(controller=controller)
    clipped, acts = set(), set()
    for row in given:
        x, xhat, own.handed = parts(controller, row)
        _, raw, estimate = execute(controller.estimator, x, xhat)
        clipped.add(bool(np.abs(raw - estimate).max() > 1e-9))
        acts.add(bool(np.abs(own.kappa(x, np.asarray(0.0))[0]).max() > 1e-9))
    assert clipped == {True, False}
    assert True in acts


def test_a_steady_uncertainty_is_found_after_one_sample():
    """(4b.1): the estimate is a mean of h over the sample before; nothing of the plant but constant B is asked for."""
    own = Reference(controller=orbit())
    Ts, steps, h = float(own.controller.sample_time), 20, np.array([[0.31]])
    x = own.plan(np.asarray(0.0))[0] + np.array([[0.02, -0.03]])
    xhat = own.start(x)
    for _ in range(steps):  # Heun's rule for plant and predictor
        slopes = []
        for share in (0.0, 1.0):
            at, ahead = x, xhat
            if share:
                at, ahead = x + Ts / steps * slopes[0][0], xhat + Ts / steps * slopes[0][1]
            u = np.zeros((1, 1))  # whatever acts: the predictor knows it
            (v,) = execute(own.controller.flow, at, u + h)
            slopes.append((v, own.predictor(at, ahead, u)))
        x = x + Ts / steps * (slopes[0][0] + slopes[1][0]) / 2
        xhat = xhat + Ts / steps * (slopes[0][1] + slopes[1][1]) / 2
    own.step(x, xhat)
    assert own.sigma_hat == pytest.approx(h, rel=1e-3)
    assert own.law(np.asarray(0.4), x)[0] - own.law(np.asarray(0.0), x)[0] != pytest.approx(0, abs=1e-3)
    assert own._filtered(np.array([[0.4]])) == pytest.approx(-h, rel=1e-3)  # u_a, long after


def test_what_a_call_costs_is_what_the_text_does():
    """Counts of the README against operations in the text."""
    own = orbit()
    counts = operations(own)
    assert counts["law"]["exp"] == counts["step"]["exp"] == 1
    assert counts["step"]["sqrt"] == 1
    assert counts["law"]["sqrt"] == 2
    assert "exp" not in counts["predictor"]
    assert "| exp | 1 | 0 | 1 |" in exported(own).files["README.md"]


def test_what_is_assumed_stands_in_every_file():
    for language in ("c", "python"):
        files = exported(orbit(), language).files
        for file, text in files.items():
            if file.endswith((".h", ".py", ".md")):
                assert "CONTINUOUS TIME" in text, file
                assert "ASSUMED" in text, file


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        (
            {"text": (controllers.CONFIGS / "state_dependent_input.yaml").read_text("utf-8")},
            "is not constant",
        ),
        ({"text": controllers.PATH.replace("p - v/2", "p*cos(t) - v/2")}, "f depends on t"),
    ],
)
def test_what_cannot_be_exported_says_why(changed, why):
    if "cos(t)" in changed["text"]:
        changed = {"text": changed["text"].replace("at: [0, 0]}", "at: [0, 0], horizon: 1}")}
    with pytest.raises(TubecertError, match=why) as error:
        together(controllers.loop(changed["text"]))
    assert error.value.findings[0].code == "TC710"


def test_there_is_no_program_around_it():
    with pytest.raises(TubecertError, match="feedback in continuous time"):
        exported(orbit()).around("arduino")


@pytest.mark.slow
def test_c_is_exported_where_it_decides():
    """Of a specification with a machine H is meant, unless C decides."""
    data = proven.shipped("hardware_orbit")
    own = certification_of(data).certificate
    assert isinstance(controller_of(own), Controller)
    data["result"]["decided_by"] = ["sampled"]
    other = json.loads(json.dumps(data["result"]))
    found = certification_of(certificate.seal(other, {})).certificate
    assert isinstance(controller_of(found), Continuous)
    other["sampled"]["verdict"] = "undecided"
    with pytest.raises(TubecertError, match="certifies no controller"):
        controller_of(certification_of(certificate.seal(other, {})).certificate)


@needs_cc
@pytest.mark.slow
def test_from_a_certificate_to_code_in_the_loop(tmp_path):
    data = proven.shipped("two_state")
    text = certificate.dump(data)
    target = tmp_path / "own.certificate.json"
    target.write_text(text, "utf-8")
    folder = tmp_path / "own.controller"
    done = CliRunner().invoke(app, ["export", str(target)], prog_name="tubecert")
    assert done.exit_code == 0, done.output
    assert "continuous time" in done.output
    from tubecert.library.rechecking import code_in

    found = code_in(str(folder), text, target.name)
    assert found.difference < 1e-12
    assert "constants were read back" in str(found)
    arguments = ["simulate", str(controllers.CONFIGS / "two_state.yaml"), "--controller", str(folder)]
    arguments += ["--certificate", str(target), "--runs", "4", "--duration", "0.3", "--json"]
    done = CliRunner().invoke(app, arguments, prog_name="tubecert")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert (told["runs"], told["escapes"], told["told"]) == (4, [], 0)
    assert told["difference"] <= 1e-12 * told["scale"]
    assert 1e-3 < told["distance"] < told["level"]
    source = folder / "two_state.c"
    source.write_text(source.read_text("utf-8").replace("2.37915", "2.4"), "utf-8")
    arguments = ["recheck", str(target), "--controller", str(folder)]
    done = CliRunner().invoke(app, arguments, prog_name="tubecert")
    assert done.exit_code == 1
    assert "two_state.c:" in done.output


@needs_cc
@pytest.mark.slow
def test_code_that_does_otherwise_is_falsified():
    """A feedback of the other sign, in the loop: the comparison and the distance tell."""
    data = proven.shipped("two_state")
    own = certification_of(data).certificate
    controller = controller_of(own)
    files = dict(exported(controller).files)
    files["two_state.c"] = files["two_state.c"].replace("out_kappa[0] = -", "out_kappa[0] = ")
    wrong = replace(exported(controller), files=files)
    spec = adopted(load_text((controllers.CONFIGS / "two_state.yaml").read_text("utf-8")), own.result)
    setting = setting_of(spec, own.result, Fraction(1, 5))
    with compiled(wrong, 2) as code:
        found = driven(setting, code, controller, Given(count=2, seed=0, precision="double"))
    assert not found.agrees
    assert not found.fine
