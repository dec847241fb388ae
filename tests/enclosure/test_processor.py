"""What every enclosure rests on is looked at: a processor that rounds otherwise proves nothing."""

import ctypes
import platform
import shutil
import subprocess
import sys
from contextlib import contextmanager

import pytest
from commands import run
from problems import judged_26, two_state
from systems import SCALAR

from tubecert.enclosure.processor import require_ieee
from tubecert.errors import ProcessorError

MODES = {"x86_64": (0x400, 0x800, 0xC00), "aarch64": (0x400000, 0x800000, 0xC00000)}
EMPTY = "int nothing(void) { return 0; }\n"
FLUSHED = """
import ctypes, sys
from tubecert.cli.app import app
from tubecert.enclosure.processor import require_ieee
require_ieee()
ctypes.CDLL(sys.argv[1])
assert sys.float_info.min / 2 == 0, "this linker does not do it"
require_ieee()
"""


@contextmanager
def rounding(mode):
    library = ctypes.CDLL(None)
    before = library.fegetround()
    assert library.fesetround(mode) == 0
    try:
        yield
    finally:
        library.fesetround(before)


@pytest.mark.skipif(platform.machine() not in MODES, reason="the names of directions are of a processor")
@pytest.mark.parametrize("direction", range(3))
def test_a_direction_of_rounding_that_is_left_behind_is_noticed(direction):
    require_ieee()
    with rounding(MODES[platform.machine()][direction]), pytest.raises(ProcessorError, match="IEEE 754"):
        require_ieee()
    require_ieee()


def strange():
    raise ProcessorError


def test_no_proof_is_made_then(monkeypatch):
    monkeypatch.setattr("tubecert.kernel.require_ieee", strange)
    with pytest.raises(ProcessorError):
        judged_26(two_state())


def test_no_constant_is_bounded_then_and_the_command_says_why(monkeypatch, tmp_path):
    monkeypatch.setattr("tubecert.enclosure.branch_and_bound.require_ieee", strange)
    (tmp_path / "plant.yaml").write_text(SCALAR)
    told = run("certify", tmp_path / "plant.yaml", "-o", tmp_path / "c.json")
    assert told.exit_code == 3
    assert "does not round as IEEE 754 does" in told.stderr
    assert "defect" not in told.stderr
    assert not (tmp_path / "c.json").exists()


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64" or shutil.which("gcc") is None, reason="needs gcc on x86")
def test_a_library_that_flushes_subnormal_numbers_is_noticed(tmp_path):
    (tmp_path / "empty.c").write_text(EMPTY)
    made = tmp_path / "empty.so"
    subprocess.run(["gcc", "-shared", "-fPIC", "-ffast-math", "-o", made, tmp_path / "empty.c"], check=True)
    ran = subprocess.run([sys.executable, "-c", FLUSHED, made], capture_output=True, text=True, check=False)
    if "does not do it" in ran.stderr:
        pytest.skip("newer linkers of gcc leave the processor alone")
    assert "ProcessorError" in ran.stderr
