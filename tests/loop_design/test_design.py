"""What the search finds, against numbers of other searches, in other units, and where there is nothing to find."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from plants import double, plant, pvtol, scalar

from tubecert.loop_design.certification import ask, certify
from tubecert.loop_design.design import NoDesign, _Search, design
from tubecert.loop_design.observer import observe
from tubecert.loop_design.plant import in_units, plant_of
from tubecert.spec import load, load_text
from tubecert.spec.override import Setting


def mean(W):
    return np.exp(np.log(W).mean())


# geometric means of the widths that other searches, with ten times as many evaluations, have found
@pytest.mark.slow
@pytest.mark.parametrize(("machine", "widths"), [
    (scalar(0.0), [1.0]),
    (scalar(0.1), [1.3]),
    (scalar(1.0), [3.67]),
    (scalar(10.0), [20.2]),
    (double(), [4.75, 7.92]),
    (double(delay=1.0), [11.8, 16.1]),
    (double((0.0, 0.0)), [0.80, 1.62]),
    (double((10.0, 3.0)), [22.9, 22.0]),
])  # fmt: skip
def test_widths_are_those_of_a_longer_search(machine, widths):
    found = design(machine)
    assert mean(found.W) < 1.05 * mean(widths)
    assert np.isfinite(found.tables.F).all()


@pytest.mark.slow
def test_a_quadrotor_with_noise_keeps_a_tube_within_its_inputs():
    machine = pvtol(0.002)
    found = design(machine)
    assert mean(found.W) < 1.05 * mean([0.0093, 0.0038, 0.0058, 0.0148, 0.0089, 0.054])
    assert (machine.room >= found.U).all()
    assert (found.W > 0).all()
    x, z = [0, 2, 3, 5], [1, 4]  # hovering decouples
    assert not found.tables.N[np.ix_([0], x)].any()
    assert not found.tables.N[np.ix_([1], z)].any()


@pytest.mark.slow
def test_a_remainder_that_a_start_brings_falls_with_it():
    settings = {"initial_state": "{within: 1}", "tube.half_widths": "{x1: 1.2, x2: 1.1}"}
    path = Path(__file__).parents[2] / "configs/hardware_orbit.yaml"
    result = certify(load(str(path), [Setting(path=key, text=text) for key, text in settings.items()])).result
    assert result.verdict == "certified"


@pytest.mark.slow
def test_tables_are_numbers_of_single_precision_and_the_same_every_time():
    told = []
    first, second = design(double(), lambda *step: told.append(step)), design(double())
    for name in "FGMN":
        table = getattr(first.tables, name)
        np.testing.assert_array_equal(table, table.astype(np.float32))
        np.testing.assert_array_equal(table, getattr(second.tables, name))
    assert told == sorted(told)
    assert told[-1][0] <= first.evaluations


@pytest.mark.slow
def test_units_do_not_matter():
    """States in km and mm, the input in mN, h in kN: the same widths in the new units."""
    machine = double((0.5, 0.3), delay=0.4, room=[4.0], magnitude=2.0)
    s, u, a = np.array([1e-3, 1e3]), 1e3, 1e-3
    other = replace(
        machine,
        A=machine.A * s[:, None] / s,
        B=machine.B * s[:, None] / u,
        H=machine.H * s[:, None] / a,
        noise=machine.noise * s,
        magnitude=machine.magnitude * a,
        rate=machine.rate * a,
        room=machine.room * u,
    )
    one, two = design(machine), design(other)
    np.testing.assert_allclose(two.W, one.W * s, rtol=0.02)
    np.testing.assert_allclose(two.U, one.U * u, rtol=0.02)


@pytest.mark.slow
def test_components_of_eta_that_do_the_same_are_one_for_the_observer():
    """h through B and what a parameter does in the same row; one of them never moves."""
    twice = double(H=[[0, 0], [1, -2.0]], rate=[1.0, 0.0], magnitude=[5.0, 0.5])
    assert len(design(twice).tables.F) == len(design(double()).tables.F) == 4


def test_a_constant_that_is_unknown_is_learnt():
    """Without a rate the long run knows it; delta must still be able to cancel it."""
    found = design(plant([[0]], [[1]], noise=0.01, magnitude=1.0, room=[2.0]))
    assert found.W[0] < 0.1
    assert 1.0 <= found.U[0] <= 2.0


@pytest.mark.slow
def test_a_parameter_that_does_nothing_at_rest_is_no_component_of_the_observer():
    """Its eta is bounded by the least float above 0: nothing corrects it, and a loop with it would not be stable."""
    text = """tubecert: 1
