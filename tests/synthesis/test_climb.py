"""Metrics without a rate: from slow to fast, by what a certification with them comes to, or nothing is written."""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import pytest
from commands import run
from hypothesis import given, settings
from hypothesis import strategies as st
from texts import CONFIGS, OLDER_METRIC

from tubecert import pipeline
from tubecert.certificate.result import MetricRow
from tubecert.claims.advice import ConstantInputs, MeasureTube
from tubecert.claims.failures import NoneCertified, NothingFound, NotWritable, Proven
from tubecert.claims.statements import TubeInSafeSet
from tubecert.enclosure.constant import Constant
from tubecert.expression import scan
from tubecert.model import build
from tubecert.pipeline import Deadline, Listeners, Options, synthesis
from tubecert.pipeline.climb import Climb, slow_scale
from tubecert.pipeline.synthesised import Row, Synthesised
from tubecert.report.synthesis import _compared
from tubecert.spec import Synthesis, load, load_text
from tubecert.verdict import Verdict

ROBOTS = Path(__file__).parents[1] / "specs" / "robots"
BARE = Synthesis(rate=None, objective="adaptation")
BY_B = Options(conditions="distance")


def robot(name):
    return load(str(ROBOTS / f"{name}.yaml"))


def synth(*arguments):
    return run("synth", "--no-progress", *arguments, catch_exceptions=False)


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
@pytest.mark.parametrize("name", ["pendulum", "car"])
def test_a_metric_for_nothing_but_the_equations_certifies(name):
    """Without a rate, `synth` used to write a metric of the largest one, which nothing certifies."""
    found = pipeline.synthesise(robot(name), BARE, BY_B)
    assert found.verdict is Verdict.CERTIFIED
    certified = pipeline.certify(found.spec, BY_B)
    assert certified.verdict is Verdict.CERTIFIED
    (pair,) = certified.deciding().values()
    rate = float(found.file.rate)
    assert float(pair.bandwidth) < 20 * rate
    asked = [(row.demand, row.rate) for row in found.rows if row.verdict is Verdict.CERTIFIED]
    assert min(asked)[1] == found.file.rate
    assert 0.3 < rate < 10
    assert found.limits.slower.cause == "distance"
    assert found.limits.slower.factor > 1
    assert found.limits.faster is not None


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_certify_finds_a_metric_by_itself_and_recheck_confirms_it(tmp_path):
    spec, target = str(ROBOTS / "pendulum.yaml"), str(tmp_path / "p.json")
    for arguments in (
        ["certify", spec, "--conditions", "B", "--no-progress", "-o", target],
        ["recheck", target, "--spec", spec],
        ["report", target, "-o", str(tmp_path / "p.html")],
    ):
        done = run(*arguments, catch_exceptions=False)
        assert done.exit_code == 0, done.output
    written = json.loads(Path(target).read_text())
    assert written["notes"]["synthesis"]["search"]["limits"]["slower"]["cause"] == "distance"
    assert written["result"]["synthesis"]["asked"]["coordinates"] == "auto"


@pytest.mark.slow
def test_the_kind_that_decides_is_what_a_metric_is_chosen_for():
    options = replace(BY_B, conditions="26")
    found = pipeline.synthesise(robot("pendulum"), BARE, options)
    assert pipeline.certify(found.spec, options).verdict is Verdict.CERTIFIED
    rows = [row for row in found.rows if row.verdict is Verdict.CERTIFIED]
    best = min(rows, key=lambda row: row.score("adaptation"))
    assert found.file.rate == best.rate


@pytest.mark.slow
def test_where_nothing_certifies_nothing_is_written(tmp_path):
    text = (ROBOTS / "pendulum.yaml").read_text().replace("epsilon: 0.1", "epsilon: 1")
    path, target = tmp_path / "wide.yaml", tmp_path / "wide.json"
    path.write_text(text)
    target.write_text(OLDER_METRIC)
    done = synth(path, "-o", target)
    assert done.exit_code == 4
    assert target.read_text() == OLDER_METRIC
    assert "certifies: the tube leaves the safe set" in " ".join(done.stdout.split())
    assert "reduce epsilon" in done.stdout
    found = pipeline.synthesise(load_text(text), BARE, BY_B)
    failure = found.reason.claim.failure
    assert isinstance(failure, NoneCertified)
    assert isinstance(failure.slow, TubeInSafeSet)
    assert failure.slowest < failure.fastest
    assert found.file is None


