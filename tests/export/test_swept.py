"""Computed geodesics as they are exported: against closed forms, what is refused, and what the README counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from controllers import GIVEN
from tubecert.export.assembly import assembled
from tubecert.export.followed import UncoveredError
from tubecert.export.reference import Reference, speeds
from tubecert.export.rounding import rounding_of
from tubecert.export.words import operations

from tubecert.errors import TubecertError
from tubecert.spec import Picard


def with_nodes(nodes, sweeps):
    return assembled(replace(GIVEN["bent"], geodesic=Picard(nodes=nodes, sweeps=sweeps)))


def test_a_metric_that_varies_needs_the_key():
    with pytest.raises(TubecertError) as error:
        assembled(replace(GIVEN["bent"], geodesic=None))
    assert "geodesic: {nodes: 16, sweeps: 3}" in error.value.findings[0].help


def test_a_constant_metric_has_its_geodesics():
    exact = assembled(GIVEN["orbit"])
    assert assembled(replace(GIVEN["orbit"], geodesic=Picard(nodes=4, sweeps=2))) == exact


def test_curves_come_near_the_geodesic_of_a_flat_metric():
    """W = J^-1 J^-' with J of (x1, int dx2/(2 + sin x2)): lines there, so that their speeds are known."""
    y = np.array([[0.1, 0.2], [-0.3, 0.1], [0.2, -0.4]])
    grid = np.linspace(0, 1, 20001)
    inner = np.array([np.trapezoid(b / (2 + np.sin(grid * b)), grid) for _, b in y])
    exact = np.stack([y[:, 0], 2 * inner], axis=1), np.stack([y[:, 0], (2 + np.sin(y[:, 1])) * inner], axis=1)
    errors = []
    for nodes, sweeps in ((1, 1), (4, 4), (16, 8)):
        own = with_nodes(nodes, sweeps).swept
        found = speeds(own, np.zeros((1, 2)), y, np.float64)
        errors.append(max(float(np.abs(a - b).max()) for a, b in zip(found, exact, strict=True)))
    assert errors[0] > 1e-4
    assert errors[1] < errors[0] / 8
    assert errors[2] < errors[1] / 8  # of second order


@pytest.mark.slow
def test_the_distance_is_the_length_of_the_computed_curve():
    c = with_nodes(64, 8)
    y = np.array([[0.1, 0.2], [-0.3, 0.1]])
    grid = np.linspace(0, 1, 20001)
    inner = np.array([np.trapezoid(b / (2 + np.sin(grid * b)), grid) for _, b in y])
    # W in (x1, z2) is [[1, -1/2], [-1/2, 1]]
    M = np.linalg.inv(np.array([[1, -0.5], [-0.5, 1]]))
    z = np.stack([y[:, 0], inner], axis=1)
    expected = np.sqrt(np.einsum("ni,ij,nj->n", z, M, z))
    assert Reference(controller=c).distance(y, np.asarray(0.0)) == pytest.approx(expected, rel=1e-5)


def test_rounding_is_not_covered_beside_it():
    with pytest.raises(UncoveredError, match="geodesics"):
        rounding_of(assembled(GIVEN["bent"]), "double")


def test_the_readme_counts_every_sweep():
    few, many = (operations(with_nodes(4, sweeps)) for sweeps in (1, 2))
    more = {name: many[name] - few.get(name, 0) for name in many}
    own = with_nodes(4, 1).swept
    assert more["div"] == 4 * own.symbols.operations["div"]
    assert more["sin"] == 4 * own.symbols.operations["sin"]
