"""Families of plans as code: the plan is handed in at every sample, and what of it can be seen is examined."""

from __future__ import annotations

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
from controllers import FAMILIES
from flint import ctx
from followed import family_in_recheck, texts
from tubecert.export.assembly import assembled
from tubecert.export.compiled import COMPILERS, FLAGS, compiled, compiler
from tubecert.export.driven import Driven, joined
from tubecert.export.folder import exported
from tubecert.export.reference import Handed
from tubecert.export.vectors import handed_of, run, vectors
from tubecert.recheck.code.constants import of_boxes
from tubecert.recheck.code.examination import agreement
from tubecert.recheck.code.reader import read_code
from typer.testing import CliRunner

from tubecert import certificate
from tubecert.cli.app import app
from tubecert.errors import TubecertError
from tubecert.library.rechecking import code_in

needs_cc = pytest.mark.skipif(
    compiler() is None, reason=f"no C compiler on PATH (one of {', '.join(COMPILERS)})"
)
SPEC = controllers.ANY + "hardware: {rate: 500, delay: 0.0005, noise: 0.0005}\nconditions: {decides: H}\n"


@pytest.fixture(scope="module", params=sorted(FAMILIES))
def name(request):
    return request.param


@pytest.fixture(scope="module")
def controller(name):
    return FAMILIES[name]()


def module_of(text):
    module = types.ModuleType("own")
    exec(text, module.__dict__)
    return module


def in_python(controller):
    return exported(controller, "python").files["family.py"]


def rows_of(own, samples):
    from tubecert.recheck.balls import exact

    return [[exact(Fraction(q)) for q in row] for row in own.given[:samples]]


@pytest.mark.slow
def test_python_computes_what_the_reference_computes(controller):
    module, own = module_of(in_python(controller)), vectors(controller)
    assert module.self_test() <= module.TOLERANCE
    assert own.given == module.MEASURED
    assert "on_plan" not in module.__dict__


@pytest.mark.slow
def test_recheck_reads_the_same_formulas_and_follows_the_text(name, controller):
    own, formulas = vectors(controller), family_in_recheck(name)
    with ctx.workprec(200):
        found = list(formulas.answers(rows_of(own, 20)))
        values = np.array([[float(ball.mid()) for ball in row] for row in found])
        assert np.abs(values - np.array(own.u)[:21]).max() < 1e-11 * np.abs(values).max()
        code = read_code(*texts(controller, "double"))
        _, share = agreement(code, formulas, rows_of(own, 6))
        assert share < 1
        assert not list(of_boxes(code, formulas))


