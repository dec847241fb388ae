"""schema, init, explain, version, completion, help: what is at hand every day."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from commands import run

import tubecert
from tubecert.bounds.constants import EVERY
from tubecert.cli.app import app
from tubecert.cli.init import TEMPLATES
from tubecert.cli.texts import SCHEMAS
from tubecert.report import pages

PACKAGE = Path(tubecert.__file__).parent
ROOT = PACKAGE.parent

pytestmark = pytest.mark.usefixtures("folder")


@pytest.mark.parametrize("name", SCHEMAS)
def test_schema(name):
    result = run("schema", name)
    assert result.exit_code == 0
    assert result.stdout == (PACKAGE / "schemas" / f"{name}.schema.json").read_text("utf-8")
    assert json.loads(result.stdout)["title"].startswith("tubecert ")


def test_schema_of_the_specification_by_default():
    assert run("schema").stdout == run("schema", "spec").stdout
    assert run("schema", "other").exit_code == 2


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
@pytest.mark.parametrize("template", TEMPLATES)
def test_templates_certify_as_they_are(template, folder):
    made = run("init", "--template", template)
    assert (made.exit_code, made.stderr) == (0, "")
    assert f"tubecert certify {template}.yaml" in made.stdout
    beside = {"csv": ["plan.csv"]}.get(template, [])
    assert sorted(path.name for path in folder.iterdir()) == sorted([f"{template}.yaml", *beside])
    assert run("check", f"{template}.yaml", "--strict", "--no-cache").stdout.endswith("no errors\n")
    result = run("certify", f"{template}.yaml", "-q")
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith(f"certified {template}: ")


def test_init_refuses_to_overwrite(folder):
    (folder / "plan.csv").write_text("mine")
    result = run("init", "--template", "csv")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "plan.csv exists and is not overwritten" in result.stderr
    assert [path.name for path in folder.iterdir()] == ["plan.csv"]
    (folder / "mine.yaml").write_text("mine")
    result = run("init", "-o", "mine.yaml")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "mine.yaml exists and is not overwritten" in result.stderr
    assert (folder / "mine.yaml").read_text() == "mine"
    (folder / "link.yaml").symlink_to("nowhere.yaml")
    assert run("init", "-o", "link.yaml").exit_code == 2


@pytest.mark.parametrize("target", ["no/folder.yaml", ".", "a" * 300])
def test_init_where_nothing_can_be_written(target):
    result = run("init", "-o", target)
    assert result.exit_code == 2
    assert "TC120" in result.stderr
    assert "Traceback" not in result.output


def test_init_takes_the_file_as_it_is_named(folder):
    assert "tubecert certify mine.yaml" in run("init", "mine.yaml", "-t", "tracking").stdout
    assert (folder / "mine.yaml").read_text().splitlines()[0].endswith("tubecert certify mine.yaml")
    assert run("init", "mine.yaml").exit_code == 2
    for arguments, said in (
        (["other.yaml", "-o", "third.yaml"], "give other.yaml or third.yaml"),
        (["tracking"], "write --template tracking"),
    ):
        result = run("init", *arguments)
        assert (result.exit_code, result.stdout) == (2, "")
        assert said in result.stderr
    assert [path.name for path in folder.iterdir()] == ["mine.yaml"]
    assert run("init", "-").stdout == run("init", "-o", "-").stdout


def test_init_to_stdout(folder):
    result = run("init", "-o", "-")
    assert result.stdout == (PACKAGE / "templates" / "regulation.yaml").read_text("utf-8")
    assert not list(folder.iterdir())
    assert run("init", "--template", "other").exit_code == 2


def codes_of_the_package() -> set[str]:
    text = "".join(path.read_text("utf-8") for path in PACKAGE.rglob("*.py"))
    return set(re.findall(r"\bTC\d{3}\b", text))


@pytest.mark.slow
def test_every_code_has_a_page_and_every_page_a_code():
    assert codes_of_the_package() == set(pages.codes())


def test_every_constant_and_every_tag_has_a_page():
    assert set(pages.constants()) == set(EVERY)
    index = (ROOT / "docs" / "equations.md").read_text("utf-8")
    section = index.split("## Tags of the paper")[1].split("##")[0]
    cells = (line.split("|")[1] for line in section.splitlines() if "|" in line)
    tags = {tag for cell in cells for tag in re.findall(r"`([^`]+)`", cell)}
    assert tags <= set(pages.equations()), tags - set(pages.equations())


@pytest.mark.slow
@pytest.mark.parametrize("topic", sorted({*pages.codes(), *pages.constants(), *pages.equations()}))
def test_every_page_has_meaning_formula_and_source(topic):
    page = pages.find(topic)
    assert page is not None
    head, *parts = page.text().split("\n\n")
    assert head.lower().startswith(topic.lower())
    assert len(parts) >= 2
    assert parts[-1].startswith("Source: ")
    assert max(map(len, page.text().splitlines())) <= 130
    if page.kind == "code":
        wrong, right = dict(page.examples)["Wrong"], dict(page.examples)["Right"]
        assert wrong != right
        assert "\\" not in page.text()  # an escape of TOML that no quotes resolved
        assert f"Right:\n    {right.splitlines()[0]}" in run("explain", topic).stdout


@pytest.mark.parametrize(
    ("asked", "head"),
    [
        *[("tc302", "TC302"), ("du", "feedback_gain (du)"), ("A", "A: certificate A"), ("a", "lower (a)")],
        *[("fills x2", "budget"), ("input F", "inputs"), ("not proven", "undecided"), ("settled", "attack")],
        *[("(26c)", "26c"), ("ccm_2", "CCM_2"), ("C2", "CCM_2"), ("f(X)", "F(x)")],
    ],
)
def test_topics_by_other_names(asked, head):
    assert run("explain", asked).stdout.startswith(head)


def test_what_is_not_known_gets_a_suggestion():
    result = run("explain", "TC1000")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "did you mean TC100" in result.stderr
    for topic in ("", "ä", "x" * 1000, "[", "--"):
        assert run("explain", "--", topic).exit_code == 2


def test_the_list_of_topics():
    shown = run("explain").stdout
    for topic in [*pages.words(), *pages.codes(), *pages.constants(), *pages.equations()]:
        assert re.search(rf"^  {re.escape(topic)} ", shown, re.MULTILINE), topic


EXAMPLE = """\
tubecert: 1
name: example
system: {states: [x, y], inputs: [u], f: [y, -x - y], B: [[0], [1]]}
safe_set: {x: [-1, 1], y: [-1, 1]}
uncertainty: {h: ["0.1*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, 0]}
metric: {rate: 0.4, dual_metric: [["1", "-0.5"], ["-0.5", "1"]]}
tube: {epsilon: 0.1, rho_a: 0.1}
"""


@pytest.mark.parametrize(
    ("code", "old"),
    [
        ("TC104", "tube: {epsilon: 0.1, rho_a: 0.1}"),
        ("TC105", "trajectory: {kind: equilibrium, at: [0, 0]}"),
        ("TC113", "tube: {epsilon: 0.1, rho_a: 0.1}"),
        ("TC117", "tube: {epsilon: 0.1, rho_a: 0.1}"),
    ],
)
def test_examples_are_wrong_and_right_as_they_say(code, old):
    for name, text in pages.codes()[code].examples:
        Path("example.yaml").write_text(EXAMPLE.replace(old, text))
        assert (code in run("check", "example.yaml", "--json").stdout) is (name == "Wrong")


def commands() -> list[str]:
    return [command.name for command in app.registered_commands if command.name] + ["certify"]


@pytest.mark.parametrize("command", sorted(set(commands())))
def test_every_command_helps_with_an_example(command):
    shown = run(command, "--help").stdout
    assert re.search(rf"Examples?:\n\s+tubecert {command}\b", shown), shown


@pytest.mark.slow
def test_completion_is_offered_and_works():
    shown = run("--help").stdout
    assert "--install-completion" in shown
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "_TUBECERT_COMPLETE": "complete_bash"}
    environment |= {"COMP_WORDS": "tubecert ch", "COMP_CWORD": "1", "_TYPER_COMPLETE_ARGS": "tubecert ch"}
    command = [sys.executable, "-m", "tubecert"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.split() == ["check"], done


def test_the_hooks_run_commands_that_exist():
    import yaml

    hooks = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text("utf-8"))
    assert {hook["id"] for hook in hooks} == {"tubecert-check", "tubecert-certify"}
    for hook in hooks:
        program, *arguments = hook["entry"].split()
        assert program == "tubecert"
        assert hook["language"] == "python"
        assert re.search(hook["files"], "some/configs/plant.yaml")
        assert run(*arguments, ROOT / "tests/specs/ok/plan.yaml", "--help").exit_code == 0


def test_the_workflow_that_is_documented_is_one():
    import yaml

    text = (ROOT / "docs" / "ci.md").read_text("utf-8")
    blocks = [yaml.safe_load(block) for block in re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)]
    [workflow] = [block for block in blocks if "jobs" in block]
    [values] = [step["with"] for step in workflow["jobs"]["check"]["steps"] if "<" in step["uses"]]
    assert set(values) == set(yaml.safe_load((ROOT / "action.yml").read_text("utf-8"))["inputs"])
    assert run("check", values["paths"], *values["options"].split(), "--help").exit_code == 0
    ci = (ROOT / ".ci" / "run").read_text("utf-8")
    assert '"$bin/tubecert" check --strict --certify' in ci


def test_a_metric_at_a_rate_needs_no_uncertainty_and_no_trajectory(folder):
    system = "tubecert: 1\nname: cart\nsystem: {states: [p, v], inputs: [u], f: [v, -v], B: [[0], [1]]}\n"
    rest = "safe_set: {p: [-1, 1], v: [-2, 2]}\ninitial_state: {at: [3, 3]}\n"
    (folder / "plant.yaml").write_text(system + rest, encoding="utf-8")
    found = run("synth", folder / "plant.yaml", "--rate", "1/2")
    assert found.exit_code == 0, found.stderr
    assert json.loads((folder / "plant.metric.json").read_text("utf-8"))["rate"] == 0.5
    refused = run("synth", folder / "plant.yaml")
    assert refused.exit_code == 2
    said = "plant.yaml:1:11: error TC105: the specification lacks uncertainty and trajectory"
    assert said in refused.stderr
    assert run("certify", folder / "plant.yaml").exit_code == 2
