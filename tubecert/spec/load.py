"""A file -> `Spec`, or every problem of the file at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, Literal, TypeAlias

from tubecert.errors import SpecError
from tubecert.expression import free_symbols
from tubecert.expression.waves import frequencies
from tubecert.findings import Finding, Location, capped
from tubecert.spec import codes, keys
from tubecert.spec.document import compose
from tubecert.spec.keys import AUTO, Kind, entry, form, section
from tubecert.spec.machine import (
    CONTROLLER,
    HARDWARE,
    IN_CONTINUOUS_TIME,
    LIMITS,
    check_machine,
    limits_of,
    read_hardware,
)
from tubecert.spec.metric import METRIC, WANTED, Metric, Synthesis, read_metric
from tubecert.spec.names import TIME, Names, read_names
from tubecert.spec.override import Setting, put
from tubecert.spec.plan import PLANS, Trajectory, at_rest, completed, read_trajectory, trajectory_data
from tubecert.spec.reader import Field, Reader, is_of_another_kind, root_field
from tubecert.spec.scene import OBSTACLE, SIMULATION, obstacles_data, read_obstacles, read_simulation
from tubecert.spec.source import Source, check_limits, read_source
from tubecert.spec.start import INITIAL_STATE, initial_state_data, read_initial_state
from tubecert.spec.system import (
    DISTURBANCE,
    SAFE_SET,
    SYSTEM,
    UNCERTAINTY,
    UNITS,
    Plant,
    read_disturbance,
    read_dynamics,
    read_uncertainty,
)
from tubecert.spec.tube import (
    ADAPTATION,
    CONDITIONS,
    EXPECT,
    SLUG,
    TUBE,
    Tube,
    decides_data,
    measured,
    read_expectation,
    read_name,
    read_tube,
    tube_data,
)
from tubecert.spec.types import Spec
from tubecert.spec.values import Term

VERSION: Final = 1

_SYSTEM = ("tubecert", "name", "system", "safe_set")
_LOOP = ("uncertainty", "trajectory")
_METRIC = ("metric", "expect")  # all that a question about a metric alone has beside its system
_LONG: Final = 10**12  # s, or that many times pi
_BOTH: Final = "simulate takes both: simulate SPEC --certificate FILE"
_CERTIFICATE: Final = f"name the specification (YAML) that it was made from; {_BOTH}"
_METRIC_FILE: Final = "give it beside a specification: tubecert certify SPEC --metric FILE"
_OTHERS: Final = {
    "format: tubecert-certificate/": ("this is a certificate, not a specification", _CERTIFICATE),
    "format: tubecert-metric/": ("this is a metric file, not a specification", _METRIC_FILE),
}
NO_SEARCH: Final = (
    "write metric: {rate: ..., dual_metric: ...}, or --metric FILE; one that synth finds for f with t replaced by "
    "a number may serve at all times, which certify proves"
)

Reads: TypeAlias = Literal["whole", "question", "plant", "system"]
"""How much of a file counts. `question`: the whole, also of one that asks about a metric alone (`Spec.lacks` says so).
`plant`: of one that lacks `uncertainty` or `trajectory` (`Spec.lacks` says what) system, safe set, metric and tube.
`system`: the first three of these. Where a plan does not count, it rests in the middle of the safe set, and h is 0."""


class File:
    """A control-affine system with matched uncertainty and its plan, beside a metric and a tube, or beside the hardware
    of its controller; or, without uncertainty, plan and all that a tube needs, a metric alone (format tubecert: 1).
    """

    tubecert = entry(form({"enum": [VERSION, str(VERSION)]}), "", needed=True, late=True)
    """Version of the format."""
    name = entry(form({"type": ["string", "number"], "pattern": f"^{SLUG}$"}), needed=True, late=True)
    """Name of the specification; becomes part of file names."""
    system = entry(keys.inside(SYSTEM), "", needed=True, late=True)
    safe_set = entry(SAFE_SET, needed=True, example={"p": [-1, 1], "v": [-2, 2]})
    """The box that the tube must stay in: [lower, upper] for every state. The metric is verified on all of it."""
    uncertainty = entry(keys.inside(UNCERTAINTY), late=True)
    trajectory = entry(form({"plans": PLANS}, trajectory_data), late=True)
    """The plan x*(t), u*(t). It need not satisfy the dynamics exactly: by how much it misses them is bounded, and
    treated as a disturbance. Needed, but for a question about a metric alone."""
    initial_state = entry(keys.inside(INITIAL_STATE, write=initial_state_data), "x0", late=True)
    metric = entry(keys.inside(WANTED, read_metric, METRIC.written))
    tube = entry(keys.inside(TUBE, read_tube, tube_data), always=True)
    adaptation = entry(keys.inside(ADAPTATION), always=True)
    conditions = entry(keys.inside(CONDITIONS, write=decides_data), "decides", late=True, always=True)
    obstacles = entry(Kind(read_obstacles, {"type": "array", "items": {"section": OBSTACLE}}, obstacles_data))
    """Obstacles in planes of two states: how far the tube keeps away from each is proven, and decides the verdict."""
    hardware = entry(keys.inside(HARDWARE, read_hardware))
    controller = entry(CONTROLLER, late=True, said="auto")
    """Beside hardware: whether a controller is designed around u*, or nothing is added to it (the plant is stable by
    itself)."""
    disturbance = entry(keys.inside(DISTURBANCE, read_disturbance))
    limits = entry(LIMITS, late=True, example={"u": [-8, 8]})
    """What the actuators can do: [lower, upper] for some or all inputs. How far each input can go in the loop is
    proven, and must stay within; this decides the verdict as well."""
    simulation = entry(keys.inside(SIMULATION), late=True)
    expect = entry(keys.inside(EXPECT), late=True)


_FORM: Final[dict[str, Any]] = {
    "if": {
        "required": ["metric"],
        "propertyNames": {"enum": [*_SYSTEM, *_METRIC]},
        "properties": {"metric": {"not": {"required": ["synthesise"]}}},
    },
    "else": {
        "required": ["trajectory"],
        "anyOf": [{"required": ["uncertainty"]}, {"required": ["hardware"]}],
    },
}
FILE: Final = section(File, **_FORM)


def load(path: str, settings: Sequence[Setting] = (), reads: Reads = "whole") -> Spec:
    """The specification in a file, with the keys that are set in place of its own.

    Raises `TargetError` if the file cannot be read and `SpecError` with every problem, in the order of the
    file; that it asks about a metric alone is one.
    """
    return load_source(read_source(path), settings, reads)


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
    """The specification in a source; see `load` and `Reads`."""
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
    if root.node.kind == "scalar" and not root.node.text:
        return root.fail(codes.MISSING_KEY, "the file is empty", f"begin with tubecert: {VERSION}")
    if is_of_another_kind(root, _OTHERS):
        return None
    alone = _asks_about_metric(root)
    in_part = alone or reads in ("plant", "system")
    loop = _LOOP if root.get("hardware") is None else _LOOP[1:]  # a machine may have no uncertainty
    entries = FILE.entries(root, _SYSTEM if in_part else (*_SYSTEM, *loop))
    if entries is None:
        return None
    check_machine(entries)
    if "hardware" in entries:
        entries = {name: field for name, field in entries.items() if name not in IN_CONTINUOUS_TIME}
    if alone and reads == "whole":
        root.reader.findings.append(_of_metric_alone(root.reader.source.file, entries["metric"].location))
    lacks = tuple(name for name in loop if name not in entries) if in_part and reads != "system" else ()
    if lacks or reads == "system":
        beside = ("metric", "tube") if reads == "plant" else _METRIC
        entries = {name: entries[name] for name in (*_SYSTEM, *beside) if name in entries}
    _check_version(entries.get("tubecert"))
    name = read_name(entries["name"]) if "name" in entries else None
    system = SYSTEM.entries(entries.get("system"))
    names = read_names(system) if system else None
    if system is None or names is None:
        return None  # without names nothing else can be read
    found = _read_named(root.reader, entries, system, names, alone=alone)
    if found is None or name is None:
        return None
    if not (alone or lacks or reads == "system" or "hardware" in entries):
        found["tube"] = measured(found.get("tube") or Tube(), names.states, dict(found["units"]))
    return Spec(
        name=name,
        path=root.reader.source.file,
        source=root.reader.source.text,
        states=names.states,
        inputs=names.inputs,
        parameters=names.parameters,
        ranges=names.ranges,
        definitions=tuple(name for name, _ in names.definitions),
        tables=tuple(table for _, table in names.tables),
        outputs=names.outputs,
        settings=tuple((each.path, each.text) for each in settings),
        lacks=lacks,
        locations=root.reader.places,
        **found,
    )


def _asks_about_metric(root: Field) -> bool:
    """Whether there is a metric, given and not asked for, and nothing of a plan, a loop or a tube."""
    found = {key.text: node for key, node in root.node.pairs}
    wanted = "metric" not in found or any(key.text == "synthesise" for key, _ in found["metric"].pairs)
    return not wanted and not found.keys() & (FILE.keys.keys() - {*_SYSTEM, *_METRIC})


def _of_metric_alone(file: str, place: Location | None) -> Finding:
    """That there is nothing to certify in a question about a metric alone."""
    return Finding(
        code=codes.MISSING_KEY,
        message="this specification asks about a metric alone: it has neither uncertainty nor trajectory",
        location=place,
        help=f"`tubecert verify {file}` decides it; for a tube around a plan, add the sections uncertainty, "
        "trajectory and tube",
    )


def _read_named(
    reader: Reader, entries: Mapping[str, Field], system: Mapping[str, Field], names: Names, *, alone: bool
) -> dict[str, Any] | None:
    """What the fields of a `Spec` are but those of the whole file; None with a finding."""
    f, machine = system.get("f"), entries.get("hardware")
    dynamics = read_dynamics(f, system.get("B"), names)
    found = FILE.values(entries, names)
    sound, box, metric = FILE.holds(found, entries), found.get("safe_set"), found.pop("metric", None)
    uncertainty = read_uncertainty(entries.get("uncertainty"), machine, names)
    trajectory = entries.get("trajectory")
    plant = None
    if box and dynamics and dynamics.f and dynamics.B:
        plant = Plant(names.states, names.inputs, dynamics.f, dynamics.B, box)
    plan = read_trajectory(trajectory, names, plant) if trajectory else None
    start = read_initial_state(entries.get("initial_state"), trajectory, plan, names)
    x0 = start.x0
    if box is not None and not entries.keys() & {*_LOOP}:  # rest, as of a system
        plan, uncertainty = at_rest(entries["safe_set"], box, len(names.inputs))
        x0 = tuple((low + high) / 2 for low, high in box)
    plan = completed(plan, x0) if plan else None
    limits = limits_of(entries.get("limits"), machine)
    found |= {
        "f": dynamics and dynamics.f,
        "B": dynamics and dynamics.B,
        "units": UNITS.read(system["units"], names) if "units" in system else (),
        "uncertainty": uncertainty,
        "trajectory": plan,
        "x0": x0,
        "limits": LIMITS.read(limits, names) if limits else (),
    }
    expect = read_expectation(entries.get("expect"), names, alone=alone)
    simulation = read_simulation(entries.get("simulation"), plan, names)
    if f is not None and dynamics is not None and plan is not None:
        waves = (*dynamics.drift, *((uncertainty and uncertainty.h) or ()))
        _check_moving(f, dynamics.drift, _beside_moving(plan, metric, waves, machine=machine is not None))
    if reader.findings or not sound or dynamics is None or None in found.values():
        return None
    entries_of_B = [term.expression for row in dynamics.gained for term in row]
    decides = CONDITIONS.sound(CONDITIONS.entries(entries.get("conditions")), names) or {}
    return found | {
        "drift": dynamics.drift if names.ranges else (),
        "gained": dynamics.gained if free_symbols(entries_of_B) & set(dict(names.ranges)) else (),
        "within": start.within,
        "start_box": start.box,
        "metric": metric if isinstance(metric, Metric) else None,
        "synthesis": metric if isinstance(metric, Synthesis) else None,
        "expect": expect,
        "simulation": simulation,
        "decides": decides.get("decides"),
        "controller": CONTROLLER.read(entries["controller"], names) if "controller" in entries else AUTO,
    }


def _check_moving(f: Field, drift: Sequence[Term], beside: Iterator[tuple[bool, str, str]]) -> None:
    """What is covered where f depends on t; `beside` is what is not, and what to write then."""
    if TIME in free_symbols(part for term in drift for part in term.parts):
        for found, message, help in beside:
            if found:
                f.fail(codes.RANGE, f"f depends on t, {message}", help)


def _beside_moving(
    plan: Trajectory, metric: Metric | Synthesis | None, waves: Sequence[Term], *, machine: bool
) -> Iterator[tuple[bool, str, str]]:
    """What no theorem is stated for where f depends on t, with what to write; `waves` is all that does."""
    if machine:
        known = "what is known of t only may stand in h; or leave out hardware"
        yield True, "and with hardware it may not", known
        return
    lasting = "without a period that can be seen, so a trajectory with a horizon is needed"
    period = "or t in sin, cos and tan only, with frequencies that are rational multiples of each other"
    found = frequencies([part for term in waves for part in term.parts], TIME)
    returns = found is not None and (found.period is None or found.period[0] < _LONG)
    endless = plan.horizon is None and not returns  # or that is not to be seen
    yield endless, lasting, f"add trajectory.horizon, in seconds; {period}"
    yield isinstance(metric, Synthesis), "and metrics are not found for that: give one", NO_SEARCH


def _check_version(field: Field | None) -> None:
    version = None if field is None else field.text("a number")
    if field is not None and version is not None and version.strip() != str(VERSION):
        shown = version[:20] or "nothing"
        field.fail(codes.RANGE, f"version {shown} of the format is unknown", f"write tubecert: {VERSION}")