@pytest.mark.slow
def test_where_radii_of_unlike_states_do_not_serve_another_tube_is_tried_and_told():
    text = (ROBOTS / "pendulum.yaml").read_text()
    text = text.replace("epsilon: 0.1", "epsilon: 100").replace("[u]", "[u]\n  units: {q: rad, w: rad/s}")
    found = pipeline.synthesise(load_text(text), BARE, BY_B)
    (told,) = found.reason.relax
    assert isinstance(told, MeasureTube)
    widths = ", ".join(f"{name}: {width}" for name, width in told.half_widths.items())
    tube = text[text.index("tube: {") :].split("}")[0] + "}"
    again = pipeline.synthesise(
        load_text(text.replace(tube, f"tube: {{half_widths: {{{widths}}}}}")), BARE, BY_B
    )
    assert again.verdict is Verdict.CERTIFIED
    assert any(row.counts for row in again.rows)


@pytest.mark.slow
def test_a_certificate_that_says_so_is_read_and_rechecked(tmp_path):
    text = (ROBOTS / "pendulum.yaml").read_text().replace("epsilon: 0.1", "epsilon: 1")
    (tmp_path / "wide.yaml").write_text(text)
    target = str(tmp_path / "wide.json")
    arguments = ["certify", str(tmp_path / "wide.yaml"), "--no-progress", "-o", target]
    done = run(*arguments, catch_exceptions=False)
    assert done.exit_code == 4
    assert json.loads(Path(target).read_text())["result"]["reasons"][0]["failure"]["id"] == "none_certified"
    for command in ("recheck", "report"):
        again = run(command, target, catch_exceptions=False)
        assert again.exit_code in (0, 4), again.output


class Valley:
    """Metrics whose demand falls with the rate, up to where the tube leaves the safe set."""

    bandwidth = 10

    def __init__(self, least, most, reach=1e9):
        self.least, self.most, self.reach, self.asked = least, most, reach, []

    def __call__(self, rate, floor, full):
        self.asked.append(rate)
        if rate > self.reach or floor == "input":
            return None
        fits = self.least <= rate <= self.most
        claim = None if fits else TubeInSafeSet(radius=Fraction(1), state="x", side="upper", excess=0.1)
        return Row(
            rate=rate,
            floor=floor,
            degree=0,
            condition_number=float(rate),
            verdict=Verdict.CERTIFIED if fits else Verdict.REFUTED,
            claim=claim,
            bandwidth=self.bandwidth * float(rate),
            adaptation_rate=1 / float(rate) if fits else None,
            demand=1 / float(rate) if fits else None,
            metric=None,
        )


@pytest.mark.slow
@settings(deadline=None)
@given(most=st.floats(0.05, 1e4), start=st.floats(1e-2, 20))
def test_the_climb_finds_the_edge_of_what_fits(most, start):
    """Whether it starts below, inside or above what certifies."""
    valley = Valley(0, most)
    climb = Climb(valley, "adaptation")
    climb.run(Fraction(start))
    assert climb.best is not None
    reach = min(most, start * 2**11)
    assert reach / 1.3 < climb.best.rate <= most
    assert len(valley.asked) < 40
    assert not climb.limits().faster or climb.limits().faster.cause == "overshoot"


def test_a_narrower_tube_has_to_be_worth_a_slower_rate():
    """The tube narrows for ever, by less and less, while what is needed for it grows without bound."""

    class Narrowing(Valley):
        def __call__(self, rate, floor, full):
            row = super().__call__(rate, floor, full)
            return row and replace(row, rho=1 + float(rate) / 10, ultimate_radius=1 / float(rate))

    climb = Climb(Narrowing(0, 1e9), "tube")
    climb.run(Fraction(1))
    assert 0.02 < climb.best.rate < 0.2
    assert climb.limits() is None


def test_a_higher_degree_has_to_be_worth_a_longer_metric():
    """Of the boat a metric of degree 2 took the place of a constant one for .5 % of Gamma."""
    for share, degree in ((0.95, 0), (0.8, 2)):

        class Longer(Valley):
            def __call__(self, rate, floor, full):
                row = super().__call__(rate, floor, full)
                return replace(row, degree=2, demand=share * row.demand) if row and full else row  # noqa: B023

        climb = Climb(Longer(0, 5), "adaptation")
        climb.run(Fraction(1))
        assert climb.best.degree == degree


@pytest.mark.parametrize(("bandwidth", "floor"), [(0.9, "identity"), (1.1, "input")])
def test_a_metric_of_least_input_gain_is_passed_over_if_its_filter_is_idle(bandwidth, floor):
    """Of the tutorial's arm it would take the place of one whose tube is ten times narrower in w."""

    class Both(Valley):
        def __call__(self, rate, floor, full):
            row = super().__call__(rate, "identity", full)
            if row is None or floor == "identity":
                return row
            return replace(row, floor=floor, demand=row.demand / 2, bandwidth=bandwidth * float(rate))

    climb = Climb(Both(0, 1e9, reach=5), "adaptation")
    climb.run(Fraction(1))
    assert climb.best.floor == floor


