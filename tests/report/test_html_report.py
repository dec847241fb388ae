"""Pages from certificates: what they say, that no text can break them, and how a browser shows them."""

import copy
import io
import json
import math
import os
import re
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import certificates
import numpy as np
import pages
import pytest
import sympy
from commands import run
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import margins_26, problem_of
from proven import result as certified_result
from texts import CONFIGS, ROOT

from tubecert import certificate, pipeline
from tubecert.bounds.constants import EVERY
from tubecert.certificate.result import Certificate, Result
from tubecert.claims.family import Assumption
from tubecert.conditions.rates import RateRecipe
from tubecert.digits import percent, up
from tubecert.expression import to_text
from tubecert.library.pages import Report
from tubecert.pipeline import Options
from tubecert.records import from_json
from tubecert.report import html, markdown
from tubecert.report.certificate_page import page_of
from tubecert.report.figures_axes import Axis, _corners, _hull, number
from tubecert.report.figures_file import painted
from tubecert.report.outline import tube_outline
from tubecert.spec import load, load_text

ORBIT = (CONFIGS / "two_state_orbit.yaml").read_text(encoding="utf-8")
THREE_STATE = (CONFIGS / "three_state.yaml").read_text(encoding="utf-8")
MADE = {
    "certified": certificates.certified,
    "refuted metric": certificates.refuted_metric,
    "refuted gains": certificates.refuted_gains,
    "undecided": certificates.undecided,
}
RUN = {
    "command": "tubecert certify plant.yaml",
    "started": "2026-01-02T03:04:05+00:00",
    "seconds": 1.5,
    "versions": {"tubecert": "0.1.0", "numpy": "2.4"},
}


def sealed(result):
    return certificate.seal(result, RUN)


def certificate_of(text):
    return json.loads(certificate.dump(sealed(certified_result(text).to_json())))


@pytest.fixture(scope="module")
def orbit():
    """A real certificate with a plan that moves, an obstacle beside the tube, and units."""
    text = ORBIT + "\nobstacles:\n  - {states: [x2, x1], disc: {center: [3, 3], radius: 1/2}}\n"
    return certificate_of(text)


@pytest.fixture(scope="module")
def regulated():
    """A real certificate of three states at an equilibrium."""
    return certificate_of(THREE_STATE)


@pytest.fixture(scope="module")
def outside():
    """A real refusal with a witness: the tube leaves the safe set."""
    return certificate_of(THREE_STATE.replace("rho_a: 0.01", "rho_a: 0.09"))


SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("regulated", "outside")]


@pytest.fixture(params=["orbit", *SLOW, *MADE])
def any_certificate(request):
    return sealed(MADE[request.param]()) if request.param in MADE else request.getfixturevalue(request.param)


def assumption(item):
    """An assumption of the JSON in words."""
    return from_json(Assumption, item, "assumption").told()


def told(sealed):
    """A certificate as the report reads it."""
    return Certificate.from_json(sealed)


def parsed(certificate):
    return pages.Page(html.render_page(page_of(told(certificate))))


def section(certificate, key):
    (found,) = (each for each in page_of(told(certificate)).sections if each.key == key)
    return found


@pytest.mark.slow
def test_well_formed_with_unique_anchors_that_resolve(any_certificate):
    page = parsed(any_certificate)
    ids = page.values("id") + [x.get("id") for d in page.drawings for x in d.iter() if x.get("id")]
    assert len(page.values("id")) == len(set(page.values("id"))), ids
    used = {link.removeprefix("#") for link in page.values("href") if link.startswith("#")}
    values = [v for d in page.drawings for x in d.iter() for v in x.attrib.values()]
    used |= {name for v in values for name in re.findall(r"url\(#(.*?)\)", v)}
    assert used
    assert used <= set(ids)
    assert page.tags.count("h1") == 1


@pytest.mark.slow
def test_nothing_is_loaded_and_nothing_runs(any_certificate):
    source = html.render_page(page_of(told(any_certificate)))
    page = pages.Page(source)
    assert not {"script", "iframe", "object", "embed", "img", "form"} & set(page.tags)
    assert all(link.startswith(("#", "data:,")) for link in page.values("href") + page.values("src"))
    assert not [name for name, _ in page.attributes if name.startswith("on")]
    assert not re.search(r"@import|url\((?!#)", page.styles)
    assert not re.search(r"(https?:)?//\w", source)
    assert "default-src 'none'" in source


