"""The sections `tube`, `adaptation`, `conditions` and `expect`, and the name of the specification."""

from __future__ import annotations

import re
from dataclasses import fields
from fractions import Fraction
from typing import Final

from tubecert.expression import number_text
from tubecert.letters import ALL, name_of, words_of
from tubecert.spec import codes
from tubecert.spec.document import Scalar
from tubecert.spec.names import Names
from tubecert.spec.reader import Field
from tubecert.spec.types import Adaptation, Expectation, Tube
from tubecert.verdict import Verdict

VERDICTS: Final = ("certified", "refuted", "undecided")
METRICS: Final = {Verdict.CERTIFIED: "holds", Verdict.REFUTED: "refuted", Verdict.UNDECIDED: "undecided"}
RANGES: Final = ("rho", "clearance", "inputs", "bandwidth", "adaptation_rate", "largest_rate")

WIDTHS: Final = "half_widths"  # ranges by state and output

_KEYS: Final = tuple(item.name for item in fields(Tube))  # of `tube`
_SLUG = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


def read_name(field: Field) -> str | None:
    """The specification's name, which becomes part of file names."""
    name = field.text("a name")
    if name is None or _SLUG.fullmatch(name):
        return name
    slug = re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_")[:64]
    field.fail(
        codes.NAME,
        f"{name[:60]!r} cannot be a name",
        "use ASCII letters, digits, _ and -, at most 64" + (f": {slug}" if slug else ""),
    )
    return None


def read_tube(field: Field | None, names: Names) -> Tube | None:
    """The two radii or the half-widths, as far as they are given, and the coordinates they are measured in."""
    entries = field.mapping(optional=_KEYS, reserved=("weights",)) if field else {}
    if entries is None:
        return None
    radii = {
        key: entries[key].number(names.values, above=0, side="below")
        for key in ("epsilon", "rho_a")
        if key in entries
    }
    widths = _read_half_widths(entries.get("half_widths"), names)
    chosen = entries["coordinates"].word(("identity", "auto")) if "coordinates" in entries else None
    refined = entries.get("gap")
    gap = None if refined is None else _read_gap(refined)
    if None in radii.values() or widths is None or (chosen is None and "coordinates" in entries):
        return None
    if gap is None and refined is not None:
        return None
    if widths and "epsilon" in entries:
        entries["epsilon"].fail(
            codes.RANGE,
            f"{entries['epsilon'].path} beside half_widths",
            "they fix the whole tube: give one of the two",
        )
        return None
    if widths and chosen == "identity":
        entries["coordinates"].fail(
            codes.RANGE, "half_widths with coordinates: identity", "write coordinates: auto, or leave it out"
        )
        return None
    return Tube(
        epsilon=radii.get("epsilon"),
        rho_a=radii.get("rho_a"),
        coordinates="auto" if chosen == "auto" else "identity" if chosen == "identity" else None,
        half_widths=widths,
        gap=None if gap is None else "auto",
    )


def _read_half_widths(field: Field | None, names: Names) -> tuple[tuple[str, Fraction], ...] | None:
    """Half-widths by state and output, in their order; empty if there are none."""
    if field is None:
        return ()
    entries = field.mapping(optional=names.lengths)
    if entries is None:
        return None
    if not field.pairs():
        field.fail(codes.RANGE, f"{field.path} is empty", f"write {{{names.states[0]}: 0.1}} or the like")
        return None
    found = {
        name: entries[name].number(names.values, above=0, side="below")
        for name in names.lengths
        if name in entries
    }
    kept = tuple((name, width) for name, width in found.items() if width is not None)
    return kept if len(kept) == len(found) else None


def read_adaptation(field: Field | None, names: Names) -> Adaptation | None:
    """The gain of the predictor and the projection."""
    entries = field.mapping(optional=("A_m", "projection")) if field else {}
    if entries is None:
        return None
    gain, known = _read_predictor(entries.get("A_m"), names)
    smooth, readable = _read_projection(entries.get("projection"), names)
    return Adaptation(predictor_gain=gain, smooth=smooth) if known and readable else None


def _read_predictor(field: Field | None, names: Names) -> tuple[Fraction | None, bool]:
    """The g of A_m = -g I (None for auto), and whether what is written is sound."""
    if field is None or (isinstance(field.node, Scalar) and field.node.text == "auto"):
        return None, True
    if not isinstance(field.node, Scalar):
        field.fail(
            codes.STABILITY,
            f"{field.path} is a matrix; the predictor is a multiple of the identity",
            "write auto, or a negative number: -10 stands for -10 I; no matrix serves better than auto",
        )
        return None, False
    value = field.number(names.values)
    if value is not None and value >= 0:
        field.fail(
            codes.STABILITY,
            f"{field.path} is {number_text(value)}, and a predictor that is stable needs a negative number",
            "write auto, or -10, which stands for -10 I",
        )
        return None, False
    return (None, False) if value is None else (-value, True)


def _read_projection(field: Field | None, names: Names) -> tuple[Fraction | None, bool]:
    """The smooth layer (None for the hard projection), and whether what is written is sound."""
    if field is None:
        return None, True
    if isinstance(field.node, Scalar):
        return None, field.word(("hard",)) is not None
    entries = field.mapping(required=("smooth",))
    smooth = (
        entries["smooth"].number(names.values, above=0, most=1) if entries and "smooth" in entries else None
    )
    return smooth, smooth is not None


def _read_gap(field: Field) -> str | None:
    """`auto`; a number is an option of the command."""
    text = field.node.text if isinstance(field.node, Scalar) else ""
    if re.fullmatch(r"[0-9./eE%+-]+", text) is None:
        return field.word(("auto",))
    field.fail(
        codes.RANGE,
        f"{field.path} is {text[:20]}",
        f"write auto here; a number is an option: --gap {text[:20]}",
    )
    return None


def read_decides(field: Field | None) -> str | None:
    """The certificate that decides, by its letter, or all; None if it is not said."""
    entries = field.mapping(optional=("decides",)) if field else None
    if entries is None or "decides" not in entries:
        return None
    word = entries["decides"].word((*words_of(), ALL))
    return word if word is None or word == ALL else name_of(word).letter


def read_expectation(field: Field | None, names: Names, *, alone: bool) -> Expectation | None:
    """Locked results: verdicts, and [least, most] of numbers of the certificate; `alone`: of a metric alone."""
    entries = field.mapping(optional=("verdict", "metric", WIDTHS, *RANGES)) if field else None
    if entries is None:
        return None
    for key in entries.keys() - {"metric", "largest_rate"} if alone else ():
        entries[key].fail(
            codes.RANGE,
            f"{entries[key].path} in a question about a metric alone",
            f"write metric: {', '.join(METRICS.values())}; the number that can be expected is largest_rate",
        )
    verdict = entries["verdict"].word(VERDICTS) if "verdict" in entries else None
    metric = entries["metric"].word(tuple(METRICS.values())) if "metric" in entries else None
    wide = entries[WIDTHS].mapping(optional=names.lengths) if WIDTHS in entries else None
    told: dict[str, Field] = {key: entries[key] for key in RANGES if key in entries}
    told |= {f"{WIDTHS}.{name}": own for name, own in (wide or {}).items()}
    ranges = []
    for key, own in told.items():
        limits = own.numbers(2, names.values)
        if limits and limits[0] > limits[1]:
            own.fail(codes.RANGE, f"{own.path}: the range is empty", "write [least, most]")
        elif limits:
            ranges.append((key, (limits[0], limits[1])))
    return Expectation(verdict=verdict, metric=metric, ranges=tuple(ranges))
