"""Certificates read back: the genuine one is taken, everything else is refused with its reason."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from simulated import FLAT, certified, setting
from texts import CONFIGS

import tubecert
from tubecert import asking, pipeline
from tubecert.certificate import dump, seal
from tubecert.certificate.belonging import compared
from tubecert.claims.family import Reason
from tubecert.claims.statements import MetricDefinite
from tubecert.errors import ExitCode, TubecertError
from tubecert.letters import ADAPTIVE, name_of, words_of
from tubecert.model import build
from tubecert.recheck.run import recheck
from tubecert.simulation.adaptive.setting import (
    CHOSEN,
    Choice,
    adopted,
    loop_of,
    require_tube,
    setting_of,
)
from tubecert.spec import load, load_text
from tubecert.verdict import Verdict


def refused(call, *arguments):
    with pytest.raises(TubecertError) as caught:
        call(*arguments)
    (finding,) = caught.value.findings
    return caught.value, finding


def written(tmp_path, result, **changes):
    path = tmp_path / "c.json"
    path.write_text(dump(seal(result if isinstance(result, dict) else result.to_json(), {}) | changes))
    return str(path)


@pytest.mark.slow
def test_a_certificate_of_another_system_is_refused_by_what_differs():
    _, result = certified("flat")
    spec = load(str(CONFIGS / "two_state.yaml"))
    error, finding = refused(adopted, spec, result)
    assert error.exit_code is ExitCode.INVALID
    assert "does not belong to" in finding.message
    assert "uncertainty" in finding.message
    assert finding.location is not None


@pytest.mark.slow
def test_overrides_of_the_certificate_are_adopted_and_other_radii_refused():
    spec = load(str(CONFIGS / "two_state.yaml"))
    _, result = certified("two_state", "0.4")
    assert adopted(spec, result).tube.epsilon == Fraction(2, 5)
    flat, plain = certified("flat")
    other = replace(flat, tube=replace(flat.tube, epsilon=Fraction(1, 2)))
    _, finding = refused(adopted, other, plain)
    assert "tube differ" in finding.message


def test_simulate_and_recheck_have_one_judge():
    """Other units were refused here and accepted there, another adaptation the other way round."""
    _, result = certified("flat")
    measured = FLAT.replace("system: {", "system: {units: {p: m}, ")
    assert compared(load_text(measured), result).idle == ("system.units",)
    assert adopted(load_text(measured), result).units != load_text(FLAT).units
    another = load_text(FLAT + "adaptation: {projection: {smooth: 0.1}}\n")
    assert compared(another, result).serious == ("adaptation",)
    error, finding = refused(adopted, another, result)
    assert (error.exit_code, finding.code) == (ExitCode.INVALID, "TC604")


@pytest.mark.slow
def test_simulation_is_no_part_of_the_system_and_obstacles_are():
    spec = load(str(CONFIGS / "two_state.yaml"))
    _, result = certified("two_state", "0.4")
    bare = replace(spec, simulation=None, name="other")
    assert adopted(bare, result).name == "other"
    _, finding = refused(adopted, replace(spec, obstacles=()), result)
    assert "obstacles differ" in finding.message


@pytest.mark.parametrize(("verdict", "code"), [("refuted", 1), ("undecided", 4)])
def test_without_a_tube_there_is_nothing_to_simulate(verdict, code):
    _, result = certified("flat")
    reason = Reason(claim=MetricDefinite(), verdict=Verdict(verdict))
    stopped = replace(result, verdict=Verdict(verdict), reasons=(reason,), tube=None)
    error, finding = refused(require_tube, stopped)
    assert error.exit_code == code
    assert "metric, definiteness: W " in finding.message


@pytest.mark.slow
def test_the_plan_is_that_of_the_certificate():
    plan = setting("two_state", "0.4").plan
    assert plan.knots.x[0] == (Fraction("3.4"), Fraction("-2.4"))
    x, _ = plan.enclose(np.array([5.0]), np.array([5.0]))
    assert np.abs(x.mid).max() < 0.05


@pytest.mark.slow
def test_gains_of_the_certificate_are_promised_and_chosen_ones_are_not():
    where = setting("two_state", "0.4")
    _, result = certified("two_state", "0.4")
    pair = result.to_json()["distance"]["least_adaptation"]
    loop = loop_of(where, "l1", Choice())
    assert (loop.gains.bandwidth, loop.gains.adaptation_rate) == (
        pair["bandwidth"],
        pair["adaptation_rate"],
    )
    assert loop.promise is not None
    assert "B distance" in loop.gains_are
    paper = loop_of(where, "l1", Choice(source="26"))
    assert paper.gains.adaptation_rate == result.to_json()["conditions_26"]["adaptation_rate"]
    chosen = loop_of(where, "l1", Choice(bandwidth=Fraction(10), adaptation_rate=Fraction(1000)))
    assert chosen.promise is None
    assert chosen.gains_are == CHOSEN
    assert loop_of(where, "ccm", Choice()).promise is None


def test_without_certified_gains_the_options_are_named():
    where = setting("flat")
    result = replace(where.result, sections={}, decided_by=())
    bare = replace(where, result=result)
    error, finding = refused(loop_of, bare, "l1", Choice())
    assert error.exit_code is ExitCode.INVALID
    assert "--bandwidth and --adaptation-rate" in finding.help
    loop = loop_of(bare, "l1", Choice(bandwidth=Fraction(10), adaptation_rate=Fraction(1000)))
    assert loop.promise is None
    assert loop.gains.projection_radius >= where.uncertainty.h


def test_the_duration_is_the_horizon_unless_asked_for():
    spec, result = certified("flat")
    assert setting_of(spec, result).horizon == 4
    assert setting_of(spec, result, Fraction(1)).horizon == 1
    _, finding = refused(setting_of, spec, result, Fraction(5))
    assert "the plan ends at 4 s" in finding.message


@pytest.mark.slow
def test_a_plan_for_ever_is_simulated_for_ten_time_constants():
    spec, result = certified("three_state")
    assert setting_of(spec, result).horizon == 10  # simulation.duration
    assert setting_of(replace(spec, simulation=None), result).horizon == pytest.approx(10 / 0.9999)


@pytest.mark.slow
def test_the_uncertainty_of_simulation_replaces_that_of_the_specification():
    text = (CONFIGS / "three_state.yaml").read_text() + '  h: ["0.05*cos(t)"]\n'
    _, result = certified("three_state")
    found = setting_of(load_text(text), result)
    assert found.h != setting("three_state").h


def test_kinds_are_named_alike_everywhere():
    assert set(asking.words_of(tubecert.simulate)["gains"].words) == set(words_of(ADAPTIVE))


@pytest.mark.slow
@pytest.mark.parametrize(("controller", "wanted"), [("l1", "26"), ("l1", "B"), ("reference", "26")])
def test_a_loop_takes_the_gains_of_the_kind_that_is_asked_for(controller, wanted):
    where = setting("two_state", "0.4")
    loop = loop_of(where, controller, Choice(source=wanted))
    recipe = where.result.proof.of[name_of(wanted).key]
    assert loop.gains.bandwidth == float(recipe.bandwidth)
    assert loop.gains_are == f"certified by {name_of(wanted)}"
    assert (loop.promise is None) == (controller == "reference")


@pytest.mark.parametrize(
    "change",
    [
        lambda result: result["tube"].pop("rho"),
        lambda result: result["constants"].update(h=[1, 2]),
        lambda result: result["tube"].update(rho="1/0"),
        lambda result: result["metric"].update(lower=[]),
        lambda result: result.update(proof=None),
        lambda result: result["distance"].pop("verdict"),
        lambda result: result.update(surprise=1),
    ],
)
def test_what_recheck_refuses_simulate_refuses_with_the_same_code(tmp_path, change):
    broken = certified("flat")[1].to_json()
    change(broken)
    path = written(tmp_path, broken)
    error, finding = refused(tubecert.read, path)
    assert (error.exit_code, finding.code) == (ExitCode.INVALID, "TC603")
    error, finding = refused(recheck, (tmp_path / "c.json").read_text(), path, 10)
    assert (error.exit_code, finding.code) == (ExitCode.INVALID, "TC603")


@pytest.mark.parametrize("part", ["tube", "metric", "h"])
def test_what_simulation_needs_is_there_or_told(part):
    spec, result = certified("flat")
    without_h = {name: item for name, item in result.constants.items() if name != "h"}
    change = {"constants": without_h} if part == "h" else {part: None}
    error, finding = refused(setting_of, spec, replace(result, **change))
    assert (error.exit_code, finding.code) == (ExitCode.INVALID, "TC603")


@pytest.mark.slow
def test_half_widths_keep_their_states_through_a_file(tmp_path):
    """A file has its keys in alphabetical order, whatever the order of the states."""
    text = FLAT.replace("[p, v]", "[v, p]").replace(
        '[v, "-p - v"], B: [[0], [1]]', '["-p - v", v], B: [[1], [0]]'
    )
    spec = load_text(
        text.replace("at: [0.05, 0]", "at: [0, 0.05]").replace(
            "[[1, -0.5], [-0.5, 1]]", "[[1.1, -0.5], [-0.5, 1]]"
        )
    )
    result = pipeline.certify(spec, pipeline.Options())
    read = tubecert.read(written(tmp_path, result)).result
    assert list(read.tube.half_widths) == ["p", "v"]
    for found in (result, read):
        widths = setting_of(spec, found).box
        assert widths.tolist() == [result.tube.half_widths[name] for name in ("v", "p")]
        assert widths[0] > 1.02 * widths[1]


def test_an_uncertain_input_gain_is_refused_by_every_loop():
    text = FLAT.replace("system: {", "system: {parameters: {g: [0.96, 1.04]}, ").replace("[1]]", '["g"]]', 1)
    spec = load_text(text)
    where = replace(setting("flat"), spec=spec, model=build(spec))
    for controller in ("ccm", "l1", "reference"):
        error, finding = refused(loop_of, where, controller, Choice())
        assert (error.exit_code, finding.code) == (ExitCode.INVALID, "TC705")
        assert "parameters known by ranges stand in B" in finding.message
        assert finding.location is not None
