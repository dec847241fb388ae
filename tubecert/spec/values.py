"""What the sections of a specification are made of: expressions with obligations, knots, tables, places."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal

from tubecert.expression import Expression, Obligation
from tubecert.findings import Location

Vector = tuple[Fraction, ...]
Matrix = tuple[Vector, ...]
Ends = tuple[Fraction, Fraction]
Interpolation = Literal["hold", "linear", "hermite-simpson"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """An expression of the file; each of its `obligations` has the location of the same index in `places`."""

    expression: Expression
    obligations: tuple[Obligation, ...]
    places: tuple[Location, ...] = field(repr=False)
    text: str
    location: Location = field(repr=False)

    def __post_init__(self) -> None:
        assert len(self.obligations) == len(self.places)

    @property
    def parts(self) -> tuple[Expression, ...]:
        """The expression, and what the obligations are about."""
        return self.expression, *(duty.argument for duty in self.obligations)

    def owed(self) -> Iterator[tuple[Obligation, Location]]:
        """The obligations with where each stands."""
        return zip(self.obligations, self.places, strict=True)


TermMatrix = tuple[tuple[Term, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Knots:
    """A curve by its values: `t` (K) in s from 0 on, `x` (K, n), `u` (K, m), all exact.

    u is held from each knot to the next, or linear between them; or rows are in turn a knot and a point between two, as
    planners by Hermite-Simpson collocation have them, and u is quadratic through a knot, that point and the next knot.
    """

    t: Vector
    x: Matrix
    u: Matrix
    interpolation: Interpolation

    def __post_init__(self) -> None:
        assert len(self.t) == len(self.x) == len(self.u) >= 2
        assert self.t[0] == 0
        assert all(a < b for a, b in zip(self.t, self.t[1:], strict=False))
        assert self.interpolation != "hermite-simpson" or len(self.t) % 2 == 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A plan file: its name as written, the hash of its bytes, its knots, where its header and its rows stand.

    `begins`: its first time in s, which is t = 0 of the knots.
    """

    file: str
    sha256: str
    knots: Knots = field(repr=False)
    begins: Fraction = Fraction(0)
    header: Location | None = field(default=None, repr=False, compare=False)
    rows: tuple[Location, ...] = field(default=(), repr=False, compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """A linear combination of the states that a half-width may be asked of: `row` (n,) times x."""

    name: str
    row: Vector


class Places(Mapping[str, Location]):
    """Where the value of each key of the file stands; read-only, and it can be pickled."""

    __slots__ = ("_found",)

    def __init__(self, found: Mapping[str, Location]) -> None:
        self._found = dict(found)

    def __getitem__(self, path: str) -> Location:
        return self._found[path]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)
