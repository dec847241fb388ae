"""Runs the notebooks, and stores what they show with a hash of what was run: python docs/execute.py [NAME...]"""

from __future__ import annotations

import hashlib
import sys
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

NOTEBOOKS = Path(__file__).parent / "notebooks"


def hash_of(cells: Iterable[Mapping[str, Any]]) -> str:
    """The hash of the sources of cells, which a file has as one text or as a list of lines."""
    texts = ("".join(cell["source"]) for cell in cells)
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()


def execute(path: Path) -> None:
    """Runs a notebook in an empty folder and writes it with what it shows."""
    import nbformat  # noqa: PLC0415 - the hash is asked for without it
    from nbclient import NotebookClient  # noqa: PLC0415

    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        where = {"metadata": {"path": folder}}
        NotebookClient(notebook, timeout=600, kernel_name="python3", resources=where).execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # times of day
    ran = [cell for cell in notebook.cells if cell.cell_type == "code"]
    notebook.metadata["executed_sources"] = hash_of(ran)
    nbformat.write(notebook, path)


if __name__ == "__main__":
    for chosen in sys.argv[1:] or sorted(path.stem for path in NOTEBOOKS.glob("*.ipynb")):
        execute(NOTEBOOKS / f"{chosen}.ipynb")
