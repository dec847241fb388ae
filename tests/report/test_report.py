"""The report: what it says, and that it says so in any terminal and in none."""

import re
from decimal import Decimal
from fractions import Fraction
from io import StringIO

import pytest
from certificates import certified, refuted_gains, refuted_metric, undecided
from hypothesis import given
from hypothesis import strategies as st
from rich.text import Text

from tubecert.certificate import seal
from tubecert.certificate.result import Certificate
from tubecert.digits import down, end, exact, in_unit, percent, short, up
from tubecert.findings import Finding, Location, Severity
from tubecert.records import to_json
from tubecert.report import findings
from tubecert.report.certificate_page import page_of
from tubecert.report.terminal import Terminal
from tubecert.report.text import headline, screen

RESULTS = (certified, refuted_metric, refuted_gains, undecided)
ANSI = re.compile(r"\x1b\[[0-9;]*m")


class Screen(StringIO):
    def isatty(self):
        return True


def terminal(*, width=100, colored=False):
    return Terminal(stream=None, colored=colored, width=width, interactive=colored)


def shown(result, *, verbose=False, **looks):
    read = Certificate.from_json(seal(result, {}))
    files = [("certificate", "out/pendulum.certificate.json")]
    return terminal(**looks).text(screen(page_of(read), files, verbose=verbose))


def line(result):
    return terminal(width=200).text(headline(page_of(Certificate.from_json(seal(result, {}))))).rstrip("\n")


@pytest.mark.parametrize("make", RESULTS)
@pytest.mark.parametrize("verbose", [False, True])
@pytest.mark.parametrize("width", [80, 100, 120])
def test_plain_text_is_plain(make, verbose, width):
    text = shown(make(), verbose=verbose, width=width)
    assert "\x1b" not in text
    assert text.isascii()
    for row in text.splitlines():
        assert row == row.rstrip()
    assert max(map(len, text.splitlines())) <= width


@pytest.mark.parametrize("make", RESULTS)
def test_colour_changes_nothing_but_colour(make):
    colored = shown(make(), verbose=True, colored=True)
    assert "\x1b[" in colored
    assert ANSI.sub("", colored) == shown(make(), verbose=True)


def test_the_verdict_comes_first_with_its_numbers():
    assert line(certified()) == "certified pendulum: rho = 0.04124; omega = 41.82 rad/s, Gamma = 1.394e7"
    for section, numbers in {"distance": "omega = 10.8 rad/s, Gamma = 13800"}.items():
        assert line(certified(decided_by=[section])).endswith(f"rho = 0.04124; {numbers}")
    every = line(certified(decided_by=["conditions_26", "distance"]))
    assert every.count("omega") == 2


def test_what_is_claimed_comes_first_then_the_start_the_tube_and_the_gains():
    text = shown(certified(), width=120)
    first, *rows = text.splitlines()
    assert first == "certified pendulum: the state stays in the tube around the plan for all t >= 0"
    assert rows[0] == "  start       at 0"
    assert rows[1].startswith("  tube        ")
    assert rows[1].endswith("; rho = 0.04124 = 0.03124 (rho_r) + 0.01 (rho_a)")
    assert "  gains       omega = 41.82 rad/s, Gamma = 1.394e7, by certificate A, paper's conditions" in rows
    assert len(rows) < 16
    finite = certified()
    finite["spec"]["effective"]["trajectory"]["horizon"] = "2.5"
    assert "for 0 <= t <= 2.5 s" in shown(finite)
    decided = shown(certified(decided_by=["distance"]))
    assert "long run    |x - x*| <= 0.0123" in decided
    assert "long run" not in shown(finite | {"decided_by": ["distance"]})


def test_a_refusal_names_claim_witness_and_remedy():
    text = shown(refuted_metric(), width=120)
    first, *rest = text.splitlines()
    assert first.startswith("refuted pendulum: metric, contraction: C2 fails at rate ")
    assert "the largest rate that this metric supports is 0.99654" in first
    assert any(row.split() == ["at", "angle", "=", "0.1,", "speed", "=", "-0.25"] for row in rest)
    assert any(" ".join(row.split()).startswith("help lower metric.rate to 0.99654") for row in rest)
    assert "stays in the tube" not in text


