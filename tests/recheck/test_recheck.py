"""Recheck: shipped certificates are confirmed; changed ones, and those of a broken producer, are not."""

import copy
import json
from fractions import Fraction
from pathlib import Path

import proven
import pytest
import rechecked
import tampers
from commands import run
from flint import ctx
from rechecked import examine, respecified, sealed, written
from systems import SMALL

import tubecert.bounds.start
import tubecert.conditions.kernels
import tubecert.conditions.rates
import tubecert.conditions.wind
import tubecert.enclosure.interval
import tubecert.expression.calculus
import tubecert.model
from tubecert import pipeline, spec
from tubecert.errors import ExitCode, TubecertError
from tubecert.model import ControlAffineModel
from tubecert.recheck.constants import OVER_TUBE, bounded
from tubecert.recheck.cover import stated
from tubecert.recheck.run import Examined, Recheck, recheck
from tubecert.report.rechecked import page_of

CONFIGS = [
    path
    for path in sorted((Path(__file__).parents[2] / "configs").glob("*state*.yaml"))
    if not path.stem.startswith("hardware_")
]
THREE = next(path for path in CONFIGS if path.stem == "three_state")
TWO = next(path for path in CONFIGS if path.stem == "two_state")


def shipped(path):
    return rechecked.shipped(path.stem)


@pytest.mark.slow
@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_a_shipped_certificate_is_confirmed(path):
    found = examine(shipped(path))
    assert [claim for claim in found.claims if not claim.outcome.holds] == []
    assert found.exit_code == ExitCode.CERTIFIED
    assert len(found.claims) > 45


@pytest.mark.slow
@pytest.mark.parametrize("path", CONFIGS[:3], ids=lambda path: path.stem)
def test_the_bounds_of_both_arithmetics_agree_within_the_gap(path):
    """Above: confirmed (the test before). A bound a little below the producer's `below` is never confirmed."""
    case = rechecked.case_of(shipped(path), 400)
    constants = case.constants
    refuted = 0
    with ctx.workprec(64):
        for name in OVER_TUBE:
            side = "above" if name == "lower" else "below"
            value = getattr(constants[name], side)
            if value <= 0:
                continue
            within = value * Fraction(1001 if side == "above" else 999, 1000)
            outcome = bounded(case.place, name, within, Fraction(5))
            assert not outcome.holds, name
            refuted += outcome.verdict == "contradicted"
    assert refuted >= 10


@pytest.mark.slow
@pytest.mark.parametrize(("path", "count"), [(THREE, 150), (TWO, 40)], ids=["three_state", "two_state"])
def test_a_changed_field_is_never_confirmed_unless_it_is_harmless(path, count):
    refused, accepted, wrong = tampers.campaign(shipped(path), count, seed=7)
    assert wrong == []
    assert refused > count / 3
    assert accepted  # harmless changes are not refused


@pytest.mark.slow
@pytest.mark.parametrize(("path", "count"), [(THREE, 200), (TWO, 100)], ids=["three_state", "two_state"])
def test_a_changed_structure_is_never_confirmed_unless_it_is_harmless(path, count):
    """Keys removed, added, renamed, moved; types; extreme numbers; names of other kinds; all hashes made right."""
    refused, accepted, wrong = tampers.structural_campaign(shipped(path), count, seed=11)
    assert wrong == []
    assert refused > 0.8 * count
    assert refused + sum(accepted.values()) == count


@pytest.mark.slow
def test_every_constant_that_is_understated_is_named():
    document, memory = shipped(THREE), {}
    examine(document, memory=memory)
    for name, entry in document["result"]["constants"].items():
        side, factor = ("below", 1.05) if name == "lower" else ("above", 0.95)
        if not entry[side] or name == "zeta_3":
            continue
        changed = copy.deepcopy(document)
        changed["result"]["constants"][name][side] *= factor
        found = examine(sealed(changed), 2_000, memory)
        failing = [claim.name for claim in found.claims if not claim.outcome.holds]
        assert any(name in claim or claim == "A: derived constants" for claim in failing), name
        assert found.exit_code == ExitCode.NOT_CERTIFIED, name


@pytest.mark.slow
def test_a_change_without_the_hash_is_contradicted():
    document = shipped(THREE)
    document["result"]["reasons"][0]["margins"]["26a"] = 0.5
    assert examine(document).failing.name == "the hash is that of the result"


@pytest.mark.slow
def test_what_is_certified_shows_no_point():
    """A report would print it beside the verdict, and nobody has examined it."""
    document = copy.deepcopy(shipped(THREE))
    assert examine(sealed(document)).exit_code == ExitCode.CERTIFIED
    document["result"]["reasons"][0]["at"] = {"x": [99.0, 99.0, 99.0]}
    found = examine(sealed(document))
    assert found.exit_code == ExitCode.NOT_CERTIFIED
    assert found.failing.name == "the verdict follows from the sections"


