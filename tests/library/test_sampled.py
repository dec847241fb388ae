"""A certificate of a sampled loop as a value: what is proven as numbers, the controller as a function."""

import json
from dataclasses import replace
from fractions import Fraction

import handmade
import numpy as np
import pytest
import sampled

import tubecert as tc
from tubecert.library.sampled import certification_of
from tubecert.loop_design import certification
from tubecert.sampled_loop.record import Lack


@pytest.fixture
def cart():
    return certification_of(sampled.certificate())


def test_numbers_by_name_rounded_outward(cart):
    assert cart.certified
    assert cart.half_widths == cart.start == {"p": 0.13201, "v": 0.13201}
    assert cart.long_run == {"p": 0.034, "v": 0.034}
    assert cart.ranges == {"F": (-3.1, 3.1)}
    assert cart.shares["p"]["wind"] == pytest.approx(0.02 / 0.034)
    assert sum(cart.shares["v"].values()) == pytest.approx(1)
    third = replace(cart.result.tube[0], half_widths=dict.fromkeys("pv", Fraction(1, 3)))
    width = certification_of(sampled.certificate(tube=(third,))).half_widths["p"]
    assert Fraction(width) >= Fraction(1, 3) > Fraction(np.nextafter(width, 0))


def test_the_tube_as_arrays(cart):
    tube = cart.tube
    assert tube.t.tolist() == [0.0, 1.6, 1.6, 2.6]
    assert (tube.upper - tube.plan)[:, 1].tolist() == [0.13201, 0.13201, 0.034, 0.034]
    assert np.array_equal(tube.lower, 2 * tube.plan - tube.upper)
    assert not tube.upper.flags.writeable
    assert certification_of(sampled.certificate(sampled.FAMILY)).tube is None


@pytest.mark.slow
def test_the_tube_is_drawn_as_that_of_other_certificates(cart):
    from matplotlib.figure import Figure

    axes = cart.plot_tube(Figure().subplots(), states=("v", "p"))
    assert axes.get_xlabel() == "v (m/s)"
    assert {"safe set", "tube", "obstacle"} <= {*axes.get_legend_handles_labels()[1]}
    assert certification_of(sampled.certificate(sampled.FAMILY)).plot_tube(Figure().subplots()).patches
    with pytest.raises(tc.SpecError, match="the states are p, v"):
        cart.plot_tube(axes, states=("p", "q"))


def test_nothing_is_handed_out_that_is_not_proven():
    found = certification_of(sampled.undecided(Lack(kind="wish", where="p", needed=0.2, allowed=0.15)))
    assert not found.certified
    assert not any([found.half_widths, found.start, found.long_run, found.ranges, found.tube])
    (reason,) = found.reasons
    assert reason.message == "the tube of p is wider than wished for: 0.2 m of 0.15 m"
    with pytest.raises(tc.TubecertError):
        found.controller()


def test_it_is_read_as_it_was_saved(cart, tmp_path):
    path = tmp_path / "cart.certificate.json"
    cart.save(path)
    found = tc.read(path)
    assert isinstance(found, tc.SampledCertification)
    assert found.text == cart.text == path.read_text()
    assert (found.hash, str(found)) == (cart.hash, str(cart))
    assert found.specification.hash == tc.specification(sampled.SPEC).hash
    assert repr(found).startswith("<SampledCertification: certified cart: ")
    assert "certified" in found._repr_html_()
    assert any("double precision" in told for told in found.assumptions)


@pytest.mark.parametrize(
    ("tamper", "code"),
    [
        (lambda data: data["result"]["tube"][0].update(start=1), "TC601"),
        (lambda data: data.update(format="tubecert-sampled-loop/2"), "TC602"),
        (lambda data: data.update(format="tubecert-certificate/3"), "TC603"),
    ],
)
def test_what_was_changed_is_refused(cart, tmp_path, tamper, code):
    data = json.loads(cart.text)
    tamper(data)
    (tmp_path / "changed.json").write_text(json.dumps(data))
    with pytest.raises(tc.TargetError, match=code):
        tc.read(tmp_path / "changed.json")


def test_pages_and_comparisons_take_the_value(cart, tmp_path):
    assert "0.1321" in tc.report(cart).markdown
    folder = tmp_path / "cart.simulation"
    folder.mkdir()
    (folder / "summary.json").write_text(json.dumps({"outcome": "not falsified", "certificate": cart.hash}))
    (folder / "tube_use.png").write_text("<svg/>")
    assert "data:image/png" in tc.report(cart, simulation=folder).html
    both = tc.compare(cart, cart)
    assert both.quantities["half_width_in_the_long_run.p"] == (Fraction("0.034"),) * 2
    assert not both.differences


