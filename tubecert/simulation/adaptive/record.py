"""The summary of a campaign: its records are what `summary.json` holds, and what reports read.

The words are chosen with care: a simulation that finds nothing has not falsified anything, and that is all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Literal

from tubecert.records import INLINE, Json, to_json
from tubecert.simulation.adaptive.judge import Clearance, Comparison, of_plan, of_run, of_tube
from tubecert.simulation.adaptive.loops import LoopGains
from tubecert.simulation.adaptive.setting import Loop, Setting

if TYPE_CHECKING:
    from tubecert.simulation.adaptive.campaign import Attack, Campaign, Drawn

FORMAT: Final = "tubecert-simulation/1"
Outcome = Literal["falsified", "tube left", "no result", "interrupted", "not falsified", "nothing claimed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopData:
    """A loop, whether a certificate covers its gains, and whether it is meant to stay in the tube."""

    controller: str
    gains_are: str
    covered: bool
    tested: bool
    gains: LoopGains | None = None

    @classmethod
    def of(cls, loop: Loop) -> LoopData:
        """What is told of a loop."""
        return cls(
            controller=loop.controller,
            gains_are=loop.origin,
            covered=loop.promise is not None,
            tested=loop.tested,
            gains=loop.problem.gains,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowedData:
    """A loop and its runs."""

    loop: LoopData = field(metadata=INLINE)
    comparison: Comparison = field(metadata=INLINE)


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnData(FollowedData):
    """A loop under the uncertainty that is drawn, and its clearances."""

    obstacles: tuple[Clearance, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomData:
    """Random runs; fewer than were asked for if somebody interrupted."""

    asked: int
    comparison: Comparison = field(metadata=INLINE)


@dataclass(frozen=True, slots=True, kw_only=True)
class AdversaryData:
    """The run of the adversary, its start, its h, a wave in x and t (`loops.Disturbance`), and what acted beside it."""

    comparison: Comparison = field(metadata=INLINE)
    start: list[float]
    h: Mapping[str, list[float]]
    beside: Mapping[str, list[float]] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackData:
    """What random runs and the adversary found against a loop."""

    loop: LoopData = field(metadata=INLINE)
    largest_distance_over_dbar: float | None
    random: RandomData
    adversary: AdversaryData | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MembersData:
    """Further random plans of a family: run i is along plan i // `runs_each`; the largest defect is a sampled one."""

    asked: int
    plans: int
    runs_each: int
    largest_defect: float
    loops: tuple[FollowedData, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ObstaclesData:
    """How far the plan, in many points, and its tube, as certified, stay from every obstacle."""

    plan: tuple[Clearance, ...]
    tube: tuple[Clearance, ...]


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
    outcome: Outcome
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
        data["class"] = data.pop("bounds")  # no name for a field
        return data


def summary(campaign: Campaign, certificate: str) -> Summary:
    """What was found; `certificate` is the hash of the certificate that was compared with."""
    setting, members, own = campaign.setting, campaign.members, campaign.setting.uncertainty
    loops = tuple(_drawn(item, setting) for item in campaign.drawn)
    attacks = tuple(_attack(item, setting) for item in campaign.attacks)
    return Summary(
        format=FORMAT,
        name=setting.spec.name,
        outcome=_outcome([*_told(loops, attacks, members)], interrupted=campaign.interrupted),
        certificate=certificate,
        horizon=setting.horizon,
        rho=setting.rho,
        dbar=setting.reach,
        uncertainty=campaign.uncertainty,
        bounds=BoundsData(h=own.h, h_x=own.h_x, h_t=own.h_t, h_initial=own.h_initial),
        seed=campaign.seed,
        loops=loops,
        attacks=attacks,
        obstacles=ObstaclesData(plan=of_plan(setting), tube=of_tube(setting)),
        members=members,
    )


def _outcome(found: Sequence[FollowedData], *, interrupted: bool) -> Outcome:
    """What all runs came to; a loop that is not meant to stay in the tube has no say but by a broken promise."""
    tested = [own.comparison for own in found if own.loop.tested]
    if any(own.comparison.violations for own in found):
        return "falsified"
    if any(own.left_the_tube for own in tested):
        return "tube left"
    if any(own.no_result for own in tested):
        return "no result"
    if interrupted:
        return "interrupted"
    return "not falsified" if any(own.loop.covered for own in found) else "nothing claimed"


def _told(
    loops: Sequence[DrawnData], attacks: Sequence[AttackData], members: MembersData | None
) -> Iterator[FollowedData]:
    """Every comparison with its loop."""
    yield from loops
    yield from members.loops if members else ()
    for own in attacks:
        yield FollowedData(loop=own.loop, comparison=own.random.comparison)
        if own.adversary is not None:
            yield FollowedData(loop=own.loop, comparison=own.adversary.comparison)


def _drawn(item: Drawn, setting: Setting) -> DrawnData:
    return DrawnData(
        loop=LoopData.of(item.loop), comparison=item.comparison, obstacles=of_run(setting, item.runs)
    )


def _attack(item: Attack, setting: Setting) -> AttackData:
    return AttackData(
        loop=LoopData.of(item.loop),
        largest_distance_over_dbar=None if item.greatest is None else item.greatest / setting.reach,
        random=RandomData(asked=item.asked, comparison=item.comparison),
        adversary=_adversary(item, setting),
    )


def _adversary(item: Attack, setting: Setting) -> AdversaryData | None:
    if item.case is None or item.worst_comparison is None:
        return None
    start, h = item.case
    names = ("amplitude", "frequency", "wave", "phase", "push")
    beside = {name: part[0].tolist() for name, part in h.beside._asdict().items()}
    return AdversaryData(
        comparison=item.worst_comparison,
        start=start[0].tolist(),
        h={name: getattr(h, name)[0].tolist() for name in names},
        beside=beside if setting.uncertainty.sources else None,
    )
