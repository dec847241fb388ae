"""A system in other units has the same metric, gains and half-widths: the generator of `benchmarks/robots.py`."""

import importlib.util
import json
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from tubecert import pipeline
from tubecert.pipeline import Options
from tubecert.spec import Synthesis, load, load_text
from tubecert.verdict import Verdict

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def robots():
    spec = importlib.util.spec_from_file_location("robots", BENCHMARKS / "robots.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["robots"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    yield module
    del sys.modules["robots"]


def gains(spec, rate):
    """omega, Gamma, rate, half-widths at a given rate."""
    wanted = Synthesis(rate=rate, objective="condition", degree=0)
    options = Options(conditions="distance", by_effect=False)
    found = pipeline.synthesise(spec, wanted, options)
    result = pipeline.certify(found.spec, options)
    assert result.verdict is Verdict.CERTIFIED
    own = result.proof.of["distance"]
    return float(own.bandwidth), float(own.adaptation_rate), list(result.tube.half_widths.values())


@pytest.mark.slow
def test_the_gains_of_a_joint_do_not_depend_on_units(robots, tmp_path):
    spec = load(str(BENCHMARKS / "robots" / "joint.yaml"))
    omega, Gamma, widths = gains(spec, Fraction(4))
    units = robots.Units(
        name="all at once", sizes={"rad": robots.DEGREE, "N m": Fraction(1000)}, time=Fraction(1, 1000)
    )
    other = load_text(json.dumps(robots.rescaled(spec, units, tmp_path)), str(tmp_path / "spec.yaml"))
    theirs = gains(other, Fraction(4) * units.time)
    sizes = [float(units.of(dict(spec.units)[name])) for name in spec.states]
    assert theirs[0] / float(units.time) == pytest.approx(omega, rel=0.01)
    assert theirs[1] * 1000**2 == pytest.approx(Gamma, rel=0.01)
    assert np.array(theirs[2]) * sizes == pytest.approx(widths, rel=0.01)
