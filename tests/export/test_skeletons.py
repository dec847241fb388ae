"""Programs around exported code: they compile against stubs, sample on time, and stop as they are written."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from controllers import GIVEN, orbit, wandering
from tubecert.export.assembly import assembled
from tubecert.export.folder import exported
from tubecert.export.reference import Reference
from tubecert.export.skeletons import skeleton

from tubecert.errors import TubecertError

STUBS = Path(__file__).parent / "stubs"
CXX = shutil.which("g++") or shutil.which("clang++")
CC = shutil.which("gcc") or shutil.which("clang")
needs_cxx = pytest.mark.skipif(CXX is None or CC is None, reason="no compiler of C++ on PATH (install g++)")
STRICT = ("-Wall", "-Wextra", "-Werror", "-pedantic")


def held():
    return assembled(GIVEN["held_orbit"])


def run(*command, where):
    done = subprocess.run(command, cwd=where, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@needs_cxx
@pytest.mark.slow
@pytest.mark.parametrize("platform", ["ros2", "px4"])
def test_it_compiles_against_stubs(platform, tmp_path):
    written = exported(held()).around(platform)
    written.save(str(tmp_path))
    (name,) = (own for own in written.files if own.endswith(".cpp"))
    run(CXX, "-std=c++17", *STRICT, f"-I{STUBS}", "-c", name, where=tmp_path)


PLAYED = """
#include "hardware_orbit_arduino.ino"
#include <cstdio>
static uint32_t now = 4294960000u; /* the clock overflows on the way */
uint32_t micros() { return now += 50; }
int main() {
    setup();
    while (running) { loop(); }
    loop();
    return 0;
}
"""


@needs_cxx
@pytest.mark.slow
def test_a_sketch_does_what_the_controller_does(tmp_path):
    """Its open functions filled in, against the reference: same inputs, a delay after samples that are on time."""
    c = held()
    written = exported(c).around("arduino")
    written.save(str(tmp_path))
    sketch = tmp_path / "hardware_orbit_arduino.ino"
    text = sketch.read_text("utf-8")
    y = wandering(c, 8, 1, 3)
    rows = ", ".join("{" + ", ".join(map(repr, row)) + "}" for row in y[:, 0].tolist())
    measured = f"static const double Y[8][2] = {{{rows}}}; static int k = 0; if (k == 8) {{ return false; }}"
    measured += " y[0] = Y[k][0]; y[1] = Y[k++][1]; return true;"
    text = text.replace("    (void)y;\n    return false;", f"    {measured}")
    text = text.replace("    (void)u;\n", '    std::printf("%u %.17g\\n", (unsigned)micros(), u[0]);\n')
    sketch.write_text("#include <cstdio>\n" + text, "utf-8")
    (tmp_path / "main.cpp").write_text(PLAYED, "utf-8")
    run(CC, "-std=c99", "-c", "hardware_orbit.c", where=tmp_path)
    run(
        CXX,
        "-std=c++17",
        *STRICT,
        f"-I{STUBS}",
        "main.cpp",
        "hardware_orbit.o",
        "-o",
        "played",
        where=tmp_path,
    )
    lines = [line.split() for line in run("./played", where=tmp_path).splitlines()]
    reference = Reference(controller=c)
    expected = [reference.start(y[0]), *(reference.step(row)[0] for row in y)]
    assert [float(u) for _, u in lines] == pytest.approx([float(u[0, 0]) for u in expected], rel=1e-12)
    times = [int(t) for t, _ in lines[1:]]
    gaps = np.diff(np.array(times, dtype=np.int64)) % 2**32
    assert all(abs(gap - 2000) <= 150 for gap in gaps), gaps


@needs_cxx
@pytest.mark.slow
def test_as_it_is_written_it_stops_at_its_first_sample(tmp_path):
    exported(held()).around("arduino").save(str(tmp_path))
    (tmp_path / "main.cpp").write_text(PLAYED, "utf-8")
    run(CC, "-std=c99", "-c", "hardware_orbit.c", where=tmp_path)
    run(
        CXX,
        "-std=c++17",
        *STRICT,
        f"-I{STUBS}",
        "main.cpp",
        "hardware_orbit.o",
        "-o",
        "played",
        where=tmp_path,
    )
    assert run("./played", where=tmp_path) == ""


def test_what_such_a_program_cannot_do_is_refused():
    with pytest.raises(TubecertError, match="moves between samples"):
        skeleton(orbit(), "ros2")
    with pytest.raises(TubecertError, match="whole number of microseconds"):
        skeleton(replace(held(), sample_time=Fraction(1, 333)), "px4")
    with pytest.raises(TubecertError, match="code in C"):
        exported(held(), "python").around("arduino")