name: arm
system: {states: [q, w], inputs: [u], parameters: {m: [0.95, 1.05]}, f: [w, 19.62*sin(q)], B: [[0], [4/m]]}
safe_set: {q: [-0.8, 0.8], w: [-4, 4]}
trajectory: {kind: equilibrium, at: [0, 0]}
hardware: {rate: 200, noise: {q: 0.002, w: 0.02}}
limits: {u: [-3, 3]}
"""
    assert certify(load_text(text, "arm.yaml")).result.verdict == "certified"


@pytest.mark.slow
@pytest.mark.parametrize("wind", ["", "disturbance: {E: [[0], [1]], bound: 1e-9}\n"])
def test_what_is_not_linear_along_a_plan_is_learnt_where_hardly_anything_else_moves_the_state(wind):
    """A filter that counts on nothing but the wind would take nothing from what is measured: an open loop."""
    text = """tubecert: 1
name: pendulum
system: {states: [q, w], inputs: [u], f: [w, -9.81*sin(q) - 0.1*w], B: [[0], [1]]}
safe_set: {q: [-1, 3], w: [-5, 5]}
trajectory:
  kind: expressions
  horizon: 4
  x: [0.8*(1 - cos(0.8*t)), 0.64*sin(0.8*t)]
  u: [0.512*cos(0.8*t) + 9.81*sin(0.8*(1 - cos(0.8*t))) + 0.064*sin(0.8*t)]
