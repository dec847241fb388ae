"""A result is the same, byte for byte, whatever kernels the processor makes BLAS, numpy and libm choose.

Other processors are played by the variables with which these libraries let themselves be told what to use.
"""

import hashlib
import json
import os
import platform
import subprocess
import sys

import numpy as np
import pytest
from proven import result
from systems import SMALL
from texts import ROOT

from tubecert import certificate

CONFIGS = {  # each on one other processor; all of them on several are what `.ci/run` is for
    "Haswell": ("three_state", "two_state_orbit"),
    "oldest": ("two_state", "state_dependent_input"),
}

# where coordinates are equally good, and where a place is one of an ellipsoid
RADII = "epsilon: 0.2, rho_a: 0.1"
TIED = SMALL.replace(RADII, f"{RADII}, coordinates: auto").replace("2]]", '"2 + 0.2*x"]]')
ELLIPSOID = """
tubecert: 1
name: ellipsoid
system:
  states: [x, y, z]
  inputs: [u]
  f: ["-x + y", "-y + 0.3*sin(x) + z", "-2*z + 0.3*y*x"]
  B: [[0], [0], [1]]
safe_set: {x: [-1, 1], y: [-1, 1], z: [-1, 1]}
uncertainty: {h: ["0.1*sin(t) + 0.05*x*z"]}
trajectory: {kind: equilibrium, at: [0, 0, 0], input: [0]}
metric: {rate: 0.3, dual_metric: [[1, "-0.2", 0], ["-0.2", 1.5, "-0.5"], [0, "-0.5", 2]]}
tube: {half_widths: {x: 0.2}, coordinates: auto}
"""
PLACES = {"tied": TIED, "ellipsoid": ELLIPSOID}

_RUN = """
import ctypes, hashlib, json, sys
from contextlib import nullcontext
from pathlib import Path
import numpy, proven
from tubecert import pipeline
from tubecert.certificate import dump
from tubecert.spec import load

def kernel():
    for path in Path(numpy.__file__).parent.parent.glob("numpy.libs/*openblas*"):
        library = ctypes.CDLL(str(path))
        for name in ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename", "openblas_get_corename"):
            if hasattr(library, name):
                function = getattr(library, name)
                function.restype = ctypes.c_char_p
                return function().decode()

def digest(path):
    return hashlib.sha256(dump(pipeline.certify(load(path), pipeline.Options()).to_json()).encode()).hexdigest()

with proven.barely() if sys.argv[1] == "barely" else nullcontext():
    print(json.dumps([kernel(), [digest(path) for path in sys.argv[2:]]]))
"""


def dispatched():
    """What numpy would use of this processor beyond its baseline."""
    return " ".join(np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", []))


PROCESSORS = {
    "this one": {"OPENBLAS_NUM_THREADS": "2"},
    "Haswell": {"OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_NUM_THREADS": "1"},
    "Nehalem": {"OPENBLAS_CORETYPE": "Nehalem", "OPENBLAS_NUM_THREADS": "1"},
    "oldest": {
        "OPENBLAS_CORETYPE": "Prescott",
        "OPENBLAS_NUM_THREADS": "1",
        "NPY_DISABLE_CPU_FEATURES": dispatched(),
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F",
    },
}


def certified_on(processor, folder, paths, barely=False):
    """The kernels of BLAS, and the hashes of specifications' results with an empty cache."""
    outside = {name: value for name, value in os.environ.items() if name not in PROCESSORS["oldest"]}
    cache = {"XDG_CACHE_HOME": str(folder / processor), "PYTHONPATH": f"{ROOT}:{ROOT / 'tests'}"}
    done = subprocess.run(
        [sys.executable, "-c", _RUN, "barely" if barely else "whole", *map(str, paths)],
        env={**outside, **cache, **PROCESSORS[processor]},
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
@pytest.mark.parametrize("processor", CONFIGS)
def test_results_are_the_same_on_every_processor(processor, tmp_path):
    """As on this one, where other tests of this run may have made them."""
    configs = CONFIGS[processor]
    paths = [ROOT / "configs" / f"{name}.yaml" for name in configs]
    kernel, hashes = certified_on(processor, tmp_path, paths)
    here = [digest(result(path.read_text("utf-8"))) for path in paths]
    assert dict(zip(configs, hashes, strict=True)) == dict(zip(configs, here, strict=True))
    if platform.machine() == "x86_64" and kernel is not None and processor == "oldest":
        assert kernel != certified_on("this one", tmp_path, ())[0], "the processor was not played"


@pytest.mark.slow
def test_places_and_what_is_equally_good_are_the_same_for_every_kernel_of_blas(tmp_path):
    """Last digits of LAPACK would be told in places, and decide between coordinates that tie."""
    paths = [tmp_path / f"{name}.yaml" for name in PLACES]
    for path, text in zip(paths, PLACES.values(), strict=True):
        path.write_text(text, "utf-8")
    one, other = (
        certified_on(processor, tmp_path, paths, barely=True)[1] for processor in ("Haswell", "Nehalem")
    )
    assert dict(zip(PLACES, one, strict=True)) == dict(zip(PLACES, other, strict=True))


def digest(found):
    return hashlib.sha256(certificate.dump(found.to_json()).encode()).hexdigest()
