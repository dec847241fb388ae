"""Writes docs/reference/: python docs/generate.py

From the table of keys (`tubecert.spec.keys`), the records of certificates, the pages of `explain` and what `verify`
said of the published metrics. The JSON Schemas are written as well.
"""

from __future__ import annotations

import ast
import inspect
import json
import re
import sys
from collections.abc import Iterator, Mapping
from decimal import ROUND_CEILING, Context
from itertools import pairwise
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

import forms  # noqa: E402

from tubecert import certificate as of_continuous  # noqa: E402
from tubecert import records  # noqa: E402
from tubecert.certificate import effective, result  # noqa: E402
from tubecert.certificate.notes import NOTES, Places  # noqa: E402
from tubecert.claims import written  # noqa: E402
from tubecert.expression import MAX_LENGTH, MAX_NAME_LENGTH  # noqa: E402
from tubecert.kinds.table import KINDS  # noqa: E402
from tubecert.report import pages  # noqa: E402
from tubecert.sampled_loop import record as of_samples  # noqa: E402
from tubecert.spec import metric_file  # noqa: E402
from tubecert.spec.keys import LIST, NAME, NUMBER, PAIR, Section  # noqa: E402
from tubecert.spec.load import FILE  # noqa: E402
from tubecert.spec.metric import METRIC  # noqa: E402
from tubecert.spec.plan import PLANS  # noqa: E402

REFERENCE = ROOT / "docs" / "reference"
_NOTE = "<!-- written by docs/generate.py; do not edit -->"
_KINDS = {
    "object": "mapping",
    "array": "list",
    "string": "text",
    "number": "number",
    "integer": "whole number",
}


_VALUES = {
    "start_by_state": {
        "description": "A number or a range [low, high] for some states.",
        "type": "object",
        "propertyNames": NAME,
        "additionalProperties": {"anyOf": [NUMBER, PAIR]},
        "examples": [{"x": [-0.1, 0.1]}],
    },
    "number": {
        "description": "An exact rational number: 0.1 is one tenth; a text may be a quotient or use parameters "
        '("1/3", "m*g/2"), pi or degrees ("-pi/4", "30 deg").',
        "type": ["number", "string"],
        "minLength": 1,
    },
    "expression": {
        "description": "An expression: + - * / **, sin cos tan asin acos atan sinh cosh tanh exp log sqrt, pi, "
        "numbers, names.",
        "type": ["number", "string"],
        "minLength": 1,
        "maxLength": MAX_LENGTH,
    },
    "name": {
        "type": "string",
        "pattern": f"^[A-Za-z][A-Za-z0-9_]{{0,{MAX_NAME_LENGTH - 1}}}$",
        "description": "A letter, then letters, digits and _; unique, and neither t nor a function.",
    },
    "matrix": {
        "description": "A square matrix by rows, or a number that stands for a multiple of the identity.",
        "anyOf": [NUMBER, {"type": "array", "minItems": 1, "items": LIST}],
    },
}
"""Forms of values that users of the schema of specifications know by name."""