def test_failing_gains_refute_no_tube():
    text = " ".join(shown(refuted_gains()).split())
    assert text.startswith(
        "refuted pendulum: A (26a): the initial error and the filter's share must fit into rho_r: it needs "
    )
    assert "does not prove that the state leaves the tube" in text
    assert "stays in the tube" not in text


def test_undecided_is_shown_as_neither():
    text = shown(undecided())
    assert text.startswith("undecided pendulum: ")
    assert "neither proven nor refuted" in text
    assert "stays in the tube" not in text


def test_gains_of_different_certificates_do_not_mix():
    table = shown(certified(), verbose=True).split("\nGains\n")[1].split("\n\n")[0].splitlines()
    rows = [row for row in table if "41.82" in row]
    assert len(rows) == 1
    assert "1.394e7" in rows[0]
    assert "*" in rows[0]
    assert "0.0041 % 26c" in rows[0]
    assert not any("0.0906" in row and "Gamma" in row for row in table)


def test_verbose_shows_constants_and_assumptions():
    brief, full = shown(certified()), shown(certified(), verbose=True)
    assert "smallest eigenvalue of the metric M" not in brief
    for words in (
        "smallest eigenvalue of the metric M",
        ">= 3.81234",
        "<= 0.1",
        "exact",
        "at t = 0.785398 s",
    ):
        assert words in full
    assert "the curve" not in full, "a terminal has none"
    for words in ("the feedback is the least k of the quadratic program", "the claim is for all t >= 0"):
        assert words in " ".join(full.split())


def test_what_is_declared_is_said_to_be_believed():
    text = shown(certified(declared={"h": 0.1, "h_t": 0.2}))
    assert "declared    h <= 0.1, h_t <= 0.2: believed as given" in text


def test_the_report_says_where_the_certificate_is():
    assert "certificate out/pendulum.certificate.json" in shown(certified())
    assert seal(certified(), {})["hash"] in shown(certified(), verbose=True)


def test_an_unbounded_constant_is_shown_as_unknown():
    result = certified()
    result["constants"]["zeta_1"] |= {"above": None, "below": None}
    assert "<= -" in shown(result, verbose=True)


@given(st.floats(min_value=1e-12, max_value=1e12), st.integers(1, 8))
def test_rounding_keeps_bounds_true(value, digits):
    true = Decimal(repr(value))
    assert Decimal(down(value, digits)) <= true <= Decimal(up(value, digits))
    assert abs(Decimal(short(value, digits)) - true) <= true * Decimal(10) ** (1 - digits)
    assert Decimal(exact(value)) == true


def test_numbers_are_short():
    assert [short(v) for v in (0, 41.82, 13940000.0, 1e-9, 123456.0, -0.5, None)] == [
        "0", "41.82", "1.394e7", "1e-9", "123500", "-0.5", "-",
    ]  # fmt: skip
    assert exact("4/3") == "4/3"
    assert exact("0.1234567890123456789") == "0.1234567890123456789"
    assert short("4/3") == "1.333"
    assert percent(0.12345) == "12.3 %"
    assert percent(-0.5) == "-50 %"
    assert percent(None) == "-"
    assert short(float("inf")) == "-"


def finding(severity=Severity.ERROR):
    place = Location(file="plant.yaml", line=3, column=5, source="f: [x^2]", width=3)
    return Finding(
        code="TC109", message="^ is not allowed", severity=severity, location=place, help="write **"
    )


def test_findings_are_printed_as_they_are_and_counted():
    text = terminal(width=20).text(findings.render([finding(), finding(Severity.WARNING)]))
    assert text == f"{finding()}\n{finding(Severity.WARNING)}\n1 error, 1 warning\n"
    colored = terminal(colored=True, width=20).text(findings.render([finding()]))
    assert "\x1b[" in colored
    assert ANSI.sub("", colored) == f"{finding()}\n1 error\n"


def test_findings_as_data():
    bare = {"code": "TC100", "severity": "error", "message": "no"}
    assert to_json(findings.as_data(Finding(code="TC100", message="no"))) == bare
    place = {"file": "plant.yaml", "line": 3, "column": 5, "help": "write **"}
    own = {"code": "TC109", "severity": "error", "message": "^ is not allowed", **place}
    assert to_json(findings.as_data(finding())) == own