@pytest.mark.slow
def test_the_same_certificate_gives_the_same_page_before_and_after_it_is_written(any_certificate):
    read_back = json.loads(certificate.dump(any_certificate))
    shuffled = {key: read_back[key] for key in reversed(read_back)}
    shuffled["result"] = {key: read_back["result"][key] for key in reversed(read_back["result"])}
    for render in (html.render_page, markdown.render_page):
        assert len({render(page_of(told(each))) for each in (any_certificate, read_back, shuffled)}) == 1


@pytest.mark.slow
def test_the_page_does_not_depend_on_the_process(tmp_path, orbit):
    file = tmp_path / "orbit.json"
    file.write_text(certificate.dump(orbit), encoding="utf-8")
    code = (
        "import json, sys; from tubecert.report import html; from tubecert.report.certificate_page import page_of;"
        "from tubecert.certificate.result import Certificate;"
        "sys.stdout.buffer.write(html.render_page(page_of(Certificate.from_json(json.load(open(sys.argv[1]))))).encode())"
    )
    outputs = set()
    for seed in ("0", "1234"):
        environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(ROOT), "TZ": f"UTC+{seed[0]}"}
        command = [sys.executable, "-c", code, str(file)]
        done = subprocess.run(command, capture_output=True, check=True, env=environment, timeout=60)
        outputs.add(done.stdout)
    assert outputs == {html.render_page(page_of(told(orbit))).encode()}


HOSTILE = st.text(
    st.sampled_from("<>&\"'`|*_\\{}%#[]()-;=/ \n\taé\u202e") | st.characters(exclude_categories=["Cs"]),
    max_size=12,
)


def _planted(text):
    """A certificate with a text of one's own wherever a text stands."""
    result = certificates.refuted_gains()
    effective = result["spec"]["effective"]
    effective["name"] = text
    effective["system"]["units"] = {"angle": text, "speed": "rad/s"}
    effective["system"]["f"] = [text, "speed"]
    effective["system"]["B"] = [["0"], [text]]
    effective["uncertainty"] = {"h": [text]}
    effective["trajectory"]["at"] = [text, "0"]
    result["plan"]["samples"] = {"t": [0.0], "x": [[0.0, 0.0]]}
    result["declared"] = {f"x {text}": 1.0}
    claim = {"claim": "tube_in_safe_set", "radius": 1.0, "state": text, "side": "upper", "excess": 0.0}
    result["reasons"] = [claim | {"verdict": "refuted", "at": {"x": [0.1, 0.2]}}]
    result["constants"]["h"] |= {"symbol": text, "unit": text, "equation": text}
    result["elasticities"] = {"conditions_26": {"h": 1.5, "lower": -2.0}, "distance": {}}
    result["metric"]["dual_metric"] = [[text, "0"], ["0", "1"]]
    return certificate.seal(result, {**RUN, "command": text, "versions": {text or "a": text}})


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(HOSTILE)
def test_no_text_becomes_markup(text):
    text = "".join(c for c in text if c.isprintable() or c in "\n\t")
    benign, hostile = parsed(_planted("plain")), parsed(_planted(text))
    assert hostile.tags.count("script") == 0
    assert set(hostile.tags) == set(benign.tags)
    assert [n for n, _ in hostile.attributes if n.startswith("on")] == []
    shown = " ".join(f"x {text}".split())
    assert shown.replace("<=", "≤").replace(">=", "≥") in hostile.text


def test_scripts_in_texts_are_shown_as_texts():
    page = parsed(_planted("<script>alert(1)</script>"))
    assert page.text.count("<script>alert(1)</script>") > 10
    assert any("<script>" in (x.text or "") for d in page.drawings for x in d.iter()), "units label the axes"


