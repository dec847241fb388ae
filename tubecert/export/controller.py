"""What is exported: the controller of a certificate H or C, as programs, tables and numbers, all exact."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from tubecert.conditions.hardware import Rounding
from tubecert.errors import TubecertError
from tubecert.export.geodesics import Swept
from tubecert.export.program import Program
from tubecert.expression.lookup import Lookup
from tubecert.findings import Finding


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """A plan through knots: `start` (K,) in s, x* (K, n, 4) and u* (K, m, 2) as polynomials of t - start.

    `most`: so many pieces can meet one sample at most. `x_off` and `u_off`, of the same shapes: how far a
    coefficient is from the exact one at most; `length` (K,) in s; `continuous`: u* does not jump.
    """

    start: tuple[Fraction, ...]
    x: tuple[tuple[tuple[Fraction, ...], ...], ...]
    u: tuple[tuple[tuple[Fraction, ...], ...], ...]
    most: int
    x_off: tuple[tuple[tuple[Fraction, ...], ...], ...]
    u_off: tuple[tuple[tuple[Fraction, ...], ...], ...]
    length: tuple[Fraction, ...]
    continuous: bool

    @cached_property
    def begins(self) -> tuple[float, ...]:
        """`start` as floats."""
        return tuple(map(float, self.start))


@dataclass(frozen=True, slots=True, kw_only=True)
class Boxes:
    """What x* (n) and u* (m) of a family of plans keep to."""

    x: tuple[tuple[Fraction, Fraction], ...]
    u: tuple[tuple[Fraction, Fraction], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Steering(ABC):
    """A plan and the feedback around it, which every controller has.

    `name` begins every name in the code; `hash` is that of the certificate. Times in s; `horizon` None
    without end; `level`: d(x*, x) stays below it, and `reach` what d(x*, .) is at most where the feedback
    looks, as it is computed; `metric` is M, empty where it is not constant: then geodesics are `swept`; `ranges`:
    what is proven of every input. Of the plan, either the program `plan`, or `pieces`, or `boxes`: then it is any of a
    family, and handed in.
    """

    name: str
    system: str
    hash: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    sample_time: Fraction
    horizon: Fraction | None
    level: Fraction
    reach: Fraction
    metric: tuple[tuple[Fraction, ...], ...]
    ranges: tuple[tuple[float, float], ...]
    plan: Program | None
    pieces: Pieces | None
    drift: Program
    flow: Program
    law: Program
    swept: Swept | None = None
    boxes: Boxes | None = None

    @property
    @abstractmethod
    def programs(self) -> tuple[Program, ...]:
        """Every program, in the order in which they are written."""

    @property
    def tables(self) -> tuple[Lookup, ...]:
        """Every table that a program reads, once."""
        found = {table.name: table for program in self.programs for table in program.tables}
        return tuple(found[name] for name in sorted(found))

    @property
    def adds_plan(self) -> bool:
        """Whether u* is in what the feedback returns."""
        return True


@dataclass(frozen=True, slots=True, kw_only=True)
class Continuous(Steering):
    """The controller of a certificate C: feedback in continuous time, of which the adaptation is sampled.

    `estimator` and `observer` are (4.5), `filter` its solution between samples; rates in 1/s.
    """

    bandwidth: Fraction
    predictor_gain: Fraction
    radius: Fraction
    estimator: Program
    filter: Program
    observer: Program

    @property
    def programs(self) -> tuple[Program, ...]:
        """Every program, in the order in which they are written."""
        given = (self.plan, self.drift, self.flow, self.law, self.estimator, self.filter, self.observer)
        return tuple(each for each in given if each is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Controller(Steering):
    """The controller of a certificate H for one computer.

    `share` is th; `estimate` bounds |q|, and `feedback_gain` is du. `lost`: what rounding may cost, where the
    certificate covers it. `bend` is u*'s sixth derivative, where its mean is that of three nodes and rounding is
    covered. `still`: u* is constant; `held`: u* is played from sample to sample. `moves`: how far every measured state
    may move from one sample to the next, where rounding is covered. `every`: the feedback is computed at every so many
    samples. `steep`: the derivatives of f + B u by states, and B, where it predicts and rounding is covered.
    """

    delay: Fraction
    share: Fraction
    estimate: Fraction
    feedback_gain: Fraction
    lost: Rounding | None
    predicts: bool
    held: bool
    still: bool
    applied: Program
    gauss: Program | None
    bend: Program | None
    predictor: Program | None
    estimator: Program
    moves: tuple[Fraction, ...] = ()
    stretch: Fraction = Fraction(1)
    every: int = 1
    steep: Program | None = None

    @property
    def programs(self) -> tuple[Program, ...]:
        """Every program, in the order in which they are written."""
        swept = () if self.swept is None else self.swept.programs
        found = (self.plan, self.drift, self.flow, *swept, self.law, self.applied, self.gauss, self.predictor)
        return tuple(each for each in (*found, self.estimator) if each is not None)

    @property
    def adds_plan(self) -> bool:
        """Whether u* is in what a step returns: it is held, or constant."""
        return self.held or self.still


def refused(message: str, help: str, code: str = "TC710") -> TubecertError:
    """The error for what cannot be exported."""
    return TubecertError([Finding(code=code, message=message, help=help)])
