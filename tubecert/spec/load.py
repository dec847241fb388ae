"""A file -> `Spec`, or every problem of the file at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final, Literal, TypeAlias

from tubecert.errors import SpecError
from tubecert.findings import Finding, Location, capped
from tubecert.spec import codes
from tubecert.spec.boxes import read_box, read_units
from tubecert.spec.document import MappingNode, Scalar, compose
from tubecert.spec.hardware import (
    IN_CONTINUOUS_TIME,
    check_machine,
    limits_of,
    read_controller,
    read_disturbance,
    read_hardware,
)
from tubecert.spec.limits import read_limits
from tubecert.spec.names import Names, read_names
from tubecert.spec.obstacles import read_obstacles
from tubecert.spec.outputs import with_outputs
from tubecert.spec.override import Setting, put
from tubecert.spec.plan import (
    at_rest,
    completed,
    no_uncertainty,
    read_initial_state,
    read_trajectory,
)
from tubecert.spec.reader import Field, Reader, root_field
from tubecert.spec.settings import (
    read_adaptation,
    read_decides,
    read_expectation,
    read_name,
    read_tube,
)
from tubecert.spec.simulation import read_simulation
from tubecert.spec.source import Source, check_limits, read_source
from tubecert.spec.system import (
    NO_SEARCH,
    check_moving,
    is_uncertain,
    known_of,
    read_dynamics,
    read_metric,
    read_uncertainty,
    returns,
    wanted_metric,
)
from tubecert.spec.types import (
    Metric,
    Places,
    Spec,
    Synthesis,
    Term,
    TermMatrix,
    Trajectory,
)

VERSION: Final = 1

_SYSTEM = ("tubecert", "name", "system", "safe_set")
_LOOP = ("uncertainty", "trajectory")
_FORMATS = (
    (
        "tubecert-certificate/",
        "a certificate",
        "name the specification (YAML) that it was made from; simulate takes both: simulate SPEC --certificate FILE",
    ),
    (
        "tubecert-metric/",
        "a metric file",
        "give it beside a specification: tubecert certify SPEC --metric FILE",
    ),
)
_METRIC = ("metric", "expect")  # all that a question about a metric alone has beside its system
_OPTIONAL = (
    "initial_state",
    "tube",
    "adaptation",
    "conditions",
    "obstacles",
    "limits",
    "simulation",
    "hardware",
    "controller",
    "disturbance",
)

Reads: TypeAlias = Literal["whole", "question", "plant", "system"]


def load(path: str, settings: Sequence[Setting] = ()) -> Spec:
    """The specification in a file, with the keys that are set in place of its own.

    Raises `TargetError` if the file cannot be read and `SpecError` with every problem, in the order of the
    file; that it asks about a metric alone is one.
    """
    return load_source(read_source(path), settings)


def load_question(path: str, settings: Sequence[Setting] = ()) -> Spec:
    """The same, also of a file that asks about a metric alone: `Spec.lacks` says so. Raises as `load` does."""
    return load_source(read_source(path), settings, "question")


def load_system(path: str, settings: Sequence[Setting] = ()) -> Spec:
    """The same of a file of which only system, safe set and metric matter: it may lack all else, which is not read.

    The specification is that of rest in the middle of the safe set without uncertainty. Raises as `load` does.
    """
    return load_source(read_source(path), settings, "system")


def load_plant(path: str, settings: Sequence[Setting] = ()) -> Spec:
    """The specification in a file that may lack `uncertainty` and `trajectory`: a metric alone can be asked for then.

    Of one that lacks either, `Spec.lacks` says what, and system, safe set, metric and tube are read; the rest is as
    `load_system` leaves it. Raises as `load` does.
    """
    return load_source(read_source(path), settings, "plant")


def load_text(text: str, file: str = "<text>", reads: Reads = "whole") -> Spec:
    """The specification in a text; `file` is what findings call it."""
    return load_source(Source.of(file, text), reads=reads)


def again(spec: Spec, settings: Sequence[Setting]) -> Spec:
    """The specification in the same text, with these keys set in place of those it was read with."""
    return load_source(Source.of(spec.path, spec.source), settings, "question") if settings else spec


def whole(spec: Spec) -> Spec:
    """The same specification; raises `SpecError` if it asks about a metric alone."""
    if spec.lacks:
        raise SpecError([_of_metric_alone(spec.path, spec.location("metric"))])
    return spec


def load_source(source: Source, settings: Sequence[Setting] = (), reads: Reads = "whole") -> Spec:
    """The specification in a source; see `load`, `load_question`, `load_plant` and `load_system`."""
    check_limits(source)
    node, findings = compose(source)
    node, misplaced = put(node, settings)
    findings += misplaced
    reader = Reader(source)
    reader.findings.extend(findings)
    spec = None
    if not any(finding.code in (codes.YAML_SYNTAX, codes.LIMIT) for finding in findings):
        spec = _read(root_field(reader, node), settings, reads)
    if reader.findings or spec is None:
        raise SpecError(_ordered(reader.findings))
    return spec


def _ordered(findings: list[Finding]) -> list[Finding]:
    def position(finding: Finding) -> tuple[int, int]:
        return (finding.location.line, finding.location.column) if finding.location else (0, 0)

    return capped(sorted(findings, key=position), codes.LIMIT)


def _read(root: Field, settings: Sequence[Setting], reads: Reads) -> Spec | None:
    if isinstance(root.node, Scalar) and not root.node.text:
        root.fail(codes.MISSING_KEY, "the file is empty", f"begin with tubecert: {VERSION}")
        return None
    if _is_another_file(root):
        return None
    alone = _asks_about_metric(root)
    in_part = alone or reads in ("plant", "system")
    loop = _LOOP if root.get("hardware") is None else _LOOP[1:]  # a machine may have no uncertainty
    entries = root.mapping(
        required=_SYSTEM if in_part else (*_SYSTEM, *loop), optional=(*_LOOP, *_METRIC, *_OPTIONAL)
    )
    if entries is None:
        return None
    check_machine(entries)
    if "hardware" in entries:
        entries = {key: field for key, field in entries.items() if key not in IN_CONTINUOUS_TIME}
    if alone and reads == "whole":
        root.reader.findings.append(_of_metric_alone(root.reader.source.file, entries["metric"].location))
    lacks = tuple(key for key in loop if key not in entries) if in_part and reads != "system" else ()
    if lacks or reads == "system":
        beside = ("metric", "tube") if reads == "plant" else _METRIC
        entries = {key: entries[key] for key in (*_SYSTEM, *beside) if key in entries}
    _check_version(entries.get("tubecert"))
    name = read_name(entries["name"]) if "name" in entries else None
    system = (
        entries["system"].mapping(
            required=("states", "inputs", "f", "B"),
            optional=("parameters", "tables", "definitions", "outputs", "units"),
        )
        if "system" in entries
        else None
    )
    names = read_names(system) if system else None
    if system is None or names is None:
        return None  # without names nothing else can be read
    names = with_outputs(names, system.get("outputs"))
    spec = _read_named(root.reader, entries, system, name, names, alone=alone)
    return (
        None
        if spec is None
        else replace(spec, settings=tuple((each.path, each.text) for each in settings), lacks=lacks)
    )


def _asks_about_metric(root: Field) -> bool:
    """Whether there is a metric, given and not asked for, and nothing of a plan, a loop or a tube."""
    found = {key.text: node for key, node in root.node.pairs} if isinstance(root.node, MappingNode) else {}
    own = found.get("metric")
    wanted = isinstance(own, MappingNode) and any(key.text == "synthesise" for key, _ in own.pairs)
    return own is not None and not wanted and not found.keys() & {*_LOOP, *_OPTIONAL}


def _of_metric_alone(file: str, place: Location | None) -> Finding:
    """That there is nothing to certify in a question about a metric alone."""
    return Finding(
        code=codes.MISSING_KEY,
        message="this specification asks about a metric alone: it has neither uncertainty nor trajectory",
        location=place,
        help=f"`tubecert verify {file}` decides it; for a tube around a plan, add the sections uncertainty, "
        "trajectory and tube",
    )


def _is_another_file(root: Field) -> bool:
    """Reports a file of ours of another kind."""
    for key, node in root.node.pairs if isinstance(root.node, MappingNode) else ():
        if key.text == "format" and isinstance(node, Scalar):
            for start, what, help in _FORMATS:
                if node.text.startswith(start):
                    root.fail(codes.WRONG_TYPE, f"this is {what}, not a specification", help)
                    return True
    return False


def _in_the_middle(
    f: Field | None, B: Field | None, dynamics: tuple[tuple[Term, ...], TermMatrix] | None, names: Names
) -> tuple[tuple[Term, ...], TermMatrix] | None:
    """The f and B that the controller knows."""
    if dynamics is None or f is None or B is None:
        return None
    drift = known_of(f, dynamics[0], names)
    rows = [known_of(B, row, names) for row in dynamics[1]]
    if drift is None or None in rows:
        return None
    return drift, tuple(row for row in rows if row is not None)


def _read_named(
    reader: Reader,
    entries: dict[str, Field],
    system: dict[str, Field],
    name: str | None,
    names: Names,
    *,
    alone: bool,
) -> Spec | None:
    f, B = system.get("f"), system.get("B")
    dynamics = read_dynamics(f, B, names)
    known = _in_the_middle(f, B, dynamics, names)
    units = read_units(system.get("units"), names)
    box = read_box(entries["safe_set"], names) if "safe_set" in entries else None
    uncertainty = (
        read_uncertainty(entries["uncertainty"], names, sudden="hardware" in entries)
        if "uncertainty" in entries
        else None
    )
    if "hardware" in entries and "uncertainty" not in entries:
        uncertainty = no_uncertainty(entries["hardware"], len(names.inputs))
    trajectory = entries.get("trajectory")
    plan = read_trajectory(trajectory, names) if trajectory else None
    start = read_initial_state(entries.get("initial_state"), trajectory, plan, names)
    x0 = start.x0
    if box is not None and not entries.keys() & {*_LOOP}:  # as `load_system` leaves it
        plan, uncertainty = at_rest(entries["safe_set"], box, len(names.inputs))
        x0 = tuple((low + high) / 2 for low, high in box)
    plan = completed(plan, x0) if plan else None
    metric, synthesis = _metric(entries.get("metric"), names)
    tube = read_tube(entries.get("tube"), names)
    adaptation = read_adaptation(entries.get("adaptation"), names)
    expect = read_expectation(entries.get("expect"), names, alone=alone)
    obstacles = read_obstacles(entries.get("obstacles"), names)
    limits = read_limits(limits_of(entries.get("limits"), entries.get("hardware")), names)
    simulation = read_simulation(entries.get("simulation"), plan, names)
    hardware = read_hardware(entries.get("hardware"), names)
    gained = dynamics is not None and is_uncertain(dynamics[1], names)
    disturbance = read_disturbance(entries.get("disturbance"), names)
    if f is not None and dynamics is not None and plan is not None:
        h = () if uncertainty is None or uncertainty.h is None else uncertainty.h
        waves = (*dynamics[0], *h)
        check_moving(f, dynamics[0], _beside_moving(plan, synthesis, waves, machine="hardware" in entries))
    if reader.findings or name is None or dynamics is None or box is None or uncertainty is None:
        return None
    if plan is None or x0 is None or tube is None or adaptation is None:
        return None
    if obstacles is None or limits is None or known is None:
        return None
    return Spec(
        name=name,
        path=reader.source.file,
        source=reader.source.text,
        states=names.states,
        inputs=names.inputs,
        units=units,
        parameters=names.parameters,
        definitions=tuple(name for name, _ in names.definitions),
        tables=tuple(table for _, table in names.tables),
        f=known[0],
        drift=dynamics[0] if names.ranges else (),
        ranges=names.ranges,
        B=known[1],
        gained=dynamics[1] if gained else (),
        outputs=names.outputs,
        safe_set=box,
        uncertainty=uncertainty,
        trajectory=plan,
        x0=x0,
        within=start.within,
        start_box=start.box,
        metric=metric,
        synthesis=synthesis,
        tube=tube,
        adaptation=adaptation,
        decides=read_decides(entries.get("conditions")),
        expect=expect,
        obstacles=obstacles,
        limits=limits,
        simulation=simulation,
        hardware=hardware,
        controller=read_controller(entries.get("controller")),
        disturbance=disturbance,
        locations=Places(reader.places),
    )


def _beside_moving(
    plan: Trajectory, synthesis: Synthesis | None, waves: Sequence[Term], *, machine: bool
) -> Iterator[tuple[bool, str, str]]:
    """What no theorem is stated for where f depends on t, with what to write; `waves` is all that does."""
    if machine:
        yield (
            True,
            "and with hardware it may not",
            "what is known of t only may stand in h; or leave out hardware",
        )
        return
    lasting = "without a period that can be seen, so a trajectory with a horizon is needed"
    period = "or t in sin, cos and tan only, with frequencies that are rational multiples of each other"
    yield (
        plan.horizon is None and not returns(waves),
        lasting,
        f"add trajectory.horizon, in seconds; {period}",
    )
    yield synthesis is not None, "and metrics are not found for that: give one", NO_SEARCH


def _metric(field: Field | None, names: Names) -> tuple[Metric | None, Synthesis | None]:
    """A metric, or what is asked for in its place."""
    if field is None:
        return None, None
    before = len(field.reader.findings)
    wanted = wanted_metric(field, names)
    if wanted is not None or len(field.reader.findings) > before:
        return None, wanted
    return read_metric(field, names), None


def _check_version(field: Field | None) -> None:
    version = None if field is None else field.text("a number")
    if field is not None and version is not None and version.strip() != str(VERSION):
        shown = version[:20] or "nothing"
        field.fail(codes.RANGE, f"version {shown} of the format is unknown", f"write tubecert: {VERSION}")
