"""What all tests share."""

import gc
import os
import signal
import sys
from contextlib import suppress
from functools import cache

import pytest
import shared
from hypothesis import HealthCheck, settings
from hypothesis.database import DirectoryBasedExampleDatabase
from hypothesis.internal.conjecture import providers
from hypothesis.internal.constants_ast import Constants

from tubecert.cli import process

# how long an example takes is the machine's affair, and its other users'
settings.register_profile(
    "tests",
    deadline=None,
    max_examples=50,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize=True,
    database=None,
)
# new examples each time: one that fails is told with what repeats it, and tried first from then on
settings.register_profile(
    "explore",
    settings.get_profile("tests"),
    derandomize=False,
    database=DirectoryBasedExampleDatabase(".hypothesis/examples"),
    print_blob=True,
)
settings.load_profile("tests")

# the rewritten assertions of all files and the modules of every `tubecert` that a test starts, compiled once
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
with suppress(AttributeError):  # another C library
    process.keep_memory()  # as commands do
# little of what tests make is in cycles, and looking for it costs a twentieth
gc.set_threshold(50_000, 20, 50)
gc.disable()  # thousands of tests are collected, and none of them is garbage


def pytest_sessionstart():
    """Constants of the modules that are loaded are tried as well: which ones these are depends on the other tests."""
    if settings.default.derandomize:
        providers._get_local_constants = Constants


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop():
    """What was collected stays until the end, and need not be looked through again and again."""
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True)
def subnormal_numbers():
    """A library that a test loads may make the processor flush them to 0: then no rounding is outward any more."""
    yield
    assert sys.float_info.min / 2 > 0, "subnormal numbers are flushed to 0 from here on"


@pytest.fixture(scope="session", autouse=True)
def interruptible():
    """A shell starts jobs in the background deaf to interruptions, nohup to hangups; children would inherit that."""
    heard = {signal.SIGINT: signal.default_int_handler, signal.SIGHUP: signal.SIG_DFL}
    before = {number: signal.signal(number, handler) for number, handler in heard.items()}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture(scope="session", autouse=True)
def commands_made_once():
    """typer makes the tree of all commands anew for every line that a test types: longer than most of them run."""
    import typer.main
    import typer.testing

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.testing, "_get_command", cache(typer.main.get_command))
        yield


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty current folder; what is kept and logged is beside it, and no workflow is around."""
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for name in ("GITHUB_ACTIONS", "GITHUB_STEP_SUMMARY", "GITHUB_WORKSPACE"):
        monkeypatch.delenv(name, raising=False)
    return work


@pytest.fixture
def barely():
    """For tests of what is proven: no curves and no explanations, which take longer than the rest."""
    import proven

    with proven.barely():
        yield


@pytest.fixture(scope="session", autouse=True)
def cache_of_the_tests(request, tmp_path_factory):
    """Plans and checks that the user has kept have no part in tests; what one process of a run keeps, all may read."""
    folder = tmp_path_factory.getbasetemp()
    run = folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(run / "cache"))
        patch.setenv("XDG_STATE_HOME", str(_notes(request.config, run)))
        for name in ("TUBECERT_CACHE_KEY", "COLUMNS"):
            patch.delenv(name, raising=False)
        shared.keep_in(run / "shared")
        yield
        shared.keep_in(None)


def _notes(config, run):
    return config.cache.mkdir("state") if hasattr(config, "cache") else run / "state"
