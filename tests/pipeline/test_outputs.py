"""What a metric is searched for: the states in which the tube is to be narrow."""

from pathlib import Path

import pytest

from tubecert.library.metrics import wanted_of
from tubecert.pipeline import Options, synthesise
from tubecert.spec import load_text

TEXT = (Path(__file__).parents[1] / "specs/ok/synthesise_outputs.yaml").read_text()


@pytest.mark.slow
def test_the_metric_is_the_one_that_is_narrow_where_it_was_asked_to_be():
    """A mass: fast metrics are narrow in position and wide in speed."""
    found = {}
    for state in ("p", "v"):
        spec = load_text(TEXT.replace("outputs: [p]", f"outputs: [{state}]"), "spec.yaml")
        found[state] = synthesise(spec, spec.synthesis, Options())
    chosen = {state: each.spec.metric.rate for state, each in found.items()}
    assert chosen["p"] > chosen["v"]
    for state, each in found.items():
        assert each.wanted.outputs == (state,)


def test_outputs_belong_to_the_objective_tube():
    spec = load_text(TEXT, "spec.yaml")
    assert wanted_of(spec).outputs == ("p",)
    assert wanted_of(spec, objective="adaptation").outputs == ()