def test_a_filter_slower_than_the_contraction_ends_the_climb_and_passes_no_metric_over():
    """Of those that were tried the one of least demand is taken: a slower one used to be, of four times as much."""

    class Idle(Valley):
        def __call__(self, rate, floor, full):
            row = super().__call__(rate, floor, full)
            return row and replace(row, bandwidth=3 / float(rate))

    valley = Idle(0, 1e9)
    climb = Climb(valley, "adaptation")
    climb.run(Fraction(1))
    assert climb.best.rate == max(valley.asked) == 2
    assert (climb.limits().faster.cause, climb.limits().faster.rate) == ("idle", 2)
    assert climb.limits().slower.factor > 1


def test_of_what_is_told_of_other_rates_the_cause_is_one_of_the_numbers():
    """It is beta/sqrt(a), over the rate where that is slower, only if that is more of the tube."""
    row = Valley(0, 9)(Fraction(2), "identity", False)
    for rate, gain, cause in ((1, 2, "distance"), (1, 0.4, "tube"), (4, 2, "input_gain"), (4, 1, "tube")):
        other = replace(row, rate=Fraction(rate), rho=1, input_gain=gain, demand=2 * row.demand)
        climb = Climb(Valley(0, 9), "adaptation")
        climb.tried = {each.rate: each for each in (replace(row, rho=1, input_gain=1), other)}
        limits = climb.limits()
        told = limits.slower if rate < 2 else limits.faster
        assert (told.cause, told.factor) == (cause, 2)


def test_what_is_refuted_is_never_the_best():
    climb = Climb(Valley(10, 5), "adaptation")
    climb.run(Fraction(1))
    assert climb.best is None
    assert climb.limits() is None


def test_a_rate_without_a_metric_ends_the_climb():
    climb = Climb(Valley(0, 100, reach=3), "adaptation")
    climb.run(Fraction(1))
    assert Fraction(2) < climb.best.rate <= 3
    assert climb.limits().faster.cause == "no_metric"


def test_the_degree_that_suffices_is_told():
    """A metric of a higher degree at a faster rate is not looked for once a lower one certifies."""
    asked = []

    class Bending(Valley):
        def __call__(self, rate, floor, full):
            asked.append(climb.degree)
            row = super().__call__(rate, floor, full)
            return row and replace(row, degree=1)

    climb = Climb(Bending(0, 100), "adaptation")
    climb.run(Fraction(1))
    assert asked[0] is None
    assert set(asked[1:]) == {1}


@pytest.mark.slow
def test_a_metric_that_no_file_can_hold_ends_the_search_at_once(monkeypatch):
    """The fields of a moving B are what is long: no rate makes them shorter, other inputs do."""
    spec = load(str(CONFIGS / "state_dependent_input.yaml"))
    monkeypatch.setattr(scan, "MAX_LENGTH", 12)
    found = pipeline.synthesise(replace(spec, metric=None), BARE, BY_B)
    assert found.verdict is Verdict.UNDECIDED
    assert found.reason.claim.failure == NotWritable(code="TC102")
    assert found.reason.relax == (ConstantInputs(),)
    assert len({attempt.rate for attempt in found.attempts}) == 1


# -- where it starts

CHAIN = """
tubecert: 1
name: chain
system: {{states: [p, v], inputs: [u], f: [v, "{slope}*p"], B: [[0], [1]]}}
safe_set: {{p: [-{p}, {p}], v: [-{v}, {v}]}}
uncertainty: {{h: [0]}}
trajectory: {{kind: equilibrium, at: [0, 0]}}
"""


@given(st.sampled_from([0.25, 1, 8, 64]))
def test_the_start_is_free_of_units(scale):
    """A chain of integrators moves its half-widths at v/p = 3; a mode at 2 is a mode at 2."""
    free = load_text(CHAIN.format(slope=0, p=scale, v=3 * scale))
    assert slow_scale(build(free), free) == Fraction(75, 100)
    moving = load_text(CHAIN.format(slope=-4, p=scale, v=3))
    assert slow_scale(build(moving), moving) == Fraction(1, 2)


class Clock:
    """A deadline that passes after so many looks at it."""

    def __init__(self, looks):
        self.left = looks

    def check(self):
        self.left -= 1
        if self.left < 0:
            raise synthesis.OutOfTime


