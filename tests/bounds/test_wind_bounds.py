"""What a wind does, over a tube: closed forms, coordinates, what joins the uncertainty, what the certificate says."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from proven import proven
from systems import SMALL, TWO, W_TWO, matrix_of, scaled, three_state, two_state

from tubecert.bounds.constants import Constant
from tubecert.bounds.start import KnownStart, StartBox, StartWithin
from tubecert.bounds.suprema import Suprema
from tubecert.bounds.wind import Beside, residual_constants, uncertainty_constants, wind_constants
from tubecert.coordinates import Coordinates
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.pencil import Pencil
from tubecert.trajectory import constant_plan

RHO = 0.3
B = np.array([0.5, -2.0])
W = np.array([[float(e) for e in row] for row in W_TWO])
M = np.linalg.inv(W)


def suprema(E, bound="0.1", rate=None, coordinates=None, model=None, *, gap=1e-4):
    """Around the origin, with a wind."""
    model = model or two_state()
    wind = {"wind_bound": Fraction(bound), "wind_rate": None if rate is None else Fraction(rate)}
    model = replace(model, E=matrix_of(E, model.states), **wind)
    plan = constant_plan([Fraction(0)] * len(model.states), [Fraction(0)], Fraction(1))
    return Suprema(model, plan, RHO, (Fraction(0), Fraction(1)), Effort(gap=gap), coordinates=coordinates)


def beta(of: Suprema) -> Constant:
    return of.metric_input_gain()


def encloses(found: Constant, value: float) -> bool:
    below = found.below <= value * (1 + 1e-9) and value <= found.above * (1 + 1e-12)
    return below and found.above <= value * (1 + 1e-3)


def test_a_constant_field_under_a_constant_metric():
    E = np.array([[0.3, 1.0], [2.0, -0.5]])
    found = wind_constants(s := suprema([["0.3", "1"], ["2", "-0.5"]]), beta(s))
    assert encloses(found.push, math.sqrt(np.linalg.eigvalsh(E.T @ M @ E)[-1]))
    assert encloses(found.size, np.linalg.norm(E, 2))
    assert encloses(found.explained, np.linalg.norm(B @ E / (B @ B)))


def test_what_is_not_reached_with_a_rate():
    E = np.array([1.0, 1.0])
    left = E - B * (B @ E) / (B @ B)
    found = wind_constants(s := suprema([["1"], ["1"]], rate="0.5"), beta(s))
    assert encloses(found.push, math.sqrt(left @ M @ left))
    assert encloses(found.size, np.linalg.norm(left))
    assert found.explained == Constant.exactly(0.0)


def test_along_the_input_nothing_is_left():
    for rate in (None, "0.5"):
        found = wind_constants(s := suprema([["-1"], ["4"]], rate=rate), beta(s))
        if rate is None:
            assert encloses(found.explained, 2.0)
            assert encloses(found.push, 2 * math.sqrt(B @ M @ B))
        else:
            assert found.push.above == found.size.above == found.explained.above == 0


def test_the_split_form_of_the_push_is_taken_where_it_is_smaller():
    """Under a metric that varies, beta on the plan beats the supremum over the tube of the same field."""
    model = three_state()
    E = [["0"], ["0"], ["1"]]
    s = replace(suprema(E, model=model), rho=0.05)
    found = wind_constants(s, beta(s))
    assert found.push.above <= beta(s).above * (1 + 1e-9)
    over_tube = s.root_of("x", Pencil(s.model.BBt, s.model.W))
    assert over_tube.above > beta(s).above * 1.001


@pytest.mark.slow
def test_a_field_of_the_state_is_sampled():
    E = [["cos(x1)", "x2"], ["1 + x1**2", "0.3"]]
    found = wind_constants(s := suprema(E), beta(s))
    rng = np.random.default_rng(1)
    x = rng.normal(size=(4000, 2))
    x = RHO * x / np.linalg.norm(x, axis=1)[:, None] * rng.uniform(size=(4000, 1)) ** 0.25
    fields = np.array([[np.cos(x[:, 0]), x[:, 1]], [1 + x[:, 0] ** 2, 0.3 + 0 * x[:, 0]]]).transpose(2, 0, 1)
    L = np.linalg.cholesky(M).T
    sizes = np.linalg.norm(fields, 2, axis=(1, 2)).max()
    pushes = np.linalg.norm(L @ fields, 2, axis=(1, 2)).max()
    taken = np.linalg.norm(B @ fields / (B @ B), axis=1).max()
    for value, sampled in ((found.push, pushes), (found.size, sizes), (found.explained, taken)):
        assert sampled <= value.above <= sampled * 1.02


def test_in_coordinates_of_the_tube_the_push_is_the_same_and_the_size_is_theirs():
    E = [["0.3"], ["2"]]
    S = Coordinates(((Fraction(2), Fraction(1)), (Fraction(0), Fraction(3))))
    plain, turned = suprema(E), suprema(E, coordinates=S)
    one, other = (wind_constants(s, beta(s)) for s in (plain, turned))
    SE = np.array([2 * 0.3 + 2, 3 * 2.0])
    assert other.push.above == pytest.approx(one.push.above, rel=1e-6)
    assert encloses(other.size, np.linalg.norm(SE))
    SB = np.array([2 * 0.5 - 2, -6.0])
    assert encloses(other.explained, abs(SB @ SE) / (SB @ SB))


def test_more_of_the_metric_is_less_push():
    s, t = (suprema([["0.3"], ["2"]], model=two_state(W)) for W in (W_TWO, scaled(W_TWO, "4")))
    one, other = (wind_constants(each, beta(each)).push.above for each in (s, t))
    assert other == pytest.approx(one / 2, rel=1e-6)


@pytest.mark.slow
def test_a_slow_wind_that_an_input_can_make_is_uncertainty():
    """h + 2 w along the input: every constant in closed form."""
    s = suprema([["-1"], ["4"]], bound="0.1", rate="3")
    own = dict(zip(("h", "h_x", "h_t"), s.uncertainty(), strict=True))
    found = uncertainty_constants(s, KnownStart((Fraction(1, 10), Fraction(0))), {})
    assert encloses(found["h"], own["h"].above + 0.2)
    assert encloses(found["h_x"], own["h_x"].above)
    assert encloses(found["h_t"], own["h_t"].above + 6)
    assert encloses(found["h_initial"], 0.01 + 0.2)


def test_the_slope_of_what_an_input_can_make_is_a_slope_of_the_uncertainty():
    """E = (0, 2 + x1): B^+ E = -8/17 (2 + x1), of slope 8/17 (2/4.25)."""
    s = suprema([["0"], ["2 + x1"]], bound="0.5", rate="0")
    own = s.uncertainty()[1]
    found = uncertainty_constants(s, KnownStart((Fraction(0), Fraction(0))), {})
    assert found["h_x"].above == pytest.approx(own.above + 0.5 * 2 / 4.25, rel=1e-3)
    assert encloses(found["h_initial"], 0.5 * 4 / 4.25)


def test_what_is_declared_is_declared_of_h_alone():
    s = suprema([["-1"], ["4"]], bound="0.1", rate="3")
    s = replace(s, model=replace(s.model, h=None))
    given = {name: Constant(below=1.0, above=1.0) for name in ("h", "h_x", "h_t")}
    found = uncertainty_constants(s, KnownStart((Fraction(0), Fraction(0))), given)
    assert encloses(found["h"], 1.2)
    assert encloses(found["h_x"], 1.0)
    assert encloses(found["h_t"], 7.0)
    assert found["h_initial"] == found["h"]


@pytest.mark.parametrize(
    "start",
    [StartWithin(Fraction(1, 10)), StartBox(((Fraction(0), Fraction(1, 10)), (Fraction(0), Fraction(0))))],
)
def test_the_wind_is_there_at_the_start(start):
    s = suprema([["-1"], ["4"]], bound="0.1", rate="3")
    assert encloses(uncertainty_constants(s, start, {})["h_initial"], 0.01 + 0.2)


def test_without_a_rate_nothing_joins():
    assert not Beside(suprema([["-1"], ["4"]]).fields).joins_uncertainty
    assert not Beside(suprema([["4"], ["1"]], rate="1").fields).joins_uncertainty  # B'E = 0
    assert Beside(suprema([["-1"], ["4"]], rate="1").fields).joins_uncertainty


def test_what_vanishes_is_seen_to_vanish():
    """E is B times a function of the state, B depends on it as well: nothing is left, exactly."""
    model = three_state(B=[["sin(x1)"], ["cos(x1)"], ["1 + x2"]])
    s = suprema([["2*x3*sin(x1)"], ["2*x3*cos(x1)"], ["2*x3*(1 + x2)"]], rate="1", model=model)
    assert wind_constants(s, Constant.exactly(1.0)).size == Constant.exactly(0.0)


def unknown(drift, ranges, h=None, coordinates=None, rho=RHO, *, gap=1e-4):
    """The two-state system, of which the plant has another drift."""
    base = two_state()
    names = (*TWO, *dict(ranges))
    model = replace(base, drift=matrix_of([drift], names)[0], parameters=ranges, h=h or base.h)
    return replace(suprema([["0"], ["0"]], coordinates=coordinates, model=model, gap=gap), rho=rho)


MASS = (("m", (Fraction(9, 10), Fraction(11, 10))),)


@pytest.mark.slow
def test_what_inputs_reach_of_a_parameter_joins_h_and_the_rest_pushes():
    """f_2 gains (m - 1) 3 x1: in closed form at the corners of m."""
    s = unknown(("-x1 + 2*x2", "-0.25*x2**3 - 3*m*x1 + 4*x2"), MASS, gap=1e-3)
    D = np.array([0.0, 0.3 * RHO])  # at x1 = RHO, m at an end
    left = D - B * (B @ D) / (B @ B)
    rest = residual_constants(s)
    assert encloses(rest.push, math.sqrt(left @ M @ left))
    assert encloses(rest.size, np.linalg.norm(left))
    found = uncertainty_constants(s, KnownStart((Fraction(1, 10), Fraction(0))), {})
    slope = 0.3 * 2 / 4.25
    assert encloses(found["h_initial"], 0.01 + slope * 0.1)
    assert found["h_t"].above == pytest.approx(s.uncertainty()[2].above)
    x1, x2, t, m = np.meshgrid(
        np.linspace(-RHO, RHO, 61), np.linspace(-RHO, RHO, 61), np.linspace(0, 1, 41), [0.9, 1.1]
    )
    inside = x1**2 + x2**2 <= RHO**2
    h = -2 * np.sin(2 * t) - 0.1 * np.hypot(x1, x2) - 2 / 4.25 * (-3 * (m - 1) * x1)
    most = np.abs(h[inside]).max()
    assert most <= found["h"].above <= most * 1.01
    own = s.uncertainty()[1].above
    assert own < found["h_x"].above <= own + slope + 1e-6


def test_a_parameter_along_the_input_leaves_nothing():
    s = unknown(("-x1 + 2*x2 + 0.5*m*x1 - 0.5*x1", "-0.25*x2**3 - 3*x1 + 4*x2 - 2*m*x1 + 2*x1"), MASS)
    assert residual_constants(s).push == residual_constants(s).size == Constant.exactly(0.0)
    assert Beside(s.fields).joins_uncertainty


def test_a_parameter_that_the_middle_knows_exactly_adds_nothing():
    s = unknown(("-x1 + 2*x2", "-0.25*x2**3 - 3*x1 + 4*x2"), MASS)
    assert residual_constants(s).push == Constant.exactly(0.0)
    assert not Beside(s.fields).joins_uncertainty


@pytest.mark.slow
def test_wider_ranges_never_need_less():
    previous = 0.0
    for half in ("1/100", "1/20", "1/5"):
        ends = (1 - Fraction(half), 1 + Fraction(half))
        s = unknown(("-m*x1 + 2*x2", "-0.25*x2**3 - 3*x1 + 4*x2"), (("m", ends),))
        push = residual_constants(s).push
        assert push.above > previous
        previous = push.above


@pytest.mark.slow
def test_in_coordinates_the_residual_is_what_is_sampled():
    S = Coordinates(((Fraction(2), Fraction(1)), (Fraction(0), Fraction(3))))
    s = unknown(("-m*x1 + 2*x2", "-0.25*x2**3 - 3*x1*m + 4*x2"), MASS, coordinates=S, gap=2e-3)
    rest = residual_constants(s)
    Sf = np.array([[2.0, 1.0], [0.0, 3.0]])
    SB = Sf @ B
    rng = np.random.default_rng(3)
    z = rng.normal(size=(20000, 2))
    z = RHO * z / np.linalg.norm(z, axis=1)[:, None]
    x = z @ np.linalg.inv(Sf).T
    D = np.stack([-0.1 * x[:, 0], -0.3 * x[:, 0]], axis=1) @ Sf.T
    left = D - np.outer(D @ SB / (SB @ SB), SB)
    Mz = np.linalg.inv(Sf @ W @ Sf.T)
    pushes = np.sqrt(np.einsum("ni,ij,nj->n", left, Mz, left)).max()
    sizes = np.linalg.norm(left, axis=1).max()
    assert pushes <= rest.push.above <= pushes * 1.01
    assert sizes <= rest.size.above <= sizes * 1.01


def certified(extra, **options):
    return proven(SMALL + extra, bare=True, **{"conditions": "all"} | options)["result"]


@pytest.mark.slow
def test_a_certificate_without_wind_says_nothing_of_it():
    result = certified("")
    assert not any(name.startswith(("wind", "residual")) for name in result["constants"])
    assert "wind" not in result["claim"]
    assert all(item["id"] != "wind_within" for item in result["assumptions"])


@pytest.mark.slow
def test_the_claim_and_the_assumptions_state_the_wind():
    result = certified("disturbance: {E: [[0], [1]], bound: 0.02, rate: 1/10}\n")
    assert result["claim"]["wind"] == {"bound": "0.02", "rate": "0.1"}
    assert result["assumptions"][-1] == {"id": "wind_within", "bound": 0.02, "rate": 0.1}
    assert result["verdict"] == "certified"  # all of it is a part of h: A covers it, too
    assert result["constants"]["wind_size"]["above"] == 0


@pytest.mark.slow
def test_gusts_need_more_and_leave_a_undecided():
    calm, gusty = certified(""), certified("disturbance: {E: [[1], [0]], bound: 0.02}\n")
    assert gusty["conditions_26"]["verdict"] == "undecided"
    assert [r["condition"] for r in gusty["reasons"] if r["verdict"] == "undecided"] == ["wind_not_covered"]
    for key in ("no_adaptation", "distance"):
        assert gusty[key]["verdict"] == "certified"
    rate = [r["distance"]["least_adaptation"]["adaptation_rate"] for r in (calm, gusty)]
    assert rate[1] > rate[0]
    assert gusty["no_adaptation"]["ultimate_radius"] > calm["no_adaptation"]["ultimate_radius"]


@pytest.mark.slow
def test_a_steady_wind_along_the_input_costs_nothing_in_the_long_run():
    """At the same gains, certificate B's S and so A1 of the long run do not feel it; the feedback alone does."""
    steady = "disturbance: {E: [[0], [1]], bound: 0.02, rate: 0}\n"
    calm, windy = (
        certified(text, bandwidth=Fraction(60), adaptation_rate=Fraction(10**12)) for text in ("", steady)
    )
    asked = [r["distance"]["asked"]["ultimate_radius"] for r in (calm, windy)]
    alone = [r["no_adaptation"]["ultimate_radius"] for r in (calm, windy)]
    assert asked[1] <= asked[0] * 1.01
    assert alone[1] > alone[0] * 1.1


@pytest.mark.slow
def test_a_range_claims_more_than_its_middle():
    text = SMALL.replace("0.3*sin(x)", "m*sin(x)").replace(
        "  inputs: [u]", "  inputs: [u]\n  parameters: {m: [LOW, HIGH]}"
    )
    exact = certified("")
    results = [
        proven(text.replace("LOW", low).replace("HIGH", high), bare=True, conditions="all")["result"]
        for low, high in (("0.3", "0.300000001"), ("0.2", "0.4"))
    ]
    assert results[1]["claim"]["parameters"] == {"m": ["0.2", "0.4"]}
    assert results[1]["assumptions"][-1] == {"id": "parameters_within"}
    radii = [r["no_adaptation"]["ultimate_radius"] for r in (exact, *results)]
    assert radii[1] == pytest.approx(radii[0], rel=1e-3)
    assert radii[2] > 1.1 * radii[0]
    assert results[1]["constants"]["h_x"]["above"] == pytest.approx(0.15, rel=1e-3)  # 0.05 + 0.1 cos
    assert results[1]["verdict"] == "certified"  # sin(x) acts where u does: nothing is left
