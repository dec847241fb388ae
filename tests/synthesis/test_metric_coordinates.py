"""Metrics do not depend on the units of states, inputs and time."""

from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from systems import values

from tubecert import pipeline
from tubecert.model import build
from tubecert.pipeline import Options
from tubecert.spec import Synthesis, load_text
from tubecert.synthesis.family import coordinates, metric_family
from tubecert.synthesis.ladder import Ladder, Request, routes
from tubecert.synthesis.problem import FLOORS
from tubecert.synthesis.rounding import distance, rounded
from tubecert.verdict import Verdict

JOINT = """
tubecert: 1
name: joint
system:
  states: [q, w, th, om]
  inputs: [u]
  parameters: {{a: {a}, b: {b}, c: {c}, d: {d}}}  # how many of the new units are one of the old
  f: [a*w/b, "b*(-2*sin(q/a) - 10*(q/a - th/c) - 0.2*w/b)", c*om/d, "d*10*(q/a - th/c)"]
  B: [[0], [0], [0], [d]]
safe_set: {{q: [-a, a], w: [-3*b, 3*b], th: [-c, c], om: [-3*d, 3*d]}}
uncertainty: {{h: [0]}}
trajectory: {{kind: equilibrium, at: [0, 0, 0, 0], input: [0]}}
"""
# the input moves both of the last states, and the direction turns
TURNING = """
tubecert: 1
name: turning
system:
  states: [x, y, z]
  inputs: [u]
  parameters: {{a: {a}, b: {b}, c: {c}}}
  f: [a*y/b, "b*(z/c - x/a)", "-c*y/b"]
  B: [[0], ["0.1*b*x/a"], ["c*(1 + 0.1*x/a)"]]
safe_set: {{x: [-a/4, a/4], y: [-b/4, b/4], z: [-c/4, c/4]}}
uncertainty: {{h: [0]}}
trajectory: {{kind: equilibrium, at: [0, 0, 0], input: [0]}}
"""


def scaled_condition(text, units, *, rate, **wanted):
    """The condition number in half-widths, by sampling."""
    spec = load_text(text.format(**units))
    asked = Synthesis(objective="condition", rate=Fraction(rate), **wanted)
    found = pipeline.synthesise(spec, asked, Options())
    assert found.verdict is Verdict.CERTIFIED, found.reason
    model = build(found.spec)
    half = np.array([float(high) for _, high in spec.safe_set])
    n = len(half)
    points = np.random.default_rng(2).uniform(-1, 1, (4000, n)) * half
    found = np.linalg.eigvalsh(values(model.W, model.states, points) / half[:, None] / half)
    return found[:, -1].max() / found[:, 0].min()


@cache
def as_written(text, **wanted):
    """In the units in which it is written."""
    return scaled_condition(text, dict.fromkeys("abcd", 1), **wanted)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "units", "wanted"),
    [
        (JOINT, {"a": 1, "b": 8, "c": 1, "d": 8}, {"rate": 1, "route": "auto"}),
        (JOINT, {"a": 1, "b": "1/16", "c": 1, "d": 2}, {"rate": 1, "route": "sos"}),
        (JOINT, {"a": 1, "b": 1000, "c": 57, "d": 100}, {"rate": 1, "route": "auto"}),
        (JOINT, {"a": 1, "b": 1000, "c": 57, "d": 100}, {"rate": 1, "route": "sos"}),
        (TURNING, {"a": 100, "b": "1/8", "c": 3}, {"rate": Fraction(1, 4), "degree": 0}),
    ],
)
def test_another_unit_gives_the_same_metric(text, units, wanted):
    """Also where the direction of the input turns."""
    assert scaled_condition(text, units, **wanted) == pytest.approx(as_written(text, **wanted), rel=0.01)


@pytest.mark.slow
def test_in_the_states_own_units_it_does():
    wanted = {"rate": 1, "degree": 0, "coordinates": "identity"}
    one, eight = (dict.fromkeys("ac", 1) | dict.fromkeys("bd", s) for s in (1, 8))
    reference = scaled_condition(JOINT, one, **wanted)
    assert scaled_condition(JOINT, eight, **wanted) != pytest.approx(reference, rel=0.03)


def test_scales_are_half_widths_or_none():
    spec = load_text(TURNING.format(a=1, b=1, c=1))
    family = metric_family(build(spec), degree=0, safe_set=spec.safe_set)
    box = [(Fraction(-3), Fraction(3)), (Fraction(0), Fraction(1)), (Fraction(-1), Fraction(3))]
    assert coordinates("auto", family, box).states.tolist() == [3, 0.5, 2]
    widths = (Fraction(1), Fraction(2), Fraction(4))
    assert coordinates("auto", family, box, widths).states.tolist() == [1, 2, 4]
    own = coordinates("identity", family, box, widths)
    assert own.states.tolist() == own.columns.tolist() == [1, 1, 1]