def half_slope(e, d):
    return true_slope(e, d) * Fraction(1, 2) if e.op == "sin" else true_slope(e, d)


def narrow_sine(x):
    value = true_sine(x)
    return tubecert.enclosure.interval.Interval(value.lo * 0.9, value.hi * 0.9)


def half_filter_error(n, terms, omega, g):
    gain = n.DBpx * terms.speed + (omega + g) * n.DBp
    return gain * tubecert.conditions.wind.prediction_error(terms.hs, terms.s1, g)


def reduced(value, factor):
    """An interval or floats, made smaller."""
    exact = tubecert.enclosure.interval.Interval.exact
    return value * (exact(factor) if isinstance(value, tubecert.enclosure.interval.Interval) else factor)


def small_kernel(c, w, s0, s1):
    return reduced(true_kernel(c, w, s0, s1), 0.9)


def small_supremum(D):
    return reduced(true_supremum(D), 0.97)


def short_segment(self, suprema, metric):
    found = true_segment(self, suprema, metric)
    return type(found)(below=found.below * 0.9, above=found.above * 0.9)


def without_rate(self):
    return self.drift_form


true_slope = tubecert.expression.calculus._slope
true_sine = tubecert.enclosure.interval.sin
true_kernel = tubecert.conditions.rates.tight_kernel
true_supremum = tubecert.conditions.kernels._supremum
true_segment = tubecert.bounds.start.KnownStart.distance

BUGS = {
    "derivative of sin": (tubecert.expression.calculus, "_slope", half_slope, "h_t"),
    "interval sine": (tubecert.enclosure.interval, "sin", narrow_sine, "h"),
    "filter error": (tubecert.conditions.rates, "filter_error", half_filter_error, "A: derived"),
    "kernel J": (tubecert.conditions.rates, "tight_kernel", small_kernel, "A: derived"),
    "sup D": (tubecert.conditions.kernels, "_supremum", small_supremum, "A: ultimate|B: sup D"),
    "length of the segment": (
        tubecert.bounds.start.KnownStart,
        "distance",
        short_segment,
        "initial_distance",
    ),
    "F without the rate": (ControlAffineModel, "F", property(without_rate), "feedback_gain"),
}


@pytest.mark.slow
@pytest.mark.parametrize("bug", BUGS)
def test_a_bug_in_the_producer_is_caught(bug, monkeypatch):
    place, name, broken, claims = BUGS[bug]
    system = spec.load_text(SMALL)
    with monkeypatch.context() as patch, proven.barely():
        patch.setattr(place, name, broken)
        result = pipeline.certify(system, pipeline.Options(conditions="all")).to_json()
    assert result["verdict"] == "certified", "the bug must pass the producer to be of interest"
    found = examine(written(result), 5_000)
    assert found.exit_code != ExitCode.CERTIFIED
    failing = [claim.name for claim in found.claims if not claim.outcome.holds]
    assert any(part in claim for part in claims.split("|") for claim in failing), failing


HEAD = '{"format": "tubecert-certificate/3"'
RUN = HEAD + ', "run": {}, "hash": "x", "result": {"verdict": '
NINES = '{"x": ' + "9" * 10_000 + "}"
HIDDEN = '{"x": "' + r"\"" + "]" * 10**5 + '", "y": ' + "[" * 10**5 + "]" * 10**5 + "}"
NO_CERTIFICATES = {
    "TC600": ["", "{", HEAD + ', "format": "x"}', '{"x": NaN}', '{"x": 1e999}', "[" * 10**5, HIDDEN, NINES],
    "TC601": ["{}", "[]", '"tubecert-certificate/3"'],
    "TC602": [f'{{"format": "tubecert-certificate/{k}"}}' for k in ("1", "4", "9" * 24)],
    "TC603": [HEAD + "}", RUN + '"maybe"}}', RUN + '"certified"}}'],
}


@pytest.mark.parametrize(
    ("text", "code"), [(text, code) for code, texts in NO_CERTIFICATES.items() for text in texts]
)
def test_what_is_no_certificate_is_named(text, code):
    with pytest.raises(TubecertError) as raised:
        recheck(text, "file.json")
    assert raised.value.exit_code == ExitCode.INVALID
    assert raised.value.findings[0].code == code


def test_a_claim_is_one_line_whatever_its_name_holds():
    claim = Examined("c\nd", stated(False, "e\nf"))
    page = repr(page_of(Recheck(stated="certified", hash="a\nb", claims=(claim,), unread=()), "file"))
    assert page.count(r"\\n") == page.count(r"\n") == 5


