"""Code and certificate belong together: recheck's own arithmetic, another certificate, a changed byte."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from unittest import mock

import controllers
import numpy as np
import proven
import pytest
from controllers import CONTROLLERS
from flint import ctx
from followed import TEXTS, in_recheck
from tubecert.export import compiled as compiled_code
from tubecert.export.assembly import controller_of
from tubecert.export.compiled import COMPILERS, compiled, compiler
from tubecert.export.driven import Driven
from tubecert.export.examined import examined
from tubecert.export.folder import exported
from tubecert.export.vectors import vectors
from tubecert.library.driving import Drive
from tubecert.recheck.code.constants import otherwise
from tubecert.recheck.code.reader import read_code
from tubecert.recheck.controller import Machine, machine_of
from typer.testing import CliRunner

import tubecert as tc
from tubecert import certificate
from tubecert.cli.app import app
from tubecert.errors import TubecertError
from tubecert.library.certification import certification_of
from tubecert.library.rechecking import code_in
from tubecert.recheck.balls import exact

needs_cc = pytest.mark.skipif(
    compiler() is None, reason=f"no C compiler on PATH (one of {', '.join(COMPILERS)})"
)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(CONTROLLERS))
def test_recheck_reads_the_same_formulas(name):
    controller = CONTROLLERS[name]()
    own = vectors(controller)
    with ctx.workprec(200):
        found = list(in_recheck(name).answers([[exact(Fraction(q)) for q in row] for row in own.y[:32]]))
    values = np.array([[float(ball.mid()) for ball in row] for row in found])
    assert np.abs(values - np.array(own.u)[:33]).max() < 1e-11 * np.abs(values).max()
    assert max(float(ball.rad()) for row in found for ball in row) < 1e-30


def in_the_loop(target, folder):
    """The compiled code drives the plant for a while."""
    arguments = ["simulate", str(controllers.CONFIGS / "hardware_orbit.yaml"), "--controller", str(folder)]
    assert CliRunner().invoke(app, arguments, prog_name="tubecert").exit_code == 2  # of which certificate?
    arguments += ["--certificate", str(target), "--runs", "4", "--duration", "0.2", "--json"]
    run = CliRunner().invoke(app, arguments, prog_name="tubecert")
    assert run.exit_code == 0, run.output
    found = json.loads(run.stdout)
    assert (found["runs"], found["samples"], found["escapes"], found["told"]) == (4, 100, [], 0)
    assert found["difference"] <= 1e-12 * found["scale"]
    assert 1e-3 < found["distance"] < found["level"]


def constants_are_read_back(folder, own, given):
    """From the object that the compiler made; another number in it, or in the header, is noticed."""
    assert "constants were read back" in str(examined(str(folder), own, *given))
    header, source = ((folder / f"hardware_orbit.{end}").read_text("utf-8") for end in "hc")
    formulas = machine_of(*given)
    assert not list(otherwise(read_code(header, source), formulas))
    for old, new, name in (
        ("SAMPLE_TIME 0.002 ", "SAMPLE_TIME 0.0020000000000000005 ", "SAMPLE_TIME"),
        ("DELAY 0.0005 ", "DELAY 0.00050000000000000012 ", "DELAY"),
        ("HORIZON 6.3 ", "HORIZON 6.300000000000001 ", "HORIZON"),
        ("1.91111315339", "1.9111131533900006", "the clip"),
    ):
        changed = [own_text.replace(old, new) for own_text in (header, source)]
        assert changed != [header, source]
        assert list(otherwise(read_code(*changed), formulas)) == [name]
    whole = compiled_code.built
    for number, other in ((0.14094299744758143, 0.14094299744768143), (0.24834955778683296, 0.248)):

        def built(exported_code, target, number=number, other=other):
            path = Path(whole(exported_code, target))
            code = path.read_bytes()
            assert struct.pack("=d", number) in code
            path.write_bytes(code.replace(struct.pack("=d", number), struct.pack("=d", other)))
            return str(path)

        with (
            mock.patch.object(compiled_code, "built", built),
            pytest.raises(TubecertError, match="other numbers"),
        ):
            examined(str(folder), own, *given)
    with mock.patch.object(compiled_code.shutil, "which", return_value=None):
        alone = examined(str(folder), own, *given)
    assert not alone.ran
    assert "no constants were read back" in str(alone)
    assert alone.difference < 1e-13


@pytest.mark.parametrize("wrong", ["difference", "escapes", "told", "lost"])
def test_what_is_driven_is_fine_if_nothing_speaks_against_it(wrong):
    fine = Driven(
        runs=2,
        samples=10,
        difference=1e-15,
        scale=2.0,
        distance=0.1,
        level=0.3,
        escapes=(),
        told=0,
        step=1e-6,
        worst=2e-6,
        precision="double",
        lost=0.25,
    )
    good = Drive(found=fine, folder="orbit")
    assert good.fine
    assert str(good).startswith("not falsified: orbit drove 2 runs of 10 samples")
    assert "rounding took at most 25 % of what the certificate allows for" in str(good)
    against = {"difference": 1e-3, "escapes": (1,), "told": 3, "lost": 1.5}
    bad = Drive(found=replace(fine, **{wrong: against[wrong]}), folder="orbit")
    assert not bad.fine
    assert str(bad).startswith("FALSIFIED")
    assert "falsified" in bad._repr_html_()


@needs_cc
@pytest.mark.slow
def test_a_certificate_its_code_and_what_is_refused(tmp_path):
    data = proven.shipped("hardware_orbit")
    text = certificate.dump(data)
    target = tmp_path / "orbit.certificate.json"
    target.write_text(text, "utf-8")
    run = CliRunner().invoke(app, ["export", str(target)], prog_name="tubecert")
    assert run.exit_code == 0, run.output
    folder = tmp_path / "orbit.controller"
    around = ["export", str(target), "-o", str(tmp_path / "node"), "--for", "ros2"]
    run = CliRunner().invoke(app, around, prog_name="tubecert")
    assert run.exit_code == 2
    assert "u* moves between samples" in run.output
    own = certification_of(data).certificate
    found = code_in(str(folder), text, target.name)
    assert found.difference < 1e-13
    assert "ball arithmetic" in str(found)
    constants_are_read_back(folder, own, (text, target.name))
    other = exported(controller_of(own), "python")
    other.save(str(tmp_path / "python"))
    in_python = examined(str(tmp_path / "python"), own, text, target.name)
    assert in_python.difference < 1e-13
    assert not in_python.unread
    with pytest.raises(TubecertError, match="in Python is not driven"):
        tc.drive(certification_of(data), tmp_path / "python", runs=1, duration="0.1")
    in_the_loop(target, folder)
    source = folder / "hardware_orbit.c"
    code = source.read_text("utf-8")
    source.write_text(code.replace("0.25 * before", "0.24 * before"), "utf-8")
    run = CliRunner().invoke(app, ["recheck", str(target), "--controller", str(folder)], prog_name="tubecert")
    assert run.exit_code == 1
    line = 1 + next(i for i, each in enumerate(code.splitlines()) if "0.25 * before" in each)
    assert f"hardware_orbit.c:{line}" in run.output
    data["result"]["plan"]["samples"]["t"][1] *= 1.01
    resealed = certification_of(certificate.seal(data["result"], {})).certificate
    with pytest.raises(TubecertError, match="that of another certificate"):
        examined(str(folder), resealed, text, target.name)
    less = json.loads(json.dumps(data["result"]))
    less["constants"]["feedback_gain"]["above"] = None
    with pytest.raises(TubecertError, match="feedback_gain has no bound"):
        controller_of(certification_of(certificate.seal(less, {})).certificate)
    section = data["result"]["hardware"]
    section["verdict"] = "undecided"
    with pytest.raises(TubecertError, match="certifies no controller"):
        controller_of(certification_of(certificate.seal(data["result"], {})).certificate)


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"recipe": controllers.recipe(feedback_time=Fraction(1, 1000))}, "are no samples of the estimate"),
        ({"recipe": controllers.recipe(feedback_time=Fraction(3, 1000))}, "are no samples of the estimate"),
        ({"text": (controllers.CONFIGS / "hardware_three.yaml").read_text("utf-8")}, "is not constant"),
    ],
)
def test_what_cannot_be_exported_says_why(changed, why):
    given = {"text": TEXTS["orbit"]} | changed
    with pytest.raises(TubecertError, match=why) as error:
        controllers.assembled(controllers.machine(given.pop("text"), **given))
    assert error.value.findings[0].code == "TC710"


def test_code_that_answers_otherwise_is_found(monkeypatch):
    """The formulas themselves: whatever the files say, recheck would object to another sign."""
    own = in_recheck("orbit")
    monkeypatch.setattr(
        Machine, "filtered", lambda self, q, sigma: [a - b for a, b in zip(q, sigma, strict=True)]
    )
    y = [[exact(Fraction(q)) for q in row] for row in vectors(controllers.orbit()).y[:4]]
    found = [float(row[0].mid()) for row in own.answers(y)]
    assert max(abs(a - b[0]) for a, b in zip(found, vectors(controllers.orbit()).u, strict=False)) > 1e-3


def test_without_a_compiler_it_says_so(monkeypatch):
    monkeypatch.setattr("tubecert.export.compiled.shutil.which", lambda name: None)
    with (
        pytest.raises(TubecertError, match="no C compiler on PATH") as error,
        compiled(exported(controllers.orbit())),
    ):
        pass
    assert error.value.findings[0].code == "TC712"


def test_a_constant_that_is_no_float_is_refused_in_single_precision():
    given = controllers.machine(TEXTS["orbit"], recipe=controllers.recipe(clip_radius=Fraction(10) ** 40))
    with pytest.raises(TubecertError, match="too large"):
        exported(controllers.assembled(given), precision="single")


@needs_cc
@pytest.mark.slow
def test_windows_along_a_plan_of_the_planner(tmp_path):
    """Of the windows in its tube the code needs to know nothing: the loop is the same in all of them."""
    data = proven.shipped("two_state_windows", bare=True)
    own = certification_of(data).certificate
    controller = controller_of(own)
    assert f"{float(controller.level):.9g}" == f"{float(data['result']['hardware']['level']):.9g}"
    exported(controller).save(str(tmp_path))
    assert examined(str(tmp_path), own, certificate.dump(data), "windows.json").difference < 1e-13
