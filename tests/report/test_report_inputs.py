"""What reports, `check --certify` and the schema say of inputs with limits."""

from io import StringIO

import pytest
from proven import proven
from rich.console import Console

from tubecert.certificate.result import Certificate
from tubecert.checking.expectations import compared, outcome
from tubecert.report.certificate_page import page_of
from tubecert.report.markdown import render_page
from tubecert.report.text import screen
from tubecert.spec import load_text

ONE = """
tubecert: 1
name: one
system: {states: [x], inputs: [u], units: {u: N}, f: ["-x"], B: [[1]]}
safe_set: {x: [-1, 1]}
uncertainty: {h: ["0.1*sin(t)"]}
trajectory: {kind: equilibrium, at: [0.2], input: [0.2], horizon: 3}
tube: {epsilon: 0.1, rho_a: 0.1}
metric: {dual_metric: [[1]], rate: 0.9}
"""


def certificate_of(text, **options):
    return Certificate.from_json(proven(text, **{"conditions": "distance", **options}))


def told(text, **options):
    out = StringIO()
    made = certificate_of(text, **options)
    Console(file=out, width=400).print(*screen(page_of(made), [], verbose=False))
    return out.getvalue()


@pytest.mark.slow
def test_the_report_says_where_an_input_stays_and_what_takes_it_there():
    shown = told(ONE + "limits: {u: [-1, 1]}\n")
    assert "input u     stays within [0.09999, 0.3001] N of [-1, 1]: 30.1 % used" in shown


@pytest.mark.slow
def test_without_limits_it_has_no_such_section():
    assert "input u" not in told(ONE)


@pytest.mark.slow
def test_what_is_used_is_told_of_the_middle_of_the_limits():
    """[0.1, 0.3] in [0, 0.8]: 0.3 from the middle, which is 0.4 from the limits."""
    result = certificate_of(ONE + "limits: {u: [0, 0.8]}\n").result
    assert result.inputs[0].use(["distance"]) == pytest.approx(0.75, abs=1e-3)
    assert result.inputs[0].use(["conditions_26", "distance"]) >= result.inputs[0].use(["distance"])
    assert result.inputs[0].use([]) is None


@pytest.mark.slow
def test_a_plan_beyond_its_limits_is_told_as_such():
    shown = told(ONE + "limits: {u: [0.3, 0.8]}\n")
    assert "the plan itself has u* = 0.2, below 0.3" in shown
    assert "The plan itself asks more of an input than its limits allow" in shown
    assert "plan with more room to the limits" in shown


@pytest.mark.slow
def test_an_input_that_may_go_too_far_is_told_with_what_takes_it_there():
    shown = told(ONE + "limits: {u: [-1, 0.25]}\n")
    assert "undecided one: limits of u: it may reach 0.3" in shown
    assert "above 0.25: u* reaches 0.2, to which feedback may add 0 and adaptation 0.1" in shown
    assert "input u     is proven to stay within" in shown


def test_the_page_has_a_row_for_every_loop():
    page = page_of(certificate_of(ONE + "limits: {u: [-1, 1]}\n"))
    section = next(section for section in page.sections if section.key == "inputs")
    table, figures = section.blocks
    assert [figure.key for figure in figures.figures] == ["input-0"]
    assert [row[4].text for row in table.rows] == ["0 no adaptation", "A paper's conditions", "B distance"]
    assert table.rows[0][6].text == "20.1 %"
    assert "| u (N) | \\[-1, 1\\] | certified |" in render_page(page)


@pytest.mark.slow
@pytest.mark.parametrize(("locked", "findings"), [("[0.29, 0.31]", 0), ("[0, 0.2]", 1)])
def test_the_largest_share_can_be_locked(locked, findings):
    text = ONE + f"limits: {{u: [-1, 1]}}\nexpect: {{verdict: certified, inputs: {locked}}}\n"
    found = outcome(certificate_of(text).result)
    assert dict(found.numbers)["inputs"] == pytest.approx(0.3, abs=1e-3)
    assert "limits of u" in {claim.name for claim in found.claims}
    assert len(compared(load_text(text), found)) == findings


@pytest.mark.slow
def test_a_lock_without_limits_is_not_met():
    text = ONE + "expect: {inputs: [0, 1]}\n"
    (finding,) = compared(load_text(text), outcome(certificate_of(text).result))
    assert finding.code == "TC503"
