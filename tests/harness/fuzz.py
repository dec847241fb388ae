"""Fuzzing: mutated and grammar-made specifications through parsing and lint, or through the whole `check --certify`.

Every case follows from its number. A case fails if anything but findings comes out: an exception, exit code 3, a
finding without a place or page, a canonical form that does not load again, a key that the JSON Schema does not know,
or an alarm; a case that kills the process (memory is limited) was the last one named on stderr.

    python tests/harness/fuzz.py --cases 100000                  # parse and lint
    python tests/harness/fuzz.py --cases 1000 --mode certify     # the command, with a small budget; metrics for
                                                                 # more than four states are not synthesised
    python tests/harness/fuzz.py --first 4711 --cases 1 --show   # one case
"""

import argparse
import json
import os
import random
import re
import resource
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

_FEW_STATES = 4
ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))  # the checkout that this file is a part of
CORPUS = sorted(
    path
    for folder in ("configs", "tests/specs/ok", "tests/specs/bad", "tubecert/templates")
    for path in (ROOT / folder).glob("*.yaml")
)
NASTY = [
    *(
        "", "0", "-0", "1e-3", "1e300", "1e-300", "1/0", "0/1", "1/3", ".inf", ".nan", "NaN", "yes", "null",
        "~", "1_000",
    ),
    *("0x10", "1:30", "-1", "999999999999999999999", "2**12", "2**99", "x", "t", "pi", "e", "x1", "x2", "u", "h"),
    *("sin(x1)", "1/x1", "sqrt(x1)", "tan(x1)", "exp(exp(x1))", "abs(x1)", "norm(x1, x2)", "x1**-2", "x1**x2"),
    *("((((((((((x1))))))))))", "-" * 60 + "1", "x1" + "+x1" * 200, "x1" + "*x1" * 300, "'", '"', "[", "]", "{", "}"),
    *("{a: 1}", "[1, 2]", "[[1]]", "&a b", "*a", "!!python/object:os.system x", "? a", "- - -", "|", ">", "#", "\t"),
    *("ä", "θ", "\u202e", "\x00", "\x1b[31m", "😀", "::error::x", "%0A", "<script>", "a: b: c", "<<", "true", "auto"),
    *("hard", "equilibrium", "expressions", "csv", "ilqr", "certified", "../../etc/passwd", "/dev/zero", "."),
]  # fmt: skip
FUNCTIONS = ["sin", "cos", "tan", "exp", "sqrt", "abs", "norm"]


def case(number: int) -> str:
    """The text of a case."""
    rng = random.Random(number)
    kind = rng.randrange(4)
    if kind == 0:
        return grammar(rng)
    good = [path for path in CORPUS if "bad" not in path.parts]
    path = rng.choice(good if rng.random() < 0.8 else CORPUS)
    text = grammar(rng) if kind == 1 else path.read_text(encoding="utf-8", errors="replace")
    for _ in range(rng.choice([1, 1, 1, 1, 2, 3, 8])):
        text = rng.choice(MUTATIONS)(rng, text)
    return text


def _lines(change: Callable[[random.Random, list[str]], None]) -> Callable[[random.Random, str], str]:
    def mutate(rng: random.Random, text: str) -> str:
        lines = text.split("\n")
        change(rng, lines)
        return "\n".join(lines)

    return mutate


def _delete(rng: random.Random, lines: list[str]) -> None:
    del lines[rng.randrange(len(lines))]


def _repeat(rng: random.Random, lines: list[str]) -> None:
    k = rng.randrange(len(lines))
    lines[k:k] = [lines[k]] * rng.choice([1, 1, 2, 300])


def _swap(rng: random.Random, lines: list[str]) -> None:
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[i], lines[j] = lines[j], lines[i]


def _indent(rng: random.Random, lines: list[str]) -> None:
    k = rng.randrange(len(lines))
    lines[k] = " " * rng.randrange(5) + lines[k].lstrip() if rng.random() < 0.8 else "\t" + lines[k]


def _tokens(text: str) -> list[tuple[int, int]]:
    return [match.span() for match in re.finditer(r"[A-Za-z_]\w*|[\d.]+(?:e[+-]?\d+)?|\S", text)]


def _replace_token(rng: random.Random, text: str) -> str:
    spans = _tokens(text)
    if not spans:
        return rng.choice(NASTY)
    a, b = rng.choice(spans)
    return text[:a] + rng.choice(NASTY) + text[b:]