@pytest.mark.slow
def test_verdict_gains_margins(regulated):
    page = parsed(regulated)
    rates = regulated["result"]["conditions_26"]
    assert page.text.startswith("certified: three_state tubecert certificate three_state certified")
    for value in (rates["bandwidth"], regulated["result"]["distance"]["least_adaptation"]["bandwidth"]):
        assert str(value) in page.text
    assert up(rates["adaptation_rate"]) in page.text
    assert percent(rates["margins"]["26a"][0]) in page.text


def test_every_constant_with_symbol_meaning_equation_value_and_place(orbit):
    text = parsed(orbit).text
    constants = orbit["result"]["constants"]
    assert len(constants) > 30
    for name in constants:
        for what in (EVERY[name].symbol, EVERY[name].equation, EVERY[name].words):
            assert what in text
    at = orbit["notes"]["constants"]["f"]["at"]
    assert f"at t = {at['t']:.6g} s, x1 = {at['x'][0]:.6g}" in text


def test_bounds_are_rounded_to_the_side_that_stays_true(orbit):
    (table,) = (block for block in section(orbit, "constants").blocks if block.block == "table")
    by_symbol = {EVERY[name].symbol: item for name, item in orbit["result"]["constants"].items()}
    for symbol, _, proven, *_ in table.rows:
        sign, value = proven.text.split()
        item = by_symbol[symbol.text]
        if sign == "<=":
            assert Fraction(value) >= Fraction(repr(item["above"]))
        else:
            assert Fraction(value) <= Fraction(repr(item["below"]))


def test_what_is_declared_and_what_is_assumed_are_kept_apart(any_certificate):
    declared, assumed = section(any_certificate, "rests-on").blocks
    assert assumed.items == tuple(map(assumption, any_certificate["result"]["assumptions"]))
    assert declared.items == ("nothing",)


def test_declared_bounds_are_called_believed():
    believed = section(sealed(certificates.certified(declared={"h": 0.25})), "rests-on")
    assert believed.blocks[0].items == ("|h| <= 0.25 on the tube",)


@pytest.mark.slow
def test_what_is_not_certified_has_no_numbers_to_rely_on_and_shows_its_witness(outside):
    page = page_of(told(outside))
    assert page.verdict == "refuted"
    parsed_page = parsed(outside)
    at = outside["result"]["reasons"][0]["at"]
    assert f"x1 = {at['x'][0]:.6g}" in parsed_page.text
    witnesses = [x for d in parsed_page.drawings for x in d.iter("circle") if "witness" in x.get("class")]
    assert len(witnesses) == 3, "one per plane"
    assert "not proven to stay in the safe set" in parsed_page.text
    words = parsed_page.text.split("Metric")[0]
    assert "certified" not in re.sub("Not certified|is certified|tubecert certif", "", words)


def test_undecided_is_never_shown_as_another_verdict():
    page = parsed(sealed(certificates.undecided()))
    assert page.text.startswith("undecided: pendulum")
    assert "neither proven nor refuted" in page.text


def test_provenance_and_how_to_check(any_certificate):
    text = parsed(any_certificate).text
    for word in (any_certificate["hash"], RUN["command"], "numpy 2.4", RUN["started"], "tubecert recheck"):
        assert word in text


def figures(certificate):
    blocks = (block for section in page_of(told(certificate)).sections for block in section.blocks)
    return {each.key: each for block in blocks if block.block == "figures" for each in block.figures}


def drawn(certificate, key):
    return pages.ET.fromstring(figures(certificate)[key].svg)


def points(path):
    return [tuple(map(float, pair.split())) for pair in re.findall(r"[-\d.]+ [-\d.]+", path.get("d"))]


@pytest.mark.slow
def test_which_figures_there_are(orbit, regulated, outside):
    gains = {"trade-off"}
    assert set(figures(orbit)) == gains | {"tube-0-1", "state-0", "state-1", "input-0"}
    over_time = {"state-0", "state-1", "state-2", "input-0"}
    planes = {f"tube-{pair}" for pair in ("0-1", "0-2", "1-2")}
    assert set(figures(regulated)) == gains | over_time | planes
    assert set(figures(outside)) == over_time | {"tube-0-1", "tube-0-2", "tube-1-2"}


def places(path):
    """The corners of all parts of a mark, (K, 2)."""
    return np.array(points(path))


