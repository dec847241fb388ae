"""When a search ends before its end: nothing better is asked for, no metric can serve, or it is out of reach."""

from dataclasses import replace
from fractions import Fraction

import pytest
from commands import run

from tubecert import pipeline
from tubecert.claims.advice import CorrectPlan, MendPlan
from tubecert.claims.statements import ConditionHolds, PlanBounded
from tubecert.model import build
from tubecert.pipeline import Options
from tubecert.pipeline.climb import Climb
from tubecert.pipeline.synthesised import Row
from tubecert.spec import Synthesis, load_text
from tubecert.synthesis.problem import beyond
from tubecert.verdict import Verdict

BARE = Synthesis(rate=None, objective="adaptation", degree=0)
BY_B = Options(conditions="distance")
LAG = """
tubecert: 1
name: lag
system: {states: [x], inputs: [u], f: [-x], B: [[1]]}
safe_set: {x: [-1, 1]}
uncertainty: {h: ["0.3*sin(t)"]}
trajectory: {kind: equilibrium, at: [0], horizon: 10}
initial_state: {at: [0.01]}
tube: {epsilon: 0.2, rho_a: 0.1}
"""
TRIM = """
tubecert: 1
name: trim
system: {states: [x, v], inputs: [u], f: [v, "-x - v"], B: [[0], [1]]}
safe_set: {x: [-1, 1], v: [-2, 2]}
uncertainty: {h: ["0.02*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, SPEED], horizon: 10}
initial_state: {at: [0, SPEED]}
tube: {half_widths: {x: 0.01, v: 0.05}}
"""


def tried(rows):
    """The rates that a climb tried, and why it ended; `rows`: what each rate comes to, by the rate."""
    asked: list[Fraction] = []

    def compare(rate, floor, full):
        del full
        asked.append(rate)
        row = Row(
            rate=rate, floor=floor, degree=0, condition_number=2.0, verdict=Verdict.REFUTED, metric=None
        )
        return replace(row, **rows(float(rate)))

    return asked, compare


def missing(share):
    """A row that fails by the plan alone, by so many tubes."""
    claim = ConditionHolds(section="distance", condition="distance")
    return {"claim": claim, "mend": MendPlan(defect=share, share=share, remedy=CorrectPlan())}


def test_two_rates_that_fail_by_the_plan_end_it():
    """The defect of a trim with three digits: 240 s of metrics that all failed by it."""
    for what in (missing(3.0), {"claim": PlanBounded()}):
        asked, compare = tried(lambda rate, what=what: what)
        climb = Climb(compare, "adaptation")
        climb.run(Fraction(1))
        assert asked == [1, 2]
        assert (climb.ended, climb.best) == ("plan", None)


def test_a_defect_that_faster_rates_make_up_for_does_not_end_it():
    """Twice the rate halves what a defect takes: at the third rate the tube is wide enough."""
    done = {"verdict": Verdict.CERTIFIED, "demand": 1.0}
    _, compare = tried(lambda rate: missing(2.5 / rate) if rate < 2.5 else done)
    climb = Climb(compare, "adaptation")
    climb.run(Fraction(1))
    assert climb.best is not None
    assert climb.ended is None
    far, compare = tried(lambda rate: missing(50 / rate))
    climb = Climb(compare, "adaptation")
    climb.run(Fraction(1))
    assert far == [1, 2], "so far away that it does not matter how fast it falls"


def test_other_claims_do_not_end_it():
    asked, compare = tried(lambda rate: {"claim": ConditionHolds(section="distance", condition="distance")})
    climb = Climb(compare, "adaptation")
    climb.run(Fraction(1))
    assert climb.ended is None
    assert len(asked) > 10


@pytest.mark.slow
def test_a_plan_that_is_none_is_said_after_two_rates(tmp_path):
    spec = load_text(TRIM.replace("SPEED", "0.4"))
    found = pipeline.synthesise(spec, BARE, BY_B)
    assert (found.verdict, found.file, found.cut) == (Verdict.UNDECIDED, None, "plan")
    assert len(found.rows) == 2
    (mend,) = found.reason.relax
    assert mend.remedy == CorrectPlan()
    assert mend.share == min(row.missed for row in found.rows) > 1
    (tmp_path / "trim.yaml").write_text(TRIM.replace("SPEED", "0.4"))
    done = run("synth", tmp_path / "trim.yaml", "-o", tmp_path / "m.json")
    assert done.exit_code == 4
    assert "it is the plan that has to be mended" in " ".join(done.stdout.split())
    assert not (tmp_path / "m.json").exists()


