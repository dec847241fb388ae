"""Bounds of h by input: what they say together is never less than what they say apart."""

import json
from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from tubecert.expression import root_above
from tubecert.spec import canonical, load_text

FILE = """
tubecert: 1
name: small
system: {{states: [x, y], inputs: [u, v], f: ["-x + y", "-y"], B: [[1, 0], [0, 1]]}}
safe_set: {{x: [-1, 1], y: [-1, 1]}}
uncertainty: {{bounds: {bounds}}}
trajectory: {{kind: equilibrium, at: [0, 0]}}
"""


def bounds(text: str):  # type: ignore[no-untyped-def]
    return load_text(FILE.format(bounds=text)).uncertainty.bounds


def test_channels_are_combined_as_euclidean_norms() -> None:
    found = bounds("{u: {h: 3, h_x: 0.5, h_t: 0}, v: {h: 4, h_x: 1.2, h_t: 7}}")
    assert found == bounds("{h: 5, h_x: 1.3, h_t: 7}")


def test_the_canonical_form_holds_what_is_rounded_up() -> None:
    text = FILE.format(bounds="{u: {h: 1, h_x: 0, h_t: 0}, v: {h: 1, h_x: 0, h_t: 0}}")
    data = canonical(load_text(text))
    assert Fraction(data["uncertainty"]["bounds"]["h"]) ** 2 > 2
    assert canonical(load_text(json.dumps(data))) == data


@given(
    st.fractions(min_value=0, max_denominator=10**9) | st.builds(lambda n: Fraction(n) ** 2, st.fractions())
)
def test_a_root_is_rounded_upward_by_almost_nothing(square: Fraction) -> None:
    root = root_above(square)
    assert root * root >= square
    assert (root * (1 - Fraction(1, 10**27))) ** 2 <= square