def marked(drawing, style):
    (mark,) = (x for x in drawing.iter("path") if x.get("class") == style)
    return places(mark)


def units(drawing, page_certificate, names):
    """Viewport units per unit of each of two states."""
    ranges = [page_certificate["result"]["safe_set"][name] for name in names]
    sizes = np.ptp(marked(drawing, "safe"), axis=0)
    return [size / (float(high) - float(low)) for size, (low, high) in zip(sizes, ranges, strict=True)]


def test_the_tube_of_a_constant_metric_is_an_ellipse_as_wide_as_its_half_widths(orbit):
    drawing = drawn(orbit, "tube-0-1")
    plan, tube, safe = places(plan_of(drawing)), marked(drawing, "tube"), marked(drawing, "safe")
    (low, _), unit = orbit["result"]["safe_set"]["x1"], units(drawing, orbit, ("x1", "x2"))
    widths = orbit["result"]["tube"]["half_widths"]
    for i, (each, name) in enumerate(zip(unit, ("x1", "x2"), strict=True)):
        for side in (np.min, np.max):
            reach = abs(side(tube[:, i]) - side(plan[:, i]))
            assert reach == pytest.approx(widths[name] * each, abs=0.25), "dbar sqrt(W_ii)"
    x = np.array([row[0] for row in orbit["notes"]["plan"]["samples"]["x"]])
    assert np.allclose(plan[:, 0], safe[:, 0].min() + (x - low) * unit[0], atol=0.02)


def test_a_tube_of_any_radius_has_an_outline():
    result = told(sealed(certificates.certified())).result
    wide = replace(result, tube=replace(result.tube, rho=Fraction(10) ** 200))
    assert np.abs(tube_outline(wide, (0, 1))).max() > 1e199


def test_every_state_over_time_has_its_half_width(orbit):
    result = orbit["result"]
    for i, name in enumerate(("x1", "x2")):
        drawing = drawn(orbit, f"state-{i}")
        (band,) = (x for x in drawing.iter("path") if x.get("class") == "tube")
        (plan,) = (x for x in drawing.iter("path") if "plan" in x.get("class", ""))
        y, curve = ([height for _, height in points(each)] for each in (band, plan))
        x = [row[i] for row in orbit["notes"]["plan"]["samples"]["x"]]
        unit = (max(curve) - min(curve)) / (max(x) - min(x))
        above, below = y[: len(x)], y[len(x) :][::-1]
        for high, middle, low in zip(above, curve, below, strict=True):
            assert middle - high == pytest.approx(result["tube"]["half_widths"][name] * unit, abs=0.03)
            assert low - middle == pytest.approx(result["tube"]["half_widths"][name] * unit, abs=0.03)


def test_an_obstacle_lies_where_it_is_whatever_the_order_of_its_states(orbit):
    drawing = drawn(orbit, "tube-0-1")
    disc, safe = marked(drawing, "obstacle"), marked(drawing, "safe")
    unit, _ = units(drawing, orbit, ("x1", "x2"))
    low, _ = orbit["result"]["safe_set"]["x1"]
    assert disc[:, 0].mean() == pytest.approx(safe[:, 0].min() + (3 - low) * unit, abs=0.02)
    assert np.ptp(disc[:, 0]) == pytest.approx(unit, abs=0.04)
    assert ("obstacle", "obstacle") in figures(orbit)["tube-0-1"].legend


@pytest.mark.slow
def test_chosen_pairs_lie_on_their_curves(regulated):
    drawing = drawn(regulated, "trade-off")
    paths = (x for x in drawing.iter("path") if "curve" in x.get("class", ""))
    curves = {x.get("class").split()[1]: points(x) for x in paths}
    dots = [x for x in drawing.iter("circle") if "dot" in x.get("class", "")]
    assert sorted(x.get("class").split()[1] for x in dots) == ["a", "a", "b", "b"]
    for dot in dots:
        here = float(dot.get("cx")), float(dot.get("cy"))
        assert min(math.dist(p, here) for p in curves[dot.get("class").split()[1]]) < 25
    assert sum("decides" in x.get("class") for x in dots) == 1


