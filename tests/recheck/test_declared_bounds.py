"""Bounds of M that a specification declares are examined on the safe set (R21): certify refutes what is not true."""

import pytest
from rechecked import certified, examine, failing, respecified
from systems import SMALL


def with_bounds(**bounds):
    def change(effective):
        effective["metric"]["bounds"] = bounds

    return respecified(certified(SMALL, conditions="no_adaptation"), change)


@pytest.mark.parametrize(
    ("bounds", "name"),
    [
        ({"lower": "1", "upper": "1.01"}, "metric.bounds: M >= 1 I on the safe set"),
        ({"lower": "0.5"}, "metric.bounds: M >= 0.5 I on the safe set"),
        ({"upper": "1"}, "metric.bounds: M <= 1 I on the safe set"),
    ],
)
def test_declared_bounds_that_are_false_are_contradicted(bounds, name):
    """The eigenvalues of M are .481 and 1.098; recheck and `--spec` confirmed them."""
    found = examine(with_bounds(**bounds), 2_000)
    assert name in [name for name, _ in failing(found)]
    assert found.verdict == "contradicted"


def test_declared_bounds_that_hold_are_confirmed():
    found = examine(with_bounds(lower="0.48", upper="1.1"))
    assert failing(found) == []
    assert sum(claim.name.startswith("metric.bounds") for claim in found.claims) == 2
