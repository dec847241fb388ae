"""A result is the same, byte for byte, whatever kernels the processor makes BLAS, numpy and libm choose.

Other processors are played by the variables with which these libraries let themselves be told what to use.
"""

import hashlib
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from proven import result

from tubecert import certificate

ROOT = Path(__file__).parents[2]
CONFIGS = {  # each on one other processor; all of them on several are what `.ci/run` is for
    "Haswell": ("three_state", "two_state_orbit"),
    "oldest": ("two_state", "state_dependent_input"),
}

_RUN = """
import ctypes, hashlib, json, sys
from pathlib import Path
import numpy
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

print(json.dumps([kernel(), [digest(path) for path in sys.argv[1:]]]))
"""


def dispatched():
    """What numpy would use of this processor beyond its baseline."""
    return " ".join(np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", []))


PROCESSORS = {
    "this one": {"OPENBLAS_NUM_THREADS": "2"},
    "Haswell": {"OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_NUM_THREADS": "1"},
    "oldest": {
        "OPENBLAS_CORETYPE": "Prescott",
        "OPENBLAS_NUM_THREADS": "1",
        "NPY_DISABLE_CPU_FEATURES": dispatched(),
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F",
    },
}


def certified_on(processor, folder, configs):
    """The kernels of BLAS, and the hashes of the shipped systems' results with an empty cache."""
    paths = [str(ROOT / "configs" / f"{name}.yaml") for name in configs]
    outside = {name: value for name, value in os.environ.items() if name not in PROCESSORS["oldest"]}
    cache = {"XDG_CACHE_HOME": str(folder / processor), "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", _RUN, *paths],
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
    kernel, hashes = certified_on(processor, tmp_path, configs)
    texts = {name: (ROOT / "configs" / f"{name}.yaml").read_text("utf-8") for name in configs}
    here = {name: digest(result(text)) for name, text in texts.items()}
    assert dict(zip(configs, hashes, strict=True)) == here
    if platform.machine() == "x86_64" and kernel is not None and processor == "oldest":
        assert kernel != certified_on("this one", tmp_path, ())[0], "the processor was not played"


def digest(found):
    return hashlib.sha256(certificate.dump(found.to_json()).encode()).hexdigest()
