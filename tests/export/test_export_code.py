"""Exported code: one arithmetic in three languages, strict compilers, mutations that the self-test meets."""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import types
from functools import cache
from pathlib import Path

import controllers
import numpy as np
import pytest
from controllers import CONTROLLERS, wandering
from tubecert.export.compiled import COMPILERS, FLAGS, Compiled, compiled, compiler
from tubecert.export.folder import exported
from tubecert.export.reference import Reference
from tubecert.export.vectors import run, vectors

needs_cc = pytest.mark.skipif(
    compiler() is None, reason=f"no C compiler on PATH (one of {', '.join(COMPILERS)})"
)
SANITIZED = "-fsanitize=address,undefined"
PRESENT = [name for name in ("gcc", "clang") if shutil.which(name)] or [compiler()]
STACK = 2048  # bytes, of all functions together


@pytest.fixture(scope="module", params=sorted(CONTROLLERS))
def controller(request):
    return CONTROLLERS[request.param]()


def loaded(controller, folder):
    """The exported module, imported from its file."""
    found = exported(controller, "python")
    found.save(str(folder))
    spec = importlib.util.spec_from_file_location(controller.name, folder / f"{controller.name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def of_python(module, y):
    own = module.Controller()
    return np.array([own.start(y[0]), *(own.step(row) for row in y)])


@pytest.mark.slow
def test_python_computes_what_the_reference_computes(controller, tmp_path):
    module = loaded(controller, tmp_path)
    y = wandering(controller, 40, 1, 3)[:, 0]
    expected = run(controller, y)
    assert of_python(module, y) == pytest.approx(expected, rel=1e-12, abs=1e-12 * np.abs(expected).max())
    assert module.self_test() <= module.TOLERANCE
    assert controller.hash == module.CERTIFICATE


@pytest.mark.slow
@needs_cc
def test_c_computes_what_python_computes(controller, tmp_path):
    module = loaded(controller, tmp_path)
    y = wandering(controller, 200, 2, 4)
    expected = np.stack([of_python(module, y[:, lane]) for lane in range(2)], axis=1)
    with compiled(exported(controller), lanes=2) as own:
        found = np.array([own.start(y[0]), *(own.step(row) for row in y)])
    assert np.abs(found - expected).max() <= 1e-12 * np.abs(expected).max()


@pytest.mark.slow
@needs_cc
def test_single_precision_is_close(controller):
    y = wandering(controller, 40, 1, 5)
    with compiled(exported(controller, precision="single")) as own:
        found = np.array([own.start(y[0]), *(own.step(row) for row in y)])[:, 0]
    exact = run(controller, y[:, 0])
    rounded = run(controller, y[:, 0], np.float32)
    assert np.abs(found - exact).max() <= 3 * np.abs(rounded - exact).max() + 1e-5
    assert np.abs(found - exact).max() > 1e-9  # it is not double


def built(folder, *flags, cc=None):
    sources = sorted(str(path) for path in folder.glob("*.c"))
    command = [cc or compiler(), *FLAGS, *flags, *sources, "-o", str(folder / "test"), "-lm"]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@cache
def sanitizes(cc):
    """Whether the libraries of the sanitizers are there: a package of its own."""
    command = [cc, SANITIZED, "-x", "c", "-", "-o", os.devnull]
    text = "int main(void) { return 0; }"
    return not subprocess.run(command, input=text, text=True, capture_output=True, check=False).returncode


def self_tested(folder):
    return subprocess.run([str(folder / "test")], capture_output=True, text=True, check=False)


@pytest.mark.slow
@needs_cc
@pytest.mark.parametrize("cc", PRESENT)
@pytest.mark.parametrize("precision", ["double", "single"])
def test_strict_compilers_and_sanitizers_have_nothing_to_say(controller, precision, cc, tmp_path):
    if not sanitizes(cc):
        pytest.skip(f"{cc} has no sanitizers here")
    exported(controller, precision=precision).save(str(tmp_path))
    done = built(tmp_path, "-Wshadow", "-Wconversion", SANITIZED, "-fno-sanitize-recover=all", cc=cc)
    assert done.returncode == 0, done.stderr
    done = self_tested(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "passes" in done.stdout


@pytest.mark.slow
@needs_cc
@pytest.mark.parametrize("cc", PRESENT)
@pytest.mark.parametrize("flag", ["-ffast-math", "-ffinite-math-only", "-Ofast"])
def test_fast_math_is_refused(flag, cc, tmp_path):
    exported(controllers.orbit()).save(str(tmp_path))
    done = built(tmp_path, flag, cc=cc)
    assert done.returncode
    assert "compile without" in done.stderr


@pytest.mark.slow
@needs_cc
@pytest.mark.parametrize("cc", PRESENT)
@pytest.mark.parametrize("flag", ["-funsafe-math-optimizations", "-freciprocal-math", "-fno-signed-zeros"])
def test_a_part_of_fast_math_is_refused_or_changes_nothing(flag, cc, tmp_path):
    """Clang does not say that it was given one: there the source takes it back."""
    controller = controllers.orbit()
    files = exported(controller)
    y = wandering(controller, 300, 1, 8)
    found = []
    for flags in ((), (flag,)):
        files.save(str(tmp_path))
        target, source = str(tmp_path / f"of{len(found)}.so"), str(tmp_path / f"{controller.name}.c")
        command = [cc, "-std=c99", "-O2", *flags, "-c", "-fPIC", source, "-o", f"{target}.o"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if flags and cc == "gcc":
            assert "compile without" in done.stderr
            return
        assert done.returncode == 0, done.stderr
        # linked without the flag: with it clang adds code that flushes subnormal numbers to 0 in this whole process
        subprocess.run([cc, "-shared", f"{target}.o", "-o", target, "-lm"], check=True)
        own = Compiled(ctypes.CDLL(target), controller, single=False, lanes=1)
        found.append(np.array([own.start(y[0]), *(own.step(row) for row in y)]))
    assert np.array_equal(*found)


@pytest.mark.slow
@needs_cc
@pytest.mark.parametrize("cc", PRESENT)
def test_the_stack_is_bounded_and_there_is_no_heap(controller, cc, tmp_path):
    """Frames as the compiler tells them: together they are more than any chain of calls."""
    exported(controller).save(str(tmp_path))
    command = [cc, "-std=c99", "-O2", "-fstack-usage", "-c", f"{controller.name}.c", "-o", "own.o"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (told,) = tmp_path.glob("*.su")
    frames = [line.split("\t") for line in told.read_text("utf-8").splitlines()]
    assert all(kind == "static" for _, _, kind in frames)
    assert sum(int(size) for _, size, _ in frames) <= STACK
    needs = subprocess.run(["nm", "-u", str(tmp_path / "own.o")], capture_output=True, text=True, check=True)
    called = set(needs.stdout.split()) - {"U", "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}
    assert called <= {"sqrt", "sin", "cos", "tanh", "exp", "sincos", "memcpy", "memset"}


def test_nothing_is_allocated_and_nothing_calls_itself(controller):
    text = exported(controller).files[f"{controller.name}.c"]
    assert not re.search(r"\b(malloc|calloc|realloc|alloca|free|goto|while)\b", text)
    assert re.findall(r"#include [<\"](.*)[>\"]", text) == [f"{controller.name}.h", "float.h", "math.h"]
    functions = re.split(r"\n(?=(?:static )?(?:void|int) \w+\()", text)[1:]
    names = [re.match(r"(?:static )?(?:void|int) (\w+)\(", each).group(1) for each in functions]
    for k, body in enumerate(functions):  # a function calls only what stands before it
        called = {name for name in names[k:] if re.search(rf"\b{name}\(", body.partition("{")[2])}
        assert not called, (names[k], called)
    assert all(
        re.search(r"for \(\w = 0; \w <=? ?[\w]+; \w\+\+\)", line)
        for line in text.splitlines()
        if "for (" in line
    )


# what is changed, as a pattern and its replacement: a sign, a gain, an index, the clip, the share of the delay
MUTATIONS = {
    "sign": (r"out_kappa\[0\] = -", "out_kappa[0] = "),
    "gain": (r"out_told\[1\]", "out_told[1] = 0.0; out_kappa[0] *= 1.0001; out_told[1]"),
    "rate": (r"500\.0", "499.0"),
    "index": (r"const real r0 = y\[0\] - xs\[0\]", "const real r0 = y[1] - xs[0]"),
    "least": (r" < 1\.9 \? ", " > 1.9 ? "),
    "clip": (r"r2 : \(-2\.0\)", "r2 : (-2.01)"),
    "delay": (r"0\.75 \* held", "0.74 * held"),
    "memory": (r"c->before\[i\] = c->held\[i\];\n        c->held", "c->held"),
    "filter": (r"0\.14094299744758143", "0.14"),
    "plan": (r"0\.838501394978079 \* r1", "0.8385 * r1"),
}


@pytest.mark.slow
@needs_cc
@pytest.mark.parametrize("what", sorted(MUTATIONS))
def test_the_self_test_meets_a_mutation(what, tmp_path):
    controller = controllers.orbit()
    exported(controller).save(str(tmp_path))
    path = tmp_path / f"{controller.name}.c"
    text = path.read_text("utf-8")
    changed, count = re.subn(*MUTATIONS[what], text, count=1)
    assert count == 1
    path.write_text(changed, "utf-8")
    done = built(tmp_path)
    assert done.returncode == 0, done.stderr
    assert self_tested(tmp_path).returncode == 1


# the same of the module in Python
IN_PYTHON = {
    "sign": (r"        -\(\(r6 / r8", "        ((r6 / r8"),
    "rate": (r"500\.0", "499.0"),
    "index": (r"r0 = y\[0\] - xs\[0\]", "r0 = y[1] - xs[0]"),
    "choice": (r"r3 if r3 < 1\.9", "r3 if r3 > 1.9"),
    "clip": (r"else \(-2\.0\)", "else (-2.01)"),
    "delay": (r"0\.75 \* held", "0.74 * held"),
    "memory": (r"self\.before = self\.held\n        self\.held", "self.held"),
    "filter": (r"0\.14094299744758143", "0.14"),
    "plan": (r"0\.838501394978079 \* r1", "0.8385 * r1"),
    "sample": (r"self\.sample \+= 1", "self.sample += 2"),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", sorted(IN_PYTHON))
def test_the_self_test_in_python_meets_a_mutation(what):
    text = exported(controllers.orbit(), "python").files["hardware_orbit.py"]
    changed, count = re.subn(*IN_PYTHON[what], text, count=1)
    assert count == 1
    module = types.ModuleType("changed")
    exec(changed, module.__dict__)
    with pytest.raises(ValueError, match="self-test"):
        module.self_test()


@pytest.mark.slow
def test_the_vectors_meet_every_branch(controller):
    reference = Reference(controller=controller)
    y = np.array(vectors(controller).y)
    reference.start(y[:1])
    acts, clipped = set(), set()
    for row in y:
        reference.step(row[None])
        played = reference.plan((reference.sample - 1) * float(controller.sample_time))[1]
        acts.add(bool(np.abs(reference.feedback - controller.adds_plan * played).max() > 1e-9))
        clipped |= set((np.abs(reference.feedback - reference.held - reference.q) > 1e-9).ravel().tolist())
    assert True in acts
    assert clipped == {True, False}


_ELSEWHERE = """
import hashlib, controllers
from tubecert.export.folder import exported
for make in reversed(list(controllers.CONTROLLERS.values())):  # expressions are numbered in another order
    make()
print(hashlib.sha256("".join(exported(controllers.turning()).files.values()).encode()).hexdigest())
"""


@pytest.mark.slow
def test_the_bytes_are_the_same_in_another_process():
    here = Path(controllers.__file__).parent
    environment = {**os.environ, "PYTHONPATH": f"{here}{os.pathsep}{here.parent}"}
    done = subprocess.run(
        [sys.executable, "-c", _ELSEWHERE], capture_output=True, text=True, check=True, env=environment
    )
    own = "".join(exported(controllers.turning()).files.values())
    assert done.stdout.strip() == hashlib.sha256(own.encode()).hexdigest()
