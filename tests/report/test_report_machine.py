"""The words of a machine, and the order in which states are told."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest
from tubecert.kinds.windows import WindowData

import tubecert as tc
from tubecert.report.figures_time import state_figures

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


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_noise_that_is_given_by_state_is_told_by_state_with_units():
    page = tc.report(tc.certify(tc.specification(PLANT.replace("NOISE", "{v: 0.0004, z: 0.0003}"))))
    assert "noise z 0.0003 m, v 0.0004 m/s" in page.html.replace("&#x27;", "'")
    page = tc.report(tc.certify(tc.specification(PLANT.replace("NOISE", "0.0001"))))
    assert "noise 0.0001" in page.html


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_states_keep_their_order_in_a_certificate_that_is_read(tmp_path):
    result = tc.certify(tc.specification(PLANT.replace("NOISE", "0")))
    result.save(tmp_path / "cart.json")
    assert list(tc.read(tmp_path / "cart.json").half_widths) == list(result.half_widths) == ["z", "v"]


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_a_band_over_time_is_as_wide_as_its_window():
    result = tc.certify(tc.specification(PLANT.replace("NOISE", "0"))).result
    own = result.sections["hardware"]
    wide = dict(own.half_widths)
    narrow = {name: width / 4 for name, width in wide.items()}
    rest = {
        "tube": own.level,
        "level": own.level,
        "radius": 1.0,
        "supremum": 1.0,
        "inputs": {},
        "constants": {},
    }
    windows = (
        WindowData(begin=0, end=1, half_widths=wide, **rest),
        WindowData(begin=1, end=3, half_widths=narrow, **rest),
    )
    machine = replace(own, windows=windows)
    figure = state_figures(replace(result, sections={**result.sections, "hardware": machine}))[0]
    (band,) = (part for part in ET.fromstring(figure.svg).iter("path") if part.get("class") == "tube")
    points = [tuple(map(float, pair.split())) for pair in re.findall(r"[-\d.]+ [-\d.]+", band.get("d"))]
    above, below = points[: len(points) // 2], points[len(points) // 2 :][::-1]
    sizes = [low[1] - high[1] for high, low in zip(above, below, strict=True)]
    assert len(sizes) == 4, "two windows, each from its begin to its end"
    assert sizes[0] == sizes[1] == pytest.approx(4 * sizes[2], abs=0.1)
    assert above[1][0] == above[2][0] == pytest.approx(above[0][0] + (above[3][0] - above[0][0]) / 3, abs=0.1)
