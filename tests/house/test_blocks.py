"""Every fenced block of README.md and docs/: commands run, specifications checked, code run, output compared.

Pages that have a test of their own are named in ELSEWHERE, commands that take minutes, a cluster or the network in
NOT_RUN: these are still read by the program's own command line. A block that is in no class fails.
"""

import re
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import proven
import pytest
import simulated
import typer
import yaml
from typer.testing import CliRunner

from tubecert import certificate
from tubecert.cli.app import app

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^```(\S*)(?: ([^\n]*))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)

# pages whose blocks are held by another test, and by which
ELSEWHERE = {
    "docs/tutorial.md": "test_tutorial.py",
    "docs/library.md": "test_library_page.py",
    "docs/howto/infeasible.md": "test_howto.py",
    "docs/howto/metric.md": "test_howto.py",
    "docs/howto/plan.md": "test_howto.py",
    "docs/architecture.md": "test_architecture_page.py: rooms, their sizes, who is trusted",
    "docs/reference/codes.md": "tests/spec/test_schema.py, tests/cli/test_everyday.py: fragments of `explain`",
    **dict.fromkeys(
        (path.relative_to(ROOT).as_posix() for path in (ROOT / "docs" / "theory").glob("*.md")),
        "formulas; test_docs.py numbers them, the tests of their rooms evaluate them",
    ),
}

# commands that are read but not run, by how they begin: why
NOT_RUN = {
    "python3 -m venv": "needs the network; .ci/run does it",
    ".venv/bin/pip install": "needs the network; .ci/run does it",
    ".venv/bin/python -m pytest": "these tests",
    "tubecert sweep": "30 certificates, or a cluster; tests/sweep runs smaller ones",
    "dask": "a cluster; tests/executor starts one",
    "tubecert simulate configs/three_state.yaml": "half a minute; tests/simulation",
    "tubecert verify configs/published/": "minutes; tests/metric/test_published.py confirms what it found",
    "tubecert recheck plant.certificate.json --json": "the line above without it",
    "tubecert certify configs/pvtol.yaml": "half a minute; its README line is a test of tests/synthesis",
}

FOREIGN = {
    ("docs/ci.md", "name: specifications"): "a workflow of GitHub; tests/cli/test_everyday.py runs its steps",
    ("docs/ci.md", "repos:"): "of pre-commit; tests/cli/test_everyday.py reads the hooks",
}

# what a command stands for here: it is not done again, or less of it is
TWO_STATE = "tubecert simulate configs/two_state.yaml --epsilon 0.4"
LESS = {
    TWO_STATE: "tubecert simulate configs/two_state.yaml --certificate two.json --runs 2",
}
OF_THE_RUNS = re.compile(r"^(not falsified|  l1 +(100 |0\.1715))")  # lines whose numbers all 100 runs decide


def linear(states: str, inputs: str, *, h: str = "0.01*sin(t)") -> str:
    """A specification with a line for every key: an oscillator for each input."""
    names, moved = states.split(", "), inputs.split(", ")
    n = len(names)
    f = ", ".join(names[i + 1] if i % 2 == 0 else f"-{names[i - 1]} - {names[i]}" for i in range(n))
    B = [[int(i == 2 * j + 1) for j in range(len(moved))] for i in range(n)]
    W = [[1 if i == j else -0.5 if i // 2 == j // 2 else 0 for j in range(n)] for i in range(n)]
    lines = [
        "tubecert: 1",
        "name: plant",
        f"system: {{states: [{states}], inputs: [{inputs}], f: [{f}], B: {B}}}",
        f"safe_set: {{{', '.join(f'{name}: [-10, 10]' for name in names)}}}",
        f"uncertainty: {{h: [{', '.join([h] * len(moved))}]}}",
        f"trajectory: {{kind: equilibrium, at: {[0] * n}, horizon: 10}}",
        f"initial_state: {{at: {[0.01] + [0] * (n - 1)}}}",
        f"metric: {{rate: 0.4, dual_metric: {W}}}",
        "tube: {epsilon: 0.3, rho_a: 0.1}",
    ]
    return "\n".join([*lines, ""])


PLANT = linear("p, v", "u")
# what the parts of specifications on a page are parts of, where that is another one
BASES = {
    "docs/families.md": [linear("p, v", "force")],
    "docs/language.md": [
        PLANT, linear("x, v", "u"), linear("phi, v", "u"), linear("p, v, q, w", "thrust, torque"),
    ],
    "docs/limits.md": [linear("p, v, q, w", "F, tau")],
    "docs/simulate.md": [linear("x1, x2", "u")],
    "docs/sweep.md": [linear("p, v", "u", h="0.01*m*sin(t)").replace("f:", "parameters: {m: 1}, f:")],
    "docs/tubes.md": [linear("q, w", "torque")],
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block: its page, line, kind, what stands after the kind, and its text."""

    page: str
    line: int
    kind: str
    note: str
    text: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def blocks_of(path: Path) -> Iterator[Block]:
    text = path.read_text("utf-8")
    for found in FENCE.finditer(text):
        line = 1 + text[: found.start()].count("\n")
        yield Block(path.relative_to(ROOT).as_posix(), line, found[1], (found[2] or "").strip(), found[3])


BLOCKS = {path.relative_to(ROOT).as_posix(): list(blocks_of(path)) for path in PAGES}
RUN = [page for page, found in BLOCKS.items() if found and page not in ELSEWHERE]


README = "README.md"


NUMBER = re.compile(r"\d[\d.]*(?:e[-+]?\d+)?")


def shape(line: str) -> str:
    """A line without the digits of its numbers, which may differ in the last ones with other versions."""
    line = re.sub(r"sha256:\w+", "sha256:", line)
    return re.sub(r"\s+", " ", NUMBER.sub("#", line)).strip()


def numbers(line: str) -> list[float]:
    return [float(found.rstrip(".")) for found in NUMBER.findall(re.sub(r"sha256:\w+", "", line))]


def told(line: str, real: list[str]) -> bool:
    """Whether a line is one of the output, to a part in a hundred of every number."""
    free = OF_THE_RUNS.match(line)
    return any(
        shape(line) == shape(other)
        and (free or numbers(line) == pytest.approx(numbers(other), rel=0.01, abs=1e-3))
        for other in real
    )


def commands(block: Block) -> list[str]:
    """The commands of a block: a line each, or several that are continued, or joined by `&&`; without comments."""
    lines = (re.sub(r"\s+#.*$", "", line).strip() for line in block.text.replace("\\\n", " ").splitlines())
    parts = (part.strip() for line in lines for part in line.split("&&"))
    return [part.removeprefix(".venv/bin/") if "bin/tubecert" in part else part for part in parts if part]


# what the README has as well is run there
OF_THE_README = {
    command for block in BLOCKS["README.md"] if block.kind == "sh" for command in commands(block)
}


def read_only(command: str) -> bool:
    return any(command.startswith(start) for start in NOT_RUN)


def understood(command: str) -> None:
    """The command line of the program takes it: the subcommand exists, its options and their values."""
    program, *arguments = shlex.split(command.split(" > ", maxsplit=1)[0])
    if program != "tubecert":
        assert program in {"python3", ".venv/bin/pip", ".venv/bin/python", "dask"}, command
        return
    group = typer.main.get_command(app)
    whole = group.make_context("tubecert", arguments[:1])
    name, known, rest = group.resolve_command(whole, arguments)  # type: ignore[attr-defined]
    known.make_context(name, rest, parent=whole)


class Reader:
    """Somebody who does in an empty folder what a page says."""

    def __init__(self, page: str) -> None:
        self.page, self.said = page, ""
        whole = [block.text for block in BLOCKS[page] if block.text.startswith("tubecert: 1")]
        Path("configs").symlink_to(ROOT / "configs")
        for text in whole:
            name = re.search(r"^name: (\w+)$", text, re.MULTILINE)
            Path(f"{name[1] if name else 'spec'}.yaml").write_text(text, "utf-8")
        Path("plant.yaml").write_text([*whole, *BASES.get(page, [PLANT])][0], "utf-8")
        Path("drag.csv").write_text("v,drag\n-20,-3\n0,0\n20,3\n", "utf-8")

    def read(self, block: Block) -> None:
        if block.kind in {"sh", "console"}:
            for command in commands(block):
                self.runs(command, fails=block.note == "fails")
        elif block.kind == "yaml":
            self.checks(block)
        elif block.kind == "text":
            self.compares(block)
        elif block.kind == "python":
            exec(compile(block.text, str(block), "exec"), {})
        else:
            pytest.fail(f"{block}: a block of no kind that is tested: {block.kind!r}")

    def runs(self, command: str, *, fails: bool) -> None:
        understood(command)
        self.said = ""
        if read_only(command) or (self.page != README and command in OF_THE_README):
            return
        self.prepare(command)
        command = LESS.get(command, command).split(" > ")[0]
        program, *arguments = shlex.split(command) or [""]
        if program == "tubecert":
            paths = [str(path) for each in arguments for path in self.files(each)]
            result = CliRunner().invoke(app, paths, prog_name="tubecert")
            assert (result.exit_code != 0) == fails, (command, result.output)
            self.said = result.stdout + result.stderr

    def files(self, argument: str) -> list[Path | str]:
        return [*sorted(Path().glob(argument))] if "*" in argument else [argument]

    def prepare(self, command: str) -> None:
        """What the reader has, or what another test has made."""
        if command == TWO_STATE:
            made = simulated.certified("two_state", "0.4")[1]
            Path("two.json").write_text(certificate.dump(certificate.seal(made.to_json(), {})), "utf-8")
        needed = [*re.findall(r"(\S*?(?:plant|before|after|points/\S*)\.certificate\.json)", command)]
        if command.startswith(("tubecert recheck", "tubecert compare", "tubecert report")):
            for name in (each.replace("*", point) for each in needed for point in ("0001", "0002")):
                Path(name).parent.mkdir(parents=True, exist_ok=True)
                Path(name).write_text(
                    certificate.dump(proven.proven(Path("plant.yaml").read_text())), "utf-8"
                )
        if "coefficients.mat" in command:
            scipy_io = pytest.importorskip("scipy.io")
            scipy_io.savemat("coefficients.mat", {"coefficients": [[1, -1], [-1, 4]]})
        if "published/" in command:
            Path("published").mkdir(exist_ok=True)
            shutil.copy(ROOT / "configs" / "published" / "lmi_pend.yaml", "published")

    def checks(self, block: Block) -> None:
        """A specification, or a part of one in a specification that has the rest: no errors."""
        if (block.page, block.text.split("\n")[0]) in FOREIGN:
            assert yaml.safe_load(block.text)
            return
        for group in groups(block.text):
            tried = [checked(group, base) for base in BASES.get(self.page, [PLANT])]
            assert "" in tried, f"{block}\n" + "\n".join(tried)

    def compares(self, block: Block) -> None:
        assert self.said, f"{block}: output of no command"
        missing = [line for line in block.text.splitlines() if not told(line, self.said.splitlines())]
        assert not missing, f"{block}: not printed: {missing}\n{self.said}"


def parts(text: str) -> list[tuple[str, str]]:
    """The keys at the margin of a text of YAML, each with its text."""
    found = re.split(r"^(?=\w+:)", text, flags=re.MULTILINE)
    return [(each.split(":")[0], each.rstrip("\n")) for each in found if re.match(r"\w", each)]


def groups(text: str) -> list[list[tuple[str, str]]]:
    """What belongs together: all keys, or, where one stands twice, each by itself."""
    own = parts(text)
    return [own] if len(dict(own)) == len(own) else [[each] for each in own]


def checked(group: list[tuple[str, str]], base: str) -> str:
    """What `check` objects to in the base with these keys; nothing if it is content."""
    text = "\n".join([*completed(group, parts(base)), ""])
    Path("part.yaml").write_text(text, "utf-8")
    found = CliRunner().invoke(app, ["check", "part.yaml", "--no-cache", "--format", "text"])
    return "" if found.exit_code == 0 else f"{found.output}\n{text}"


def completed(group: list[tuple[str, str]], base: list[tuple[str, str]]) -> Iterator[str]:
    keys = dict(group)
    for key, text in base:
        if key not in keys:
            if "hardware" not in keys or key not in ("metric", "tube"):  # beside which there is no metric
                yield text
        elif key == "system":  # what the system of the block leaves out
            own = yaml.load(keys[key], Loader=yaml.BaseLoader)[key]
            rest = {
                name: value
                for name, value in yaml.load(text, Loader=yaml.BaseLoader)[key].items()
                if name not in own
            }
            lines = [
                f"  {name}: {yaml.safe_dump(value, default_flow_style=True).strip()}"
                for name, value in rest.items()
            ]
            yield "\n".join([keys[key], *lines]).replace("\n...", "")
        else:
            yield keys[key]
    yield from (text for key, text in group if key not in dict(base))


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("page", RUN)
def test_the_page(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    reader = Reader(page)
    for block in BLOCKS[page]:
        reader.read(block)


def test_every_block_has_a_kind():
    for page, found in BLOCKS.items():
        text = (ROOT / page).read_text("utf-8")
        assert 2 * len(found) == len(re.findall(r"^\s*```", text, re.MULTILINE)), page
        assert all(block.kind for block in found), [str(block) for block in found if not block.kind]
        assert not re.search(r"^    (\$ )?tubecert ", text, re.MULTILINE), f"{page}: a command in no block"


def test_the_lists_name_what_is_there():
    """An exception that nothing needs any longer is taken out."""
    every = [
        command
        for page in RUN
        for block in BLOCKS[page]
        if block.kind in {"sh", "console"}
        for command in commands(block)
    ]
    for start in (*NOT_RUN, *LESS):
        assert any(command.startswith(start) for command in every), start
    assert {(block.page, block.text.split("\n")[0]) for page in RUN for block in BLOCKS[page]} >= set(FOREIGN)
    assert {page for page in ELSEWHERE if BLOCKS[page]} == set(ELSEWHERE)
    assert set(BASES) <= set(RUN)
