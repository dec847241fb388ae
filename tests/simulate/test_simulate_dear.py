"""Loops whose runs take very many steps: attacked with fewer, less accurate runs; and geodesics of a lower degree."""

from dataclasses import replace

import pytest
from simulated import setting

from tubecert.simulate import campaign
from tubecert.simulate.campaign import Attack, simulate
from tubecert.simulate.tuning import Choice, loop_of


def with_upper(own, share):
    """The setting of a tube over which M varies by this share."""
    lower = (own.reach / own.rho) ** 2
    return replace(own, certified=replace(own.certified, upper=lower * (1 + share)))


def test_geodesics_are_cubic_where_the_metric_hardly_varies_over_the_tube():
    own = setting("flat")
    degrees = [loop_of(with_upper(own, share), "ccm", Choice()).problem.degree for share in (0.009, 0.011)]
    assert degrees == [3, 5]
    unknown = replace(own, certified=replace(own.certified, upper=None))
    assert loop_of(unknown, "ccm", Choice()).problem.degree == 5


@pytest.mark.slow
@pytest.mark.parametrize("most", [1, 10**6])
def test_a_loop_that_takes_many_steps_is_attacked_with_less_accurate_runs(monkeypatch, most):
    asked = []

    def attacked(setting, loop, *rest):
        asked.append(setting)
        return Attack(loop=loop, sample=None, comparison=None, worst=None, case=None, worst_comparison=None)

    monkeypatch.setattr(campaign, "_DEAR", most)
    monkeypatch.setattr(campaign, "_attack", attacked)
    own = setting("flat")
    simulate(own, [loop_of(own, "l1", Choice())], count=1, seed=0)
    assert [each.dear for each in asked] == [most == 1]
    assert asked[0].tolerance == pytest.approx((5e-3 if most == 1 else 1e-3) * own.rho)
