"""The summary of a simulation as records: what `simulate` writes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from tubecert.records import INLINE, Json, to_json
from tubecert.simulate.campaign import Campaign
from tubecert.simulate.inputs import InputUse

FORMAT: Final = "tubecert-simulation/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class GainsData:
    """Gains of a loop; None where it has no such gain, or one beyond all numbers."""

    bandwidth: float | None
    adaptation_rate: float | None
    projection_radius: float | None
    predictor_gain: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopData:
    """A loop, whether a certificate covers its gains, and whether it is meant to stay in the tube."""

    controller: str
    gains_are: str
    covered: bool
    tested: bool
    gains: GainsData | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RunAt:
    """A run, by its number, and a time in s."""

    run: int
    t: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class StoppedData:
    """A run that ended early, and why."""

    run: int
    t: float | None
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class UseData:
    """The largest value of a quantity, its bound if it has one, and where it was met."""

    value: float | None
    bound: float | None
    share: float | None
    run: int
    t: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ViolationData:
    """A bound that was broken."""

    bound_of: str
    run: int
    t: float | None
    value: float | None
    bound: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonData:
    """Runs against the promises about their loop."""

    runs: int
    left_the_tube: int
    first_outside: tuple[int, ...]
    first_exit: RunAt | None
    no_result: int
    unresolved: tuple[RunAt, ...]
    stopped: tuple[StoppedData, ...]
    worst: Mapping[str, UseData]
    violations: tuple[ViolationData, ...]
    settled: float | None
    final_deviation: float | None
    error_estimate: float
    inputs: tuple[InputUse, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ClearanceData:
    """The least distance to an obstacle, by its number, and when in s."""

    obstacle: int
    clearance: float | None
    t: float
    collides: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnData:
    """A loop under the uncertainty that is drawn."""

    loop: LoopData = field(metadata=INLINE)
    comparison: ComparisonData = field(metadata=INLINE)
    obstacles: tuple[ClearanceData, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomData:
    """Random runs; fewer than were asked for if somebody interrupted."""

    asked: int
    comparison: ComparisonData = field(metadata=INLINE)


@dataclass(frozen=True, slots=True, kw_only=True)
class WaveData:
    """The h that the adversary found, a wave in x and t."""

    amplitude: list[float]
    frequency: list[float]
    wave: list[float]
    phase: list[float]
    push: float


@dataclass(frozen=True, slots=True, kw_only=True)
class AdversaryData:
    """The run of the adversary, its start, its h and what acted beside it."""

    comparison: ComparisonData = field(metadata=INLINE)
    start: list[float]
    h: WaveData
    beside: Mapping[str, list[float]] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackData:
    """What random runs and the adversary found against a loop."""

    loop: LoopData = field(metadata=INLINE)
    largest_distance_over_dbar: float | None
    random: RandomData | None = None
    adversary: AdversaryData | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowedData:
    """Random runs of a loop along random plans of a family."""

    loop: LoopData = field(metadata=INLINE)
    comparison: ComparisonData = field(metadata=INLINE)


@dataclass(frozen=True, slots=True, kw_only=True)
class MembersData:
    """Further random plans of a family: run i is along plan i // `runs_each`; the largest defect is a sampled one.

    `replan`: after so many s a plan is given up for another; None: never.
    """

    asked: int
    plans: int
    runs_each: int
    largest_defect: float
    loops: tuple[FollowedData, ...]
    replan: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ObstaclesData:
    """How far the plan and its tube stay from every obstacle."""

    plan: tuple[ClearanceData, ...]
    tube: tuple[ClearanceData, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class BoundsData:
    """The class of uncertainties that attacked: bounds of |h|, |dh/dx|, |dh/dt|, and of |h| at the start."""

    h: float
    h_x: float
    h_t: float
    h_initial: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """Everything that was found; `certificate` is the hash of the one that was compared with."""

    format: str
    name: str
    outcome: str
    certificate: str
    horizon: float
    rho: float
    dbar: float
    uncertainty: str
    bounds: BoundsData
    seed: int
    loops: tuple[DrawnData, ...]
    attacks: tuple[AttackData, ...]
    obstacles: ObstaclesData
    members: MembersData | None = None

    def to_json(self) -> Json:
        """What `summary.json` holds."""
        data = to_json(self)
        data["class"] = data.pop("bounds")
        return data


def outcome(campaign: Campaign) -> str:
    """The outcome in a word or two: falsified, tube left, no result, interrupted, not falsified, or nothing claimed."""
    if campaign.falsified:
        return "falsified"
    if campaign.left:
        return "tube left"
    if campaign.unreliable:
        return "no result"
    if campaign.interrupted:
        return "interrupted"
    return "not falsified" if any(loop.promise for loop, _ in campaign.comparisons) else "nothing claimed"
