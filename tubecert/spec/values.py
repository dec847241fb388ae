"""What the sections of a specification are made of: expressions in the names of a scope, knots, tables, places."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Final, Literal

from tubecert.expression import (
    MAX_LENGTH,
    MAX_NUMBER_EXPONENT,
    Expression,
    ExpressionError,
    Lookup,
    Obligation,
    Parsed,
    full_text,
    longest_text,
    parse,
)
from tubecert.findings import Location

Vector = tuple[Fraction, ...]
Matrix = tuple[Vector, ...]
Ends = tuple[Fraction, Fraction]
Interpolation = Literal["hold", "linear", "hermite-simpson"]
Parameters = Mapping[str, Expression]
_GREATEST: Final = Fraction(10) ** MAX_NUMBER_EXPONENT  # floats end at 1e308, and lose digits below 1e-308
MODERATE: Final = "choose units in which the numbers are moderate"


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
class Scope:
    """The names that an expression may use here, and why other names of the file may not occur.

    `owed` is what the use of a definition owes; one that owes nothing is there as well.
    """

    symbols: Mapping[str, Expression]
    tables: Mapping[str, Lookup] = field(default_factory=dict)
    refused: Mapping[str, str] = field(default_factory=dict)
    kinks: bool = False
    owed: Mapping[str, tuple[Obligation, ...]] = field(default_factory=dict)

    def parse(self, text: str) -> Parsed:
        """The expression of a text; raises `ExpressionError`."""
        parsed = parse(
            text,
            symbols=self.symbols,
            tables=self.tables,
            kinks=self.kinks,
            refused=self.refused,
            owed=self.owed,
        )
        if self.owed:
            self._check_written_out(parsed)
        return parsed

    def _check_written_out(self, parsed: Parsed) -> None:
        """What definitions stand for is written out in certificates, and must be an expression of the grammar there."""
        parts = [parsed.expression, *(owed.argument for owed in parsed.obligations)]
        try:
            if sum(map(longest_text, parts)) > 8 * MAX_LENGTH:
                raise ExpressionError("it is longer than that", kind="limit")
            text = full_text(parsed.expression, parsed.obligations)
            parse(text, symbols=self.symbols, tables=self.tables, kinks=self.kinks)
        except ExpressionError as error:
            raise ExpressionError(
                f"with its definitions written out the expression is too large ({error.message})",
                help=f"an expression may have {MAX_LENGTH} characters, definitions written out",
                kind="limit",
            ) from None


def out_of_range(value: Fraction) -> str | None:
    """What is wrong with the size of a number: it must be a float, give or take a rounding, and not a subnormal one."""
    if abs(value) > _GREATEST:
        return f"beyond 1e{MAX_NUMBER_EXPONENT}"
    if 0 < abs(value) < 1 / _GREATEST:
        return f"nearer to 0 than 1e-{MAX_NUMBER_EXPONENT}"
    return None


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
