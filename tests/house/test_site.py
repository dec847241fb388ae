"""The site and the notebooks: every page is reached, every link resolves, every notebook runs as it stands."""

import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))

import execute  # noqa: E402
import typeset  # noqa: E402

NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))


def entries(node: object) -> set[str]:
    """The pages in a navigation."""
    if isinstance(node, str):
        return {node}
    return set().union(*map(entries, node.values() if isinstance(node, dict) else node))


def test_every_page_is_in_the_navigation():
    pages = {path.relative_to(DOCS).as_posix() for path in (*DOCS.rglob("*.md"), *NOTEBOOKS)}
    assert entries(yaml.safe_load((ROOT / "mkdocs.yml").read_text("utf-8"))["nav"]) == pages


PROOFS = [*sorted((DOCS / "theory").glob("*.md")), DOCS / "errata.md"]


@pytest.mark.parametrize("path", PROOFS, ids=lambda path: path.stem)
def test_formulas_are_set_and_nothing_of_their_notation_is_left(path):
    page = SimpleNamespace(file=SimpleNamespace(src_uri=path.relative_to(DOCS).as_posix()))
    kept = typeset.on_page_markdown(path.read_text("utf-8"), page)
    assert len(page.formulas) > 5
    assert "```text" not in kept
    for formula in page.formulas:
        text = "".join(ET.fromstring(f"<all>{formula}</all>").itertext())
        assert not re.search(r"[_^*~']|[<>]=|\\", text), text


@pytest.mark.parametrize(
    ("written", "shown"),
    [
        ("|xt(t)| <= Dxt/sqrt(Gamma)", "|x˜(t)|≤ Δx˜/Γ"),
        ("D+ d <= -lambda d + beta |xi|", "D+d≤ −λd+β|ξ|"),
        ("sum_1<=i<j |d_i xi_k-i|", "∑1≤i<j|diξk−i|"),
        ("x*' - B(x*) u*", "x∗′−B(x∗)u∗"),
    ],
)
def test_a_formula_keeps_its_letters_and_their_order(written, shown):
    text = "".join(ET.fromstring(f"<all>{typeset.inline(written)}</all>").itertext())
    assert text == shown
    assert "<msub>" in typeset.inline("w_i")
    assert "<msup>" in typeset.inline("e^(-lambda t)")


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1", "JUPYTER_PLATFORM_DIRS": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "site" / "notebooks" / "regulation" / "index.html").exists()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_shows_what_its_own_sources_gave(path):
    """The outputs in the file are of the sources in it: docs/execute.py stores both, and the hash of what it ran."""
    notebook = json.loads(path.read_text("utf-8"))
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert notebook["metadata"]["executed_sources"] == execute.hash_of(cells), "run python docs/execute.py"
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert not [out for cell in cells for out in cell["outputs"] if out["output_type"] == "error"]


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.filterwarnings("default")  # of the kernel's libraries
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path, tmp_path, monkeypatch):
    import nbformat
    from nbclient import NotebookClient

    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    notebook = nbformat.read(path, as_version=4)
    assert any("assert result.certified" in cell.source for cell in notebook.cells)
    NotebookClient(
        notebook, timeout=500, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    ).execute()
