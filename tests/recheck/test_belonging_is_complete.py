"""`--spec` compares every key, and tells every override and every other text (R23)."""

import pytest
from rechecked import belongs_to, certified, respecified, sealed
from systems import SMALL

from tubecert.certificate.belonging import ForeignError

PLAN = "{kind: equilibrium, at: [0, 0], input: [0]}"
ROWS = "t,x,y,u\n0,0,0,0\n1,0,0,0\n"
OVERRIDES = {
    "epsilon": 0.2,
    "rho_a": 0.1,
    "bandwidth": 40.0,
    "adaptation_rate": 1000.0,
    "conditions": "0",
    "metric": "mine.json",
    "settings": {"tube.epsilon": "0.2"},
}


@pytest.mark.parametrize("key", OVERRIDES)
def test_every_override_is_told_with_its_value(key, tmp_path):
    """Nothing was said of `conditions: 0` where the file lets B decide, nor of gains that were asked for."""
    text = SMALL + 'conditions: {decides: "B"}\n'
    document = certified(text, conditions=None)
    assert "command line" not in belongs_to(document, text, tmp_path)
    document["result"]["overrides"] = {key: OVERRIDES[key]}
    shown = "tube.epsilon = 0.2" if key == "settings" else f"{key} = {OVERRIDES[key]}"
    assert f"with {shown} given on the command line" in belongs_to(sealed(document), text, tmp_path)


def test_other_bytes_of_a_plan_are_told(tmp_path):
    """The knots are compared; the hash of the file was not."""
    (tmp_path / "plan.csv").write_text(ROWS, encoding="utf-8")
    text = SMALL.replace(PLAN, f"{{kind: csv, file: {tmp_path}/plan.csv}}")
    document = certified(text, conditions="no_adaptation")
    assert "has changed" not in belongs_to(document, text, tmp_path)
    document["result"]["plan"]["file_hash"] = "sha256:" + 64 * "0"
    assert "plan.csv has changed, the system has not" in belongs_to(sealed(document), text, tmp_path)


def test_every_section_of_the_specification_is_compared(tmp_path):
    """One of each, written otherwise than in the file; those that nothing rests on are told."""
    document = certified(SMALL, conditions="no_adaptation")
    idle = {"name", "expect", "simulation"}
    changes = {
        "name": "other",
        "safe_set": {"x": ["-1", "1"], "y": ["-1", "2"]},
        "uncertainty": {"h": ["0"]},
        "initial_state": {"at": ["0", "0"]},
        "tube": {"epsilon": "0.2", "rho_a": "0.1", "gap": "auto"},
        "adaptation": {"A_m": "auto", "projection": "hard"},
        "conditions": {"decides": "B"},
        "limits": {"u": ["-1", "1"]},
        "simulation": {"runs": "3"},
        "expect": {"verdict": "certified"},
        "metric": {"rate": "0.8", "dual_metric": [["1", "0"], ["0", "1"]]},
        "trajectory": {"kind": "equilibrium", "at": ["0.1", "0"], "input": ["0"]},
        "system": document["result"]["spec"]["effective"]["system"] | {"f": ["x", "y"]},
    }
    for key, value in changes.items():

        def change(effective, key=key, value=value):
            effective[key] = value

        forged = respecified(document, change)
        if key in idle:
            assert f"nothing rests on what differs: {key}" in belongs_to(forged, SMALL, tmp_path)
        else:
            with pytest.raises(ForeignError, match=key):
                belongs_to(forged, SMALL, tmp_path)
