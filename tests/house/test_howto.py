"""docs/howto, followed to the letter, beside the arm of the tutorial: files, commands, what they print."""

import re
import shlex
from pathlib import Path

import pytest
from test_tutorial import shape
from typer.testing import CliRunner

from tubecert.cli.app import app

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs" / "howto").glob("*.md"))
BLOCK = re.compile(r"```(yaml|sh|text|python)(?: (fails)| title=\"([\w.]+)\")?\n(.*?)```", re.DOTALL)
TUTORIAL = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "tutorial.md").read_text("utf-8"), re.DOTALL)


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_page(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    Path("arm.yaml").write_text("\n".join(TUTORIAL), encoding="utf-8")
    Path("configs").symlink_to(ROOT / "configs")
    blocks = BLOCK.findall(page.read_text("utf-8"))
    assert len(blocks) == page.read_text("utf-8").count("```") / 2
    said = ""
    for kind, fails, title, text in blocks:
        if kind == "yaml":
            Path(title).write_text(text, encoding="utf-8")
        elif kind == "python":
            exec(compile(text, str(page), "exec"), {})
        elif kind == "sh":
            program, *arguments = shlex.split(text)
            assert program == "tubecert"
            result = CliRunner().invoke(app, arguments, prog_name="tubecert")
            assert (result.exit_code != 0) == bool(fails), result.output
            said = result.stdout
        else:
            real = {shape(line) for line in said.splitlines()}
            assert not [line for line in text.splitlines() if shape(line) not in real], said
