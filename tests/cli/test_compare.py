"""`compare`: what certificates state, side by side; what is missing and what differs is said."""

import copy
import csv
import io
import json

import certificates
import pytest
from commands import run

from tubecert.certificate import dump, seal
from tubecert.certificate.result import Certificate
from tubecert.kinds import NAMES
from tubecert.report.comparison import Comparison, page_of
from tubecert.report.quantities import quantities

pytestmark = pytest.mark.timeout(60)


def changed(change):
    result = copy.deepcopy(certificates.certified())
    change(result)
    return result


def other(result):
    """Half the rate, another horizon, and no certificate A."""
    result["spec"]["effective"]["trajectory"] |= {"at": ["0", "1"], "horizon": "10"}
    result["distance"]["least_adaptation"]["adaptation_rate"] *= 0.5
    del result["conditions_26"]
    result["decided_by"] = ["distance"]


@pytest.fixture
def files(tmp_path):
    paths = []
    for name, result in (("before", certificates.certified()), ("after", changed(other))):
        paths.append(tmp_path / f"{name}.certificate.json")
        paths[-1].write_text(dump(seal(result, {})), encoding="utf-8")
    return paths


def told(*results):
    sides = [(f"{i}.json", Certificate.from_json(seal(each, {}))) for i, each in enumerate(results)]
    return Comparison.of(sides)


def test_a_table_names_gains_changes_what_is_missing_and_what_differs(files):
    brief, done = run("compare", *files), run("compare", *files, "-v")
    assert (brief.exit_code, done.exit_code) == (0, 0), done.output
    assert len(brief.output.splitlines()) <= 15
    assert any(line.split()[:2] == ["B", "distance"] for line in brief.output.splitlines())
    lines = [" ".join(line.split()) for line in done.output.splitlines()]
    assert lines[0] == "pendulum: 2 certificates, 2 keys of their specifications differ"
    rate = certificates.certified()["distance"]["least_adaptation"]["adaptation_rate"]
    assert any(
        line.startswith("B distance, least Gamma, Gamma ") and line.endswith("-50 %") for line in lines
    ), rate
    assert any(
        line.startswith("A paper's conditions certified: omega") and "not there" in line for line in lines
    )
    assert "trajectory.at[1] 0 1" in lines
    assert "trajectory.horizon not there 10" in lines
    same = run("compare", files[0], files[0], "-v")
    assert "2 certificates of the same specification" in same.output
    assert "nothing" in same.output
    assert "change" not in same.output


def test_formats_have_every_number_as_the_certificate_states_it(files):
    table = csv.DictReader(io.StringIO(run("compare", *files, "--format", "csv").output))
    rows = {row["quantity"]: row for row in table}
    data = json.loads(run("compare", *files, "--json").output)
    assert [each["name"] for each in data["certificates"]] == ["before", "after"]
    for path, name in zip(files, ("before", "after"), strict=True):
        result = json.loads(path.read_text(encoding="utf-8"))["result"]
        index, least = ["before", "after"].index(name), result["distance"]["least_adaptation"]
        for key, number in (
            ("rho", result["tube"]["rho"]),
            ("distance.least_adaptation.adaptation_rate", least["adaptation_rate"]),
            ("distance.least_adaptation.margin.distance", least["margin"][0]),
        ):
            assert float(rows[key][name]) == data["quantities"][key][index] == number
    verdicts = rows["conditions_26.verdict"]
    assert (verdicts["before"], verdicts["after"]) == ("certified", "")
    assert rows["specification.trajectory.horizon"]["after"] == "10"
    assert data["differences"]["trajectory.horizon"] == [None, "10"]


def test_markdown_is_a_comment_for_a_pull_request(files):
    done = run("compare", *files, "--format", "markdown")
    assert done.output.startswith("# pendulum: comparison\n")
    assert "## Figures" not in done.output
    tables = [line for line in done.output.splitlines() if line.startswith("|")]
    assert {line.count("|") for line in tables} <= {4, 5}
    assert "| trajectory.horizon | not there | 10 |" in tables


def test_every_kind_is_there_without_being_named():
    comparison, own = told(certificates.certified(), changed(other)), certificates.certified()
    (glance, *_) = page_of(comparison).sections[0].blocks
    named = [row[0].text for row in glance.rows]
    assert [name for name in named if name in map(str, NAMES)] == [str(n) for n in NAMES if n.key in own]
    found = {each.key for each in quantities(comparison.results[0])}
    assert {f"{name.key}.verdict" for name in NAMES if name.key in own} <= found


def test_what_acts_nowhere_is_said_in_one_way_and_has_no_change():
    """Half-widths of 1.7e-25 m and 1.2e-25 m were compared: rounding alone, `-29.4 %`."""

    def nothing(width):
        return lambda result: result["tube"].update(half_widths={"angle": width, "speed": 0.1})

    page = page_of(told(changed(nothing(1.7e-25)), changed(nothing(1.2e-25))))
    (glance, *_) = page.sections[0].blocks
    row = next(row for row in glance.rows if row[0].text == "half width of angle")
    assert [cell.text for cell in row[1:3]] == ["< 1e-12"] * 2
    assert not any(cell.text for cell in row[3:])


def test_files_of_one_name_are_told_apart(tmp_path):
    text = dump(seal(certificates.certified(), {}))
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "c.certificate.json").write_text(text, encoding="utf-8")
    done = run("compare", tmp_path / "one/c.certificate.json", tmp_path / "two/c.certificate.json", "--json")
    names = [each["name"] for each in json.loads(done.output)["certificates"]]
    assert names == [str(tmp_path / "one/c"), str(tmp_path / "two/c")]


def test_lists_of_other_sizes_differ_as_a_whole():
    def larger(result):
        result["spec"]["effective"]["trajectory"]["at"] = ["0", "0", "0"]

    differences = told(certificates.certified(), changed(larger)).differences
    assert differences == {"trajectory.at": (["0", "0"], ["0", "0", "0"])}


def test_what_cannot_be_compared_is_refused(files, tmp_path):
    broken = tmp_path / "broken.json"
    broken.write_text(files[0].read_text("utf-8").replace("certified", "refuted", 1), "utf-8")
    for words, said in (
        ((files[0],), "two certificates or more"),
        ((files[0], broken), "TC601"),
        ((files[0], tmp_path / "none.json"), "TC600"),
        (("-", "-"), "given twice"),
        ((*files, "-o", "page.pdf"), "TC120"),
        ((*files, "-o", files[0]), "would be overwritten"),
        ((*files, "--json", "--format", "csv"), "exclude each other"),
    ):
        done = run("compare", *words)
        assert (done.exit_code, said in " ".join(done.output.split())) == (2, True), done.output