@given(
    st.lists(st.floats(-1, 1), min_size=3, max_size=3),
    st.integers(2, 7),
    st.lists(st.sampled_from([1e-3, 1.0, 57.3, 1e6]), min_size=3, max_size=3),
)
@settings(deadline=None)
def test_rounding_changes_a_metric_as_little_in_all_units(entries, digits, units):
    """W = V_0 + V_1 psi: psi in degrees has a small coefficient, and no entry is rounded away beside a large one."""
    a, b, c = entries
    values = np.array([[[4, b], [b, 1 + c * c]], [[a, 0.1], [0.1, -c / 2]]])
    states, psi = np.array(units[:2]), units[2]
    size = np.outer(states, states) / np.array([1, psi])[:, None, None]
    functions = np.array([[1.0, x] for x in np.linspace(-0.35, 0.35, 9)]) * [1, psi]
    found = np.array(rounded(values * size, digits, functions), dtype=float)
    largest = np.sqrt(
        np.abs(functions[:, :, None] * [np.diag(v) for v in values * size]).sum(axis=1).max(axis=0)
    )
    wrong = np.einsum("pk,kij->pij", functions, found - values * size) / np.outer(largest, largest)
    assert np.abs(wrong).max() <= 2 * 0.5 * 10.0 ** (1 - digits) * (1 + 1e-9)


def test_the_distance_of_metrics_is_that_of_the_worst_direction():
    """A thousandth of an entry is as much as the whole metric in the direction in which it is small."""
    values = np.array([[[1.0, 0.999], [0.999, 1.0]]])
    other = values + np.array([[0, -0.001], [-0.001, 0]])
    units = np.outer([1.0, 1e5], [1.0, 1e5])
    assert distance(values, other, np.ones((1, 1))) == pytest.approx(1, rel=1e-9)
    assert distance(values * units, other * units, np.ones((1, 1))) == pytest.approx(1, rel=1e-9)
    assert distance(-values, other, np.ones((1, 1))) == np.inf


# -- units of inputs and of time

# a, b, c, T: how many of the new units one of the old is; one of the old unit of time is 1/T of the new one
DRIVEN = """
tubecert: 1
name: driven
system:
  states: [q, w]
  inputs: [u]
  parameters: {{a: {a}, b: {b}, c: {c}, T: {T}}}
  f: ["a*w/b*T", "b*T*(3*sin(q/a) - 0.5*w/b)"]
  B: [[0], ["b*T*2/c"]]
safe_set: {{q: [-a, a], w: [-4*b, 4*b]}}
uncertainty: {{h: ["c*(0.2*sin(2*T*t) + 0.1*q/a)"]}}
trajectory: {{kind: equilibrium, at: [0, 0], input: [0]}}
initial_state: {{at: [0.02*a, 0]}}
tube: {{half_widths: {{q: 0.2*a, w: b}}}}
"""
ONES = dict.fromkeys("abcT", 1)
# q to the third power: W moves with q and q^2, whose sizes are far apart where the unit of q is
CUBIC = """
tubecert: 1
name: cubic
system:
  states: [q, w]
  inputs: [u]
  parameters: {{a: {a}, b: {b}, c: {c}, T: {T}}}
  f: ["T*a*(w/b - (q/a)**3)", "b*T*((q/a)**3 - 0.5*w/b + 2*(q/a)*(w/b))"]
  B: [[0], ["b*T*2/c"]]
safe_set: {{q: [-a, a], w: [-4*b, 4*b]}}
uncertainty: {{h: [0]}}
trajectory: {{kind: equilibrium, at: [0, 0], input: [0]}}
"""
any_unit = st.sampled_from([1, 57, 1000, 10**6, Fraction(1, 8), Fraction(1, 1000), Fraction(1, 10**6)])
FAR_APART = [
    {"a": Fraction(1, 1000), "b": 1000, "c": 1, "T": 1},
    {"a": 1000, "b": Fraction(1, 10**6), "c": 10**6, "T": 57},
    {"a": Fraction(1, 10**5), "b": 10**4, "c": 10**9, "T": 10**6},
    {"a": 10**6, "b": 10**6, "c": Fraction(1, 10**9), "T": Fraction(1, 1000)},
]
ROUTES = ["cegis", "sos"]


