"""The module in Python as recheck reads it: the same code as that in C, and what it is changed to is noticed."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from unittest import mock

import followed
import numpy as np
import proven
import pytest
from controllers import CONTROLLERS
from flint import ctx
from followed import bounds, covered, in_recheck, texts
from tubecert.export.assembly import controller_of
from tubecert.export.examined import examined
from tubecert.export.folder import exported
from tubecert.export.vectors import vectors
from tubecert.recheck.code import python_reader
from tubecert.recheck.code.constants import of_tables, otherwise
from tubecert.recheck.code.examination import agreement
from tubecert.recheck.code.python_loop import Loop, functions, methods
from tubecert.recheck.code.python_reader import read_python
from tubecert.recheck.code.reader import read_code
from tubecert.recheck.code.words import UnreadError

from tubecert import certificate
from tubecert.errors import ExitCode, TubecertError
from tubecert.export import asked
from tubecert.export import examined as export_examined
from tubecert.library.certification import certification_of
from tubecert.recheck.balls import exact


def module_of(c):
    return exported(c, "python").files[f"{c.name}.py"]


def answered(code, name, rows):
    with ctx.workprec(200):
        given = [[exact(Fraction(value)) for value in row] for row in rows.tolist()]
        return agreement(code, in_recheck(name), given)


def measured(c):
    """Near the plan, then where the clip acts."""
    y = np.array(vectors(c).y)
    return y[np.r_[0:2, 24:27]]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["orbit", "seldom_orbit", "turning", "bent", "predicting_path"])
def test_both_languages_are_read_into_the_same_code(name):
    """The very numbers, differences and bounds of differences, at every sample."""
    c = CONTROLLERS[name]()
    found = answered(read_python(module_of(c)), name, measured(c))
    assert found == answered(read_code(*texts(c, "double")), name, measured(c))
    assert 0 < found[1] < 1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["held_orbit", "path"])
def test_what_python_loses_to_rounding_is_bounded_as_what_c_loses(name):
    c = covered(name)
    of_c = bounds(c, in_recheck(name), texts(c, "double"))
    with mock.patch.object(followed, "read_code", read_python):
        assert bounds(c, in_recheck(name), (module_of(c),)) == of_c


# of the orbit's module: what is changed, and into what
CHANGES = {
    "sign": ("    out_kappa = (\n        -", "    out_kappa = (\n        "),
    "gain": ("0.14094299744758143", "0.14094299744769143"),
    "index": ("y[1] - xs[1]", "y[0] - xs[1]"),
    "clip": ("r3 if r3 < 1.9 else 1.9", "r3 if r3 < 1.9000001 else 1.9000001"),
    "digit": ("0.24834955778683296", "0.24834955778783296"),
    "delay": ("(0.75 * held[0]) + (0.25 * before[0])", "(0.75 * before[0]) + (0.25 * held[0])"),
    "node": ("0.00022540333075851663", "0.00032540333075851663"),
    "step": ("SAMPLE_TIME = 0.002 ", "SAMPLE_TIME = 0.0020000001 "),
}


@pytest.mark.slow
@pytest.mark.parametrize("change", sorted(CHANGES))
def test_a_module_that_computes_something_else_is_noticed(change):
    """By its text alone: nothing is run, and no bytes are compared."""
    c = CONTROLLERS["orbit"]()
    text = module_of(c)
    old, new = CHANGES[change]
    assert text.count(old) >= 1
    try:
        _, share = answered(read_python(text.replace(old, new, 1)), "orbit", measured(c))
    except UnreadError:
        return
    assert share > 1


# what a loop does otherwise, or Python that a controller has no need of
REFUSED = {
    "what is subtracted": ("tuple(p - q for p, q in", "tuple(p + q for p, q in"),
    "memory": ("self.before = self.held\n        self.held = t", "self.before = self.feedback\n        self.held = t"),
    "an estimate": ("self.q, estimate = est", "estimate, self.q = est"),
    "a time": ("self.sample * SAMPLE_TIME\n", "(self.sample - 1) * SAMPLE_TIME\n"),
    "a step more": ("self.sample += 1", "self.sample += 2"),
    "an end": ("t if t < HORIZON", "t if t <= HORIZON"),
    "another module": ("import numpy as np", "import numpy as np\nimport os"),
    "a name that hides another": ("def drift(x):", "def math(x):\n    return x\n\n\ndef drift(x):"),
    "a name that is given twice": ("DELAY = 0.0005", "DELAY = 0.0006\nDELAY = 0.0005"),
    "a default": ("def drift(x):", "def drift(x, y=0.0):"),
    "a decorator": ("def drift(x):", "@print\ndef drift(x):"),
    "a class of another": ("class Controller:", "class Controller(dict):"),
    "a method more": ("    def start(self, y):", "    def more(self):\n        pass\n\n    def start(self, y):"),
    "a whole number": ("0.75 * held[0]", "3 * held[0]"),
    "a place from the end": ("y[1] - xs[1]", "y[-1] - xs[1]"),
    "a power": ("0.75 * held[0]", "0.75 ** held[0]"),
    "a function": ("math.sin(t[0])", "math.gamma(t[0])"),
    "a call": ("math.sin(t[0])", "__import__('os')"),
    "no number": ("0.75 * held[0]", "1e999 * held[0]"),
    "a result more": ("return out_f\n", "return out_f, out_f\n"),
    "a result that is changed": ("    return out_f\n", "    out_f = (0.0, 0.0)\n    return out_f\n"),
    "a number without a name": ("DELAY = 0.0005", "TIMEOUT = 0.0005"),
    "a test that tests nothing": ("if not worst <= TOLERANCE:", "if False:"),
    "no Python": ("def drift(x):", "def drift(x:"),
    "an encoding": ('"""', '# -*- coding: utf-7 -*-\n"""'),
}  # fmt: skip


