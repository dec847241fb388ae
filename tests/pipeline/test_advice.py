"""What would help, in words."""

from tubecert.claims.advice import HalveConstant
from tubecert.claims.advice import advice as words


def test_the_users_own_h_is_named_beside_the_constant_that_bounds_it():
    """Once: reports said `halving Dh (sup |h|)`, which no user has written."""
    items = [HalveConstant(constant=name, factor=0.5) for name in ("M_x", "h", "h_t")]
    told = words(items, ["0.1*sin(t)"])
    assert "DMx (sup of the sum of |dM/dx_i|) would" in told
    assert "halving Dh (sup |h|, h = 0.1*sin(t)) would lower the least Gamma by 50 %" in told
    assert told.count("sin(t)") == 1
    assert "h = [a, b])" in words(items[1:], ["a", "b"])
    assert "h = " not in words(items)
    assert f"h = {'1 + ' * 15} ...)" in words(items, ["1 + " * 40])