OTHERS = {
    "uncertainty": (lambda e: e["uncertainty"].update(h=["0.11*sin(2*t)"]), "h <="),
    "dynamics": (lambda e: e["system"]["f"].__setitem__(0, "x3 - 0.9*x1"), "C2"),
    "start": (lambda e: e["initial_state"].update(at=["0.011", "-0.01", "0.01"]), "rho ="),
    "metric": (lambda e: e["metric"]["dual_metric"][0].__setitem__(0, "0.2"), "C"),
}


@pytest.mark.slow
@pytest.mark.parametrize("other", OTHERS)
def test_a_certificate_forged_for_another_system_fails_by_name(other):
    change, claim = OTHERS[other]
    found = examine(respecified(shipped(THREE), change), 5_000, to_first_failure=True)
    assert found.exit_code == ExitCode.NOT_CERTIFIED
    assert claim in found.failing.name


@pytest.mark.slow
def test_another_metric_in_the_section_alone_is_named():
    document = shipped(THREE)
    document["result"]["metric"]["dual_metric"][0][0] = "0.20366"
    assert "dual_metric" in examine(sealed(document), 100).failing.outcome.why


@pytest.mark.slow
def test_a_refuted_metric_is_confirmed_at_its_witness():
    text = THREE.read_text(encoding="utf-8").replace("rate: 0.9999", "rate: 1")
    result = pipeline.certify(spec.load_text(text, "faster.yaml"), pipeline.Options()).to_json()
    assert result["verdict"] == "refuted"
    found = examine(written(result))
    assert found.exit_code == ExitCode.NOT_CERTIFIED
    assert found.failing is None
    result["reasons"][0]["at"]["x"] = [0.0, 0.0, 0.0]
    assert examine(written(result)).failing is not None
    result["verdict"] = "certified"
    with pytest.raises(TubecertError):
        examine(written(result))


@pytest.fixture
def small(tmp_path):
    path = tmp_path / "small.yaml"
    path.write_text(SMALL, encoding="utf-8")
    return path


@pytest.fixture
def certified(tmp_path):
    path = tmp_path / "small.certificate.json"
    path.write_text(json.dumps(rechecked.certified(SMALL)), encoding="utf-8")
    return path


def command(*arguments):
    return run("recheck", *arguments)


@pytest.mark.slow
def test_the_command_confirms_and_says_so(certified, small):
    done, brief = command(certified, "--spec", small, "-v"), command(certified)
    assert done.exit_code == 0
    words = "".join(done.stdout.split())
    assert words.startswith(f"confirmed{certified}:thecertificatesayscertified;")
    assert f"belongsto{small}" in words
    assert "feedback_gain <=" in done.stdout
    assert len(brief.stdout.splitlines()) <= 15
    assert "more with -v" in brief.stdout
    assert "Further" not in command(certified, "-q").stdout


@pytest.mark.slow
def test_the_command_answers_in_json(certified):
    data = json.loads(command(certified, "--json").stdout)
    assert data["verdict"] == "confirmed"
    assert data["first_failing"] is None
    assert {claim["verdict"] for claim in data["claims"]} == {"confirmed"}


@pytest.mark.slow
def test_another_specification_is_a_named_error(certified):
    done = command(certified, "--spec", TWO)
    assert done.exit_code == ExitCode.INVALID
    assert "TC604" in done.stderr
    assert "system" in done.stderr


@pytest.mark.slow
def test_a_comment_in_the_specification_changes_its_text_only(certified, tmp_path):
    other = tmp_path / "commented.yaml"
    other.write_text("# mine\n" + SMALL, encoding="utf-8")
    done = command(certified, "--spec", other, "-q")
    assert done.exit_code == 0
    assert "the text of the file has changed" in " ".join(done.stdout.split())


@pytest.mark.slow
def test_a_failing_claim_is_named_first(certified):
    document = json.loads(certified.read_text(encoding="utf-8"))
    document["result"]["constants"]["f_x"] |= {"below": 1.3, "above": 1.4}
    certified.write_text(json.dumps(sealed(document)), encoding="utf-8")
    done = command(certified)
    assert done.exit_code == ExitCode.NOT_CERTIFIED
    first, *rows = done.stdout.split("\n  ")
    assert "; first failing claim: f_x <= 1.4: false at x = " in " ".join(first.split())
    assert rows[1].startswith("contradicted  f_x <= 1.4: false at x = ")


@pytest.mark.slow
def test_a_small_budget_is_undecided(certified):
    done = command(certified, "--budget", "3")
    assert done.exit_code == ExitCode.UNDECIDED
    assert "within 3 boxes" in done.stdout


@pytest.mark.parametrize("name", ["nothing.json", "."])
def test_an_unreadable_file_is_one_clear_error(name):
    done = command(name)
    assert done.exit_code == ExitCode.INVALID
    assert "TC600" in done.stderr
