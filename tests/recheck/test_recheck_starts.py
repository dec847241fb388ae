"""What is stated of starts of every kind: d0, H0 and the radius, each made a little better than it is."""

import copy
from fractions import Fraction
from typing import Any

import mpmath
import pytest
from flint import ctx
from rechecked import case_of, certified, confirmed, examine, failing, sealed
from systems import SMALL

from tubecert.recheck.start import _segment, _Speed, off_plan

pytestmark = pytest.mark.slow
FLAT = SMALL.replace("0.1*sin(t)", "0.1*cos(t)")
BENT = FLAT.replace('[[1, "-0.3"], ["-0.3", 2]]', '[["1 + 0.3*x", "0.2*x"], ["0.2*x", 2]]').replace(
    "rate: 0.8", "rate: 0.5"
)
START, TUBE, H = "{at: [0.05, 0]}", "tube: {epsilon: 0.2,", 'h: ["0.1*cos(t) + 0.05*x"]'
WITHIN, BOX = (START, "{within: 0.03}"), (START, "{box: {x: [-0.02, 0.05], y: [0.01, 0.04]}}")
COORDINATES = (  # that stretch what is measured of a start
    (TUBE, "tube: {coordinates: auto, epsilon: 0.2,"),
    ('[[1, "-0.3"], ["-0.3", 2]]', '[["1/9", "-0.03"], ["-0.03", 2]]'),
)
ADAPTED = ("adaptation:", 'disturbance: {E: [["0.1"], [1]], bound: 0.02, rate: 1}\nadaptation:')
PARAMETER = (
    ("inputs: [u]", "inputs: [u]\n  parameters: {k: [0.2, 0.4]}"),
    ("0.3*sin(x)", "k*sin(x)"),
    (START, "{at: [0.2, 0]}"),
)
STARTS: dict[str, tuple[str, list[tuple[str, str]]]] = {
    "a point": (FLAT, []),
    "a point of a metric that is not constant": (BENT, []),
    "a radius": (FLAT, [WITHIN]),
    "a radius of a metric that is not constant": (BENT, [WITHIN]),
    "a radius in coordinates": (FLAT, [WITHIN, *COORDINATES]),
    "a box": (FLAT, [BOX]),
    "a box of a metric that is not constant": (BENT, [BOX]),
    "a box in coordinates": (FLAT, [BOX, *COORDINATES]),
    "an h with a bound": (FLAT, [(H, "bounds: {h: 0.12, h_x: 0.05, h_t: 0.1}")]),
    "an h with a bound beside": (FLAT, [(H, H + ", bounds: {h: 0.12}")]),
    "a wind that is adapted to": (FLAT, [ADAPTED]),
    "a wind beside an h with a bound": (FLAT, [ADAPTED, (H, "bounds: {h: 0.12, h_x: 0.05, h_t: 0.1}")]),
    "a parameter": (FLAT, [*PARAMETER]),
}


@pytest.fixture(scope="module", params=STARTS)
def honest(request):
    text, changes = STARTS[request.param]
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return confirmed(text, conditions="none")


def failed(honest: Any, change: Any) -> list[str]:
    document = copy.deepcopy(honest[0])
    change(document["result"])
    return [name for name, _ in failing(examine(sealed(document), memory=dict(honest[1])))]


@pytest.mark.parametrize(("name", "factor"), [("initial_distance", 0.95), ("h_initial", 0.99)])
def test_a_start_that_is_nearer_than_it_is_is_refused(honest, name, factor):
    """By more than what bounds of a metric that is not constant leave open, and less than what any part of it adds."""

    def change(result: dict[str, Any]) -> None:
        own = result["constants"][name]
        own["above"] *= factor
        own["below"] = min(own["below"], own["above"])

    assert any(found.startswith(f"{name} <= ") for found in failed(honest, change))


def test_a_radius_that_has_no_room_for_the_start_is_refused(honest):
    def change(result: dict[str, Any]) -> None:
        tube = result["tube"]
        width = tube["epsilon"] + tube["rho_a"]
        tube["rho"] = width + 0.95 * (tube["rho"] - width)
        tube["rho_r"] = tube["rho"] - tube["rho_a"]

    assert any(found.startswith("rho = ") for found in failed(honest, change))


@pytest.mark.parametrize("point", [("0.9", "0.7"), ("-0.9", "0.7"), ("0.8", "-0.9")])
@pytest.mark.parametrize("count", [1, 4, 16])
def test_a_segment_is_as_long_as_its_metric_makes_it(point, count):
    """Between both bounds, however few its pieces; the roots of W are those of the closed form."""
    case = case_of(certified(BENT, conditions="none"))
    with ctx.workprec(160), mpmath.workdps(40):
        x, y = map(mpmath.mpf, point)

        def speed(s: mpmath.mpf) -> mpmath.mpf:
            a, b = 1 + mpmath.mpf("0.3") * s * x, mpmath.mpf("0.2") * s * x
            return mpmath.sqrt((2 * x * x - 2 * b * x * y + a * y * y) / (2 * a - b * b))

        true = mpmath.quad(speed, [0, 1])
        delta = off_plan(tuple(map(Fraction, point)), case.curve)
        low, high = _Speed(case.system, case.curve, delta).over_pieces(count)
        ends = [mpmath.mpf(end.str(40, radius=False)) for end in (low.lower(), high.upper())]
        assert ends[0] <= true <= ends[1]
        assert ends[1] - ends[0] <= true * (mpmath.mpf("0.2") if count > 1 else 1)
        for factor, holds in (("0.999", False), ("1.001", True)):
            limit = Fraction(str(true)) * Fraction(factor)
            assert _segment(case.place, tuple(map(Fraction, point)), limit).holds == holds
