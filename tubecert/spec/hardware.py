"""The sections `hardware` and `disturbance`: the machine that an engineer has, and what pushes it.

A file that names its machine asks about the sampled loop: `check_machine` tells what else may then stand in it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Final, TypeVar, get_args

from tubecert.digits import near
from tubecert.expression import ONE, ZERO
from tubecert.spec import codes
from tubecert.spec.document import ListNode, MappingNode, Scalar
from tubecert.spec.instead import same_as
from tubecert.spec.names import Names
from tubecert.spec.reader import Field
from tubecert.spec.settings import RANGES
from tubecert.spec.types import (
    Arithmetic,
    Controller,
    Disturbance,
    Hardware,
    Hold,
    Term,
    TermMatrix,
    Vector,
)

Word = TypeVar("Word", bound=str)

KEYS: Final = ("rate", "sample_time", "delay", "noise", "arithmetic", "hold", "limits")
ONE_SAMPLE: Final = "one sample"
MAX_COLUMNS: Final = 32
MAX_LATE: Final = 64  # samples of delay: every one is a state of the loop

_ARITHMETICS: Final[tuple[Arithmetic, ...]] = get_args(Arithmetic)
_HOLDS: Final[tuple[Hold, ...]] = get_args(Hold)
_CONTROLLERS: Final[tuple[Controller, ...]] = get_args(Controller)
_WITHOUT_METRIC: Final = "the sampled loop is proven without a metric: leave it out, or leave out hardware"
_WIDTHS: Final = (
    "the tube of a sampled loop is found, half_widths are wishes: leave it out, or leave out hardware"
)
_EXPECTED: Final = "of a sampled loop verdict, half_widths and inputs can be expected: leave it out"
_ONE_NUMBER: Final = "write one number, the bound of |w|; a list of them goes with hardware: {rate: 500}"
_OF_A_COMPUTER: Final = "name the computer that it is about, hardware: {rate: 500}, or leave it out"
IN_CONTINUOUS_TIME: Final = ("metric", "adaptation", "conditions")
"""Sections of a file that asks about a loop in continuous time."""

_TUBE_IN_TIME: Final = ("epsilon", "rho_a", "coordinates", "gap")


def check_machine(entries: Mapping[str, Field]) -> None:
    """Reports what does not go with `hardware`, and what does not go without."""
    plan, tube, wind, expect = map(entries.get, ("trajectory", "tube", "disturbance", "expect"))
    if "hardware" in entries:
        told = [(entries.get(key), _WITHOUT_METRIC) for key in IN_CONTINUOUS_TIME]
        told += [(tube and tube.get(key), _WIDTHS) for key in _TUBE_IN_TIME]
        told += [(expect and expect.get(key), _EXPECTED) for key in ("metric", *RANGES) if key != "inputs"]
        beside = "beside"
    else:
        told = [(entries.get("controller"), _OF_A_COMPUTER)]
        told += [(plan and plan.get(key), _OF_A_COMPUTER) for key in ("afterwards", "input_rate")]
        bound = wind and wind.get("bound")
        told += [(bound, _ONE_NUMBER)] if bound and isinstance(bound.node, ListNode) else []
        beside = "without"
    for field, help in told:
        if field is not None:
            field.fail(codes.RANGE, f"{field.path} {beside} hardware", help)


def read_controller(field: Field | None) -> Controller:
    """Whether a controller is to be found for the computer; `auto` also for what is unsound."""
    return _one_of(field, _CONTROLLERS)


def read_disturbance(field: Field | None, names: Names) -> Disturbance | None:
    """E, the bound and the rate of w; None if the section is absent or unsound."""
    entries = field.mapping(required=("bound",), optional=("E", "rate")) if field else None
    if field is None or entries is None:
        return None
    before = len(field.reader.findings)
    E = _shape(entries["E"], names) if "E" in entries else _identity(field, names)
    bound = _bound(entries["bound"], len(E[0]) if E else None, names) if "bound" in entries else None
    rate = _size(entries, "rate", names)
    if E is None or bound is None or len(field.reader.findings) > before:
        return None
    return Disturbance(E=E, bound=bound, rate=rate)


def _bound(field: Field, columns: int | None, names: Names) -> Fraction | Vector | None:
    """|w|, or |w_i| by column of E, rounded up; None if unsound."""
    if not isinstance(field.node, ListNode):
        return field.number(names.values, least=0, side="above")
    items = field.items(columns, "numbers, one per column of E") or []
    sizes = [item.number(names.values, least=0, side="above") for item in items]
    found = tuple(size for size in sizes if size is not None)
    return found if found and len(found) == len(sizes) else None


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


def read_hardware(field: Field | None, names: Names) -> Hardware | None:
    """The computer and the sensors; None if the section is absent or unsound."""
    entries = None if field is None else field.mapping(optional=KEYS)
    if field is None or entries is None:
        return None
    before = len(field.reader.findings)
    sample_time = _sample_time(field, entries, names)
    one_sample = _is(entries.get("delay"), ONE_SAMPLE)
    delay = (
        None
        if one_sample or _is_of_samples(entries, names)
        else _size(entries, "delay", names, default=Fraction(0))
    )
    if delay is not None and sample_time is not None and delay > MAX_LATE * sample_time:
        entries["delay"].fail(
            codes.LIMIT,
            f"hardware.delay is {near(float(delay / sample_time))} samples; at most {MAX_LATE} are read",
            f"write a time in seconds, or `delay: {ONE_SAMPLE}`, which follows the rate (in a sweep, too)",
        )
    noise = _noise(entries.get("noise"), names)
    arithmetic = _one_of(entries.get("arithmetic"), _ARITHMETICS, "double")
    hold = _one_of(entries.get("hold"), _HOLDS)
    if len(field.reader.findings) > before or sample_time is None or noise is None:
        return None
    return Hardware(
        sample_time=sample_time,
        delay=delay,
        noise=noise,
        arithmetic=arithmetic,
        hold=hold,
    )


def _one_of(field: Field | None, known: Sequence[Word], default: Word | None = None) -> Word:
    """One of the words, the first by default."""
    word = None if field is None else field.word(known)
    return next((each for each in known if each == word), default or known[0])


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
        f"write a number of seconds (half of the sample time at 500 Hz: 0.001), or `{ONE_SAMPLE}`",
    )
    return True


def limits_of(limits: Field | None, hardware: Field | None) -> Field | None:
    """Where the limits of the inputs stand: in a section of their own, or in that of the hardware."""
    own = None if hardware is None else hardware.get("limits")
    if own is not None and limits is not None:
        own.fail(
            codes.RANGE, "hardware.limits beside limits", "they are the same limits: give one of the two"
        )
    return limits or own


def _sample_time(field: Field, entries: Mapping[str, Field], names: Names) -> Fraction | None:
    """From the rate, or itself; None if unsound."""
    if "rate" in entries and "sample_time" in entries:
        entries["sample_time"].fail(
            codes.RANGE, "hardware has a rate and a sample time", "give one of the two"
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
            "write rate: 500 (in Hz), or sample_time: 1/500 (in s)",
        )
        return None
    return _positive(entries, "sample_time", names)


def _is_meant(field: Field) -> bool:
    """Whether an unknown key stands for the rate or the sample time."""
    pairs = field.node.pairs if isinstance(field.node, MappingNode) else ()
    return any(same_as(key.text, ("rate", "sample_time")) for key, _ in pairs)


def _noise(field: Field | None, names: Names) -> Fraction | Vector | None:
    """|n|, or |n_i| by state, 0 for those that are not named; None if unsound."""
    if field is None:
        return Fraction(0)
    if not isinstance(field.node, MappingNode):
        return field.number(names.values, least=0, side="above")
    entries = field.mapping(optional=names.states)
    if entries is None:
        return None
    sizes = {name: _size(entries, name, names, default=Fraction(0)) for name in names.states}
    found = tuple(size for size in sizes.values() if size is not None)
    return found if len(found) == len(sizes) else None


def _size(
    entries: Mapping[str, Field], key: str, names: Names, default: Fraction | None = None
) -> Fraction | None:
    """A number that is not negative, rounded up; `default` if it is not there."""
    return entries[key].number(names.values, least=0, side="above") if key in entries else default


def _positive(entries: Mapping[str, Field], key: str, names: Names) -> Fraction | None:
    return entries[key].number(names.values, above=0) if key in entries else None


def _is(field: Field | None, word: str) -> bool:
    return field is not None and isinstance(field.node, Scalar) and field.node.text == word