class Reference:
    """A schema as a page: a table for each mapping."""

    def __init__(self, schema: dict[str, Any]) -> None:
        self.schema = schema
        self.waiting: list[tuple[str, dict[str, Any]]] = []

    def page(self) -> str:
        """The text."""
        parts = [_NOTE, f"# {self.schema['title'].capitalize()}", self.schema["description"]]
        self.waiting = [("", self.schema)]
        while self.waiting:
            parts += self._section(*self.waiting.pop(0))
        types = [f"- **{name}**: {self.schema['$defs'][name]['description']}" for name in self._simple()]
        for name in self._families():
            parts += self._family(name)
        return "\n\n".join([*parts, "## Kinds of values", "\n".join(types)]) + "\n"

    def _simple(self) -> list[str]:
        return [name for name, value in self.schema.get("$defs", {}).items() if "properties" not in value]

    def _families(self) -> list[str]:
        return [
            name
            for name, value in self.schema.get("$defs", {}).items()
            if _tag(*value.get("anyOf", ({},))[:1])
        ]

    def _family(self, name: str) -> Iterator[str]:
        """The members of a family of records, each told apart by its id."""
        family = self.schema["$defs"][name]
        key, _ = _tag(family["anyOf"][0]) or ("id", "")
        yield f"## {name}"
        yield f"{family['description']} Told apart by `{key}`; the other members are parameters."
        rows = [f"| `{key}` | parameters | meaning |", "|---|---|---|"]
        for member in family["anyOf"]:
            own, tag = _tag(member) or ("", "")
            names = [other for other in member["properties"] if other != own]
            parameters = ", ".join(f"`{other}`" for other in names)
            rows.append(f"| `{tag}` | {parameters} | {self._meaning(member)} |")
        yield "\n".join(rows)

    def _section(self, path: str, schema: dict[str, Any]) -> Iterator[str]:
        if path:
            yield f"## `{path}`"
            yield schema.get("description", "")
        rows = ["| key | value | meaning |", "|---|---|---|"]
        required = set(schema.get("required", ()))
        for key, value in schema.get("properties", {}).items():
            name = f"{path}.{key}" if path else key
            mark, kind = " (required)" if key in required else "", self._kind(name, value)
            if not mark and "anyOf" in value:
                kind = kind.removesuffix(" or null")  # what is left out may be null as well
            rows.append(f"| `{key}`{mark} | {kind} | {self._meaning(value)} |")
        yield "\n".join(rows)

    def _resolved(self, value: dict[str, Any]) -> dict[str, Any]:
        if "$ref" not in value:
            return value
        target = self.schema["$defs"][value["$ref"].rsplit("/", 1)[1]]
        return {**target, **{key: item for key, item in value.items() if key != "$ref"}}

    def _kind(self, path: str, value: dict[str, Any]) -> str:
        """What a value is, in words; mappings get sections of their own."""
        if "$ref" in value and "properties" not in value:
            name = value["$ref"].rsplit("/", 1)[1]
            if "properties" not in self.schema["$defs"][name]:
                return name
        value = self._resolved(value)
        if "allOf" in value:
            return " or ".join(self._branch(path, item) for item in value["allOf"])
        if "properties" in value:
            self.waiting.append((path, value))
            return "mapping, see below"
        if "enum" in value:
            return ", ".join(dict.fromkeys(f"`{str(item).lower()}`" for item in value["enum"]))
        if "const" in value:
            return f"`{value['const']}`"
        if "anyOf" in value:
            return " or ".join(dict.fromkeys(self._kind(path, item) for item in value["anyOf"]))
        if value.get("type") == "array":
            return f"list of: {self._kind(f'{path}[]', value['items'])}"
        if isinstance(value.get("additionalProperties"), dict):
            return f"mapping of names to: {self._kind(f'{path}.*', value['additionalProperties'])}"
        kinds = value.get("type", "anything")
        return " or ".join(_KINDS.get(kind, kind) for kind in ([kinds] if isinstance(kinds, str) else kinds))

    def _branch(self, path: str, item: dict[str, Any]) -> str:
        kind = item["if"]["properties"]["kind"]["const"]
        self.waiting.append((f"{path}, kind: {kind}", self._resolved(item["then"])))
        return f"`kind: {kind}`"

    def _meaning(self, value: dict[str, Any]) -> str:
        value = self._resolved(value)
        words = value.get("description", "").replace("*", "\\*").replace("<", "&lt;")
        if "default" in value:
            words += f" Default: `{json.dumps(value['default'])}`."
        if "examples" in value:
            words += " Example: " + ", ".join(f"`{json.dumps(item)}`" for item in value["examples"]) + "."
        return words.replace("|", "\\|").strip()


def _tag(schema: dict[str, Any]) -> tuple[str, str] | None:
    """The member that tells a record of a family apart, and what it is."""
    found = [(key, value["const"]) for key, value in schema.get("properties", {}).items() if "const" in value]
    return found[0] if found else None