@pytest.mark.parametrize(
    ("stream", "color", "environment", "colored"),
    [
        (StringIO(), None, {}, False),
        (StringIO(), "always", {}, True),
        (Screen(), None, {}, True),
        (Screen(), "auto", {"NO_COLOR": "1"}, False),
        (Screen(), "auto", {"NO_COLOR": ""}, True),
        (Screen(), "auto", {"TERM": "dumb"}, False),
        (Screen(), "always", {"NO_COLOR": "1"}, True),
        (Screen(), "never", {}, False),
        (None, None, {}, False),
    ],
)
def test_when_to_colour(stream, color, environment, colored):
    found = Terminal.of(stream, color, environment)
    assert found.colored is colored
    assert ("\x1b" in found.text(Text("x", style="red"))) is colored
    found.show(Text("x"))


def test_pipes_have_a_fixed_width():
    assert Terminal.of(StringIO(), None, {}).width == 100
    for columns, width in (("72", 72), ("5", 40), ("9" * 5000, 120), ("0", 100), ("-5", 100), ("wide", 100)):
        assert Terminal.of(StringIO(), None, {"COLUMNS": columns}).width == width


def test_an_end_of_a_range_is_exact_and_a_multiple_of_pi_in_degrees():
    assert end(Fraction(-1, 10)) == "-0.1"
    assert end(Fraction(1, 3)) == "1/3"
    assert end(Fraction("0.5235987755982988730771072305")) == "30 deg"
    assert end(Fraction("0.5235987755982988730801072305")) == "0.523598775598"
    assert (in_unit("30 deg", "rad/s"), in_unit("30 deg", "1/s"), in_unit("3", "")) == (
        "30 deg/s",
        "30 deg 1/s",
        "3",
    )


def test_a_rho_a_that_is_cut_down_is_told():
    """Within half-widths rho_a is what the start leaves, at most."""
    result = certified()
    words = "--rho-a 5 is more than the start leaves"
    assert words not in shown(result)
    result["overrides"]["rho_a"] = 5
    assert words in " ".join(shown(result).split())
    result["overrides"]["rho_a"] = None
    result["spec"]["effective"]["tube"] = {"rho_a": "4"}
    assert words.replace("--rho-a 5", "tube.rho_a 4") in " ".join(shown(result).split())


def test_half_widths_narrower_than_asked_for_are_told_with_what_limits_the_tube():
    """A magnet's gap was asked to be 1.5 mm at most and came out as .67 mm, without a word: the current had no room."""
    result = certified()
    states = result["spec"]["effective"]["system"]["states"]
    first, second = states[:2]
    low, high = map(float, map(Fraction, result["safe_set"][second]))
    result["plan"]["samples"] = {"t": [0.0], "x": [[0.0] * len(states)]}
    asked = result["spec"]["effective"]["tube"] = {"half_widths": {first: "0.5"}}
    result["tube"]["half_widths"] = {first: 0.2, second: 0.97 * min(-low, high)}
    told = " ".join(shown(result).split())
    assert f"wish at most {first} 0.5" in told
    assert f"; {second} limits the tube: it goes nearly to the edge of the safe set" in told
    result["tube"]["half_widths"][second] = 0.5 * min(-low, high)
    assert "limits the tube" not in shown(result)
    asked["half_widths"][second] = str(0.5 * min(-low, high))
    told = " ".join(shown(result).split())
    assert f"; {second} limits the tube, with the half-width that is asked for" in told
    result["tube"]["half_widths"][first] = 0.499
    assert "wish" not in shown(result)


def test_gains_that_do_not_serve_are_not_told_as_those_of_a_certificate():
    """`gains ..., by certificate A, paper's conditions` stood below `refuted`, and what would lower them beside it."""
    text = shown(refuted_gains(), width=120)
    assert (
        "  gains       omega = 5 rad/s, Gamma = 100, refuted by certificate A, paper's conditions\n" in text
    )
    assert "That condition is proven not to hold." in text, "it stands above, not below"
    limited = certified(verdict="undecided")
    reason = {**undecided()["reasons"][0]}
    limited["reasons"] = [reason, *limited["reasons"]]
    assert "sets the bandwidth" in shown(certified())
    assert "sets the bandwidth" not in shown(limited)
