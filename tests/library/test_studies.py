"""`tc.sweep`, `tc.compare` and `tc.design`: values that say what the files say."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import systems
from tubecert.library.designing import _merged

import tubecert as tc
from tubecert.pipeline import design as attempts
from tubecert.spec import Setting
from tubecert.spec.load import load_source
from tubecert.spec.source import Source


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studies") / "out"
    steps = []
    over = {"tube.epsilon": (0.2, "0.3")}
    found = tc.sweep(
        tc.specification(systems.SMALL), over, folder=folder, conditions="B", gap=0.1, progress=steps.append
    )
    return found, folder, steps


@pytest.mark.slow
def test_a_sweep_is_its_certificates(swept):
    found, folder, steps = swept
    assert [point.settings for point in found.points] == [{"tube.epsilon": "0.2"}, {"tube.epsilon": "0.3"}]
    for point in found.points:
        own = tc.certify(
            tc.load(tc.specification(systems.SMALL), settings=point.settings), conditions="B", gap=0.1
        )
        assert point.certification().hash == own.hash
        assert point.quantities["rho"] == own.result.tube.rho
    np.testing.assert_array_equal(found.column("tube.epsilon"), [0.2, 0.3])
    assert (np.diff(found.column("rho")) > 0).all()
    with pytest.raises(KeyError):
        found.column("nothing")
    assert (folder / "table.csv").read_text("utf-8") == found.csv
    assert steps[-1].done == 2
    assert str(found).startswith("small: 2 points")
    assert "table" in found._repr_html_()


@pytest.mark.slow
def test_a_comparison_is_what_its_certificates_say(swept, tmp_path):
    points = swept[0].points
    both = tc.compare(points[0].certification(), points[1].file)
    assert both.names == ("small", "0002")
    assert both.quantities["epsilon"] == (Fraction(1, 5), Fraction(3, 10))
    assert set(both.differences) == {"tube.epsilon"}
    for name in ("x.md", "x.csv", "x.json", "x.html"):
        both.save(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 200
    assert "epsilon" in both._repr_html_()
    with pytest.raises(tc.TargetError, match="a page or a table"):
        both.save(tmp_path / "x.png")
    with pytest.raises(tc.SpecError, match="two certificates or more"):
        tc.compare(points[0].file)
    with pytest.raises(tc.SpecError, match="1 names for 2"):
        tc.compare(points[0].file, points[1].file, names=["one"])


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_a_design_gives_the_certificate_of_its_best_tube(monkeypatch):
    monkeypatch.setattr(attempts, "_FARTHEST", 1)
    monkeypatch.setattr(attempts, "_NARROWINGS", 0)
    steps = []
    found = tc.design(tc.specification(systems.SCALAR), gap=0.1, progress=steps.append)
    assert [each.scale for each in found.attempts] == [1, Fraction(1, 2), 2]
    sizes = [each.size for each in found.attempts if each.size is not None]
    assert found.best.size == min(sizes)
    best = found.best.certification
    assert best.certified
    assert str(found) == str(best)
    assert best.result.tube.epsilon == found.best.scale / 2
    assert steps
    assert "times as wide" in found._repr_html_()


def test_what_a_design_lacks_is_told():
    for wrong, message in (({"minimise": ["z"]}, "minimise: z is no state"), ({"gap": 2}, "gap")):
        with pytest.raises(tc.SpecError, match=message):
            tc.design(tc.specification(systems.SCALAR), **wrong)
    with pytest.raises(tc.SpecError, match="is no pair of quantities"):
        tc.trade_off(tc.specification(systems.SCALAR), "hardware.colour")
    with pytest.raises(tc.SpecError, match="corridor: the specification has no hardware"):
        tc.machines(tc.specification(systems.SMALL), {"x": 0.1})
    with pytest.raises(tc.SpecError, match="no range"):
        tc.sweep(systems.SMALL, {"tube.epsilon": "1:2"}, folder="x")


@pytest.mark.parametrize(
    ("whole", "own", "widths"),
    [
        (
            "tube={epsilon: 0.3, rho_a: 0.2}",
            ("tube.epsilon=0.6", "tube.rho_a=0.4"),
            (Fraction("0.6"), Fraction("0.4")),
        ),
        ("tube={half_widths: {x: 0.3}}", ("tube.half_widths.x=1/7",), (Fraction(1, 7),)),
    ],
)
def test_a_tube_that_was_set_as_a_whole_is_scaled_inside(whole, own, widths):
    fixed = [Setting.of(whole), Setting.of("hardware.rate=100")]
    merged = _merged(fixed, [Setting.of(each) for each in own])
    spec = load_source(Source.of("scalar.yaml", systems.SCALAR), merged)
    assert len(merged) == 2
    tube = spec.tube
    assert (tuple(w for _, w in tube.half_widths) or (tube.epsilon, tube.rho_a)) == widths