def _exchange_tokens(rng: random.Random, text: str) -> str:
    spans = _tokens(text)
    if len(spans) < 2:
        return text
    (a, b), (c, d) = sorted(rng.sample(spans, 2))
    return text[:a] + text[c:d] + text[b:c] + text[a:b] + text[d:]


def _scale_number(rng: random.Random, text: str) -> str:
    spans = [match.span() for match in re.finditer(r"\d+\.?\d*", text)]
    if not spans:
        return text
    a, b = rng.choice(spans)
    return text[:a] + f"{float(text[a:b]) * 10.0 ** rng.randint(-6, 6):.6g}" + text[b:]


def _characters(rng: random.Random, text: str) -> str:
    k = rng.randrange(len(text) + 1)
    return text[:k] + rng.choice([*"{}[]:,-?&*!|>'\"%@` \t\n#^=;", *NASTY]) + text[k + rng.randrange(3) :]


def _cut(rng: random.Random, text: str) -> str:
    a = rng.randrange(len(text) + 1)
    return text[:a] + text[rng.randrange(a, len(text) + 1) :]


MUTATIONS: list[Callable[[random.Random, str], str]] = [
    *(_lines(change) for change in (_delete, _repeat, _swap, _indent)),
    *(_replace_token, _replace_token, _exchange_tokens, _characters, _cut),
    *[_scale_number] * 5,
]


def expression(rng: random.Random, names: list[str], depth: int, functions: list[str]) -> str:
    """A random expression."""
    if depth == 0 or rng.random() < 0.25:
        return rng.choice([*names, *names, number(rng)])
    below = [expression(rng, names, depth - 1, functions) for _ in range(2)]
    match rng.randrange(6):
        case 0 | 1:
            return f"{below[0]} {rng.choice('+-')} {below[1]}"
        case 2:
            return f"({below[0]})*({below[1]})"
        case 3:
            bottom = rng.choice([f"({below[1]})**2 + 1"] * 6 + [f"{below[1]} + 2", below[1]])
            return f"({below[0]})/({bottom})"
        case 4:
            return f"({below[0]})**{rng.choice(['2', '2', '2', '3', '3', '1', '0', '-1', '12'])}"
        case _:
            name = rng.choice([*functions[:2], *functions])
            return f"{name}({below[0]}{', ' + below[1] if name == 'norm' else ''})"


def number(rng: random.Random) -> str:
    """A random number, sometimes an odd one."""
    if rng.random() < 0.03:
        return rng.choice(["0", "1e300", "-1e-300", "1/3", "1e-9", "12345678901234567890"])
    return f"{rng.choice([-1, 1, 1]) * rng.choice([0.1, 1, 2, 0.25, 3.3, 10]) * rng.randint(1, 9):.4g}"


def positive(rng: random.Random) -> str:
    """A random positive number."""
    return f"{rng.choice([1e-3, 0.01, 0.1, 1, 10]) * rng.randint(1, 9):.4g}"


def grammar(rng: random.Random) -> str:
    """A well-formed specification of a random system; most of these load, few certify."""
    n = rng.randint(1, 4)
    m = rng.randint(1, n)
    states, inputs = [f"x{i + 1}" for i in range(n)], [f"u{j + 1}" for j in range(m)]
    smooth = FUNCTIONS[:5] if rng.random() < 0.5 else FUNCTIONS[:2]

    def e(names: list[str], depth: int = 3, functions: list[str] = smooth) -> str:
        return expression(rng, names, rng.randint(0, depth), functions)

    B = [["0"] * m for _ in range(n)]
    for j in range(m):
        B[n - 1 - j][j] = e(states, 2) if rng.random() < 0.3 else positive(rng)
    W = [["0"] * n for _ in range(n)]
    for i in range(n):
        for j in range(i + 1):
            beside = e(states[: max(1, n - m)], 2) if rng.random() < 0.2 else number(rng)
            W[i][j] = W[j][i] = positive(rng) if i == j else beside
    data: dict[str, Any] = {
        "tubecert": 1,
        "name": f"case{rng.randrange(1000)}",
        "system": {"states": states, "inputs": inputs, "f": [e(states) for _ in states], "B": B},
        "safe_set": {name: [f"-{positive(rng)}", positive(rng)] for name in states},
        "uncertainty": _uncertainty(rng, e, states, inputs),
        "trajectory": _trajectory(rng, e, n, m),
    }
    if rng.random() < 0.8:
        data["metric"] = {"rate": positive(rng), "dual_metric": W}
    if rng.random() < 0.8:
        data["tube"] = {"epsilon": positive(rng), "rho_a": positive(rng)}
    if rng.random() < 0.3 or data["trajectory"]["kind"] in ("ilqr", "expressions"):
        data["initial_state"] = {"within": positive(rng)} if rng.random() < 0.3 else {"at": [number(rng)] * n}
    if rng.random() < 0.3:
        data["adaptation"] = {"A_m": rng.choice(["auto", "-1", number(rng)])}
    if rng.random() < 0.2:
        verdict = rng.choice(["certified", "refuted", "undecided"])
        data["expect"] = {"verdict": verdict, "rho": ["0", positive(rng)]}
    if rng.random() < 0.2:
        data["limits"] = {inputs[0]: [number(rng), number(rng)]}
    if n >= 2 and rng.random() < 0.2:
        disc = {"center": [number(rng), number(rng)], "radius": positive(rng)}
        corners = [[number(rng), number(rng)] for _ in range(rng.randint(3, 6))]
        data["obstacles"] = [
            {"states": states[:2], **({"disc": disc} if rng.random() < 0.5 else {"polygon": corners})}
        ]
    return json.dumps(data, indent=1 if rng.random() < 0.5 else None)