hardware: {rate: 200, delay: 0.002, noise: {q: 0.001, w: 0.01}}
limits: {u: [-20, 20]}
"""
    assert certify(load_text(text + wind, "pendulum.yaml")).result.verdict == "certified"


@pytest.mark.parametrize(("bent", "meets"), [(100.0, False), (0.0, True)])
def test_a_tube_that_is_wider_than_the_safe_set_meets_no_wish(bent, meets):
    """Without wishes as well: the search starts again then, which a drone of a mass known to 5 % needs."""
    machine = double(rho=lambda W, U: np.array([0.0, bent * W[0], 0.0]), space=100.0)
    search = _Search(observe(in_units(machine)), lambda *_: None)
    assert search.meets_wishes(search.within()) == meets


@pytest.mark.slow
def test_a_wish_is_paid_by_other_states():
    plain = design(double())
    wished = design(double(wishes=[np.inf, 0.8 * plain.W[1]]))
    assert wished.W[1] < 0.9 * plain.W[1]
    assert wished.W[0] > plain.W[0]


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.0, 2.5])
def test_nothing_acts_and_nothing_is_asked(delay):
    """No noise, no eta, no wind, no limits: only a start."""
    found = design(plant([[1.0]], [[1.0]], H=np.zeros((1, 0)), delay=delay, sample_time=0.2, start=1.0))
    assert 1.0 <= found.W[0] < 30
    assert np.isfinite(found.tables.F).all()


@pytest.mark.slow
@pytest.mark.parametrize("start", [[1.0, 5e-324], [5e-324, 5e-324]])
def test_a_start_at_zero_is_no_unit_although_it_is_rounded_outward(start):
    found = design(plant([[0, 1], [-4, -1]], [[0], [1]], sample_time=0.005, start=start))
    assert np.isfinite(found.W).all()


def refused(machine):
    with pytest.raises(NoDesign) as error:
        design(machine)
    return error.value


@pytest.mark.slow
def test_a_mode_that_no_input_moves_is_named():
    drifts = plant([[-1, 0, 0], [0, 0.1, 0], [1, 0, -2]], [[1], [0], [0]], noise=0.1)
    found = refused(drifts)
    assert (found.kind, found.where) == ("no_design", 1)
    assert found.needed == pytest.approx(0.1)
    fades = replace(drifts, A=drifts.A * [1, -1, 1])
    assert design(fades).W[1] < 1e-6


def test_an_input_that_no_controller_could_do_with_is_refused_before_a_search():
    pole = plant([[1.0]], [[1.0]], E=[[1.0]], wind=0.5, noise=0.01, room=[1.0], sample_time=0.5, delay=0.5)
    found = refused(pole)
    assert (found.kind, found.where, found.allowed) == ("inputs", 0, 1.0)
    assert found.needed == pytest.approx(0.5 * np.e)
    assert refused(replace(pole, room=np.zeros(1))).kind == "inputs"


@pytest.mark.slow
def test_an_input_that_is_too_small_is_told_with_what_it_needs():
    found = refused(scalar(0.1, room=[0.5]))
    assert (found.kind, found.where, found.allowed) == ("inputs", 0, 0.5)
    assert found.needed > 1e3


@pytest.mark.slow
def test_a_remainder_without_a_tube_is_told_with_the_state():
    wild = scalar(1.0, rho=lambda W, U: np.r_[50 * W**2, 0.0])
    found = refused(wild)
    assert (found.kind, found.where) == ("no_fixed_point", 0)
    assert found.needed > found.allowed > 1


def test_without_a_controller_the_mode_that_grows_is_named():
    """x' = 2 x beside a state that dies away; the tube never closes, and that is not what is nonlinear."""
    text = (
        "{tubecert: 1, name: alone, system: {states: [y, x], inputs: [u], f: [-y, 2*x], B: [[1], [0]]},"
        " safe_set: {y: [-1, 1], x: [-1, 1]}, trajectory: {kind: equilibrium, at: [0, 0], input: [0]},"
        " initial_state: {at: [0, 0]}, hardware: {rate: 100}, controller: none,"
        " disturbance: {E: [[0], [1]], bound: 0.1}}"
    )
    (lack,) = certify(load_text(text)).result.lacks
    assert (lack.kind, lack.where, lack.needed) == ("no_design", "x", pytest.approx(2))


@pytest.mark.slow
def test_a_drone_whose_mass_is_hardly_known_keeps_a_tube_without_a_wish():
    """Nothing moves its angle but its own inputs: a loop that hears nothing would be narrow, but never closes."""
    text = """tubecert: 1
name: drone
system:
  states: [px, pz, phi, vx, vz, w]
  inputs: [F, M]
  parameters: {m: [0.475, 0.525], J: 0.004, g: 9.81}
  f: [vx, vz, w, 0, -g, 0]
  B: [[0, 0], [0, 0], [0, 0], [-sin(phi)/m, 0], [cos(phi)/m, 0], [0, 1/J]]
safe_set: {px: [-3, 3], pz: [-3, 3], phi: [-0.7, 0.7], vx: [-3, 3], vz: [-3, 3], w: [-6, 6]}
trajectory: {kind: equilibrium, at: [0, 0, 0, 0, 0, 0], input: [0.5*g, 0]}
limits: {F: [0, 10], M: [-0.3, 0.3]}
hardware: {rate: 250, delay: 0.004, noise: {px: 0.002, pz: 0.002, phi: 0.002, vx: 0.01, vz: 0.01, w: 0.01}}
"""
    spec = load_text(text, "drone.yaml")
    found = design(plant_of(ask(spec), np.ones(2)))
    assert found.evaluations < 700
    assert (found.W < [0.1, 0.03, 0.03, 0.15, 0.1, 0.2]).all()
    assert certify(spec).result.verdict == "certified"


def test_an_input_whose_plan_is_at_its_limit_is_told_without_numbers():
    found = refused(scalar(0.1, room=[0.0]))
    assert (found.kind, found.where, found.needed) == ("inputs", 0, None)


