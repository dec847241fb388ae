"""What a simulation of a sampled loop found: the records of `summary.json`. Trusted: no."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from tubecert.records import Json, to_json

FORMAT: Final = "tubecert-sampled-simulation/1"
Code = Literal["c", "floats"]
Outcome = Literal["falsified", "no result", "interrupted", "not falsified"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """The largest |x - x*| of a state, or |u - u*| of an input, as a share of its bound: in which run, at t in s."""

    share: float
    value: float
    bound: float
    run: int
    t: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Attained:
    """Of a state or an input: the peaks of random runs and of adversaries, and their shares in every stage."""

    random: Peak | None
    adversary: Peak | None
    random_by_stage: tuple[float, ...]
    adversary_by_stage: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Violation:
    """A run was outside at t in s, for the first time: by `of`, whose bound was `bound`; its greatest `value` is told.

    The run is repeated by the same seed. `aimed`: what an adversary wanted, empty for a random run.
    """

    of: str
    run: int
    t: float
    value: float
    bound: float
    aimed: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Went:
    """Where an input was in all runs, and where it is proven to stay."""

    least: float
    greatest: float
    proven: tuple[float, float] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Passed:
    """How near a run came to obstacle number `index` (negative: into it), and whether none is proven to meet it."""

    index: int
    distance: float
    run: int
    proven: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """A whole campaign: runs that were asked for and made, adversaries among them; times in s.

    `stages`: when they begin. `error`: the largest error of an integration, as a share of a half-width. `controller`:
    the exported C code, or its tables in floats.
    """

    format: str
    name: str
    outcome: Outcome
    certificate: str
    seed: int
    duration: float
    asked: int
    runs: int
    adversaries: int
    controller: Code
    error: float
    stages: tuple[float, ...]
    states: Mapping[str, Attained]
    inputs: Mapping[str, Attained]
    went: Mapping[str, Went]
    obstacles: tuple[Passed, ...] = ()
    outside: int = 0
    violations: tuple[Violation, ...] = ()

    @property
    def attained(self) -> float:
        """The largest share of any half-width."""
        peaks = (peak for own in self.states.values() for peak in (own.random, own.adversary) if peak)
        return max((peak.share for peak in peaks), default=0.0)

    def to_json(self) -> Json:
        """The file's content."""
        return to_json(self)
