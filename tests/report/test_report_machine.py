"""The words of a machine, and the order in which states are told."""

import tubecert as tc

PLANT = """
tubecert: 1
name: cart
system: {states: [z, v], inputs: [F], units: {z: m, v: m/s}, f: [v, "-v"], B: [[0], [1]]}
safe_set: {z: [-1, 1], v: [-2, 2]}
uncertainty: {h: ["0.01*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, 0], input: [0], horizon: 3}
tube: {half_widths: {z: 0.5}}
metric: {dual_metric: [[1, -1], [-1, 2]], rate: 0.4}
hardware: {rate: 500, noise: NOISE}
conditions: {decides: H}
"""


def test_noise_that_is_given_by_state_is_told_by_state_with_units():
    page = tc.report(tc.certify(tc.specification(PLANT.replace("NOISE", "{v: 0.0004, z: 0.0003}"))))
    assert "noise z 0.0003 m, v 0.0004 m/s" in page.html.replace("&#x27;", "'")
    page = tc.report(tc.certify(tc.specification(PLANT.replace("NOISE", "0.0001"))))
    assert "noise 0.0001" in page.html


def test_states_keep_their_order_in_a_certificate_that_is_read(tmp_path):
    result = tc.certify(tc.specification(PLANT.replace("NOISE", "0")))
    result.save(tmp_path / "cart.json")
    assert list(tc.read(tmp_path / "cart.json").half_widths) == list(result.half_widths) == ["z", "v"]
