"""Rounding that lies: a metric is called proven only if the proof is about what is written."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.expression import constant
from tubecert.metric.verify import verify_metric
from tubecert.model import build
from tubecert.pipeline import Options, synthesise
from tubecert.spec import Synthesis, load
from tubecert.synthesis import ladder

SPEC = load(str(Path(__file__).parents[2] / "configs" / "two_state.yaml"))
WANTED = Synthesis(rate=Fraction("1.7"), route="cegis")


def scaled(matrix, factor):
    return tuple(tuple(constant(e.fraction * factor) for e in row) for row in matrix)


def turned(matrix):
    (a, b), (_, c) = matrix
    return (c, b), (b, a)


LIES = {
    "another metric": lambda m: replace(m, dual_metric=turned(m.dual_metric)),
    "an indefinite one": lambda m: replace(m, dual_metric=scaled(m.dual_metric, Fraction(-1))),
    "a higher rate": lambda m: replace(m, rate=m.rate * 2),
    "a proof on a smaller set": lambda m: replace(
        m,
        proof=replace(m.proof, safe_set=tuple((lo / 2, hi / 2) for lo, hi in m.proof.safe_set)),
        rate=2 * m.rate,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LIES)
def test_what_is_written_is_what_was_proven(name, monkeypatch):
    original = ladder.shortest_proven

    def lie(*given, **options):
        found = original(*given, **options)
        return LIES[name](found) if hasattr(found, "dual_metric") else found

    monkeypatch.setattr(ladder, "shortest_proven", lie)
    found = synthesise(SPEC, WANTED, Options())
    if found.verdict == "certified":  # then the file is proven by itself
        model = build(found.spec)
        proof = verify_metric(model, found.spec.safe_set, Effort())
        assert proof.verdict == "certified"
    else:
        assert found.file is None


def test_a_proof_knows_what_it_is_about():
    model = build(SPEC)
    proof = verify_metric(model, SPEC.safe_set, Effort())
    assert proof.is_about(model, SPEC.safe_set)
    assert proof.is_about(build(load(str(Path(SPEC.path)))), SPEC.safe_set)
    smaller = tuple((lo / 2, hi) for lo, hi in SPEC.safe_set)
    assert not proof.is_about(model, smaller)
    assert not proof.is_about(replace(model, rate=model.rate / 2), SPEC.safe_set)
    assert not proof.is_about(replace(model, W=turned(model.W)), SPEC.safe_set)
    assert not proof.is_about(replace(model, f=model.f[::-1]), SPEC.safe_set)
    assert not proof.is_about(replace(model, B=model.B[::-1]), SPEC.safe_set)