def test_certify_answers_for_hardware_and_refuses_what_is_about_metrics(monkeypatch):
    asked = {}

    def certify(spec, report):
        asked.update(name=spec.name, settings=dict(spec.settings))
        return sampled.certificate()

    monkeypatch.setattr(certification, "certify", certify)
    question = tc.load(tc.specification(sampled.SPEC), settings={"hardware.rate": 400})
    found = tc.certify(question)
    assert found.certified
    assert found.certificate.run["command"] == "tubecert.certify"
    assert asked == {"name": "cart", "settings": {"hardware.rate": "400"}}
    with pytest.raises(tc.SpecError) as refused:
        tc.certify(question, rho_a=0.1, conditions="B", deadline=3, jobs=2)
    about = {str(item.location).partition(":")[0] for item in refused.value.findings}
    assert about == {"rho_a", "conditions", "deadline", "jobs"}
    with pytest.raises(tc.SpecError, match="without a metric"):
        tc.synth(question, rate=1)


@pytest.mark.parametrize(("plan", "told"), [
    ("{kind: equilibrium, at: [-1.5, 0]}", "p goes to -1.5 m, beyond -1 m"),
    ('{kind: expressions, x: ["1.5*sin(t)", "1.5*cos(t)"], u: [0], horizon: 2}', "p goes to 1.5 m, beyond 1 m"),
    ("{kind: equilibrium, at: [1, 2]}", ""),  # at a corner
])  # fmt: skip
def test_a_plan_that_leaves_the_safe_set_is_refuted_for_that(monkeypatch, plan, told):
    """That no tube closes was said, or that an input has too little room."""
    lacking = sampled.undecided(Lack(kind="no_fixed_point", where="v"))
    monkeypatch.setattr(certification, "_answer", lambda *_: (lacking.result, lacking.notes))
    found = tc.certify(tc.specification(sampled.SPEC.replace(sampled.POINT, plan)))
    assert found.verdict == ("refuted" if told else "undecided")
    assert (f"the plan itself leaves the safe set: {told}" == found.reasons[0].message) == bool(told)
    assert ("neither proven nor refuted" in tc.report(found).markdown) != bool(told)


def test_the_controller_is_the_recursion_of_the_record():
    """The tables as it defines them: delta = M zeta + N dy, zeta+ = F zeta + G dy."""
    certificate = handmade.certificate(handmade.REST, z=3)
    controller, own = certification_of(certificate).controller(), certificate.result.controller
    zeta = np.zeros(3)
    for k, dy in enumerate(np.random.default_rng(0).normal(size=(20, 2)) / 100):
        wanted, zeta = 0.5 + own.M @ zeta + own.N @ dy, own.F @ zeta + own.G @ dy
        assert np.allclose(controller(0.02 * k, np.array([0.5, 0.0]) + dy), wanted, atol=1e-12)
    with pytest.raises(ValueError, match=r"next sample is at t = 0.4"):
        controller(0.38, [0, 0])
    with pytest.raises(ValueError, match="not finite"):
        controller(0.4, [np.nan, 0])
    assert np.isfinite(controller(0.4, [0, 0])).all(), "it was nan ever after"
    with pytest.raises(ValueError, match="family"):
        controller(0.42, [0, 0], [0, 0], [0])


def test_along_a_plan_that_ends_and_of_a_family():
    moving = certification_of(handmade.certificate(handmade.WAVE % "", z=0)).controller()
    for k in range(51):
        t = 0.02 * k
        u = moving(t, [np.sin(t), np.cos(t)])  # on the plan: the input that acts, in the middle of its time
        at = min(t + 0.005 + 0.01, 1.01)
        assert u == pytest.approx([np.cos(at) / 3 + 0.1 * np.sin(2 * at) ** 2], abs=1e-6)
    with pytest.raises(ValueError, match="the plan is over"):
        moving(1.02, [0, 0])
    handed = certification_of(handmade.certificate(handmade.ANY, z=1)).controller()
    assert handed(0, [0.2, 0.1], x=[0.2, 0.1], u=[0.7]).tolist() == [0.7]
    with pytest.raises(ValueError, match="family"):
        handed(0.02, [0, 0])
