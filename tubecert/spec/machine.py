"""The machine that an engineer has: the sections `hardware`, `controller` and `limits`.

A file that names its machine asks about the sampled loop: `check_machine` tells what else may then stand in it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, Final, Literal

from tubecert.digits import near
from tubecert.expression import number_text
from tubecert.spec import codes, keys
from tubecert.spec.instead import same_as
from tubecert.spec.keys import CHOSEN, NUMBER, Kind, ends, entry, key, named, number, says, section, word
from tubecert.spec.names import Names
from tubecert.spec.reader import Field
from tubecert.spec.tube import EXPECT
from tubecert.spec.values import Vector

Arithmetic = Literal["double", "single"]
Hold = Literal["middle", "left", "continuous"]
Controller = Literal["auto", "none"]

ONE_SAMPLE: Final = "one sample"
MAX_LATE: Final = 64  # samples of delay: every one is a state of the loop

CONTROLLER: Final = word("auto", "none")
LIMITS: Final = named("inputs", ends(inward="limit"), "[-1, 1]")
IN_CONTINUOUS_TIME: Final = ("metric", "adaptation", "conditions")
"""Sections of a file that asks about a loop in continuous time."""

_WITHOUT_METRIC: Final = "the sampled loop is proven without a metric: leave it out, or leave out hardware"
_WIDTHS: Final = (
    "the tube of a sampled loop is found, half_widths are wishes: leave it out, or leave out hardware"
)
_EXPECTED: Final = "of a sampled loop verdict, half_widths and inputs can be expected: leave it out"
_ONE_NUMBER: Final = "write one number, the bound of |w|; a list of them goes with hardware: {rate: 500}"
_OF_A_COMPUTER: Final = "name the computer that it is about, hardware: {rate: 500}, or leave it out"
_OF_GAINS: Final = tuple(name for name in EXPECT.keys if name not in ("verdict", "half_widths", "inputs"))
_TUBE_IN_TIME: Final = ("epsilon", "rho_a", "coordinates", "gap")


def check_machine(entries: Mapping[str, Field]) -> None:
    """Reports what does not go with `hardware`, and what does not go without."""
    plan, tube, wind, expect = map(entries.get, ("trajectory", "tube", "disturbance", "expect"))
    if "hardware" in entries:
        told = [(entries.get(key), _WITHOUT_METRIC) for key in IN_CONTINUOUS_TIME]
        told += [(tube and tube.get(key), _WIDTHS) for key in _TUBE_IN_TIME]
        told += [(expect and expect.get(key), _EXPECTED) for key in _OF_GAINS]
        beside = "beside"
    else:
        told = [(entries.get("controller"), _OF_A_COMPUTER)]
        told += [(plan and plan.get(key), _OF_A_COMPUTER) for key in ("afterwards", "input_rate")]
        bound = wind and wind.get("bound")
        told += [(bound, _ONE_NUMBER)] if bound and bound.node.kind == "list" else []
        beside = "without"
    for field, help in told:
        if field is not None:
            field.fail(codes.RANGE, f"{field.path} {beside} hardware", help)


def _delay(field: Field, names: Names) -> Fraction | object | None:
    """In s; what is told in samples is refused, but for one sample, and a parameter may have that name."""
    if says(field, ONE_SAMPLE):
        return CHOSEN
    text = field.node.text
    if not any("sample" in each and each not in names.values for each in re.findall(r"\w+", text)):
        return field.number(names.values, least=0, side="above")
    message = f"{field.path} is {text[:40]!r}, not a time in seconds"
    help = f"write a number of seconds (half of the sample time at 500 Hz: 0.001), or `{ONE_SAMPLE}`"
    return field.fail(codes.RANGE, message, help)


_LATE: Final = {"anyOf": [NUMBER, {"enum": [ONE_SAMPLE]}]}
_BY_STATE: Final = named("states", keys.SIZE)


def _noise(field: Field, names: Names) -> Fraction | Vector | None:
    """|n|, or |n_i| by state, 0 for those that are not named."""
    if field.node.kind != "mapping":
        return field.number(names.values, least=0, side="above")
    sizes = _BY_STATE.read(field, names)
    return None if sizes is None else tuple(dict(sizes).get(name, Fraction(0)) for name in names.states)


def _noise_written(noise: Fraction | Vector, spec: Any) -> str | dict[str, str]:
    if isinstance(noise, Fraction):
        return number_text(noise)
    return {name: number_text(size) for name, size in zip(spec.states, noise, strict=True)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardware:
    """The computer and the sensors of the loop, which is then proven as it is: sampled, late, noisy, with inputs that
    are held between samples, and without a metric. metric, adaptation, conditions and the radii of the tube are not
    given beside it, and f is free of t. (Certificates 0, A and B, without hardware, are about a controller in
    continuous time that sees the state.)

    `delay` None: one sample time, whatever that is; `noise`: |n|, or |n_i| per state (n), in units of the states.
    """

    rate: ClassVar = entry(number(above=0), into="", late=True, example=500)
    """Samples and inputs per second, in Hz; > 0. Or sample_time."""
    sample_time: Fraction = key(number(above=0), late=True, needed=False, example="1/500")
    """Time between two samples in s, in place of the rate; > 0."""
    delay: Fraction | None = key(
        Kind(_delay, _LATE, lambda time, _: ONE_SAMPLE if time is None else number_text(time)),
        Fraction(0),
        said=0,
        example=0.0005,
        always=True,
    )
    """From a sample to the input that is computed from it, in s, or one sample time; any number of samples up to 64."""
    noise: Fraction | Vector = key(
        Kind(_noise, {"anyOf": [NUMBER, _BY_STATE.schema]}, _noise_written),
        Fraction(0),
        said=0,
        example=0.001,
    )
    """How wrong a measured state may be, anew at every sample: the Euclidean length of its error, or the error of each
    state by name (0 for those that are not named)."""
    arithmetic: Arithmetic = key(word("double", "single"), "double", said="double")
    """What the controller computes in; what it rounds is part of what is proven."""
    hold: Hold = key(word("middle", "left", "continuous"), "middle", said="middle")
    """What becomes of the plan's input over the time in which an input acts: u* in the middle of it is held, or u* at
    its beginning, or u*(t) is followed continuously."""

    limits: ClassVar = entry(LIMITS, into="", late=True, example={"u": [-8, 8]})
    """What the actuators can do, as in the section limits."""

    @property
    def delayed(self) -> Fraction:
        """The delay in s."""
        return self.sample_time if self.delay is None else self.delay


HARDWARE: Final = section(
    Hardware, examples=[{"rate": 500, "delay": 0.0005, "noise": {"x1": 0.001, "x2": 0.001}}]
)


def read_hardware(field: Field, names: Names) -> Hardware | None:
    """The computer and the sensors; None if the section is unsound."""
    entries = HARDWARE.entries(field)
    if entries is None:
        return None
    values = HARDWARE.values(entries, names)
    sample_time = _sample_time(field, entries, names)
    delay = values.get("delay")
    if delay is not None and sample_time is not None and delay > MAX_LATE * sample_time:
        message = f"hardware.delay is {near(float(delay / sample_time))} samples; at most {MAX_LATE} are read"
        help = f"it is in s (2 ms are 0.002); at this rate at most {number_text(MAX_LATE * sample_time)}"
        return entries["delay"].fail(codes.LIMIT, message, help)
    if sample_time is None or not HARDWARE.holds(values, entries):
        return None
    return Hardware(sample_time=sample_time, **values)


def limits_of(limits: Field | None, hardware: Field | None) -> Field | None:
    """Where the limits of the inputs stand: in a section of their own, or in that of the hardware."""
    own = None if hardware is None else hardware.get("limits")
    if own is not None and limits is not None:
        help = "they are the same limits: give one of the two"
        own.fail(codes.RANGE, "hardware.limits beside limits", help)
    return limits or own


def _sample_time(field: Field, entries: Mapping[str, Field], names: Names) -> Fraction | None:
    """From the rate, or itself; None if unsound."""
    there = [key for key in ("rate", "sample_time") if key in entries]
    if len(there) == 1:
        value = entries[there[0]].number(names.values, above=0)
        return 1 / value if value is not None and "rate" in entries else value
    if there:
        message = "hardware has a rate and a sample time"
        entries["sample_time"].fail(codes.RANGE, message, "give one of the two")
    elif not _is_meant(field):  # one finding says what it is called
        help = "write rate: 500 (in Hz), or sample_time: 1/500 (in s)"
        field.fail(codes.MISSING_KEY, "hardware lacks the rate", help)
    return None


def _is_meant(field: Field) -> bool:
    """Whether an unknown key stands for the rate or the sample time."""
    return any(same_as(key.text, ("rate", "sample_time")) for key, _ in field.node.pairs)
