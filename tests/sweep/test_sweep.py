"""Sweeps: every point has its row and the certificate of `certify --set`; nothing is lost, and nothing of another."""

import csv
import io
import json
import shutil
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ET

import pytest
from commands import run
from systems import ONE

from tubecert import pipeline
from tubecert.errors import SpecError, TargetError
from tubecert.executor import Cluster, Serial, WorkerError
from tubecert.pipeline import Options
from tubecert.report.figures_sweep import sweep_figures
from tubecert.report.sweep import SweepTable
from tubecert.spec import Setting
from tubecert.sweep.grid import Axis
from tubecert.sweep.point import Task, memory_of
from tubecert.sweep.run import Sweep

pytestmark = pytest.mark.timeout(240)
OVER = ("--over", "tube.epsilon=.2,.4,1.2,-1")


def sweep_of(folder, *over, fixed=(), **options):
    settings = tuple(map(Setting.of, fixed))
    task = Task(path="one.yaml", text=ONE, fixed=settings, options=Options(**options), folder=folder)
    return Sweep.of(task, [Axis.of(each) for each in over])


def bytes_in(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def rows_of(folder):
    return list(csv.DictReader(io.StringIO((folder / "table.csv").read_text(encoding="utf-8"))))


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A sweep of four points: two certified, one refuted, one that is no specification."""
    folder = tmp_path_factory.mktemp("sweep")
    spec = folder / "one.yaml"
    spec.write_text(ONE, encoding="utf-8")
    answer = run("sweep", spec, *OVER, "-o", folder / "out")
    assert answer.exit_code == 0, answer.output
    return spec, folder / "out", answer


def copied(done, tmp_path):
    shutil.copytree(done[1], tmp_path / "out")
    return tmp_path / "out"


@pytest.mark.slow
def test_every_point_has_a_row_with_its_verdict_and_what_failed(done):
    rows = rows_of(done[1])
    assert [(row["tube.epsilon"], row["verdict"], row["failed"]) for row in rows] == [
        (".2", "certified", ""),
        (".4", "certified", ""),
        ("1.2", "refuted", "tube_in_safe_set:x"),
        ("-1", "error", "TC112"),
    ]
    for row in rows[:2]:
        result = json.loads((done[1] / row["certificate"]).read_text(encoding="utf-8"))["result"]
        own = result["distance"]["least_adaptation"]
        assert float(row["distance.least_adaptation.adaptation_rate"]) == own["adaptation_rate"]
        assert float(row["distance.least_adaptation.margin.distance"]) == own["margin"][0]
        assert float(row["rho"]) == result["tube"]["rho"]
        assert float(row["half_width.x"]) == result["tube"]["half_widths"]["x"]
        assert row["no_adaptation.verdict"] == result["no_adaptation"]["verdict"]
    assert rows[3]["rho"] == ""
    error = json.loads((done[1] / rows[3]["certificate"]).read_text(encoding="utf-8"))
    assert error["problems"][0]["message"] == "tube.epsilon is -1; it must be > 0"
    assert "4 points, 2 certified, 1 refuted, 1 invalid or broken" in done[2].output


@pytest.mark.slow
def test_a_point_is_the_certificate_that_certify_writes(done, tmp_path):
    spec, folder, _ = done
    target = tmp_path / "c.json"
    answer = run("certify", spec, "--set", "tube.epsilon=.4", "-q", "-o", target)
    assert answer.exit_code == 0, answer.output
    files = target, folder / "points/0002.certificate.json"
    one, other = (json.loads(path.read_bytes()) for path in files)
    for key in ("started", "seconds"):
        one["run"].pop(key)
    one["run"].pop("command")  # of this process, not of a shell
    assert other["run"].pop("command") == f"tubecert certify {spec} --set tube.epsilon=.4"
    assert one == other
    answer = run("recheck", folder / "points/0002.certificate.json", "--spec", spec, "--budget", "2000")
    assert answer.exit_code == 0, answer.output


@pytest.mark.slow
def test_what_does_not_depend_on_the_key_is_proven_once(tmp_path):
    sweep = sweep_of(tmp_path / "a", "tube.epsilon=.2,.3", "tube.rho_a=.1,.2")
    memory_of.cache_clear()
    sweep.run(Serial())
    assert (memory_of(sweep.task).computed["metric"], memory_of(sweep.task).computed["rank"]) == (1, 1)
    sweep = sweep_of(tmp_path / "b", "metric.rate=.5,.4", "tube.rho_a=.1,.2")
    memory_of.cache_clear()
    sweep.run(Serial())
    assert memory_of(sweep.task).computed["metric"] == 2


@pytest.mark.slow
def test_what_is_there_is_used_and_what_is_broken_or_gone_is_made_again(done, tmp_path, monkeypatch):
    folder = copied(done, tmp_path)
    before = bytes_in(folder)
    asked, certify = [], pipeline.certify
    monkeypatch.setattr(pipeline, "certify", lambda *a, **k: asked.append(a) or certify(*a, **k))
    assert run("sweep", done[0], *OVER, "-o", folder).exit_code == 0
    assert (asked, bytes_in(folder)) == ([], before)
    first, second = folder / "points/0001.certificate.json", folder / "points/0002.certificate.json"
    first.write_bytes(first.read_bytes().replace(b'"certified"', b'"refuted"', 1))
    shutil.copy(folder / "points/0003.certificate.json", second)  # of another point
    (folder / "points/0004.error.json").unlink()
    (folder / "points/.0002.certificate.json.x.part").write_text("{")
    assert run("sweep", done[0], *OVER, "-o", folder).exit_code == 0
    assert len(asked) == 2
    assert bytes_in(folder) == before


@pytest.mark.slow
def test_two_processes_give_the_same_bytes(done, tmp_path):
    answer = run("sweep", done[0], *OVER, "-o", tmp_path / "out", "--jobs", "2")
    assert answer.exit_code == 0, answer.output
    assert bytes_in(tmp_path / "out") == bytes_in(done[1])


@pytest.mark.slow
def test_a_sweep_that_is_killed_goes_on_and_gives_the_same_bytes(done, tmp_path):
    folder = tmp_path / "out"
    words = [sys.executable, "-m", "tubecert", "sweep", str(done[0]), *OVER, "-o", str(folder)]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    end = time.monotonic() + 120
    while not (folder / "points/0001.certificate.json").exists() and time.monotonic() < end:
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not (folder / "table.csv").exists()
    assert run("sweep", done[0], *OVER, "-o", folder).exit_code == 0
    assert bytes_in(folder) == bytes_in(done[1])


@pytest.mark.slow
def test_a_folder_of_something_else_is_left_alone(done, tmp_path):
    folder = copied(done, tmp_path)
    before = bytes_in(folder)
    spec = tmp_path / "one.yaml"
    spec.write_text(ONE.replace("0.05", "0.06"), encoding="utf-8")
    for words, said in (
        ((done[0], "--over", "tube.epsilon=.2,.5"), "over differ"),
        ((done[0], *OVER, "--set", "tube.rho_a=.2"), "settings differ"),
        ((done[0], *OVER, "--conditions", "B"), "options differ"),
        ((spec, *OVER), "specification_hash differ"),
    ):
        answer = run("sweep", *words, "-o", folder)
        assert (answer.exit_code, said in " ".join(answer.output.split())) == (2, True), answer.output
    (tmp_path / "full").mkdir()
    (tmp_path / "full/mine.txt").write_text("mine")
    answer = run("sweep", done[0], *OVER, "-o", tmp_path / "full")
    assert (answer.exit_code, "holds something else" in answer.output) == (2, True)
    assert bytes_in(folder) == before
    assert [item.name for item in (tmp_path / "full").iterdir()] == ["mine.txt"]


def test_a_mistake_that_all_points_share_is_told_before_any_work(tmp_path):
    spec = tmp_path / "one.yaml"
    spec.write_text(ONE, encoding="utf-8")
    for words, place in (
        (("--over", "tube.epsilom=1,2"), "--over tube.epsilom: error TC103"),
        (("--over", "system.parameters.q=1:2:3"), "--over system.parameters.q: error TC103"),
        (("--over", "tube.epsilon=1:2"), "--over tube.epsilon: error TC112"),
        (("--over", "tube.epsilon=1,2", "--set", "tube.epsilon=1"), "TC104"),
        (("--over", "tube.epsilon=-1,-2"), "--over tube.epsilon: error TC112"),
        (("--over", "tube.epsilon=1,2", "--jobs", "0"), "--jobs: error TC112"),
        (("--over", "tube.epsilon=1,2", "--metric", "none.json"), "none.json"),
        ((), "--over says which keys"),
    ):
        answer = run("sweep", spec, *words, "-o", tmp_path / "out")
        assert (answer.exit_code, place in answer.output) == (2, True), answer.output
        assert not (tmp_path / "out").exists()


def test_a_defect_at_a_point_is_a_row_and_is_tried_again(tmp_path, monkeypatch):
    broken = True

    def certify(spec, *_, **__):
        if broken and spec.tube.epsilon != 1:
            raise ZeroDivisionError("of a test")
        raise SpecError([])

    monkeypatch.setattr(pipeline, "certify", certify)
    spec = tmp_path / "one.yaml"
    spec.write_text(ONE, encoding="utf-8")
    words = ("sweep", spec, "--over", "tube.epsilon=1,2", "-o", tmp_path / "out")
    assert run(*words).exit_code == 3
    assert [row["failed"] for row in rows_of(tmp_path / "out")] == ["", "internal"]
    assert "ZeroDivisionError: of a test" in (tmp_path / "out/points/0002.error.json").read_text()
    broken = False
    assert run(*words).exit_code == 0


def test_a_folder_that_cannot_be_written_is_an_error_and_no_row(tmp_path, monkeypatch):
    sweep = sweep_of(tmp_path / "out", "tube.epsilon=-1,.2")

    def lost(*_, **__):
        shutil.rmtree(tmp_path / "out")
        raise SpecError([])

    monkeypatch.setattr(pipeline, "certify", lost)
    with pytest.raises(TargetError):
        sweep.run(Serial())


@pytest.mark.slow
def test_figures_mark_every_point_that_is_not_certified(done):
    sweep = sweep_of(done[1], "tube.epsilon=.2,.4,1.2,-1")
    ordered = SweepTable.of("one", [Axis.of("tube.epsilon=.2,.4,1.2,2")], sweep.outcomes())
    figures = {figure.key: figure for figure in sweep_figures(ordered)}
    assert {"sweep-rho", "sweep-bandwidth", "sweep-adaptation_rate"} <= figures.keys()
    for figure in figures.values():
        drawing = ET.fromstring(figure.svg)
        classes = [mark.get("class") for mark in drawing.iter("path")]
        assert (classes.count("cell refuted"), classes.count("cell error")) == (1, 1)
        assert ("cell refuted", "refuted") in figure.legend
    dots = list(ET.fromstring(figures["sweep-adaptation_rate"].svg).iter("circle"))
    assert len(dots) == 2 * 2  # A and B, where they are certified
    axes = [Axis.of("tube.epsilon=.2,.4"), Axis.of("tube.rho_a=1:9:log2")]
    for figure in sweep_figures(SweepTable.of("one", axes, sweep.outcomes())):
        drawing = ET.fromstring(figure.svg)
        cells = [mark for mark in drawing.iter("path") if mark.get("class", "").startswith("cell ")]
        colored = [mark for mark in cells if mark.find("title") is not None]
        assert len(cells) == 4
        assert all(mark.get("class").startswith("cell h") for mark in colored)
        assert len(colored) == (0 if figure.key == "sweep-verdict" else 2)
    assert sweep_figures(SweepTable.of("one", sweep.axes, sweep.outcomes())) == []  # its values have no order


@pytest.mark.slow
def test_the_folder_holds_a_page_and_drawings_that_can_be_opened(done, tmp_path):
    spec, _, _ = done
    answer = run("sweep", spec, "--over", "tube.epsilon=.2:.4:2", "-o", tmp_path / "out", "--json")
    assert answer.exit_code == 0, answer.output
    rows = json.loads(answer.stdout)
    assert [row["tube.epsilon"] for row in rows] == [".2", ".4"]
    drawings = sorted((tmp_path / "out/figures").glob("*.svg"))
    assert drawings
    for path in drawings:
        assert ET.fromstring(path.read_text(encoding="utf-8")).tag == "{http://www.w3.org/2000/svg}svg"
    page = (tmp_path / "out/sweep.html").read_text(encoding="utf-8")
    assert page.count("<svg viewBox") >= len(drawings)


@pytest.mark.parametrize(
    ("there", "others", "said"),
    [
        (None, [], "--scheduler needs distributed"),
        ("spec", [{"numpy": "0"}], "have other versions of"),
        ("spec", WorkerError("no cluster with workers at a"), "no cluster with workers at a"),
    ],
)
def test_a_cluster_that_could_find_other_results_is_refused(tmp_path, monkeypatch, there, others, said):
    def asked(self, function):
        if isinstance(others, WorkerError):
            raise others
        return [function() | each for each in others]

    monkeypatch.setattr("tubecert.asking.importlib.util.find_spec", lambda name: there)
    monkeypatch.setattr(Cluster, "versions", asked)
    spec = tmp_path / "one.yaml"
    spec.write_text(ONE, encoding="utf-8")
    done = run("sweep", spec, *OVER, "--scheduler", "a", "-o", tmp_path / "out")
    assert (done.exit_code, said in " ".join(done.output.split())) == (2, True), done.output
    assert not (tmp_path / "out").exists()
