"""Norms of vectors of many states by their linear part (theory 1a.7): for the producer and for recheck.

Compared with points of the tube; whatever is proposed for the linear part, the bound stays a bound.
"""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
import rechecked
from systems import at_rest, matrix_of, model_of

from tubecert.bounds import linear
from tubecert.bounds.suprema import Suprema
from tubecert.coordinates import Coordinates
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.recheck import norms as again
from tubecert.recheck.coordinates import Coordinates as OwnCoordinates
from tubecert.recheck.curve import expressed
from tubecert.recheck.place import Place
from tubecert.recheck.terms import number

NAMES = ("x", "y", "z", "w")
CENTRE = (Fraction(1, 10), Fraction(0), Fraction(-1, 5), Fraction(0))
RHO = Fraction(1, 2)
S = ((Fraction(2), 0, 0, 0), (Fraction(1, 2), 1, 0, 0), (0, 0, Fraction(3, 2), 0), (0, 0, Fraction(-1, 3), 1))
VECTORS = {
    "bent": ["sin(2*x) + y", "w - z/3 + 0.2*cos(x - z)", "0.3*x*y + 0.2*z**2 - w"],
    "linear": ["x - 0.1 + y", "w - 3*(z + 0.2)", "2*y"],
    "far from 0": ["3 + sin(x) + w", "y + z", "z - 0.1*x**3"],
}


def suprema():
    model = model_of(NAMES, ["0"] * 4, [["0"], ["0"], ["0"], ["1"]])
    start = Suprema(
        model, at_rest(*CENTRE), 0.0, None, Effort(), coordinates=Coordinates(tuple(map(tuple, exact(S))))
    )
    return start.with_radius(RHO, (Fraction(9),) * 4)


def exact(rows):
    return [[Fraction(e) for e in row] for row in rows]


@cache
def largest(*vector):
    """By points of the rim and inside."""
    generator = np.random.default_rng(0)
    d = generator.normal(size=(50_000, 4))
    d *= float(RHO) * generator.uniform(0.9, 1, (len(d), 1)) / np.linalg.norm(d, axis=1, keepdims=True)
    x, y, z, w = (np.array(CENTRE, dtype=float) + d @ np.linalg.inv(np.array(S, dtype=float)).T).T
    space = {"x": x, "y": y, "z": z, "w": w, "sin": np.sin, "cos": np.cos}
    return np.linalg.norm([eval(e, space) * np.ones(len(x)) for e in vector], axis=0).max()


@pytest.mark.slow
@pytest.mark.parametrize("name", VECTORS)
def test_the_bound_is_above_every_point_and_close(name):
    v = matrix_of([[e] for e in VECTORS[name]], NAMES)
    most, found = largest(*VECTORS[name]), linear.linear_bound(suprema(), v)
    assert most <= found <= most * (1.12 if name == "bent" else 1.02)
    if name == "linear":
        K = np.array([[1, 1, 0, 0], [0, 0, -3, 1], [0, 2, 0, 0]])
        assert found == pytest.approx(0.5 * np.linalg.norm(K @ np.linalg.inv(np.array(S, dtype=float)), 2))


@pytest.mark.slow
def test_what_is_proposed_is_not_believed(monkeypatch):
    """A linear part that is none, and another point: larger bounds, and never a wrong one."""
    v, most = matrix_of([[e] for e in VECTORS["bent"]], NAMES), largest(*VECTORS["bent"])
    for v0, K in (([1, -2, 0], [[1, 2, 3, 4]] * 3), ([0] * 3, [[2, 1, 0, 0]] * 3)):
        own = [Fraction(q) for q in v0], exact(K)
        monkeypatch.setattr(linear, "_proposed", lambda *_, own=own: own)
        assert linear.linear_bound(suprema(), v) >= most


def test_few_states_families_and_parameters_are_left_to_boxes():
    few = matrix_of([["sin(x) + y"]], NAMES)
    assert linear.linear_bound(suprema(), few) is None
    moving = replace(suprema(), plan=SimpleNamespace(is_constant=False, allowance=None))
    assert linear.linear_bound(moving, matrix_of([[e] for e in VECTORS["bent"]], NAMES)) is None


def place():
    curve = expressed([number(q) for q in CENTRE], [number(0)], "t", None)
    system = SimpleNamespace(states=NAMES, inputs=("u",), ranges={}, times=None, varies=False)
    return Place(system, curve, RHO, 2000, OwnCoordinates(tuple(map(tuple, exact(S)))), (Fraction(9),) * 4)


@pytest.mark.slow
@pytest.mark.parametrize("name", VECTORS)
def test_recheck_confirms_what_is_true_and_nothing_else(name, monkeypatch):
    most, column = largest(*VECTORS[name]), rechecked.terms(VECTORS[name], list(NAMES))
    share = Fraction(6, 5) if name == "bent" else Fraction(21, 20)
    true, false = Fraction(most) * share, Fraction(most) * Fraction(99, 100)
    assert again.straight_below(place(), column, true).holds
    assert again.straight_below(place(), column, false) is None
    g, K = [Fraction(0)] * 3, exact([[1, 2, 3, 4], [0] * 4, [0, 0, 1, 0]])
    for own in ((g, K), (g, exact([[0] * 4] * 3))):
        monkeypatch.setattr(again, "_proposed", lambda *_, own=own: own)
        assert again.straight_below(place(), column, false) is None
