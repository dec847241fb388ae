"""A campaign as records: what was simulated, with which gains, what it used of every bound, and what broke.

The words are chosen with care: a simulation that finds nothing has not falsified anything, and that is all.
"""

from __future__ import annotations

import math
from typing import Final

from tubecert.simulate.campaign import Attack, Campaign, Drawn, Members
from tubecert.simulate.clearance import Clearance
from tubecert.simulate.compare import Comparison, Use
from tubecert.simulate.setting import Loop, Setting
from tubecert.simulate.told import (
    FORMAT,
    AdversaryData,
    AttackData,
    BoundsData,
    ClearanceData,
    ComparisonData,
    DrawnData,
    FollowedData,
    GainsData,
    LoopData,
    MembersData,
    ObstaclesData,
    RandomData,
    RunAt,
    StoppedData,
    Summary,
    UseData,
    ViolationData,
    WaveData,
    outcome,
)

_LISTED: Final = 20  # of the runs that left, stopped or came to nothing


def summary(campaign: Campaign, certificate: str) -> Summary:
    """What was found; `certificate` is the hash of the certificate that was compared with."""
    setting = campaign.setting
    own = setting.uncertainty
    return Summary(
        format=FORMAT,
        name=setting.spec.name,
        outcome=outcome(campaign),
        certificate=certificate,
        horizon=setting.horizon,
        rho=setting.rho,
        dbar=setting.reach,
        uncertainty=campaign.uncertainty,
        bounds=BoundsData(h=own.h, h_x=own.h_x, h_t=own.h_t, h_initial=own.h_initial),
        seed=campaign.seed,
        loops=tuple(map(_drawn, campaign.drawn)),
        attacks=tuple(_attack(item, setting) for item in campaign.attacks),
        obstacles=ObstaclesData(
            plan=tuple(map(_clearance, campaign.plan_clearance)),
            tube=tuple(map(_clearance, campaign.tube_clearance)),
        ),
        members=None if campaign.members is None else members_data(campaign.members),
    )


def members_data(found: Members) -> MembersData:
    """What further plans of a family came to."""
    return MembersData(
        asked=found.asked,
        plans=found.plans,
        runs_each=found.each,
        largest_defect=found.defect,
        replan=None if found.replan is None else float(found.replan),
        loops=tuple(
            FollowedData(loop=_loop(item.loop), comparison=_comparison(item.comparison))
            for item in found.followed
        ),
    )


def _loop(loop: Loop) -> LoopData:
    return LoopData(
        controller=loop.controller,
        gains_are=loop.origin,
        covered=loop.promise is not None,
        tested=loop.tested,
        gains=_gains(loop),
    )


def _gains(loop: Loop) -> GainsData | None:
    gains = loop.problem.gains
    if gains is None:
        return None
    return GainsData(
        bandwidth=gains.bandwidth,
        adaptation_rate=gains.adaptation_rate,
        projection_radius=gains.projection_radius,
        predictor_gain=gains.predictor_gain,
    )


def _drawn(item: Drawn) -> DrawnData:
    return DrawnData(
        loop=_loop(item.loop),
        comparison=_comparison(item.comparison),
        obstacles=tuple(map(_clearance, item.clearance)),
    )


def _attack(item: Attack, setting: Setting) -> AttackData:
    return AttackData(
        loop=_loop(item.loop),
        largest_distance_over_dbar=_finite(item.greatest / setting.reach),
        random=_random(item),
        adversary=_adversary(item, setting),
    )


def _random(item: Attack) -> RandomData:
    return RandomData(asked=item.sample.asked, comparison=_comparison(item.comparison))


def _adversary(item: Attack, setting: Setting) -> AdversaryData | None:
    if item.case is None or item.worst_comparison is None:
        return None
    start, h = item.case
    beside = {name: part[0].tolist() for name, part in h.beside._asdict().items()}
    waves = {
        name: getattr(h, name)[0].tolist() for name in ("amplitude", "frequency", "wave", "phase", "push")
    }
    return AdversaryData(
        comparison=_comparison(item.worst_comparison),
        start=start[0].tolist(),
        h=WaveData(**waves),
        beside=beside if setting.uncertainty.sources else None,
    )


def _comparison(found: Comparison) -> ComparisonData:
    return ComparisonData(
        runs=found.count,
        left_the_tube=len(found.outside),
        first_outside=found.outside[:_LISTED],
        first_exit=None if found.first_exit is None else _run_at(*found.first_exit),
        no_result=len(found.unreliable),
        unresolved=tuple(_run_at(lane, t) for lane, t in found.unresolved[:_LISTED]),
        stopped=tuple(
            StoppedData(run=lane, t=_finite(t), reason=reason) for lane, t, reason in found.failures[:_LISTED]
        ),
        worst={name: _use(use) for name, use in found.uses.items()},
        violations=tuple(
            ViolationData(
                bound_of=item.name,
                run=item.lane,
                t=_finite(item.time),
                value=_finite(item.value),
                bound=item.bound,
            )
            for item in found.violations
        ),
        settled=found.settled,
        final_deviation=None if found.final is None else _finite(found.final),
        error_estimate=found.error,
        inputs=found.inputs,
    )


def _run_at(lane: int, t: float) -> RunAt:
    return RunAt(run=lane, t=_finite(t))


def _use(use: Use) -> UseData:
    share = use.share
    return UseData(
        value=_finite(use.value),
        bound=use.bound,
        share=None if share is None else _finite(share),
        run=use.lane,
        t=_finite(use.time),
    )


def _clearance(item: Clearance) -> ClearanceData:
    return ClearanceData(
        obstacle=item.obstacle,
        clearance=_finite(item.value),
        t=item.time,
        collides=item.collides,
    )


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