# what is changed in the text of C, and its replacement
MUTATIONS = {
    "another state": (r"xs\[0\]", "xs[1]"),
    "no mean": (r"applied\(c->held, c->before, mean_us, mean\)", "applied(c->held, c->before, us, mean)"),
    "the plan's speed": (r"flow\(xs, us, vs\)", "flow(y, us, vs)"),
    "delay": (r"0\.75 \* held", "0.74 * held"),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", sorted(MUTATIONS))
def test_a_mutation_is_seen(what):
    own = FAMILIES["played"]()
    header, source = texts(own, "double")
    changed, count = re.subn(*MUTATIONS[what], source, count=1)
    assert count == 1
    with ctx.workprec(200):
        _, share = agreement(
            read_code(header, changed),
            family_in_recheck("played"),
            rows_of(vectors(own), 5 if what != "another state" else 30),
        )
    assert share > 1


@pytest.mark.parametrize("what", ["xs", "mean", "held"])
def test_the_self_test_in_python_meets_a_mutation(what):
    text = in_python(FAMILIES["held" if what == "held" else "played"]())
    old, new = {
        "xs": ("r0 = y[0] - xs[0]", "r0 = y[0] - xs[1]"),
        "mean": ("applied(self.held, self.before, mean_us)", "applied(self.held, self.before, us)"),
        "held": ("tuple(p + q for p, q in zip(kappa, u))", "kappa"),
    }[what]
    assert text.count(old) == 1
    with pytest.raises(ValueError, match="self-test"):
        module_of(text.replace(old, new)).self_test()


def test_another_box_is_named():
    header, source = texts(FAMILIES["played"](), "double")
    with ctx.workprec(200):
        formulas = family_in_recheck("played")
        for old, new, name in (
            ("MOST_X[] = {0.9, 0.4}", "MOST_X[] = {0.9, 0.4000000000000001}", "MOST_X"),
            ("LEAST_U[] = {(-2.0)}", "LEAST_U[] = {2.0}", "LEAST_U"),
        ):
            assert source.count(old) == 1
            assert list(of_boxes(read_code(header, source.replace(old, new)), formulas)) == [name]


PLANS = {  # x*, u* and its mean: what a step says of it
    "at the ends": (([0.9, -0.5], [1.9], [-2.0]), 0),
    "x* is outside": (([0.9000001, 0.0], [0.0], [0.0]), 8),
    "another x*": (([0.0, -0.50001], [0.0], [0.0]), 8),
    "u* is outside": (([0.0, 0.0], [-2.0001], [0.0]), 8),
    "its mean is outside": (([0.0, 0.0], [0.0], [1.91]), 8),
    "no number": (([np.nan, 0.0], [0.0], [0.0]), 8),
}


@pytest.mark.parametrize("what", sorted(PLANS))
def test_a_plan_outside_of_its_boxes_is_told_in_python(what):
    (x, u, mean), status = PLANS[what]
    own = module_of(in_python(FAMILIES["played"]())).Controller()
    own.start([0.0, 0.0], [0.0, 0.0], [0.0])
    assert own.status == 0
    own.step([0.0, 0.0], [0.0, 0.0], [0.0], [9.0])  # at the first sample there is no mean
    assert own.status == 0
    own.step(np.nan_to_num(x), x, u, mean)
    assert own.status & 8 == status
    if what in ("at the ends", "x* is outside", "u* is outside"):
        own.start(np.nan_to_num(x), x, u)
        assert own.status & 8 == status


@needs_cc
@pytest.mark.slow
def test_a_plan_outside_of_its_boxes_is_told_in_c():
    with compiled(exported(FAMILIES["played"]())) as own:
        zero = Handed(np.zeros((1, 2)), np.zeros((1, 1)), np.zeros((1, 1)))
        for (x, u, mean), status in PLANS.values():
            own.handed = zero
            own.start(np.zeros((1, 2)))
            assert own.status[0] == 0
            own.handed = zero._replace(mean=np.full((1, 1), 9.0))
            own.step(np.zeros((1, 2)))
            assert own.status[0] == 0
            own.handed = Handed(*(np.array([each]) for each in (x, u, mean)))
            own.step(np.nan_to_num(np.array([x])))
            assert own.status[0] & 8 == status


@needs_cc
@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
def test_c_computes_what_the_reference_computes(controller, precision, tmp_path):
    found = exported(controller, precision=precision)
    found.save(str(tmp_path))
    command = [compiler(), *FLAGS, "-Wshadow", "-Wconversion", *map(str, tmp_path.glob("*.c")), "-lm"]
    done = subprocess.run(
        [*command, "-o", str(tmp_path / "own")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    done = subprocess.run([str(tmp_path / "own")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    if precision == "double":
        own, n = vectors(controller), len(controller.states)
        y, plan = np.array(own.y), np.array(own.plan)
        answers = []
        with compiled(found) as code:
            for k, row in enumerate(y):
                code.handed = handed_of(controller, plan[k])
                answers += [code.start(row[None, :n])] if k == 0 else []
                answers.append(code.step(row[None, :n]))
        expected = run(controller, y, plan=plan)
        assert np.abs(np.concatenate(answers) - expected).max() <= 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"recipe": controllers.recipe(prediction=Fraction("0.01"))}, "a prediction needs u"),
        ({"recipe": controllers.recipe(rounding=("some",))}, "no bound of rounding"),
    ],
)
def test_what_cannot_be_exported_says_why(changed, why):
    with pytest.raises(TubecertError, match=why) as error:
        assembled(controllers.machine(controllers.ANY, **changed))
    assert error.value.findings[0].code == "TC710"


def test_there_is_no_program_around_it():
    with pytest.raises(TubecertError, match="would need the planner"):
        exported(FAMILIES["held"]()).around("arduino")


def test_the_files_say_what_the_code_cannot_see():
    for language in ("c", "python"):
        for file, text in exported(FAMILIES["played"](), language).files.items():
            if file.endswith((".h", ".py", ".md")):
                assert "It cannot say more" in " ".join(text.split()), file


def test_runs_along_several_plans_are_told_as_one():
    one = Driven(
        runs=2, samples=10, difference=1e-15, scale=2.0, distance=0.1, level=0.3, escapes=(1,), told=1,
        step=1e-6, worst=2e-6, precision="double",
    )  # fmt: skip
    both = joined([one, replace(one, difference=2e-15, escapes=(0,), told=0, distance=0.2)])
    assert (both.runs, both.escapes, both.told, both.distance) == (4, (1, 2), 1, 0.2)
    assert both.difference == 2e-15


@needs_cc
@pytest.mark.slow
def test_from_a_certificate_to_code_in_the_loop(tmp_path):
    data = proven.proven(SPEC, bare=True)
    text = certificate.dump(data)
    target, plant = tmp_path / "own.certificate.json", tmp_path / "own.yaml"
    target.write_text(text, "utf-8")
    plant.write_text(SPEC, "utf-8")
    done = CliRunner().invoke(app, ["export", str(target)], prog_name="tubecert")
    assert done.exit_code == 0, done.output
    folder = tmp_path / "own.controller"
    found = code_in(str(folder), text, target.name)
    assert found.difference < 1e-12
    assert "constants were read back" in str(found)
    assert not found.unread
    arguments = ["simulate", str(plant), "--controller", str(folder), "--certificate", str(target)]
    arguments += ["--runs", "4", "--duration", "0.1", "--json"]
    done = CliRunner().invoke(app, arguments, prog_name="tubecert")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert (told["runs"], told["samples"], told["escapes"], told["told"]) == (4, 50, [], 0)
    assert told["difference"] <= 1e-12 * max(1, told["scale"])
    assert 0 < told["distance"] < told["level"]
    source = folder / "family.c"
    source.write_text(source.read_text("utf-8").replace("MOST_X[] = {0.9", "MOST_X[] = {9.0"), "utf-8")
    arguments = ["recheck", str(target), "--controller", str(folder)]
    done = CliRunner().invoke(app, arguments, prog_name="tubecert")
    assert done.exit_code == 1
    assert "family.c:" in done.output
