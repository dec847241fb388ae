"""The pages in docs/: links resolve, code references exist, every tag of the code is in the equation index."""

import ast
import re
from functools import reduce
from importlib import import_module
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
import pytest

import tubecert
from tubecert.bounds.constants import EVERY
from tubecert.certificate.sections import assumptions
from tubecert.claims.assumptions import UncertaintyAsGiven
from tubecert.model import build
from tubecert.pipeline import Options, certify
from tubecert.spec import load_text

PACKAGE = Path(tubecert.__file__).parent
ROOT = PACKAGE.parent
PAGES = sorted((ROOT / "docs").rglob("*.md"))
INDEX = (ROOT / "docs" / "equations.md").read_text(encoding="utf-8")
THEORY = "\n".join(
    path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs" / "theory").glob("*.md"))
)
REFERENCE = re.compile(r"`(tubecert(?:\.\w+)*):(\w+(?:\.\w+)*)`")
MODULE = re.compile(r"`(tubecert(?:\.\w+)+)`")
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
ROWS = [line.split("|") for line in INDEX.splitlines() if line.startswith("| ") and "tubecert" in line]
TAGS = {tag for row in ROWS for tag in re.findall(r"`([^`]+)`|\((\d\.\d+)\)", row[1]) for tag in tag if tag}


def test_the_figure_of_a_sweep_has_the_looks_that_figures_have_now():
    style = escape((PACKAGE / "report/templates/page.css").read_text("utf-8"))
    assert style in (ROOT / "docs/figures/tradeoff_adaptation_rate.svg").read_text("utf-8")


def tags_in(text):
    """Everything in a sentence that names an equation, a section or an assumption."""
    text = re.sub(r"\s+", " ", text)
    found = set(
        re.findall(r"\b(CCM_\d|26[abc]|(?:bounds|conditions):\w+|zeta_\d|omega_norm_ball|full_tube)", text)
    )
    found |= set(re.findall(r"\((\d\.\d+)\)", text))
    found |= {f"theorem {name}" for name in re.findall(r"theorem ([0AB])\b", text)}
    for first, last in re.findall(r"assumptions? (\d)(?: to (\d))?", text):
        found |= {f"assumption {i}" for i in range(int(first), int(last or first) + 1)}
    for part in re.findall(
        r"theory,?(?: sections?)? (\d[a-z]?(?: \([^)]*\))?(?:(?:,| and) \d[a-z]?\b)*)", text
    ):
        found |= {
            f"theory {name}" for name in re.findall(r"(?<![\w.])\d[a-z]?\b", re.sub(r"\([^)]*\)", "", part))
        }
    for first, last in re.findall(r"theory of the sampled loop, sections? (\d)(?: (?:to|and) (\d))?", text):
        found |= {f"sampled loop {i}" for i in range(int(first), int(last or first) + 1)}
    return found | {name for name in ("F(x)",) if name in text}


SOURCES = {
    path.relative_to(PACKAGE).as_posix(): text
    for path in sorted(PACKAGE.rglob("*.py"))
    if "Implements: " in (text := path.read_text(encoding="utf-8"))
}