def test_one_state_is_drawn_against_time():
    result = certificates.certified()
    result["spec"]["effective"]["system"]["states"] = ["angle"]
    result["tube"]["half_widths"] = {"angle": 0.03}
    del result["safe_set"]["speed"]
    result["plan"]["samples"] = {"t": [0.0], "x": [[0.0]]}
    result["constants"] = {}
    assert figures(sealed(result))["state-0"].title == "angle over time"


@given(st.floats(-1e6, 1e6), st.floats(1e-9, 1e6), st.booleans())
def test_ticks_are_round_and_inside(low, width, log):
    low = abs(low) + 1e-9 if log else low
    axis = Axis(label="", low=low, high=low + width + 1e-6 * abs(low), log=log)
    ticks = axis.ticks()
    assert 2 <= len(ticks) <= 12
    assert ticks == sorted(set(ticks))
    for value in ticks:
        assert -1e-6 <= axis.share(value) <= 1 + 1e-6


_coordinates = st.integers(-20, 20).map(float)
_points = st.tuples(_coordinates, _coordinates)


@given(_points, _points, st.integers(1, 5), st.integers(1, 5), st.integers(-4, 4))
def test_the_hull_of_a_shape_at_two_places(one, other, wide, high, tilt):
    """Every point of both shapes lies to the left of every edge, and every corner is one of theirs."""
    shape = np.array([(wide, tilt), (tilt, high + 20), (-wide, -tilt), (-tilt, -high - 20)], dtype=float)
    both = np.concatenate([shape + one, shape + other])
    hull = _hull(shape, np.array(one), np.array(other))
    assert {*map(tuple, hull)} <= {*map(tuple, both)}
    edges = np.roll(hull, -1, axis=0) - hull
    for start, (x, y) in zip(hull, edges, strict=True):
        away = both - start
        assert (x * away[:, 1] - y * away[:, 0]).min() >= -1e-9


@given(st.lists(_points, min_size=2, max_size=12))
def test_what_is_left_out_of_a_curve_lies_beside_the_line(corners):
    curve = np.array(corners)
    kept = _corners(curve)
    assert (kept[0], kept[-1]) == (0, len(curve) - 1)
    for first, last in pairwise(kept):
        along, off = curve[last] - curve[first], curve[first : last + 1] - curve[first]
        share = np.clip(off @ along / max(along @ along, 1e-300), 0, 1)
        assert np.abs(off - share[:, None] * along).max() <= 1 + 1e-9


@given(st.floats(-1e5, 1e5))
def test_numbers_of_drawings(value):
    text = number(value)
    assert re.fullmatch(r"-?\d+(\.\d{1,2})?", text)
    assert abs(float(text) - value) <= 0.005001
    assert text != "-0"


def test_samples_lie_on_the_plan(orbit):
    samples = orbit["notes"]["plan"]["samples"]
    horizon = float(orbit["result"]["spec"]["effective"]["trajectory"]["horizon"])
    assert samples["t"][0] == 0
    assert samples["t"][-1] == pytest.approx(horizon)
    spec = load_text(ORBIT)
    for i, term in enumerate(spec.trajectory.x):
        curve = sympy.lambdify("t", sympy.parse_expr(to_text(term.expression)), "math")
        for t, row in zip(samples["t"][::20], samples["x"][::20], strict=True):
            assert row[i] == pytest.approx(curve(t), abs=1e-5)


@pytest.mark.slow
def test_the_margin_around_is_that_of_the_pair_at_its_bandwidth(regulated):
    distance = regulated["result"]["distance"]
    pair, around = distance["least_adaptation"], regulated["notes"]["distance"]["margins_around"]
    here = around["bandwidth"].index(pair["bandwidth"])
    assert around["margin"][here] == pytest.approx(pair["margin"][0], abs=1e-6)
    most = max(v for v in around["margin"] if v is not None)
    assert most < 0.01, "the least rate leaves next to nothing anywhere"


