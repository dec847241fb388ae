"""The test command is the same every time: what Hypothesis draws depends on the test alone."""

import subprocess
import sys
from pathlib import Path

import pytest

HOUSE = Path(__file__).parents[1]
_DRAWN = """
from hypothesis import given, strategies as st
{loaded}

drawn = []

@given(st.floats(), st.integers())
def test_draws(x, n):
    drawn.append((x, n))

def test_told(capsys):
    with capsys.disabled():
        print(f"\\n{{drawn}}")
"""


def drawn(folder, loaded, *options):
    """What a test is given in a run of its own, under the settings of this house."""
    (folder / "conftest.py").write_text((HOUSE / "conftest.py").read_text("utf-8"), "utf-8")
    (folder / "own.py").write_text("ODD = 271828.1828\nODDER = 31415926535\n", "utf-8")
    (folder / "test_drawn.py").write_text(_DRAWN.format(loaded=loaded), "utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_drawn.py", *options],
        cwd=folder,
        env={"PATH": "", "PYTHONPATH": f"{HOUSE}:{HOUSE.parent}"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return next(line for line in done.stdout.splitlines() if line.startswith("[("))


@pytest.mark.slow
def test_examples_are_the_same_whatever_is_loaded_and_new_ones_are_asked_for(tmp_path):
    alone = drawn(tmp_path, "")
    assert drawn(tmp_path, "import own") == alone
    assert drawn(tmp_path, "", "--hypothesis-profile=explore") != alone
