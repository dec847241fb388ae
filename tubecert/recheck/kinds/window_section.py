"""What a certificate tells of windows: each by its times, its tube and its numbers, and the recipe of each."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Node
from tubecert.recheck.recipe import Stretch
from tubecert.recheck.specified.numbers import Range

PROOF = ("level", "floor", "speed", "bias", "ripple")
_MOST = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowSection:
    """What is told of one window, times in s: `tube` is its radius, the other numbers are None without a proof."""

    begin: Fraction
    end: Fraction
    tube: Fraction
    level: Fraction | None
    radius: Fraction | None
    supremum: Fraction | None
    half_widths: dict[str, Fraction]
    inputs: dict[str, Range]
    constants: dict[str, Fraction]

    @property
    def proves(self) -> bool:
        """Whether it tells anything of a level."""
        told = (self.level, self.radius, self.supremum)
        return any(item is not None for item in told) or bool(self.half_widths or self.inputs)


def read_windows(node: Node) -> tuple[WindowSection, ...]:
    """The windows that a section tells of."""
    items = node.entries()
    if not 0 < len(items) <= _MOST:
        raise node.refused(f"does not have 1 to {_MOST} windows")
    return tuple(map(_window, items))


def _window(node: Node) -> WindowSection:
    told = ("level", "radius", "supremum", "half_widths", "inputs", "constants")
    own = node.closed("begin", "end", "tube", *told)
    return WindowSection(
        begin=own["begin"].decimal(),
        end=own["end"].decimal(),
        tube=own["tube"].decimal(),
        level=own.known("level", Node.decimal),
        radius=own.known("radius", Node.number),
        supremum=own.known("supremum", Node.number),
        half_widths={name: item.number() for name, item in own["half_widths"].items()},
        inputs={name: read_range(item) for name, item in own["inputs"].items()},
        constants={name: item.number() for name, item in own["constants"].items()},
    )


def read_range(node: Node) -> Range:
    """Two ends."""
    low, high = node.pair()
    return low.decimal(), high.decimal()


def read_stretches(node: Node) -> tuple[Stretch, ...]:
    """The numbers of a recipe for every window."""
    items = node.entries()
    if not 0 < len(items) <= _MOST:
        raise node.refused(f"does not have 1 to {_MOST} windows")
    return tuple(map(_stretch, items))


def _stretch(node: Node) -> Stretch:
    own = node.closed(*PROOF, "prediction")
    return Stretch(
        **{key: own[key].decimal() for key in PROOF}, prediction=own.known("prediction", Node.decimal)
    )