@pytest.mark.slow
def test_a_margin_around_is_the_margin_of_those_gains(regulated):
    problem = problem_of(load(str(CONFIGS / "three_state.yaml")), Options())
    data = regulated["notes"]["conditions_26"]["margins_around"]
    recipe = regulated["result"]["proof"]["conditions_26"]
    for i in (0, 17, 40):
        gain = recipe["predictor_gain"]
        own = RateRecipe(
            bandwidth=Fraction(str(data["bandwidth"][i])),
            adaptation_rate=Fraction(str(data["adaptation_rate"])),
            predictor_gain=None if gain is None else Fraction(str(gain)),
            projection_radius=Fraction(str(recipe["projection_radius"])),
        )
        for claim, margin in margins_26(problem, own).items():
            assert data[claim][i] <= float(margin.lo)
            assert data[claim][i] == pytest.approx(float(margin.lo), rel=1e-8, abs=1e-9)


def test_markdown_says_the_same(any_certificate):
    text = markdown.render_page(page_of(told(any_certificate)))
    plain = text.replace("\\", "")
    result = any_certificate["result"]
    assert text.startswith(f"# {markdown.escape(result['spec']['effective']['name'])}: {result['verdict']}\n")
    assert any_certificate["hash"] in plain
    for item in map(assumption, result["assumptions"]):
        assert item.replace("<=", "≤").replace(">=", "≥") in plain
    assert "<svg" not in text


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(HOSTILE)
def test_markdown_tables_keep_their_columns(text):
    lines = markdown.render_page(page_of(told(_planted(text)))).splitlines()
    width = None
    for line in lines:
        if line.startswith("| "):
            cells = len(re.findall(r"(?<!\\)\|", re.sub(r"\\\\", "", line)))
            assert width in (None, cells), line
            width = cells
        else:
            width = None
    assert sum(line.startswith("# ") for line in lines) == 1


@pytest.fixture
def folder(folder):
    Path("plant.yaml").write_text(THREE_STATE, encoding="utf-8")
    return folder


@pytest.fixture
def proven(monkeypatch):
    calls = []

    def answer(spec, options, progress=None, **_):
        calls.append(spec)
        return Result.from_json(certificates.certified())

    monkeypatch.setattr(pipeline, "certify", answer)
    return calls


def test_certify_writes_pages_beside_the_certificate(folder, proven):
    done = run("certify", "plant.yaml", "--report", "a.html", "--report", "b.md")
    assert done.exit_code == 0, done.output
    assert "page        a.html" in done.output
    written = json.loads(Path("plant.certificate.json").read_text(encoding="utf-8"))
    assert Path("a.html").read_text(encoding="utf-8") == html.render_page(page_of(told(written)))
    assert Path("b.md").read_text(encoding="utf-8") == markdown.render_page(page_of(told(written)))
    assert {p.name for p in folder.iterdir()} == {"a.html", "b.md", "plant.certificate.json", "plant.yaml"}


def test_a_page_goes_well_with_the_certificate_on_stdout(folder, proven):
    done = run("certify", "plant.yaml", "-o", "-", "--report", "a.htm")
    assert json.loads(done.stdout)["result"]["verdict"] == "certified"
    assert Path("a.htm").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


@pytest.mark.slow
def test_figures_are_files_for_a_paper(orbit, tmp_path):
    """The tube is as wide in the PNG as in the drawing, in its colour; a PDF has fonts, and the caption says all."""
    chart = figures(orbit)["tube-0-1"]
    import matplotlib.pyplot as plt

    image = plt.imread(io.BytesIO(painted("png", chart)))[..., :3]
    ground = np.abs(image - np.array([0xEB, 0xE3, 0xE1]) / 255).max(axis=2) < 0.02  # what is not safe
    rows, columns = (np.flatnonzero(ground.sum(axis=i) > 40) for i in (1, 0))  # and not an edge of a text
    colored = np.abs(image - np.array([0xA8, 0xCA, 0xEC]) / 255).max(axis=2) < 0.02
    found = np.flatnonzero(colored[rows[0] : rows[-1]].any(axis=0))  # and not of the legend
    tube = [x for mark in chart.marks if mark.style == "tube" for part in mark.parts for x, _ in part]
    share = (max(tube) - min(tube)) / (chart.x.high - chart.x.low)
    assert np.ptp(found) / np.ptp(columns) == pytest.approx(share, abs=0.01)
    data = painted("pdf", chart)
    assert data.startswith(b"%PDF")
    assert data == painted("pdf", chart)
    assert b"/FontFile2" in data, "texts are texts"
    assert chart.told.startswith("Tube in the plane of x1 and x2: safe set, tube, plan, obstacle")
    names = Report(certificate=told(orbit)).save_figures(tmp_path)
    assert {"tube-0-1.svg", "tube-0-1.pdf", "tube-0-1.png", "captions.md"} <= {*names}
    assert {path.name for path in tmp_path.iterdir()} == {*names}


