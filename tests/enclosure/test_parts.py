"""A search that falls apart: the same to the bit whoever searches the parts, sound, and nothing lost with a worker."""

import os
import pickle
import signal
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import systems
from hypothesis import given, settings
from hypothesis import strategies as st
from test_branch_and_bound import box, circle, number, read, x, y, z

from tubecert import certificate
from tubecert.enclosure import branch_and_bound as bnb
from tubecert.enclosure.branch_and_bound import Effort, Supremum, decide, supremum
from tubecert.enclosure.objective import Estimate, SumOfNorms
from tubecert.enclosure.pencil import scalar
from tubecert.executor import Executor, Processes, Serial, WorkerError
from tubecert.pipeline import Options, certify
from tubecert.progress import Step
from tubecert.recheck.run import recheck
from tubecert.spec import load_text
from tubecert.verdict import Verdict


@dataclass(frozen=True)
class Elsewhere:
    """Other processes, without any: the last part first, and all that is sent is copied as it would be."""

    def map(self, function, items, ready=None):
        found = {}
        for place in reversed(range(len(items))):
            own, item = pickle.loads(pickle.dumps((function, items[place])))
            found[place] = pickle.loads(pickle.dumps(own(item)))
            ready(place, found[place])
        return [found[place] for place in range(len(items))]


@dataclass(frozen=True)
class Lost:
    """Workers that are lost after some parts."""

    after: int

    def map(self, function, items, ready=None):
        for place, item in enumerate(items[: self.after]):
            ready(place, function(item))
        raise WorkerError("killed")


@pytest.fixture
def short(monkeypatch):
    """Searches fall apart early."""
    monkeypatch.setattr(bnb, "_ALONE", 200)
    monkeypatch.setattr(bnb, "_PARTS", 8)


# as large on a whole surface: what a search has to split everywhere
RIDGE = scalar(read("2 - (sin(3*x) - y*z)**2"))
CUBE = box(x=(-1, 1.5), y=(-1, 1.2), z=(-1, 1.1))
EFFORT = Effort(gap=3e-2, cheap=0)


def ridge(workers: Executor | None, effort: Effort = EFFORT) -> Supremum:
    return supremum(RIDGE, CUBE, replace(effort, workers=workers))


@pytest.mark.slow
def test_the_parts_are_the_same_whoever_searches_them(short, monkeypatch):
    own = ridge(None)
    assert own.boxes > 600  # it does fall apart
    assert own.reached
    for workers in (Serial(), Elsewhere(), Lost(0), Lost(3)):
        assert ridge(workers) == own
    monkeypatch.setattr(bnb, "_ALONE", 10**9)
    whole = ridge(None)
    assert max(whole.below, own.below) <= 2 <= min(whole.above, own.above)


def test_short_searches_and_decisions_stay_whole(short):
    def nobody(*_):
        raise AssertionError("asked for help")

    alone = Lost(0)
    object.__setattr__(alone, "map", nobody)
    few = Effort(gap=2, cheap=0, workers=alone)
    assert supremum(RIDGE, CUBE, few).boxes < 300
    assert decide(RIDGE, CUBE, 100.0, Effort(workers=alone)).boxes < 300
    with pytest.raises(AssertionError, match="asked for help"):
        supremum(RIDGE, CUBE, replace(EFFORT, workers=alone))


@pytest.mark.slow
def test_the_budget_is_that_of_all_parts_together(short):
    found = ridge(Elsewhere(), Effort(gap=1e-9, absolute=0, budget=9_000))
    assert not found.reached
    assert 8_000 < found.boxes < 9_000 + 8 * bnb._BATCH
    assert found.below < found.above
    assert found == ridge(None, Effort(gap=1e-9, absolute=0, budget=9_000))


