"""What is handed out: the wheel, the sdist, the action and the workflows, and that all of them tell one version."""

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
import typer
import yaml

from tubecert.cli.app import app
from tubecert.release import __version__

ROOT = Path(__file__).parents[2]
PAPER = (ROOT / "paper.md").read_text("utf-8")
ACTION = yaml.safe_load((ROOT / "action.yml").read_text("utf-8"))
WORKFLOWS = {
    path.stem: yaml.safe_load(path.read_text("utf-8")) for path in ROOT.glob(".github/workflows/*.yml")
}
JOBS = [job for workflow in WORKFLOWS.values() for job in workflow["jobs"].values()]
SCRIPTS = [step["run"] for steps in (ACTION["runs"], *JOBS) for step in steps["steps"] if "run" in step]


def built(kind: str, folder: Path) -> Path:
    """The wheel or the sdist of this tree, by the backend of pyproject.toml."""
    script = f"import sys; from hatchling.build import build_{kind}; build_{kind}(sys.argv[1])"
    subprocess.run([sys.executable, "-c", script, str(folder)], cwd=ROOT, check=True, capture_output=True)
    [path] = folder.iterdir()
    return path


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    with zipfile.ZipFile(built("wheel", tmp_path_factory.mktemp("dist"))) as wheel:
        wheel.extractall(folder)
    return folder


def files(folder: Path) -> set[str]:
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


@pytest.mark.slow
def test_the_wheel_is_the_package_and_nothing_else(unpacked):
    assert files(unpacked / "tubecert") == files(ROOT / "tubecert")
    assert {path.name for path in unpacked.iterdir()} == {"tubecert", f"tubecert-{__version__}.dist-info"}


@pytest.mark.slow
def test_the_wheel_runs_without_the_checkout(unpacked, tmp_path):
    """README's first command, and what reads the data of the package: pages, schemas, templates."""
    shutil.copy(ROOT / "configs" / "two_state_orbit.yaml", tmp_path)
    lines = ["certify two_state_orbit.yaml", "report two_state_orbit.certificate.json"]
    lines += ["init robot.yaml", "schema", "explain TC603"]
    environment = os.environ | {"PYTHONPATH": str(unpacked)}
    for line in lines:
        command = [sys.executable, "-m", "tubecert", *line.split()]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, (line, done.stderr)
    where = [sys.executable, "-c", "import tubecert; print(tubecert.__file__)"]
    found = subprocess.run(where, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert Path(found.stdout.strip()).is_relative_to(unpacked)


@pytest.mark.slow
@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="the list of files is git's")
def test_the_sdist_is_the_checkout(tmp_path):
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True)
    with tarfile.open(built("sdist", tmp_path)) as archive:
        held = {name.split("/", 1)[1] for name in archive.getnames()}
    assert {name for name in listed.stdout.split("\n") if (ROOT / name).is_file()} <= held
    assert not [
        name for name in held if re.search(r"(^|/)(\.\w+_cache|\.cache|\.venv|__pycache__|site)/", name)
    ]


def test_every_file_tells_the_same_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    zenodo = json.loads((ROOT / ".zenodo.json").read_text("utf-8"))
    assert citation["version"] == zenodo["version"] == __version__
    assert citation["title"] == zenodo["title"]


@pytest.mark.slow
def test_what_they_run_exists():
    lines = re.findall(r"^tubecert ([^\n>|#]*)", "\n".join(SCRIPTS), re.MULTILINE)
    program = typer.main.get_command(app)
    assert {line.split()[0] for line in lines} == {"check", "certify", "recheck", "report"}
    for line in lines:
        name, command, arguments = program.resolve_command(None, line.split())
        command.make_context(name, arguments)
    assert (ROOT / ".ci" / "run").stat().st_mode & 0o111
    for place in re.findall(r"(?:^| )(\.?\w+/[\w./]+)", "\n".join(SCRIPTS), re.MULTILINE):
        assert place.startswith("dist/") or (ROOT / place).exists(), place


def test_jobs_wait_for_jobs_that_exist_and_write_only_where_they_say_so():
    for workflow in WORKFLOWS.values():
        assert workflow["permissions"] == {"contents": "read"}
        assert {job["needs"] for job in workflow["jobs"].values() if "needs" in job} <= set(workflow["jobs"])
    assert [job["permissions"] for job in JOBS if "permissions" in job] == [{"id-token": "write"}]


def test_the_action_uses_its_inputs():
    used = set(re.findall(r"inputs\.([\w-]+)", json.dumps(ACTION["runs"])))
    assert used == set(ACTION["inputs"])


def test_the_site_is_built_alike_everywhere():
    steps = WORKFLOWS["ci"]["jobs"]["site"]["steps"]
    readthedocs = yaml.safe_load((ROOT / ".readthedocs.yaml").read_text("utf-8"))["build"]["commands"]
    assert [step["run"] for step in steps if "run" in step] == [
        line.split(" --site-dir")[0] for line in readthedocs
    ]


def test_the_image_is_made_of_files_that_exist():
    for line in re.findall(r"^COPY ([^-].*)$", (ROOT / "Dockerfile").read_text("utf-8"), re.MULTILINE):
        *sources, _ = line.split()
        assert all((ROOT / source).exists() for source in sources)


def test_the_paper_cites_what_is_listed():
    cited = set(re.findall(r"@(\w+)", PAPER.split("---", 2)[2]))
    assert cited == set(re.findall(r"^@\w+\{(\w+),", (ROOT / "paper.bib").read_text("utf-8"), re.MULTILINE))


def test_the_paper_counts_what_was_verified():
    listed = json.loads((ROOT / "configs/published/verified.json").read_text("utf-8"))
    verdicts = [found["verdict"] for found in listed]
    held, refuted = verdicts.count("certified"), verdicts.count("refuted")
    assert f"holds {held + refuted} contraction metrics" in PAPER
    assert f"proves that {held} of them" in re.sub(r"\s+", " ", PAPER)
    assert f"refutes {refuted}:" in PAPER