def plan_of(drawing):
    (plan,) = (x for x in drawing.iter("path") if "plan" in x.get("class", ""))
    return plan


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--report", "a.pdf"], "HTML or Markdown"),
        (["--report", "-"], "HTML or Markdown"),
        (["--report", "none/a.html"], "no folder none"),
        (["--report", "sub.html"], "it is a folder"),
        (["--report", "a.html", "-o", "a.html"], "the certificate itself"),
        (["--report", "./sub.html/../a.html", "-o", "a.html"], "the certificate itself"),
        (["--report", "link.md"], "the specification itself"),
        (["--report", "a.html", "--report", "a.html"], "the page a.html itself"),
    ],
)
def test_bad_targets_are_errors_before_any_work(folder, proven, arguments, words):
    (folder / "sub.html").mkdir()
    (folder / "link.md").symlink_to("plant.yaml")
    before = Path("plant.yaml").read_text(encoding="utf-8")
    done = run("certify", "plant.yaml", *arguments)
    assert done.exit_code == 2
    assert "error TC120" in done.output
    assert words in " ".join(done.output.split())
    assert done.output.count("error") >= 1
    assert not proven, "nothing was certified"
    assert Path("plant.yaml").read_text(encoding="utf-8") == before
    assert not list(folder.glob("*.json"))


def test_report_makes_the_page_that_certify_makes(folder, proven):
    run("certify", "plant.yaml", "--report", "a.html")
    proven.clear()
    done = run("report", "plant.certificate.json", "-o", "b.html", "-o", "c.md")
    assert done.exit_code == 0, done.output
    assert done.output.startswith("page b.html\npage c.md\nNot rechecked: ")
    assert Path("a.html").read_bytes() == Path("b.html").read_bytes()
    assert run("report", "plant.certificate.json").output.startswith("page plant.html\nNot rechecked: ")
    assert json.loads(run("report", "plant.certificate.json", "--json").output) == {"pages": ["plant.html"]}
    assert run("report", "plant.certificate.json", "-q").output == ""
    assert not proven


def _tampered(change):
    data = copy.deepcopy(sealed(certificates.certified()))
    change(data)
    return json.dumps(data)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (_tampered(lambda d: d["result"]["tube"].update(rho=0.001)), "its hash is not that of its result"),
        (_tampered(lambda d: d.update(format="tubecert-certificate/1")), "has the format tubecert-certificate/1"),
        (_tampered(lambda d: d.pop("result")), "it has no result"),
        ("[]", "is not a certificate"),
        ("{", "it is not JSON (line 1"),
        ("", "it is not JSON"),
        ('{"result": {"a": NaN}, "format": "tubecert-certificate/3"}', "it holds NaN"),
        ("[" * 100_000, "it is nested too deeply"),
        ("\x00", "it is not JSON"),
        ('{"format": "x", "format": "tubecert-certificate/3"}', "occurs twice"),
    ],
)  # fmt: skip
def test_what_is_no_certificate_is_refused(folder, text, words):
    Path("c.json").write_text(text, encoding="utf-8")
    done = run("report", "c.json", "-o", "c.html")
    assert done.exit_code == 2
    assert done.output.startswith(("error TC600: ", "error TC601: ", "error TC602: ", "error TC603: "))
    assert words in " ".join(done.output.split())
    assert not Path("c.html").exists()


def test_a_certificate_that_is_not_there_or_no_text(folder):
    assert run("report", "none.json").exit_code == 2
    assert run("report", ".").exit_code == 2
    Path("c.json").write_bytes(b"\xff\xfe")
    assert "it is not UTF-8" in run("report", "c.json").output


