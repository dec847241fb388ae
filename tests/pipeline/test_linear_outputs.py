"""Outputs: the half-widths of linear combinations of the states, proposed, proven, reported and examined."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from rechecked import certified, examine, failing, respecified, sealed, unconfirmed

from tubecert.pipeline.candidates import measured_in
from tubecert.spec import canonical, load_text

TEXT = (Path(__file__).parents[1] / "specs/ok/outputs.yaml").read_text("utf-8")
ROWS = {"x": (1, 0), "y": (0, 1), "m": (0.5, 0.5), "tip": (1, -0.5), "twice": (2, 0)}
BALL = TEXT.replace("half_widths: {tip: 0.3, y: 0.5}", "epsilon: 0.2, rho_a: 0.1")


def made(text=TEXT):
    return certified(text, conditions="distance")


def test_outputs_are_rows_and_the_effective_specification_says_them_again():
    spec = load_text(TEXT)
    assert {output.name: output.row for output in spec.outputs} == {
        name: tuple(map(Fraction, row)) for name, row in ROWS.items() if name not in "xy"
    }
    written = canonical(spec)["system"]["outputs"]
    assert written == {"m": "0.5*x + 0.5*y", "tip": "x - 0.5*y", "twice": "2*x"}


def dual(x):
    return np.array([[1 + 0.1 * x[0], -0.3], [-0.3, 2 + 0.2 * x[0]]])


@pytest.mark.slow
@pytest.mark.parametrize("text", [TEXT, BALL], ids=["half-widths", "ball"])
def test_half_widths_are_the_suprema_over_the_tube(text):
    """By a grid: dbar sup sqrt(c'W c), in a ball at most |c| rho; what was asked for is reached and kept."""
    tube = made(text)["result"]["tube"]
    lower = made(text)["result"]["constants"]["lower"]["below"]
    widths, rho = tube["half_widths"], tube["rho"]
    S = np.array(tube.get("coordinates", np.eye(2).tolist()), dtype=float)
    angles = np.linspace(0, 2 * np.pi, 721)
    rim = (rho * np.linalg.inv(S) @ [np.cos(angles), np.sin(angles)]).T
    if "coordinates" in tube:
        rim = rim[np.all(np.abs(rim) <= [widths["x"], widths["y"]], axis=1)]
    for name, row in ROWS.items():
        c = np.array(row)
        most = max(c @ dual(share * x) @ c for x in rim for share in (0.5, 1)) ** 0.5 * rho * lower**0.5
        if "coordinates" not in tube:
            most = min(most, rho * np.linalg.norm(c))
        assert most * (1 - 1e-9) <= widths[name] <= most * 1.01
    if "coordinates" in tube:
        assert widths["tip"] <= 0.3
        assert widths["y"] <= 0.5
        assert max(widths["tip"] / 0.3, widths["y"] / 0.5) > 0.99


@pytest.mark.slow
def test_an_output_alone_fixes_the_tube():
    """States that nothing is asked of are as wide as the metric makes them."""
    tube = made(TEXT.replace(", y: 0.5", ""))["result"]["tube"]
    assert 0.297 < tube["half_widths"]["tip"] <= 0.3
    assert tube["half_widths"]["twice"] == pytest.approx(2 * tube["half_widths"]["x"], rel=2e-3)


@pytest.mark.slow
def test_recheck_confirms_half_widths_of_outputs_and_catches_what_is_wrong_with_them():
    document = made()
    found = examine(document)
    assert failing(found) == []
    names = [claim.name for claim in found.claims]
    assert (
        sum(
            name.startswith(tuple(f"half-width of {each} " for each in ("m", "tip", "twice")))
            for name in names
        )
        == 3
    )
    for name in ("m", "tip", "twice"):
        narrow = sealed(document)
        narrow["result"]["tube"]["half_widths"][name] *= 0.97
        assert any(claim.startswith(f"half-width of {name}") for claim, _ in failing(examine(sealed(narrow))))
        del narrow["result"]["tube"]["half_widths"][name]
        assert unconfirmed(narrow)


CHANGES = {
    "another combination": lambda outputs: outputs | {"tip": "x - 0.7*y"},
    "one more": lambda outputs: outputs | {"more": "y"},
    "one less": lambda outputs: {name: e for name, e in outputs.items() if name != "m"},
    "a square": lambda outputs: outputs | {"m": "x*y"},
    "a constant": lambda outputs: outputs | {"m": "x + 1"},
    "nothing": lambda outputs: outputs | {"m": "x - x"},
    "a debt": lambda outputs: outputs | {"m": "x + 0/y"},
    "a name of a state": lambda outputs: outputs | {"x": "y"},
    "a name of a function": lambda outputs: outputs | {"sin": "y"},
}


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_other_outputs_are_noticed(change):
    def other(effective):
        effective["system"]["outputs"] = change(effective["system"]["outputs"])

    assert unconfirmed(respecified(made(), other))


@pytest.mark.slow
def test_more_than_was_asked_for_is_noticed():
    def other(effective):
        effective["tube"]["half_widths"]["tip"] = "0.29"

    assert failing(examine(respecified(made(), other)))


def test_metrics_may_be_compared_by_outputs():
    spec = load_text(TEXT)
    assert measured_in(spec, ["tip", "m"]) == {"tip": 0.3, "m": 1.0}
    wanted = TEXT.replace("metric: {rate: 0.8", "metric: {synthesise: {outputs: [tip, x]}} #")
    assert load_text(wanted).synthesis.outputs == ("tip", "x")