def _uncertainty(
    rng: random.Random, e: Callable[..., str], states: list[str], inputs: list[str]
) -> dict[str, Any]:
    h = [e(rng.choice([["t"], states, [*states, "t"]]), 3, FUNCTIONS) for _ in inputs]
    bounds = {name: positive(rng) for name in ("h", "h_x", "h_t")}
    return rng.choice([{"h": h}, {"bounds": bounds}, {"h": h, "bounds": bounds}])


def _trajectory(rng: random.Random, e: Callable[..., str], n: int, m: int) -> dict[str, Any]:
    horizon = {"horizon": positive(rng)} if rng.random() < 0.7 else {}
    match rng.randrange(4):
        case 0:
            x, u = [e(["t"], 2) for _ in range(n)], [e(["t"], 2) for _ in range(m)]
            return {"kind": "expressions", "x": x, "u": u, "horizon": positive(rng)}
        case 1:
            target, knots = [number(rng) for _ in range(n)], rng.choice([2, 5, 21])
            goal = rng.choice(["true", "false"])
            return {"kind": "ilqr", "target": target, "knots": knots, "horizon": positive(rng), "goal": goal}
        case _:
            at = [rng.choice(["0", number(rng)]) for _ in range(n)]
            return {"kind": "equilibrium", "at": at, **horizon}


def _takes_minutes(text: str) -> bool:
    """Whether its metric is synthesised for many states: a solver is no matter of boxes, nor to be interrupted."""
    from tubecert.errors import TubecertError
    from tubecert.spec import load_text

    try:
        spec = load_text(text, "case.yaml")
    except TubecertError:
        return False
    return spec.metric is None and spec.synthesis is not None and len(spec.states) > _FEW_STATES


