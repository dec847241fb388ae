"""What is not a number stays so through every operation of the checker: flint's own asin of it is a thin ball."""

import pytest
from flint import arb

from tubecert.recheck.program import _KERNELS

NOTHING = arb("nan")


@pytest.mark.parametrize("name", [name for name in _KERNELS if name != "direction"])
def test_what_is_not_a_number_stays_so(name):
    for args in ([NOTHING], [NOTHING, arb(1)], [arb("0 +/- inf")], [arb(-2), arb(0)]):
        if name == "div" and len(args) < 2:
            continue
        found = _KERNELS[name](args, 2)
        if args[0].is_nan():
            assert found.is_nan()
        elif name in ("asin", "acos", "sqrt", "log"):
            assert not found.is_finite()


def test_a_direction_lies_between_minus_one_and_one_whatever_is_known():
    found = _KERNELS["direction"]([NOTHING, arb(1)], 0)
    assert found.is_nan() or (found.contains(-1) and found.contains(1))