@pytest.fixture(scope="module")
def orbit_module():
    return module_of(CONTROLLERS["orbit"]())


@pytest.mark.parametrize("change", sorted(REFUSED))
def test_what_is_not_of_the_grammar_is_refused(change, orbit_module):
    old, new = REFUSED[change]
    assert old in orbit_module
    with pytest.raises(UnreadError):
        read_python(orbit_module.replace(old, new, 1))


@pytest.mark.slow
def test_every_number_of_a_table_and_of_the_header_is_that_of_the_certificate():
    text = module_of(CONTROLLERS["turning"]())
    formulas = in_recheck("turning")
    assert not list(of_tables(read_python(text), formulas))
    changed = text.replace("(-0.01), ", "(-0.0100000001), ", 1)
    assert list(of_tables(read_python(changed), formulas)) == ["at_bend"]
    text = module_of(CONTROLLERS["seldom_orbit"]())
    code = read_python(text.replace("EVERY = 3 ", "EVERY = 4 "))
    assert next(otherwise(code, in_recheck("seldom_orbit"))) == "EVERY"


FULL = Loop(
    inputs=1, states=2, adds_plan=False, ends=True, seldom=True, predicts=True, swept=True, pieces=3,
    meets=2, panels=2, sweeps=1,
)  # fmt: skip


@pytest.mark.slow
def test_every_line_of_the_loop_has_to_be_there():
    """One line at a time is left out of the module: no loop is read without it."""
    for name in ("predicting_path", "bent"):
        text = module_of(CONTROLLERS[name]())
        start = text.index("\ndef geodesic") if name == "bent" else text.index("\ndef on_plan")
        lines = text[start : text.index("# What is measured")].split("\n")
        for k, line in enumerate(lines):
            if line.strip() and not line.strip().startswith(('"""', "`status`", "4, no")):
                left = "\n".join([*lines[:k], *lines[k + 1 :]])
                with pytest.raises(UnreadError):
                    read_python(text[:start] + left + text[text.index("# What is measured") :])
    assert set(functions(FULL)) == {"on_plan", "feedforward", "piece", "mean_of_plan", "geodesic"}
    assert len(methods(FULL)) == 5


@pytest.mark.slow
def test_a_folder_in_python_is_followed_and_what_is_not_read_is_said(tmp_path, monkeypatch):
    data = proven.shipped("hardware_orbit")
    given = certification_of(data).certificate, certificate.dump(data), "orbit.json"
    found = exported(controller_of(given[0]), "python")
    text = found.files["hardware_orbit.py"]
    other = {**found.files, "hardware_orbit.py": text.replace("0.75 * held[0]", "0.76 * held[0]")}
    monkeypatch.setattr(export_examined, "belonging", lambda *_: type(found)(
        controller=found.controller, language="python", precision="double", files=other
    ))  # fmt: skip
    monkeypatch.setattr(asked, "_test", lambda found: None)
    few = vectors(found.controller)
    few = replace(few, y=few.y[:4], u=few.u[:5])
    monkeypatch.setattr(asked, "vectors", lambda *_, **__: few)
    with pytest.raises(TubecertError, match="differs by") as error:
        examined(str(tmp_path), *given)
    assert error.value.exit_code == ExitCode.NOT_CERTIFIED
    monkeypatch.setattr(python_reader, "IMPORTED", "import re\n")
    assert "did not follow its text" in str(examined(str(tmp_path), *given))
