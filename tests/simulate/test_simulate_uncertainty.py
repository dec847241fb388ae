"""Members of a class are in it, and use it: checked by evaluating them, not by the formulas that made them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import setting

from tubecert.simulate.monte_carlo import case
from tubecert.simulate.uncertainty import WAVES, Class, Member, adversary, genes_of, random_member, triangle

bounds = st.floats(0.0, 10.0).map(lambda value: 0.0 if value < 1e-3 else value)
seeds = st.integers(0, 2**32)


@st.composite
def kinds(draw):
    h = draw(st.floats(0.01, 10.0))
    return Class(
        h=h,
        h_x=draw(bounds),
        h_t=draw(bounds),
        h_initial=draw(st.floats(0.0, 1.0)) * h,
        n=draw(st.integers(1, 4)),
        m=draw(st.integers(1, 3)),
    )


def values(member: Member, t: np.ndarray, x: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """h at times (P,) and states (P, n), (P, m), without pushes."""
    angle = t[:, None] * member.frequency + (x - centre) @ member.wave.T + member.phase
    return np.sin(angle) @ member.amplitude


def assert_in_class(member: Member, kind: Class, x0: np.ndarray, centre: np.ndarray, rng):
    t, x = rng.uniform(0, 20, 400), centre + rng.normal(size=(400, kind.n))
    h = values(member, t, x, centre)
    push = abs(member.push)
    tight = 1 + 1e-9
    assert np.linalg.norm(h, axis=1).max() + push <= kind.h * tight
    far = rng.uniform(0, 20, 400)
    change = np.linalg.norm(values(member, far, x, centre) - h, axis=1)
    assert (change <= kind.h_t * tight * np.abs(far - t) + 1e-12 * kind.h).all()
    other = x + 0.1 * rng.normal(size=x.shape)
    change = np.linalg.norm(values(member, t, other, centre) - h, axis=1)
    assert (change <= kind.h_x * tight * np.linalg.norm(other - x, axis=1) + 1e-12 * kind.h).all()
    start = values(member, np.zeros(1), x0[None], centre)
    assert np.linalg.norm(start) + push <= max(kind.h_initial, push) * tight + 1e-12 * kind.h


@settings(max_examples=50, deadline=None)
@given(kinds(), seeds)
def test_random_members_and_adversaries_are_in_the_class(kind, seed):
    rng = np.random.default_rng(seed)
    x0, centre = rng.normal(size=kind.n), rng.normal(size=kind.n)
    worst = adversary(kind, rng.random(genes_of(kind)), x0, centre, 0.1)
    for member in (random_member(kind, x0, centre, rng), worst):
        assert_in_class(member, kind, x0, centre, rng)


def test_the_triangle_has_slope_one_and_no_overshoot():
    j, c = triangle(WAVES)
    s = np.linspace(0, 2 * np.pi, 5001)
    slope = np.cos(np.outer(s, j)) @ (j * c)
    assert np.abs(slope).max() <= 1 + 1e-12
    assert np.abs(slope).max() > 0.9
    assert 0.8 * np.pi / 2 < np.abs(np.sin(np.outer(s, j)) @ c).max() <= np.pi / 2


def test_adversaries_move_as_fast_as_they_may():
    kind = Class(h=2.0, h_x=0.0, h_t=4.0, h_initial=2.0, n=2, m=1)
    genes = np.full(genes_of(kind), 0.5)
    member = adversary(kind, genes, np.zeros(2), np.zeros(2), 0.1)
    t = np.linspace(0, 20, 20001)
    h = values(member, t, np.zeros((len(t), 2)), np.zeros(2))[:, 0]
    fastest = np.abs(np.diff(h)).max() / (t[1] - t[0])
    assert max(fastest / kind.h_t, np.abs(h).max() / kind.h) > 0.9


def test_pushes_use_the_class():
    kind = Class(h=1.0, h_x=2.0, h_t=3.0, h_initial=1.0, n=2, m=1, push=(4.0, 5.0))
    genes = np.full(genes_of(kind), 0.5)
    genes[3] = 1.0
    member = adversary(kind, genes, np.zeros(2), np.zeros(2), 0.5)
    # slope of the direction: 4/0.5 per push; rate: 5/0.5 per push
    assert member.push == pytest.approx(min(2.0 / 8, 3.0 / 10, 1.0), rel=1e-6)
    size, slope, _ = member.bounds()
    assert size + member.push <= 1.0
    assert slope + 8 * member.push <= 2.0 * (1 + 1e-9)


def test_a_run_is_drawn_from_its_seed_and_number_alone():
    where = setting("flat")
    one, same = case(where, where.uncertainty, 3, 17), case(where, where.uncertainty, 3, 17)
    for name in ("amplitude", "frequency", "wave", "phase"):
        np.testing.assert_array_equal(getattr(one.member, name), getattr(same.member, name))
    others = [case(where, where.uncertainty, 3, 18), case(where, where.uncertainty, 4, 17)]
    assert all(not np.array_equal(one.member.frequency, other.member.frequency) for other in others)