def codes() -> str:
    """The page of finding codes."""
    parts = [_NOTE, "# Finding codes", "The same pages as `tubecert explain CODE`. Codes are stable."]
    for page in pages.codes().values():
        parts += [f"## {page.name}: {page.title}", page.meaning]
        parts += [f"{name}:\n\n```text\n{text}\n```" for name, text in page.examples]
    return "\n\n".join(parts) + "\n"


def published() -> str:
    """The page of published metrics, from what `verify` said of them (configs/published/verified.json)."""
    folder = ROOT / "configs" / "published"
    known = json.loads((folder / "verified.json").read_text(encoding="utf-8"))
    count = {word: sum(each["verdict"] == word for each in known) for word in ("certified", "refuted")}
    parts = [
        _NOTE,
        "# Published metrics",
        "Contraction metrics as their authors published them, every digit, each on the set and at the rate that were "
        "published with it, and what is proven of each with true sine and cosine: C1 (W is positive definite), C2 and "
        f"C3 hold for {count['certified']} of {len(known)}; {count['refuted']} are refuted, each at a point of its set "
        "that a test evaluates again with 50 digits (tests/metric/test_published.py). One of these fails C3 in its "
        "strong form only, which tubecert asks for: its authors ask for a weaker one. *Supports* is the largest rate "
        "for which C2 is proven on that set.",
        "```console\ntubecert verify configs/published/*.yaml --json > configs/published/verified.json\n```",
        "The command takes a few minutes; `tubecert verify configs/published/*.yaml --expect` compares with what the "
        "files lock.",
        "\n".join(_by_source(folder, known)),
        "| metric | published | proven | supports, 1/s | condition number | refuted at |\n|---|---|---|---|---|---|\n"
        + "\n".join(_published_row(folder, each) for each in known),
        *_beside(folder, known),
        "## Sources",
        "\n".join(f"- {source}" for source in _sources(folder, known)),
    ]
    return "\n\n".join(parts) + "\n"