@dataclass(slots=True)
class Judge:
    """Looks at one case; returns words for the statistics, raises for a failure."""

    mode: str
    budget: int
    schema: Any = None
    pages: Any = None
    folder: Path = field(default_factory=lambda: Path(tempfile.mkdtemp(prefix="fuzz-")))

    def __call__(self, number: int) -> str:
        text = case(number)
        return self._lint(text) if self.mode == "lint" else self._command(number, text)

    def _lint(self, text: str) -> str:
        from tubecert import pipeline
        from tubecert.errors import TubecertError
        from tubecert.spec import load_text

        try:
            spec = load_text(text, "case.yaml")
        except TubecertError as error:
            self._findings(error.findings, text)
            return f"refused {error.findings[0].code}"
        self._accepted(spec, text)
        findings = pipeline.inspect(spec, budget=self.budget)
        self._findings(findings)
        return f"lint {findings[0].code}" if findings else "clean"

    def _findings(self, findings: Any, refused: str | None = None) -> None:
        if self.pages is None:
            from tubecert.report import pages

            self.pages = pages.codes()
        assert findings or refused is None, "refused without a reason"
        for item in findings:
            assert item.code in self.pages, item.code
            if refused is not None:
                lines = re.split(r"\r\n|\r|\n", refused)
                assert item.location is not None, str(item)
                assert 1 <= item.location.line <= len(lines), str(item)
                assert 1 <= item.location.column <= len(lines[item.location.line - 1]) + 1, str(item)
            assert str(item).isprintable() or "\n" in str(item)
            assert not set(map(ord, str(item))) & (set(range(32)) - {10}), "a control character"

    def _accepted(self, spec: Any, text: str) -> None:
        """What the reader accepts, the schema does; and the canonical form is the same specification."""
        import yaml

        from tubecert.spec import canonical, load_text
        from tubecert.spec.canonical import as_file

        data = canonical(spec)
        if spec.trajectory.table is None:
            again = load_text(json.dumps(as_file(data)), "canonical.json")
            assert canonical(again) == data, "canonical form differs"
        if self.schema is None:
            import jsonschema

            path = ROOT / "tubecert/schemas/spec.schema.json"
            self.schema = jsonschema.Draft202012Validator(json.loads(path.read_text(encoding="utf-8")))
        written = yaml.load(text.lstrip("\ufeff"), Loader=yaml.CBaseLoader)
        wrong = [
            error for error in self.schema.iter_errors(written) if error.validator not in ("enum", "const")
        ]
        assert not wrong, f"the schema refuses what the reader accepts: {wrong[0].message}"

    def _command(self, number: int, text: str) -> str:
        from typer.testing import CliRunner

        from tubecert.cli.app import app

        if _takes_minutes(text):
            return f"large, {self._lint(text)}"
        path = self.folder / "case.yaml"
        path.write_text(text, encoding="utf-8", errors="replace")
        format_ = ("text", "json", "github", "junit", "sarif")[number % 5]
        options = ["--no-cache", "--certify", "--format", format_, "--budget", str(self.budget)]
        result = CliRunner().invoke(app, ["check", str(path), *options])
        said = result.output
        assert result.exception is None or isinstance(result.exception, SystemExit), repr(result.exception)
        assert "Traceback" not in said, said[-2000:]
        assert result.exit_code in (0, 1, 2, 4), f"exit code {result.exit_code}: {said[-2000:]}"
        if format_ in ("json", "sarif"):
            json.loads(result.stdout)
        return f"exit {result.exit_code}"


class Alarm(BaseException):
    """A case took too long."""


def _ring(*_: object) -> None:
    raise Alarm


def outcome(judge: Judge, number_: int, seconds: float) -> str:
    """What became of a case; other work on the machine makes none slow, as seconds of this process are counted."""
    try:
        # again and again: a library may take the first ring for an error of its own
        signal.setitimer(signal.ITIMER_PROF, seconds, 0.2 * seconds)
        try:
            return judge(number_)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
    except Alarm:
        return f"FAILED alarm after {seconds:g} s"
    except Exception as error:  # whatever it is, it is a failure
        where = traceback.extract_tb(error.__traceback__)[-1]
        return (
            f"FAILED {type(error).__name__} in {Path(where.filename).name}:{where.lineno}: {str(error)[:300]}"
        )


def run(options: argparse.Namespace) -> dict[str, list[int]]:
    """The cases of each outcome; memory is limited, and the number of a case that kills the process was said."""
    resource.setrlimit(resource.RLIMIT_AS, (options.memory << 20, options.memory << 20))
    os.environ["XDG_STATE_HOME"] = os.environ["XDG_CACHE_HOME"] = tempfile.mkdtemp(prefix="fuzz-state-")
    signal.signal(signal.SIGPROF, _ring)
    judge = Judge(mode=options.mode, budget=options.budget)
    os.chdir(judge.folder)
    found: dict[str, list[int]] = {}
    for number_ in range(options.first, options.first + options.cases):
        print(f"\r{number_}", end="", file=sys.stderr, flush=True)
        found.setdefault(outcome(judge, number_, options.alarm), []).append(number_)
    print(file=sys.stderr)
    return found


def main() -> int:
    """Fuzz; 1 if anything failed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--mode", choices=["lint", "certify"], default="lint")
    parser.add_argument("--alarm", type=float, help="seconds of CPU per case [10; certify: 120]")
    parser.add_argument("--memory", type=int, default=3000, help="address space, in MB")
    parser.add_argument("--budget", type=int, default=2000, help="boxes per claim")
    parser.add_argument("--show", action="store_true", help="print the texts of the cases instead")
    options = parser.parse_args()
    options.alarm = options.alarm or (10.0 if options.mode == "lint" else 120.0)
    if options.show:
        print(*map(case, range(options.first, options.first + options.cases)), sep="\n")
        return 0
    found = run(options)
    for said, numbers in sorted(found.items(), key=lambda item: -len(item[1])):
        print(f"{len(numbers):7d}  {said}{f': cases {numbers[:20]}' if said.startswith('FAILED') else ''}")
    return int(any(said.startswith("FAILED") for said in found))


if __name__ == "__main__":
    raise SystemExit(main())
