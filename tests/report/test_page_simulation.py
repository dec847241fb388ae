"""The figures of a simulation on the page: only of the one that belongs to the certificate, and only as images."""

import json
import os

import certificates
import pages
import pytest
from commands import run

import tubecert as tc
from tubecert import certificate
from tubecert.errors import TargetError

DRAWING = '<svg xmlns="http://www.w3.org/2000/svg"><script>alert(1)</script></svg>'


@pytest.fixture
def made(tmp_path):
    sealed = certificate.seal(certificates.certified(), {})
    (tmp_path / "plant.json").write_text(certificate.dump(sealed), encoding="utf-8")
    folder = tmp_path / "plant.simulation"
    folder.mkdir()
    (folder / "states.png").write_text(DRAWING)
    (folder / "other.png").write_text(DRAWING)
    summary = {
        "format": "tubecert-simulation/1",
        "outcome": "not falsified",
        "certificate": sealed["hash"],
        "seed": 0,
    }
    (folder / "summary.json").write_text(json.dumps(summary))
    return tmp_path


def test_figures_are_images_in_which_nothing_runs(made):
    target = made / "page.html"
    words = [str(made / "plant.json"), "--simulation", str(made / "plant.simulation"), "-o", str(target)]
    assert run("report", *words).exit_code == 0
    source = target.read_text(encoding="utf-8")
    page = pages.Page(source)
    assert "Outcome: not falsified. A simulation can falsify a certificate" in page.text
    (image,) = page.values("src")
    assert image.startswith("data:image/png;base64,")
    assert "<script" not in source
    assert source == tc.report(made / "plant.json", simulation=made / "plant.simulation").html


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"outcome": 1, "certificate": 2}', "[" * 100_000])
def test_a_folder_that_holds_none_is_refused(made, text):
    (made / "plant.simulation" / "summary.json").write_text(text)
    with pytest.raises(TargetError, match=r"no simulation|another certificate"):
        tc.report(made / "plant.json", simulation=made / "plant.simulation")


def test_a_simulation_of_another_certificate_is_refused(made):
    summary = made / "plant.simulation" / "summary.json"
    summary.write_text(summary.read_text().replace("sha256:", "sha256:0"))
    with pytest.raises(TargetError, match="another certificate"):
        tc.report(made / "plant.json", simulation=made / "plant.simulation")
    os.remove(summary)
    with pytest.raises(TargetError, match="cannot read"):
        tc.report(made / "plant.json", simulation=made / "plant.simulation")