@pytest.mark.parametrize(("growth", "held", "room", "told"), [
    (-0.5, 0.4, 3, "input: [0.5]"),
    (-0.5, 0.5, 3, None),
    (0.5, -0.4, 0.01, "input: [-0.5]"),
])  # fmt: skip
def test_what_would_hold_a_plan_that_is_no_equilibrium_is_told(growth, held, room, told):
    """Whether a tube is proven or none is found."""
    text = f"""tubecert: 1
name: tank
system: {{states: [x], inputs: [u], f: ["{growth}*x"], B: [[1]]}}
safe_set: {{x: [-5, 5]}}
trajectory: {{kind: equilibrium, at: [1], input: [{held}]}}
hardware: {{rate: 10, noise: {{x: 0.05}}}}
limits: {{u: [{held - room}, {held + room}]}}
"""
    found = certify(load_text(text, "tank.yaml"))
    assert (found.result.verdict == "certified") == (room > 1)
    assert found.notes.missed == told


LAG = """tubecert: 1
name: lag
system: {states: [x], inputs: [u], f: ["-20*x"], B: [[20]]}
safe_set: {x: [-1, 1]}
disturbance: {bound: 0.01}
trajectory: {kind: equilibrium, at: [0], input: [0]}
hardware: {rate: 1, noise: 0.001}
"""


@pytest.mark.slow
def test_a_sample_may_last_twenty_times_as_long_as_a_mode_takes():
    found = certify(load_text(LAG)).result
    assert found.verdict == "certified"
    assert 0.01 / 20 < found.tube[0].half_widths["x"] < 1.1 * 0.01 / 20


@pytest.mark.slow
def test_a_wind_that_is_too_strong_is_not_told_as_what_is_not_linear():
    (lack,) = certify(load_text(LAG.replace("bound: 0.01", "bound: 40") + "controller: none\n")).result.lacks
    assert (lack.kind, lack.where) == ("safe_set", "x")
    assert lack.needed == pytest.approx(1, rel=0.1)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning", "ignore:invalid value:RuntimeWarning")
def test_of_a_sample_that_lasts_too_long_for_floats_no_number_is_told():
    found = certify(load_text(LAG.replace("-20*x", "-100000*x") + "controller: none\n"))
    assert [(lack.kind, lack.allowed) for lack in found.result.lacks] == [("no_fixed_point", None)]


@pytest.mark.slow
@pytest.mark.parametrize("rate", [10, 100])
def test_where_only_a_start_acts_the_loop_returns_about_as_fast_as_its_input_can(rate):
    """1 m with at most 1 m/s^2: 2 s. It took 500: a slow loop has a narrow v, whose unit was what 3 samples do."""
    text = f"""tubecert: 1
name: cart
system: {{states: [x, v], inputs: [u], f: [v, 0], B: [[0], [1]]}}
safe_set: {{x: [-10, 10], v: [-10, 10]}}
trajectory: {{kind: equilibrium, at: [0, 0]}}
initial_state: {{box: {{x: [-1, 1], v: [0, 0]}}}}
hardware: {{rate: {rate}}}
limits: {{u: [-1, 1]}}
"""
    result = certify(load_text(text, "cart.yaml")).result
    assert result.verdict == "certified"
    assert result.tube[-1].start <= 25 * rate
    assert result.tube[-1].half_widths["x"] < 0.01


def test_a_spring_that_is_held_off_its_rest_by_a_mass_known_to_ten_per_cent():
    """The rate of what a constant parameter does at rest is what rounding leaves of 0: no unit for a signal."""
    text = """tubecert: 1
name: spring
system: {states: [x, v], inputs: [F], parameters: {m: [0.9, 1.1]}, f: [v, -10*x/m], B: [[0], [1/m]]}
safe_set: {x: [-1, 1], v: [-3, 3]}
trajectory: {kind: equilibrium, at: [0.1, 0], input: [1]}
hardware: {rate: 200, noise: {x: 0.001, v: 0.01}}
"""
    assert certify(load_text(text)).result.verdict == "certified"