def test_the_first_tube_without_adaptation_is_enough_where_nothing_better_is_asked_for():
    """A satellite took 143 s to a metric whose report said that its tube needs no adaptation."""

    def rows(rate):
        return {"verdict": Verdict.CERTIFIED, "demand": 1 / rate, "alone": rate >= 4}

    lengths = []
    for enough in (True, False):
        asked, compare = tried(rows)
        climb = Climb(compare, "adaptation", enough)
        climb.run(Fraction(1))
        lengths.append(len(asked))
        assert climb.ended == ("no_adaptation" if enough else None)
        assert (climb.best.rate == 4) is enough
    assert lengths[0] == 3 < lengths[1]


def test_a_tube_without_adaptation_is_not_enough_where_what_decides_fails():
    asked, compare = tried(lambda rate: {"alone": True})
    climb = Climb(compare, "adaptation", enough=True)
    climb.run(Fraction(1))
    assert climb.ended is None
    assert len(asked) > 10


@pytest.mark.slow
def test_synth_ends_with_the_first_of_them_unless_an_objective_is_asked_for(tmp_path):
    path, target = tmp_path / "lag.yaml", tmp_path / "m.json"
    path.write_text(LAG.replace("0.3*", "0.03*"))
    said = []
    for more in ([], ["--objective", "adaptation"]):
        done = run("synth", path, "-o", target, "--degree", "0", *more)
        assert done.exit_code == 0
        said.append(" ".join(done.stdout.split()))
    words = "ended with the first metric whose tube needs no adaptation (certificate 0)"
    assert [words in each for each in said] == [True, False]


@pytest.mark.slow
def test_what_certifies_by_another_certificate_only_is_not_written(tmp_path):
    """Exit code 0, `metric proven` and a file, where B held and what decides did not."""
    hopeless = LAG.replace("0.3*", "0.9*")
    path, target = tmp_path / "lag.yaml", tmp_path / "m.json"
    arguments = ["synth", str(path), "--rate", "0.2", "--objective", "adaptation", "--degree", "0"]
    arguments += ["-o", str(target)]
    path.write_text(hopeless + "conditions: {decides: '0'}\n")
    done = run(*arguments)
    assert (done.exit_code, target.exists()) == (4, False), done.stdout
    assert done.stdout.startswith("undecided lag: the metric at rate 0.2 1/s does not certify")
    path.write_text(hopeless + "conditions: {decides: B}\n")
    assert run(*arguments).exit_code == 0


def chain(states, *moving):
    """Integrators one after another; the slope of each of `moving` depends on it."""
    names = [f"x{i}" for i in range(states)]
    bends = [f" + 0.1*{name}**2" if i in moving else "" for i, name in enumerate(names)]
    rates = [after + bend for after, bend in zip(names[1:], bends, strict=False)]
    columns = [[0]] * (states - 1) + [[1]]
    return f"""
tubecert: 1
name: chain
system: {{states: [{", ".join(names)}], inputs: [u], f: [{", ".join(rates)}, 0], B: {columns}}}
safe_set: {{{", ".join(f"{name}: [-1, 1]" for name in names)}}}
uncertainty: {{h: [0]}}
trajectory: {{kind: equilibrium, at: {[0] * states}}}
"""


def test_a_search_that_is_out_of_reach_by_its_size_is_known_before():
    """Ten and more states: it was in the docs only."""
    whole = [load_text(chain(*own)) for own in ((12, 0, 3, 5), (9, 0, 3, 5), (12, 4))]
    size, *others = [beyond(build(spec)) for spec in whole]
    assert (size.states, size.entries, size.moving, size.vertices) == (12, 78, 3, 8)
    assert others == [None, None]


def test_and_is_said_before_it_starts(tmp_path, monkeypatch):
    def search(*given, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(pipeline, "synthesise", search)
    (tmp_path / "large.yaml").write_text(chain(12, 0, 3, 5))
    arguments = ["synth", str(tmp_path / "large.yaml"), "--rate", "1", "-o", str(tmp_path / "m.json")]
    done = run(*arguments)
    assert done.exit_code == 130
    said = " ".join(done.stderr.split())
    assert "warning: 12 states, and slopes that depend on 3 of them" in said
    assert "78 unknown entries" in said
    assert "warning" not in run(*arguments, "-q").stderr