@pytest.mark.slow
def test_progress_goes_on_and_ends_with_all_boxes(short):
    told: list[Step] = []
    found = supremum(RIDGE, CUBE, replace(EFFORT, progress=told.append, workers=Elsewhere()))
    counts = [step.count for step in told]
    assert counts == sorted(counts)
    assert counts[-1] == found.boxes
    assert all(step.above >= found.below for step in told)


def polynomial(c, x, y, z):
    return sum(a * b for a, b in zip(c[:-1], (x, x * y, z**2, x * z, y**2, x * y * z, y), strict=True)) + c[7]


numbers = st.integers(-8, 8).map(lambda k: number(str(k / 4)))


@pytest.mark.slow
@given(st.lists(numbers, min_size=8, max_size=8), st.integers(1, 200), st.integers(1, 9))
@settings(max_examples=15, deadline=None)
def test_random_searches_enclose_their_supremum(c, alone, parts):
    e = polynomial(c, x, y, z)
    domain = box(x=(-1, 2), y=(-1, 1), z=(0, 1))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bnb, "_ALONE", alone)
        patch.setattr(bnb, "_PARTS", parts)
        found = supremum(scalar(e), domain, Effort(gap=1e-2, budget=30_000))
    k = [float(each.fraction) for each in c]
    X, Y, Z = np.meshgrid(np.linspace(-1, 2, 25), np.linspace(-1, 1, 25), np.linspace(0, 1, 25))
    assert polynomial(k, X, Y, Z).max() <= found.above + 1e-12
    assert found.below <= found.above
    at = [found.at.get(name, 0.0) for name in "xyz"]
    assert polynomial(k, *at) == pytest.approx(found.below, abs=1e-9)


@dataclass(frozen=True)
class Deadly:
    """The ridge; the first process beside its own that evaluates it is killed."""

    marker: Path
    home: int
    variables: tuple[str, ...] = RIDGE.variables

    def upper(self, lo, hi, target) -> Estimate:
        if os.getpid() != self.home and self.marker.exists():
            self.marker.unlink()
            os.kill(os.getpid(), signal.SIGKILL)
        return RIDGE.upper(lo, hi, target)

    def lower(self, lo, hi):
        return RIDGE.lower(lo, hi)


@pytest.mark.slow
def test_processes_and_one_that_is_killed(short, tmp_path):
    own = ridge(None)
    assert ridge(Processes(2)) == own
    marker = tmp_path / "alive"
    marker.touch()
    found = supremum(Deadly(marker, os.getpid()), CUBE, replace(EFFORT, workers=Processes(2)))
    assert not marker.exists()
    assert found == own


@pytest.mark.slow
def test_a_tube_is_sent_as_well(short):
    objective, tube = SumOfNorms([[[x], [y], [read("x*y/10")]]]), circle(0.5)
    own = supremum(objective, tube, EFFORT)
    assert own.boxes > 300
    assert supremum(objective, tube, replace(EFFORT, workers=Elsewhere())) == own


WAVY = systems.SMALL.replace("0.1*sin(t) + 0.05*x", "0.1*sin(20*x)*cos(9*y)")


@dataclass(frozen=True)
class Liars:
    """Workers that say that less is held than there is."""

    share: float

    def map(self, function, items, ready=None):
        for place, item in enumerate(items):
            held = function(item)
            ready(place, replace(held, below=-np.inf, at={}, above=held.above * self.share))


@pytest.mark.slow
@pytest.mark.parametrize(("share", "confirmed"), [(1.0, True), (0.7, False)])
def test_a_certificate_of_workers_that_lie_is_not_confirmed(share, confirmed, monkeypatch):
    monkeypatch.setattr(bnb, "_ALONE", 1)
    found = certify(load_text(WAVY, "wavy.yaml"), Options(conditions="B"), workers=Liars(share))
    assert found.verdict is Verdict.CERTIFIED
    text = certificate.dump(certificate.seal(found.to_json(), {}))
    assert (recheck(text, "made").verdict == "confirmed") is confirmed