def implemented(text):
    """The clause of every `Implements:` in a docstring."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
            yield from re.findall(
                r"Implements: (.*?)(?:Trusted: |\n\n|\Z)", ast.get_docstring(node) or "", re.S
            )


@pytest.mark.parametrize("place", SOURCES)
def test_every_implements_line_is_in_the_index(place):
    clauses = list(implemented(SOURCES[place]))
    assert clauses, "Implements: outside of a docstring"
    for clause in clauses:
        tags = tags_in(clause)
        assert tags, f"no equation is recognised in {clause!r}"
        assert tags <= TAGS, f"not in docs/equations.md: {sorted(tags - TAGS)}"


def test_every_tag_of_the_tables_of_constants_is_in_the_index():
    for name, meaning in EVERY.items():
        tags = tags_in(meaning.equation)
        assert tags, f"{name}: {meaning.equation}"
        assert tags <= TAGS, f"{name}: {sorted(tags - TAGS)}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_code_references_exist(page):
    text = page.read_text(encoding="utf-8")
    for module, name in REFERENCE.findall(text):
        reduce(getattr, name.split("."), import_module(module))
    for name in MODULE.findall(text):
        import_module(name)


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md"], ids=lambda page: page.name)
def test_links_resolve(page):
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        if "://" not in target and not target.startswith(("#", "mailto:")):
            assert (page.parent / target.split("#")[0]).exists(), target


def test_numbered_equations_are_defined_once_and_exist():
    defined = re.findall(r"\s{2,}\(([D\d]\.\d+)\)$", THEORY, re.M)
    assert len(defined) == len(set(defined)) > 60
    for page in PAGES:
        used = set(re.findall(r"\(([D\d]\.\d+)\)", page.read_text(encoding="utf-8")))
        assert used <= set(defined), f"{page.name}: {sorted(used - set(defined))}"


def test_the_readme_is_read_once():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) <= 1300


def test_the_documentation_is_short():
    """Beside the theory, its index and errata, and what docs/generate.py writes."""
    others = {"theory", "reference"}
    own = [
        page for page in PAGES if page.parent.name not in others and page.stem not in {"equations", "errata"}
    ]
    words = {page.name: len(page.read_text(encoding="utf-8").split()) for page in own}
    assert sum(words.values()) <= 20_000
    assert max(words.values()) <= 1_400, words


def test_the_glossary_has_sixty_nouns_and_each_once():
    glossary = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    nouns = re.findall(r"^\| (?!noun)([a-z ]+) \|", glossary, re.M)
    assert len(nouns) == len(set(nouns)) <= 60


def test_errata_mentioned_elsewhere_exist():
    errata = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")
    headings = " ".join(re.findall(r"^## (.*)$", errata, re.M))
    known = set(re.findall(r"\bE\d+\b", headings))
    for page in PAGES:
        used = set(re.findall(r"\bE\d+\b", page.read_text(encoding="utf-8")))
        assert used <= known, f"{page.name}: {sorted(used - known)}"
    assert known == {f"E{i}" for i in range(1, len(known) + 1)}


@pytest.mark.slow
def test_theorem_b_can_be_checked_from_the_file_alone():
    """The check that docs/guarantee describes, (4.1)-(4.4), in plain floats."""
    text = (ROOT / "configs" / "three_state.yaml").read_text(encoding="utf-8")
    result = certify(load_text(text, "three.yaml"), Options(conditions="all")).to_json()
    proof = {name: float(value) for name, value in result["proof"]["distance"].items()}
    c = {name: value["above"] for name, value in result["constants"].items()}
    rate, rho = result["metric"]["rate"], result["tube"]["rho"]
    dbar = result["constants"]["lower"]["below"] ** 0.5 * rho
    omega, Y, S, e = (proof[k] for k in ("bandwidth", "speed", "uncertainty", "prediction_error"))
    g, R_H = proof["predictor_gain"], proof["projection_radius"]
    s1 = c["h_t"] + c["h_x"] * Y
    Dxt = (2 * (c["h"] + R_H) * s1 / (2 * g) + (c["h"] + R_H) ** 2) ** 0.5
    Deta = (c["B_pinv_x"] * Y + c["B_pinv"] * (omega + abs(omega - g))) * Dxt
    assert c["h"] <= R_H
    assert s1 / omega <= S
    assert Deta / proof["adaptation_rate"] ** 0.5 <= e
    control = c["feedback_gain"] * dbar + min(c["h"] + R_H, max(c["h_initial"], S) + e)
    assert c["drift_on_plan"] + c["B"] * control < Y
    t = np.linspace(0, 20, 200_001)
    K = (np.exp(-rate * t) - np.exp(-omega * t)) / (omega - rate)
    A1 = (c["metric_input_gain"] * (S + e) + c["plan_defect_metric"]) / rate
    D = A1 + (c["initial_distance"] - A1) * np.exp(-rate * t)
    D += c["metric_input_gain"] * (c["h_initial"] - S) * K
    assert D.max() < dbar
    below = result["distance"]["least_adaptation"]["margin"][0]
    assert 1 - D.max() / dbar == pytest.approx(below, abs=1e-6)


def test_the_uncertainties_that_are_covered_are_those_the_initial_value_covers():
    """H0 is that of the expression unless |h| is declared: then and only then other uncertainties are covered."""
    text = (ROOT / "configs" / "three_state.yaml").read_text(encoding="utf-8")
    start = '  h: ["0.1*sin(2*t)"]'
    assert start in text
    for bounds, covered in (("{h: 0.1, h_t: 0.2}", True), ("{h_t: 0.2}", False)):
        spec = load_text(text.replace(start, f"{start}\n  bounds: {bounds}"), "spec.yaml")
        assert (UncertaintyAsGiven(any_within_bounds=True) in assumptions(spec, build(spec))) is covered