def least(text, units, *, rate, **wanted):
    """kappa over both floors, in a system whose rates are of the unit of time."""
    spec = load_text(text.format(**units))
    asked = Request(model=build(spec), safe_set=spec.safe_set, coordinates="auto", **wanted)
    ladder = Ladder(asked)
    found = [ladder.metric(rate * Fraction(units["T"]), floor) for floor in FLOORS]
    assert None not in found, [attempt.outcome for attempt in ladder.attempts]
    return [metric.proposal.kappa for metric in found]


def least_driven(units, route):
    half_widths = (Fraction(units["a"]) / 5, Fraction(units["b"]))
    return least(DRIVEN, units, rate=Fraction(7, 4), degree=0, routes=routes(route), half_widths=half_widths)


@cache
def of_driven(route):
    return least_driven(ONES, route)


@pytest.mark.slow
@given(st.fixed_dictionaries(dict.fromkeys("abcT", any_unit)), st.sampled_from(ROUTES))
@settings(deadline=None, max_examples=4)
def test_what_is_least_does_not_depend_on_the_units_of_inputs_and_time(units, route):
    """B B' is as large as its unit, and the rows of C2 have 1/s in them."""
    assert least_driven(units, route) == pytest.approx(of_driven(route), rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("units", FAR_APART)
@pytest.mark.parametrize("route", ROUTES)
def test_nor_where_units_are_far_apart(units, route):
    """By 1e6 or 1e9: W has entries 1e12, or 1e18, apart, and is proven in the states' own units."""
    assert least_driven(units, route) == pytest.approx(of_driven(route), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("route", ROUTES)
def test_nor_where_a_metric_moves_with_powers_of_a_state(route):
    wanted = {"rate": Fraction(1, 2), "degree": 2, "routes": routes(route)}
    reference = least(CUBIC, ONES, **wanted)
    for units in FAR_APART[3:]:
        assert least(CUBIC, units, **wanted) == pytest.approx(reference, rel=1e-4)


@pytest.mark.slow
def test_a_rate_that_is_searched_for_does_not_depend_on_units():
    """Nor do the gains that it certifies with, in a tube of half-widths."""
    rates, tables = [], []
    for units in (ONES, ONES | {"a": 57, "b": "1/10"}):
        spec = load_text(DRIVEN.format(**units))
        found = pipeline.synthesise(spec, Synthesis(degree=0), Options(conditions="distance"))
        plain = [row for row in found.rows if row.floor == "identity"]
        rates.append(found.file.rate)
        tables.append([(float(row.rate), row.bandwidth, row.adaptation_rate) for row in plain])
    assert rates[0] == rates[1]
    assert np.array(tables[1]) == pytest.approx(np.array(tables[0]), rel=0.01)


def test_the_frame_of_a_moving_input_does_not_depend_on_units():
    """The pivot rows are those that keep it small in half-widths: 1/(x + 10), not 1/x, whatever x is measured in."""
    frames = []
    for a, b, c in ((1, 1, 1), (1000, Fraction(1, 10**6), 1)):
        spec = load_text(TURNING.format(a=a, b=b, c=c))
        frame = metric_family(build(spec), degree=0, safe_set=spec.safe_set).frame
        scale = np.array([a, b, c], dtype=float)
        (own,) = values(frame, spec.states, scale[None] * [0.1, 0.2, 0.05])
        frames.append(own * scale / scale[:, None])
    assert frames[1] == pytest.approx(frames[0], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("time", ["1/1000", "1000"])
def test_a_bare_synthesis_finds_the_same_in_another_unit_of_time(time):
    tables = []
    for units in (ONES, ONES | {"b": 8, "c": "1/1000", "T": time}):
        found = pipeline.synthesise(
            load_text(DRIVEN.format(**units)),
            Synthesis(rate=Fraction(7, 4) * Fraction(units["T"]), objective="adaptation", degree=0),
            Options(conditions="distance"),
        )
        T, c = float(Fraction(units["T"])), float(Fraction(units["c"]))
        rows = [(float(row.rate), row.bandwidth or 0, row.adaptation_rate or 0) for row in found.rows]
        tables.append(np.array(rows) / [T, T, c**2])
    assert tables[1] == pytest.approx(tables[0], rel=0.01)


@pytest.mark.slow
def test_the_largest_rate_does_not_depend_on_the_unit_of_time():
    rates = []
    for T in ("1", "1/4096", "10000"):
        spec = load_text(DRIVEN.format(**(ONES | {"T": T})))
        wanted = Synthesis(objective="rate", condition_number=Fraction(30), degree=0)
        found = pipeline.synthesise(spec, wanted, Options())
        rates.append(float(found.file.rate / Fraction(T)))
    assert rates == pytest.approx([rates[0]] * 3, rel=0.011)
