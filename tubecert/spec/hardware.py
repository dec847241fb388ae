"""The sections `hardware` and `disturbance`: the machine that an engineer has, and what pushes it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from typing import Final

from tubecert.expression import ONE, ZERO, number_text
from tubecert.spec import codes
from tubecert.spec.document import MappingNode, Scalar
from tubecert.spec.instead import same_as
from tubecert.spec.names import Names
from tubecert.spec.reader import Field
from tubecert.spec.types import (
    Arithmetic,
    Disturbance,
    Hardware,
    Largest,
    Picard,
    Term,
    TermMatrix,
    Vector,
)

KEYS: Final = (
    "rate",
    "sample_time",
    "delay",
    "noise",
    "noise_rate",
    "feedforward",
    "feedback_rate",
    "predict",
    "bandwidth",
    "arithmetic",
    "geodesic",
    "limits",
)
LARGEST: Final = "largest"
EXACT: Final = "exact"
_ARITHMETICS: Final[Mapping[str, Arithmetic]] = {"single": "single", "double": "double"}
ONE_SAMPLE: Final = "one sample"
MAX_NODES: Final = 256
MAX_SWEEPS: Final = 32
MAX_COLUMNS: Final = 32


def read_disturbance(field: Field | None, names: Names) -> Disturbance | None:
    """E, the bound and the rate of w; None if the section is absent or unsound."""
    entries = field.mapping(required=("bound",), optional=("E", "rate")) if field else None
    if field is None or entries is None:
        return None
    before = len(field.reader.findings)
    E = _shape(entries["E"], names) if "E" in entries else _identity(field, names)
    unbounded = "bound" in entries and _is(entries["bound"], LARGEST)
    bound = _size(entries, "bound", names)
    rate = _size(entries, "rate", names)
    if unbounded and rate is not None:
        entries["rate"].fail(
            codes.RANGE,
            "disturbance.rate beside bound: largest",
            "give the bound, or leave the rate out: what is adapted to depends on how large it is",
        )
    if E is None or len(field.reader.findings) > before or (bound is None and not unbounded):
        return None
    return Disturbance(E=E, bound=bound, rate=rate)


def _shape(field: Field, names: Names) -> TermMatrix | None:
    """E with as many columns as its first row has."""
    rows = field.items(len(names.states), "rows, one per state", "write [[...], ...], a row for every state")
    width = len(rows[0].items(None, "expressions") or ()) if rows else 0
    if not rows or not width:
        return None
    if width > MAX_COLUMNS:
        field.fail(codes.LIMIT, f"{field.path} has {width} columns; at most {MAX_COLUMNS} are read")
        return None
    return field.term_matrix(len(names.states), width, names.of_state())


def _identity(field: Field, names: Names) -> TermMatrix:
    """Wind in every state."""

    def entry(one: bool) -> Term:
        return Term(
            expression=ONE if one else ZERO,
            obligations=(),
            places=(),
            text="1" if one else "0",
            location=field.location,
        )

    n = range(len(names.states))
    return tuple(tuple(entry(i == j) for j in n) for i in n)


def read_hardware(field: Field | None, disturbance: Field | None, names: Names) -> Hardware | None:
    """The machine; None if the section is absent or unsound. One number of it, or the wind, may be `largest`."""
    wind = _within(disturbance, "bound")
    wind = wind if _is(wind, LARGEST) else None
    if field is None:
        if wind is not None:
            wind.fail(
                codes.MISSING_KEY,
                "the largest disturbance is that of a machine",
                "add hardware: {rate: ...}, or give a number",
            )
        return None
    entries = field.mapping(optional=KEYS)
    if entries is None:
        return None
    before = len(field.reader.findings)
    sought = {
        key: entries[key] for key in ("sample_time", "delay", "noise") if _is(entries.get(key), LARGEST)
    }
    unknown: list[Largest] = [key for key in ("sample_time", "delay", "noise") if key in sought]
    if wind is not None:
        unknown.append("wind")
    if len(unknown) > 1:
        last = sought.get(unknown[1], wind)
        assert last is not None
        last.fail(
            codes.RANGE, f"{' and '.join(unknown)} are both to be largest", "give numbers for all but one"
        )
    sample_time = _sample_time(field, entries, names)
    one_sample = _is(entries.get("delay"), ONE_SAMPLE)
    delay = (
        None
        if one_sample or _is_of_samples(entries, names)
        else _size(entries, "delay", names, default=Fraction(0))
    )
    if delay is not None and sample_time is not None and delay > sample_time:
        entries["delay"].fail(
            codes.RANGE,
            f"hardware.delay is {number_text(delay)} s, longer than the sample time of {number_text(sample_time)} s",
            f"write a time in seconds, or `delay: {ONE_SAMPLE}`, which follows the rate (in a sweep, too)",
        )
    feedback = _positive(entries, "feedback_rate", names)
    found = (
        _noise(entries.get("noise"), names),
        _size(entries, "noise_rate", names),
        entries["feedforward"].word(("continuous", "held")) if "feedforward" in entries else "continuous",
        entries["predict"].word(("true", "false")) if "predict" in entries else "false",
        None if _is(entries.get("bandwidth"), "auto") else _positive(entries, "bandwidth", names),
        entries["arithmetic"].word((EXACT, *_ARITHMETICS)) if "arithmetic" in entries else EXACT,
        _geodesic(entries.get("geodesic"), names),
    )
    if len(field.reader.findings) > before or (sample_time is None and "sample_time" not in sought):
        return None
    noise, noise_rate, feedforward, predict, bandwidth, arithmetic, geodesic = found
    if geodesic is not None and arithmetic != EXACT:
        entries["geodesic"].fail(
            codes.RANGE,
            "hardware.geodesic beside hardware.arithmetic: how geodesics are rounded is not covered",
            "leave one of the two out",
        )
    return Hardware(
        sample_time=sample_time,
        delay=delay,
        one_sample=one_sample,
        noise=noise,
        noise_rate=noise_rate,
        held=feedforward == "held",
        feedback_time=None if feedback is None else 1 / feedback,
        predict=predict == "true",
        bandwidth=bandwidth,
        arithmetic=_ARITHMETICS.get(arithmetic or EXACT),
        geodesic=geodesic,
        largest=unknown[0] if unknown else None,
    )


def _is_of_samples(entries: Mapping[str, Field], names: Names) -> bool:
    """Reports a delay that is told in samples, but for one sample; a parameter may have that name."""
    field = entries.get("delay")
    if field is None or not isinstance(field.node, Scalar):
        return False
    if not any("sample" in word and word not in names.values for word in re.findall(r"\w+", field.node.text)):
        return False
    field.fail(
        codes.RANGE,
        f"{field.path} is {field.node.text[:40]!r}, not a time in seconds",
        f"write a number of seconds (half of the sample time at 500 Hz: 0.001), `{ONE_SAMPLE}`, or {LARGEST}",
    )
    return True


def limits_of(limits: Field | None, hardware: Field | None) -> Field | None:
    """Where the limits of the inputs stand: in a section of their own, or in that of the hardware."""
    own = _within(hardware, "limits")
    if own is not None and limits is not None:
        own.fail(
            codes.RANGE, "hardware.limits beside limits", "they are the same limits: give one of the two"
        )
    return limits or own


def _within(section: Field | None, name: str) -> Field | None:
    """The value of a key of a section, if it is there."""
    if section is None or not isinstance(section.node, MappingNode):
        return None
    return next((section.child(key, node) for key, node in section.node.pairs if key.text == name), None)


def _sample_time(field: Field, entries: Mapping[str, Field], names: Names) -> Fraction | None:
    """From the rate, or itself; None if it is the largest, or unsound."""
    if "rate" in entries and "sample_time" in entries:
        entries["sample_time"].fail(
            codes.RANGE, "hardware has a rate and a sample time", "give one of the two"
        )
        return None
    if _is(entries.get("rate"), LARGEST):
        entries["rate"].fail(
            codes.RANGE,
            "hardware.rate is searched for by its sample time",
            f"write sample_time: {LARGEST}: it finds the slowest computer that serves",
        )
        return None
    if "rate" in entries:
        rate = _positive(entries, "rate", names)
        return None if rate is None else 1 / rate
    if "sample_time" not in entries:
        if _is_meant(field):  # one finding says what it is called
            return None
        field.fail(
            codes.MISSING_KEY,
            "hardware lacks the rate",
            "write rate: 500 (in Hz), sample_time: 1/500, or sample_time: largest",
        )
        return None
    return None if _is(entries["sample_time"], LARGEST) else _positive(entries, "sample_time", names)


def _is_meant(field: Field) -> bool:
    """Whether an unknown key stands for the rate or the sample time."""
    pairs = field.node.pairs if isinstance(field.node, MappingNode) else ()
    return any(same_as(key.text, ("rate", "sample_time")) for key, _ in pairs)


def _noise(field: Field | None, names: Names) -> Fraction | Vector | None:
    """|n|, or |n_i| by state, 0 for those that are not named; None if it is the largest, or unsound."""
    if field is None:
        return Fraction(0)
    if _is(field, LARGEST):
        return None
    if not isinstance(field.node, MappingNode):
        return field.number(names.values, least=0, side="above")
    entries = field.mapping(optional=names.states)
    if entries is None:
        return None
    sizes = {name: _size(entries, name, names, default=Fraction(0)) for name in names.states}
    found = tuple(size for size in sizes.values() if size is not None)
    return found if len(found) == len(sizes) else None


def _geodesic(field: Field | None, names: Names) -> Picard | None:
    """Nodes and sweeps; None if geodesics are exact, or unsound."""
    if field is None or _is(field, EXACT):
        return None
    entries = field.mapping(required=("nodes", "sweeps"))
    if entries is None or len(entries) < len(Picard.__slots__):
        return None
    nodes, sweeps = (
        _whole(entries[key], names, most) for key, most in (("nodes", MAX_NODES), ("sweeps", MAX_SWEEPS))
    )
    return None if nodes is None or sweeps is None else Picard(nodes=nodes, sweeps=sweeps)


def _whole(field: Field, names: Names, most: int) -> int | None:
    """A whole number from 1 to `most`."""
    value = field.number(names.values, least=1)
    if value is None:
        return None
    if value.denominator != 1 or value > most:
        field.fail(
            codes.RANGE,
            f"{field.path} is {number_text(value)}, not a whole number from 1 to {most}",
            "write geodesic: {nodes: 16, sweeps: 3}",
        )
        return None
    return int(value)


def _size(
    entries: Mapping[str, Field], key: str, names: Names, default: Fraction | None = None
) -> Fraction | None:
    """A number that is not negative, rounded up; `default` if it is not there, None if it is the largest."""
    if key not in entries:
        return default
    return None if _is(entries[key], LARGEST) else entries[key].number(names.values, least=0, side="above")


def _positive(entries: Mapping[str, Field], key: str, names: Names) -> Fraction | None:
    return entries[key].number(names.values, above=0) if key in entries else None


def _is(field: Field | None, word: str) -> bool:
    return field is not None and isinstance(field.node, Scalar) and field.node.text == word
