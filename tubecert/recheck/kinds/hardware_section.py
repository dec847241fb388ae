"""The section `hardware` of a certificate, and the recipe of its machine, as they are read."""

from __future__ import annotations

from dataclasses import dataclass, fields
from fractions import Fraction

from tubecert.recheck.document import Node
from tubecert.recheck.enclosures import Enclosure, enclosure
from tubecert.recheck.kinds import printed
from tubecert.recheck.kinds.kind import VERDICTS, Section
from tubecert.recheck.kinds.window_section import WindowSection, read_range, read_windows
from tubecert.recheck.recipe import Losses
from tubecert.recheck.specified.numbers import Range

SHARES = (
    "plan",
    "feedforward",
    "wind",
    "wind_estimate",
    "bias",
    "noise_estimate",
    "lag",
    "noise_feedback",
    "sampling",
)
OF_GAINS = ("gain", "geodesic")  # of an uncertain B, and of computed geodesics: left out where they are 0
OF_MACHINE = ("sample_time", "delay", "feedback_time", "noise", "wind", "clip_radius", "level")
OF_PROOF = ("floor", "speed", "bias", "ripple")
_MOST_POINTS = 100  # of the curve: for each a recipe is searched for


@dataclass(frozen=True, slots=True, kw_only=True)
class HardwareSection(Section):
    """The machine, the level that is proven for it, and what follows; None, and nothing, where there is no recipe."""

    machine: dict[str, Fraction]
    bandwidth: Fraction | None
    deadbeat: bool
    predict: bool
    largest: str | None
    clip: tuple[Range, ...]
    radius: Fraction | None
    half_widths: dict[str, Fraction]
    inputs: dict[str, Range]
    margin: Enclosure | None
    level_margin: Enclosure | None
    ultimate_radius: Fraction | None
    budget: dict[str, Fraction] | None
    curve: tuple[tuple[Fraction, Fraction], ...]
    windows: tuple[WindowSection, ...]


def read_section(node: Node) -> HardwareSection:
    """The section, closed: `CertificateError` where anything else stands in it."""
    others = (
        "verdict",
        "bandwidth",
        "deadbeat",
        "predict",
        "clip",
        "radius",
        "half_widths",
        "inputs",
    )
    rest = ("margin", "level_margin", "ultimate_radius", "budget", "curve", "shortfalls")
    own = node.closed(*OF_MACHINE, *others, *rest, optional=("largest", "windows"))
    verdict = own["verdict"].word(*VERDICTS)
    present = [own[key].value is not None for key in (*OF_MACHINE, "margin", "level_margin")]
    if any(present) != all(present) or (verdict == "certified" and not all(present)):
        raise node.refused("has a part of its machine only")
    return HardwareSection(
        verdict=verdict,
        machine={key: own[key].decimal() for key in OF_MACHINE} if all(present) else {},
        bandwidth=own.known("bandwidth", Node.decimal),
        deadbeat=own["deadbeat"].flag(),
        predict=own["predict"].flag(),
        largest=own.get("largest", Node.text),
        clip=tuple(read_range(item) for item in own["clip"].entries()),
        radius=own.known("radius", Node.number),
        half_widths={name: item.number() for name, item in own["half_widths"].items()},
        inputs={name: read_range(item) for name, item in own["inputs"].items()},
        margin=own.known("margin", enclosure),
        level_margin=own.known("level_margin", enclosure),
        ultimate_radius=own.known("ultimate_radius", Node.number),
        budget=own.known("budget", _budget),
        curve=_points(own["curve"]),
        windows=own.get("windows", read_windows) or (),
        shortfalls=printed.read_shortfalls(own["shortfalls"]),
    )


def read_losses(node: Node) -> Losses:
    """One record, in a list: none is left out."""
    (own,) = node.sized(1)
    keys = tuple(item.name for item in fields(Losses))
    members = own.closed(*keys)
    return Losses(**{key: members[key].decimal() for key in keys})


def _budget(node: Node) -> dict[str, Fraction]:
    own = node.closed(*SHARES, optional=OF_GAINS)
    more = {key: own.get(key, Node.number) or Fraction(0) for key in OF_GAINS}
    return {key: own[key].number() for key in SHARES} | more


def _points(node: Node) -> tuple[tuple[Fraction, Fraction], ...]:
    items = node.entries()
    if len(items) > _MOST_POINTS:
        raise node.refused(f"has more than {_MOST_POINTS} points")
    return tuple(map(_point, items))


def _point(node: Node) -> tuple[Fraction, Fraction]:
    own = node.closed("sample_time", "level")
    return own["sample_time"].decimal(), own["level"].decimal()
