"""`tc.sweep` and `tc.compare`: values that say what the files say."""

from fractions import Fraction

import numpy as np
import pytest
import systems

import tubecert as tc


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


def test_a_range_of_one_value_is_refused():
    with pytest.raises(tc.SpecError, match="no range"):
        tc.sweep(systems.SMALL, {"tube.epsilon": "1:2"}, folder="x")