@pytest.mark.slow
@pytest.mark.parametrize("key", ["verdict", "spec", "safe_set", "plan", "reasons", "assumptions"])
@pytest.mark.parametrize("value", [None, "absent", 7, [], {}, "text"])
def test_a_sealed_result_that_lacks_something_is_an_error_and_no_traceback(folder, key, value):
    result = certificates.certified()
    if value == "absent":
        del result[key]
    else:
        result[key] = value
    Path("c.json").write_text(json.dumps(sealed(result)), encoding="utf-8")
    done = run("report", "c.json", "-o", "c.html")
    assert done.exit_code in (0, 2), done.output
    assert "internal" not in done.output
    assert done.exit_code == 2 or key in {"plan", "reasons", "assumptions", "safe_set"}
    assert Path("c.html").exists() == (done.exit_code == 0)


def test_report_never_overwrites_the_certificate(folder):
    Path("c.html").write_text(json.dumps(sealed(certificates.certified())), encoding="utf-8")
    before = Path("c.html").read_bytes()
    done = run("report", "c.html", "-o", "c.html")
    assert done.exit_code == 2
    assert "the certificate itself" in done.output
    assert Path("c.html").read_bytes() == before


# -- in a browser

needs_browser = pytest.mark.skipif(
    pages.browser() is None, reason=f"no browser on PATH (one of {', '.join(pages.BROWSERS)})"
)


@pytest.fixture
def shown(tmp_path, orbit, regulated, outside):
    """Pages as files."""
    written = {}
    for name, each in {"orbit": orbit, "regulated": regulated, "outside": outside}.items():
        written[name] = tmp_path / f"{name}.html"
        written[name].write_text(html.render_page(page_of(told(each))), encoding="utf-8")
    return written


def _inside(inner, outer, slack=1.0):
    begins = all(a >= b - slack for a, b in zip(inner[:2], outer[:2], strict=True))
    return begins and all(a <= b + slack for a, b in zip(inner[2:], outer[2:], strict=True))


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize(
    ("name", "width", "dark"),
    [("orbit", 360, False), ("orbit", 1280, True), ("regulated", 360, True), ("outside", 360, False)],
)
def test_layout_in_a_browser(shown, tmp_path, name, width, dark):
    found = pages.measure(shown[name], tmp_path, width=width, dark=dark)
    assert found["width"] == width
    brightness = sum(map(int, re.findall(r"\d+", found["background"])[:3]))
    assert brightness < 150 if dark else brightness > 600
    assert found["scroll"] <= found["client"], "no horizontal scrolling"
    assert len(found["figures"]) == len(re.findall("<figure ", shown[name].read_text(encoding="utf-8")))
    for drawing in found["figures"]:
        left, top, right, bottom = drawing["box"]
        assert right - left > 0.75 * min(width, 400)
        assert bottom - top > 120
        for words, *box in drawing["texts"]:
            assert _inside(box, drawing["box"]), f"{words!r} is cut"
        assert all(box[2] > box[0] or box[3] > box[1] for box in drawing["marks"]), "a mark is not visible"
    assert min(found["sizes"]) > 9, "ticks can be read"


@pytest.mark.slow
@needs_browser
def test_the_browser_has_nothing_to_complain_about(shown, tmp_path):
    assert pages.console_of(shown.values(), tmp_path) == []


def test_colours_have_contrast():
    styles = parsed(sealed(certificates.certified())).styles
    parts = styles.split("@media")[0], styles.split("dark) {")[1].split("* {")[0]
    schemes = [dict(re.findall(r"--([a-z-]+): (#[0-9a-f]{6})", part)) for part in parts]

    def luminance(color):
        parts = [int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
        return 0.2126 * r + 0.7152 * g + 0.0722 * b

    def contrast(one, other):
        a, b = sorted((luminance(one), luminance(other)))
        return (b + 0.05) / (a + 0.05)

    pairs = [("ink", "page"), ("ink", "panel"), ("soft", "page"), ("soft", "panel"), ("a", "page")]
    pairs += [(word, ground) for word in ("good", "bad", "open") for ground in ("page", f"{word}-panel")]
    for scheme in schemes:
        for front, back in pairs:
            assert contrast(scheme[front], scheme[back]) >= 4.5, (front, back)
