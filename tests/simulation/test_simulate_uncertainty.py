"""Members of a class are in it, and use it: checked by evaluating them, not by the formulas that made them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import setting

from tubecert.simulation.adaptive.campaign import bred, cases
from tubecert.simulation.adaptive.uncertainty import WAVES, Class, adversaries, random_members, triangle

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


def values(waves, t, x):
    """h of N members at times (P,) and states (P, n), (N, P, m), without pushes."""
    frequency, wave, phase = (np.moveaxis(each, -1, 0) for each in (waves.frequency, waves.wave, waves.phase))
    angle = t[:, None] * frequency[:, None] + np.einsum("pj,nwj->npw", x, wave)
    return np.sin(angle + phase[:, None]) @ np.moveaxis(waves.amplitude, -1, 0)


def assert_in_class(waves, kind, offset, rng):
    t, x = rng.uniform(0, 20, 400), rng.normal(size=(400, kind.n))
    h, push, tight = values(waves, t, x), np.abs(waves.push), 1 + 1e-9
    assert np.all(np.linalg.norm(h, axis=2).max(axis=1) + push <= kind.h * tight)
    far = rng.uniform(0, 20, 400)
    change = np.linalg.norm(values(waves, far, x) - h, axis=2)
    assert (change <= kind.h_t * tight * np.abs(far - t) + 1e-12 * kind.h).all()
    other = x + 0.1 * rng.normal(size=x.shape)
    change = np.linalg.norm(values(waves, t, other) - h, axis=2)
    assert (change <= kind.h_x * tight * np.linalg.norm(other - x, axis=1) + 1e-12 * kind.h).all()
    N = np.arange(offset.shape[1])
    start = np.linalg.norm(values(waves, 0.0 * N, offset.T)[N, N], axis=1)
    assert np.all(start + push <= np.maximum(kind.h_initial, push) * tight + 1e-12 * kind.h)


@settings(max_examples=50, deadline=None)
@given(kinds(), seeds)
def test_random_members_and_adversaries_are_in_the_class(kind, seed):
    rng = np.random.default_rng(seed)
    offset = rng.normal(size=(kind.n, 3))
    assert_in_class(random_members(kind, rng.random((kind.member, 3)), offset), kind, offset, rng)
    assert_in_class(adversaries(kind, rng.random((kind.adversary, 3)), offset), kind, offset, rng)


def test_the_triangle_has_slope_one_and_no_overshoot():
    j, c = triangle(WAVES)
    s = np.linspace(0, 2 * np.pi, 5001)
    slope = np.cos(np.outer(s, j)) @ (j * c)
    assert np.abs(slope).max() <= 1 + 1e-12
    assert np.abs(slope).max() > 0.9
    assert 0.8 * np.pi / 2 < np.abs(np.sin(np.outer(s, j)) @ c).max() <= np.pi / 2


def halves(kind):
    return np.full((kind.adversary, 1), 0.5)


def test_adversaries_move_as_fast_as_they_may():
    kind = Class(h=2.0, h_x=0.0, h_t=4.0, h_initial=2.0, n=2, m=1)
    waves = adversaries(kind, halves(kind), np.zeros((2, 1)))
    t = np.linspace(0, 20, 20001)
    h = values(waves, t, np.zeros((len(t), 2)))[0, :, 0]
    fastest = np.abs(np.diff(h)).max() / (t[1] - t[0])
    assert max(fastest / kind.h_t, np.abs(h).max() / kind.h) > 0.9


def test_random_members_use_the_class():
    kind = Class(h=2.0, h_x=3.0, h_t=4.0, h_initial=2.0, n=2, m=1)
    waves = random_members(kind, np.random.default_rng(0).random((kind.member, 200)), np.zeros((2, 200)))
    size = np.linalg.norm(waves.amplitude, axis=1)
    bounds = size.sum(axis=0), (size * waves.frequency).sum(axis=0), np.einsum("wn,wjn->jn", size, waves.wave)
    assert 0.6 < np.mean(bounds[0] > 0.99 * kind.h) < 0.8
    assert 0.3 < np.mean(bounds[1] > 0.99 * kind.h_t) < 0.6
    assert np.ptp(bounds[2], axis=1).min() > 1


def test_pushes_use_the_class():
    kind = Class(h=1.0, h_x=2.0, h_t=3.0, h_initial=1.0, n=2, m=1, push=(4.0, 5.0), layer=0.5)
    genes = halves(kind)
    genes[3] = 1.0
    waves = adversaries(kind, genes, np.zeros((2, 1)))
    # slope of the direction: 4/0.5 per push; rate: 5/0.5 per push
    assert waves.push[0] == pytest.approx(min(2.0 / 8, 3.0 / 10, 1.0), rel=1e-6)
    size, slope = np.linalg.norm(waves.amplitude, axis=1), np.linalg.norm(waves.wave, axis=1)
    assert size.sum() + waves.push[0] <= 1.0
    assert (size * slope).sum() + 8 * waves.push[0] <= 2.0 * (1 + 1e-9)


def test_a_run_is_drawn_from_its_seed_and_number_alone():
    where = setting("flat")
    one, many = cases(where, 3, [17]), cases(where, 3, range(20))
    for name in ("amplitude", "frequency", "wave", "phase"):
        np.testing.assert_array_equal(getattr(one.h, name)[..., 0], getattr(many.h, name)[..., 17])
    others = cases(where, 3, [18]), cases(where, 4, [17])
    assert all(not np.array_equal(one.h.frequency, other.h.frequency) for other in others)


@pytest.mark.parametrize("changes", [{"within": 0.3}, {"spread": np.array([0.2, 0.1])}])
def test_starts_are_allowed_and_use_what_is(changes):
    where = replace(setting("flat"), **changes)
    genes = np.random.default_rng(0).random((where.uncertainty.adversary + 2, 40))
    for start in (cases(where, 1, range(40)).start.T, bred(where, genes).start.T):
        if where.within:
            share = np.linalg.norm(start - where.centre, axis=1) / where.within
        else:
            share = np.abs((start - where.x0) / where.spread).max(axis=1)
        assert share.max() <= 1 + 1e-12
        assert np.mean(share > 0.999) > 0.3 or share.max() > 0.9
    x = cases(where, 1, range(40)).start.T
    assert len(np.unique(x, axis=0)) > 20