@pytest.mark.slow
def test_a_deadline_leaves_the_best_that_was_proven():
    """It cuts the list of metrics that are tried and no proof; without any there is nothing, and that is said."""
    patient = Clock(10**9)
    whole = pipeline.synthesise(robot("van_der_pol"), BARE, BY_B, Listeners(deadline=patient))
    assert whole.data().search.cut is None
    half = Clock((10**9 - patient.left) // 2)
    cut = pipeline.synthesise(robot("van_der_pol"), BARE, BY_B, Listeners(deadline=half))
    assert cut.data().search.cut == "deadline"
    assert cut.verdict is Verdict.CERTIFIED
    assert {row.rate for row in cut.rows} < {row.rate for row in whole.rows}
    kept = {(row.rate, row.degree): row.adaptation_rate for row in whole.rows}
    assert all(kept[row.rate, row.degree] == row.adaptation_rate for row in cut.rows)
    none = pipeline.synthesise(robot("van_der_pol"), BARE, BY_B, Listeners(deadline=Deadline.after(0)))
    assert (none.verdict, none.cut, none.file) == (Verdict.UNDECIDED, "deadline", None)
    assert isinstance(none.reason.claim.failure, NothingFound)


def interrupt_at_the_second_metric(monkeypatch):
    """The metrics that were judged: one, and one that was interrupted."""
    calls = []
    whole = synthesis.SynthesisRun._row

    def interrupted(self, metric, floor):
        calls.append(metric)
        if len(calls) > 1:
            raise KeyboardInterrupt
        return whole(self, metric, floor)

    monkeypatch.setattr(synthesis.SynthesisRun, "_row", interrupted)
    return calls


@pytest.mark.slow
def test_an_interruption_leaves_the_best_that_was_proven(monkeypatch, tmp_path):
    calls = interrupt_at_the_second_metric(monkeypatch)
    target = tmp_path / "m.json"
    done = synth(ROBOTS / "van_der_pol.yaml", "-o", target)
    assert done.exit_code == 130
    assert "interrupted: this is the best" in done.stdout
    assert json.loads(target.read_text())["rate"] == float(calls[0].rate)


@pytest.mark.slow
def test_an_interruption_tells_what_was_tried_where_nothing_certified(monkeypatch, tmp_path):
    interrupt_at_the_second_metric(monkeypatch)
    text = (ROBOTS / "van_der_pol.yaml").read_text()
    assert "epsilon: 0.2" in text
    hopeless, target = tmp_path / "hopeless.yaml", tmp_path / "m.json"
    hopeless.write_text(text.replace("epsilon: 0.2", "epsilon: 5"))  # larger than the safe set
    target.write_text(OLDER_METRIC)
    done = synth(hopeless, "-o", target)
    assert done.exit_code == 130
    assert "interrupted: no metric that certifies was found by then" in done.stdout
    assert "kappa" in done.stdout
    assert "reduce epsilon" in done.stdout
    assert target.read_text() == OLDER_METRIC


def test_the_verdict_is_told_before_advice(monkeypatch):
    said = []

    def remedies(*args):
        said.append("advice")
        return []

    monkeypatch.setattr(synthesis, "remedies", remedies)
    lonely = load_text(CHAIN.format(slope=0, p=1, v=1).replace("f: [v", 'f: ["p**2 - p"'))
    wanted = Synthesis(rate=Fraction(1, 2), objective="condition", degree=0)
    pipeline.synthesise(lonely, wanted, Options(), Listeners(told=said.append))
    assert isinstance(said[0], Synthesised)
    assert said[0].verdict is Verdict.UNDECIDED
    assert said[1] == "advice"


@pytest.mark.slow
def test_advice_costs_no_more_than_the_search():
    lonely = load_text(CHAIN.format(slope=0, p=1, v=1).replace("f: [v", 'f: ["p**2 - p"'))
    wanted = Synthesis(rate=Fraction(1, 2), objective="condition", degree=0)
    run = synthesis.SynthesisRun(lonely, wanted, Options(), Listeners())
    spent = []
    honest = run.ladder.cheap

    def cheap():
        spent.append(honest())
        return spent[0]

    run.ladder.cheap = cheap
    found = run.run(table=False)
    assert found.reason.relax
    assert spent[0].rounds <= max(run.ladder.rounds, 30)


def test_the_metric_that_was_chosen_leads_the_table():
    """A first screen had the two slowest of nine, and marked none."""
    proven = Constant(below=4.5, above=4.6)
    rows = [
        MetricRow(rate=Fraction(n), floor="identity", degree=0, condition_number=n + 1.6) for n in (1, 2, 3)
    ]
    table = _compared(rows, SimpleNamespace(rate=Fraction(3), condition_number=proven))
    assert [[cell.text for cell in row[:2]] for row in table.rows] == [
        ["3", "kappa, chosen"],
        ["1", "kappa"],
        ["2", "kappa"],
    ]


def test_an_attempt_that_is_proven_and_does_not_serve_is_told_so():
    """`no metric was found: 1 attempts by cegis, degree 0; the last: proven`."""
    failure = NothingFound(attempts=1, routes=("cegis",), degrees=(0,), last=Proven())
    assert failure._why(None) == (
        "no metric that serves was found: 1 attempt by cegis, degree 0; the last: proven"
    )
