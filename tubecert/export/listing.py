"""Programs as lines of a language: results that are used once are written where they are used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Final, Protocol

import numpy as np

from tubecert.export.controller import refused
from tubecert.export.program import Program, Step

_WIDEST: Final = 72  # characters of what is written in place
_SIGNS: Final = {"add": "+", "sub": "-", "mul": "*", "div": "/"}


class Language(Protocol):
    """What differs between languages."""

    def number(self, value: Fraction) -> str:
        """A constant."""
        ...

    def entry(self, name: str, index: int) -> str:
        """An entry of a vector that goes in."""
        ...

    def call(self, name: str, argument: str) -> str:
        """A function."""
        ...

    def choice(self, name: str, a: str, b: str) -> str:
        """RATIO, SHRINK, LEAST or GREATEST; both are names or numbers."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Lines:
    """A program in a language: names of intermediate results with their texts, and every entry that comes out."""

    named: tuple[tuple[str, str], ...]
    results: tuple[tuple[str, int, str], ...]


@dataclass(frozen=True, slots=True)
class _Text:
    text: str
    simple: bool  # a name or a number: no brackets, and as good as free


def lines(program: Program, language: Language) -> Lines:
    """The lines of a program."""
    uses = [0] * len(program.steps)
    for step in program.steps:
        for place in step.places:
            uses[place] += 2 if step.operation == "choose" else 1
    for port in program.outputs:
        for place in port.places:
            uses[place] += 1
    texts: list[_Text] = []
    named: list[tuple[str, str]] = []
    for place, step in enumerate(program.steps):
        found = _text(step, texts, language)
        if not found.simple and (uses[place] > 1 or len(found.text) > _WIDEST):
            named.append((f"r{len(named)}", found.text))
            found = _Text(named[-1][0], simple=True)
        texts.append(found)
    results = tuple(
        (port.name, i, texts[place].text) for port in program.outputs for i, place in enumerate(port.places)
    )
    return Lines(named=tuple(named), results=results)


def _text(step: Step, texts: Sequence[_Text], language: Language) -> _Text:
    if step.operation == "input":
        return _Text(language.entry(step.name, step.index), simple=True)
    if step.operation == "constant":
        return _Text(language.number(step.value), simple=True)
    args = [texts[place] for place in step.places]
    if step.operation == "call":
        return _Text(language.call(step.name, args[0].text), simple=False)
    if step.operation == "choose":
        return _Text(language.choice(step.name, args[0].text, args[1].text), simple=False)
    bracketed = [each.text if each.simple else f"({each.text})" for each in args]
    if step.operation == "neg":
        return _Text(f"-{bracketed[0]}", simple=False)
    return _Text(f" {_SIGNS[step.operation]} ".join(bracketed), simple=False)


def decimal(value: Fraction, *, single: bool = False) -> str:
    """The shortest decimal of the number nearest to a fraction; one that is negative is in brackets."""
    near = float(value)
    text = str(_single(value)) if single else repr(near)
    if "." not in text and "e" not in text:
        text += ".0"
    return f"({text})" if near < 0 else text


def _single(value: Fraction) -> np.float32:
    """The nearest `float` to a fraction: rounded once, not by way of `double`."""
    with np.errstate(over="ignore"):
        near = np.float32(float(value))
    if not np.isfinite(near):
        raise refused(f"{float(value):g} is no float: it is too large", "export it in double")
    below, above = np.nextafter(near, np.float32(-np.inf)), np.nextafter(near, np.float32(np.inf))
    return min(
        (x for x in (near, below, above) if np.isfinite(x)), key=lambda x: abs(Fraction(float(x)) - value)
    )