def _published_row(folder: Path, each: dict[str, Any]) -> str:
    notes = _notes(folder / Path(each["file"]).name)
    rate, at = each.get("largest_rate"), each.get("reason", {}).get("at")
    condition = each.get("condition_number")
    where = (
        ""
        if at is None
        else ", ".join(f"{name} = {value:.6g}" for name, value in zip(each["safe_set"], at["x"], strict=True))
    )
    failed = "" if each["verdict"] == "certified" else f": {_FAILS[each['reason']['claim']]}"
    cells = [
        f"`{Path(each['file']).stem}`",
        notes["published"].split(";")[0],
        each["verdict"] + failed,
        "" if rate is None else f"{rate[0]:.6g}" if rate[0] > 0 else "none above 0",
        "" if condition is None else f"{condition[1]:.4g}",
        where,
    ]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _beside(folder: Path, known: list[dict[str, Any]]) -> Iterator[str]:
    """Beside each metric that is refuted the one that was found, from what `verify` said of that."""
    found = json.loads((folder / "found" / "verified.json").read_text(encoding="utf-8"))
    yield "## Beside each that is refuted"
    yield (
        "What `tubecert synth` finds for the same system, on the same set, at the published rate or just above it. "
        "Each is a file in `configs/published/found/` with the verdict that `verify` gives it; the condition number "
        "is a proven bound on the whole set, and the seconds are of one core, proof included."
    )
    command = "tubecert verify configs/published/found/*.yaml --json > configs/published/found/verified.json"
    yield f"```console\n{command}\n```"
    rows = [
        "| published | its rate, 1/s | its condition number | found | rate, 1/s | condition number | verdict | s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    refuted = {Path(each["file"]).stem: each for each in known if each["verdict"] == "refuted"}
    notes: list[str] = []
    for each in found:
        own = _notes(folder / "found" / Path(each["file"]).name)
        rows += [_beside_row(refuted[name], each, own) for name in own["for"].split(", ")]
        notes += [f"- `{Path(each['file']).stem}`: {own['beside']}."] if "beside" in own else []
    yield "\n".join(rows)
    yield _QUADROTOR + "\n\n" + "\n".join(notes)


def _beside_row(published: dict[str, Any], found: dict[str, Any], notes: dict[str, str]) -> str:
    condition = published.get("condition_number")
    cells = [
        f"`{Path(published['file']).stem}`",
        f"{published['rate']:.6g}",
        "" if condition is None else f"{condition[1]:.4g}",
        f"`found/{Path(found['file']).name}`",
        f"{found['rate']:.6g}",
        str(Context(prec=4, rounding=ROUND_CEILING).create_decimal(str(found["condition_number"][1]))),
        found["verdict"] + (", not the same set" if "beside" in notes else ""),
        notes["seconds"],
    ]
    return "| " + " | ".join(cells) + " |"


_QUADROTOR = (
    "For the nine-state quadrotor **no metric was found on its set at its rate**. Thrust and angles are all moved by "
    "inputs, so C3 in its strong form leaves W a function of position and velocity alone; a constant W was searched, "
    "and at rates from 1.29 down to .001 the solver finds the conditions at points of the set infeasible (its word, "
    "not a proof). What was found:"
)

_FAILS = {"metric_definite": "C1", "metric_contraction": "C2", "metric_killing": "C3 in its strong form"}


def _notes(path: Path) -> dict[str, str]:
    """The comments at the head of a file: `# key: words`."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return dict(line[2:].split(": ", 1) for line in lines if line.startswith("# "))


def _sources(folder: Path, known: list[dict[str, Any]]) -> list[str]:
    """Every source once, without the number of a metric of a series."""
    found = [_notes(folder / Path(each["file"]).name) for each in known]
    told = [f"{n['source']} ({n['published']})" for n in found]
    return list(dict.fromkeys(re.sub(r"cached metric \d+", "cached metrics (ged_..)", text) for text in told))


def _by_source(folder: Path, known: list[dict[str, Any]]) -> list[str]:
    """How many metrics of each source hold."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for each in known:
        source = _notes(folder / Path(each["file"]).name)["source"]
        groups.setdefault(re.split(r",| \(", source)[0], []).append(each)
    rows = (_of_source(source, groups[source]) for source in sorted(groups))
    return ["| source | metrics | hold | refuted |", "|---|---|---|---|", *rows]


def _of_source(source: str, group: list[dict[str, Any]]) -> str:
    failed = [_FAILS[each["reason"]["claim"]] for each in group if each["verdict"] != "certified"]
    counts = (f"{failed.count(claim)} {claim}" for claim in sorted(set(failed)))
    told = f"{len(failed)} ({', '.join(counts)})" if failed else "0"
    return f"| {source} | {len(group)} | {len(group) - len(failed)} | {told} |"


_DECIMAL = {
    "description": "An exact decimal, or a quotient as text.",
    "type": ["number", "string"],
    "pattern": f"^({records._DECIMAL.pattern}|{records._QUOTIENT.pattern})$",
}
_NULL = {"type": "null"}
_SPECIFICATION = {"description": "An effective specification.", "type": "object"}


def certificate() -> dict[str, Any]:
    """The schema of certificates, from their records and the words of these."""
    proven, noted = _parted(forms.schema(result.Result), NOTES)
    proven["properties"]["decided_by"]["items"] = {"enum": [kind.key for kind in KINDS]}
    start = proven["properties"]["claim"]["properties"]["start"]
    start["oneOf"] = [{"required": [key], "properties": {key: {"not": _NULL}}} for key in start["properties"]]
    asked = {
        "description": "`metric.synthesise` of the specification, or what the command line asked for.",
        "type": "object",
        "required": [*effective._ASKED],
        "propertyNames": {"enum": [*effective._ASKED, *effective._MAY_ASK]},
        "additionalProperties": {"type": ["string", "array"], "items": {"type": "string"}},
    }
    ends = "[proven below, proven above]; null where no bound was found."
    defined = {
        "enclosure": {"description": ends, **forms.schema(tuple[float | None, float | None])},
        "point": forms.schema(written._Place),
        "asked": asked,
        **{name: forms.family(kind) for name, kind in forms.FAMILIES.items()},
    }
    return {
        "$id": "urn:tubecert:certificate:2",
        "title": "tubecert certificate",
        "description": "What `certify` writes, for every verdict. `recheck` reads these keys and no others: more keys "
        "are another version.",
        **_sealed(of_continuous.FORMAT, proven, noted, forms.schema(result.Run)),
        "additionalProperties": False,
        "$defs": {"decimal": _DECIMAL, "specification": _SPECIFICATION, **defined},
    }


def _parted(form: dict[str, Any], tree: Places) -> tuple[dict[str, Any], dict[str, Any]]:
    """The forms of what stays of a value and of its notes, as `certificate.notes.split` parts the value."""
    for key, inner in (("items", tree), ("additionalProperties", tree.get("*", tree))):
        if isinstance(form.get(key), dict):
            stays, told = _parted(form[key], inner)
            return {**form, key: stays}, {**form, key: told}
    if "anyOf" in form:
        stays, told = _parted(form["anyOf"][0], tree)
        return {**form, "anyOf": [stays, _NULL]}, told
    own, noted = dict(form["properties"]), {}
    beside = [key for key in tree if key not in own]  # of members of a family
    for key, inner in tree.items():
        if key in beside:
            noted[key] = _of_family(form["$ref"], key)
        elif inner:
            own[key], told = _parted(own[key], inner)
            noted[key] = {**told, "description": f"What explains `{key}`."}
        else:
            noted[key] = own.pop(key)
    stays = {**form, "properties": own, **({"not": {"required": beside}} if beside else {})}
    words = "What explains it and claims nothing."
    told = {"type": "object", "description": words, "properties": noted, "additionalProperties": False}
    return stays, told


def _of_family(reference: str, key: str) -> dict[str, Any]:
    """The form of a member of a family's record."""
    family = forms.family(forms.FAMILIES[reference.rpartition("/")[2]])
    return next(own["properties"][key] for own in family["anyOf"] if key in own["properties"])


def _sealed(version: str, proven: Any, noted: Any, run: Any) -> dict[str, Any]:
    """What a file with a hash has: the forms of what was proven, of notes, and of how it was made."""
    words = {
        "format": ({"const": version}, "Version of the format."),
        "hash": (
            {"type": "string"},
            "SHA-256 of the canonical bytes of `result`: UTF-8, sorted keys, no spaces.",
        ),
        "result": (proven, "What was proven. This is hashed, and `recheck` examines it."),
        "notes": (noted, "What explains and claims nothing: neither hashed nor examined."),
        "run": (run, "How it was made: command line, versions, times; not hashed."),
    }
    properties = {key: {**form, "description": told} for key, (form, told) in words.items()}
    return {"type": "object", "required": list(words), "properties": properties}


def metric() -> dict[str, Any]:
    """The schema of metric files: what is read, in the words of the specification; and what else they may have."""
    reported, used = forms.schema(result.MetricFile)["properties"], described_section(METRIC)["properties"]
    words = {key: {"description": form["description"]} for key, form in reported.items()}
    read = {"format": {"const": metric_file.FORMAT, "description": "Version of the format."}}
    read |= {key: used[key] for key in ("rate", "dual_metric")}
    return {
        "$id": "urn:tubecert:metric:1",
        "title": "tubecert metric file",
        "description": "A dual metric with its rate, as `synth` writes it and `certify --metric` reads it. Only rate "
        "and dual_metric are used; all else is proven again.",
        "type": "object",
        "required": list(read),
        "properties": {**read, **{key: form for key, form in words.items() if key not in read}},
        "additionalProperties": False,
        "$defs": {name: _VALUES[name] for name in ("number", "expression")},
    }


def sampled_loop() -> dict[str, Any]:
    """The schema of certificates of sampled loops, from their records and the words of these."""
    row = {"type": "array", "items": {"type": "string", "description": "A float in hexadecimal."}}
    entries = {
        "columns": {"type": "integer", "description": "How many."},
        "rows": {"type": "array", "items": row},
    }
    entries["rows"]["description"] = "Row by row, every number exact."
    proven, noted = forms.schema(of_samples.Result), forms.schema(of_samples.Notes)
    matrix = {"description": "A matrix.", "type": "object", "required": [*entries], "properties": entries}
    return {
        "$id": "urn:tubecert:sampled-loop:1",
        "title": "tubecert certificate of a sampled loop",
        "description": "What `certify` writes for a specification with `hardware`, for every verdict.",
        **_sealed(of_samples.FORMAT, proven, noted, {"type": "object"}),
        "$defs": {"decimal": _DECIMAL, "specification": _SPECIFICATION, "matrix": matrix},
    }


def specification() -> dict[str, Any]:
    """The schema of specifications, from the table of keys and the words below them."""
    own = described_section(FILE)
    kinds = {f"trajectory_{kind}": described_section(section) for kind, section in PLANS.items()}
    return {
        "$id": "urn:tubecert:spec:1",
        "title": "tubecert specification",
        **own,
        "$defs": {**_VALUES, **kinds},
    }


def described_section(section: Section) -> dict[str, Any]:
    """The schema of a section: keys with their words, closed."""
    words = {} if section.make is None else _words(section.make)
    properties = {}
    for name, key in section.keys.items():
        said = key.words or words.get((key.into or name).rpartition(".")[2]) or words.get(name)
        properties[name] = (
            ({"description": said} if said else {}) | _with_sections(key.kind.schema) | key.beside
        )
    needed = {"required": list(section.needed)} if section.needed else {}
    described = {"type": "object", "description": section.words, "properties": properties}
    return described | needed | {"additionalProperties": False, **section.form}


def _with_sections(form: Any) -> Any:
    """A schema with those of its sections in their places."""
    match form:
        case {"section": section}:
            return described_section(section)
        case {"plans": plans}:
            return _union(plans)
        case dict():
            return {key: _with_sections(value) for key, value in form.items()}
        case list():
            return [_with_sections(each) for each in form]
    return form


def _union(plans: Mapping[str, Section]) -> dict[str, Any]:
    branches = [
        {
            "if": {"properties": {"kind": {"const": kind}}, "required": ["kind"]},
            "then": {"$ref": f"#/$defs/trajectory_{kind}"},
        }
        for kind in plans
    ]
    kind = {"enum": list(plans), "description": "What kind of plan."}
    return {"type": "object", "required": ["kind"], "properties": {"kind": kind}, "allOf": branches}


def _words(make: type) -> dict[str, str]:
    """What stands below each key in the source of a class."""
    [own] = ast.parse(inspect.getsource(make)).body
    found = {}
    for line, below in pairwise(own.body):
        match line, below:
            case (
                ast.Assign(targets=[ast.Name(id=name)]) | ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                found[name] = " ".join(text.split())
    return found


def schemas() -> dict[str, dict[str, Any]]:
    """Every schema by its name."""
    made = {"spec": specification, "metric": metric, "certificate": certificate, "sampled-loop": sampled_loop}
    dialect = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return {name: dialect | schema() for name, schema in made.items()}


def everything() -> dict[str, str]:
    """The text of every page by its file name."""
    made = {f"{name}.md": Reference(schema).page() for name, schema in schemas().items()}
    made["specification.md"] = made.pop("spec.md")
    return {**made, "codes.md": codes(), "published.md": published()}


def main() -> None:
    """Write schemas and pages."""
    REFERENCE.mkdir(exist_ok=True)
    for name, schema in schemas().items():
        text = json.dumps(schema, indent=2, ensure_ascii=False) + "\n"
        (ROOT / "tubecert" / "schemas" / f"{name}.schema.json").write_text(text, encoding="utf-8")
    for name, text in everything().items():
        (REFERENCE / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
