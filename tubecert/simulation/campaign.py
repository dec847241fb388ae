"""A campaign: adversaries, then random runs, by chunks; what is finished stays when the user interrupts.

Trusted: no; it can falsify a certificate, and never supports one.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.progress import Phase, Progress, Step
from tubecert.simulation.attack import Attack, Lanes
from tubecert.simulation.engine import march
from tubecert.simulation.families import course_of, courses
from tubecert.simulation.record import FORMAT, Attained, Code, Outcome, Passed, Peak, Summary, Violation, Went
from tubecert.simulation.sampled import Controller, Linear, Sampled
from tubecert.simulation.setting import Setting
from tubecert.verdict import Verdict

LANES: Final = 1024  # of a chunk: the more, the cheaper is each
_PLANS: Final = 256  # of a chunk whose lanes have plans of their own, which are kept
_RESOLVED: Final = 0.01  # of a half-width, that a run may be wrong by
_PACE: Final = 0.15  # |A| times the length of a step of RK4
_FINER: Final = 3  # times that steps are made shorter, four times each, where they were too long
_ROUNDED: Final = 2.0**-22  # of an input: that of a plan in single precision
_LISTED: Final = 20  # of the violations

Controllers = Callable[[int], Controller]  # for so many lanes


def simulate(
    setting: Setting,
    certificate: str,
    controllers: Controllers | None = None,
    *,
    runs: int,
    seed: int,
    report: Progress | None = None,
) -> Campaign:
    """All adversaries and `runs` random runs; `controllers` makes controllers, by default the tables in floats."""
    attack = Attack(setting=setting, seed=seed)
    made = controllers or controllers_of(setting)
    found: list[Sampled] = []
    asked = len(attack.aims) + runs
    with suppress(KeyboardInterrupt):
        size = LANES if setting.spec.trajectory.bundle is None else _PLANS
        for first in range(0, asked, size):
            if report is not None:
                report(Step(phase=Phase.SIMULATION, done=first, of=asked))
            found.append(_chunk(attack, attack.lanes(first, min(first + size, asked)), made))
    return Campaign(
        attack=attack,
        certificate=certificate,
        asked=asked,
        code="c" if controllers else "floats",
        found=tuple(found),
    )


def controllers_of(setting: Setting) -> Controllers:
    """The tables in floats."""
    return lambda lanes: Linear(setting.tables, lanes)


def _chunk(attack: Attack, lanes: Lanes, made: Controllers) -> Sampled:
    """What is seen of some lanes, in steps that are short enough if any are."""
    setting, bundle = attack.setting, attack.setting.spec.trajectory.bundle
    course = course_of(setting) if bundle is None else courses(setting, bundle, attack.planned(lanes))
    size = float(abs(setting.nominal.A).sum(axis=1).max())
    count = max(1, ceil(size * float(setting.nominal.lengths.max()) / _PACE))
    for _ in range(_FINER):
        coarse, fine = (Sampled(attack, lanes, course, made(len(lanes.number))) for _ in range(2))
        march(coarse, fine, count)
        if (fine.peaks.slack <= _RESOLVED).all() or np.isfinite(fine.peaks.left).any():
            break
        count *= 4
    return fine


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Campaign:
    """What was run of what was `asked`: chunks of lanes in the order of their numbers, with what was seen of them."""

    attack: Attack
    certificate: str
    asked: int
    code: Code
    found: tuple[Sampled, ...]

    @property
    def setting(self) -> Setting:
        """What all runs share."""
        return self.attack.setting

    @property
    def runs(self) -> int:
        """How many were made."""
        return sum(part.N for part in self.found)

    def all(self, name: str) -> Array:
        """A field of the lanes' `Peaks`, of all of them, lanes last."""
        return np.concatenate([getattr(part.peaks, name) for part in self.found], axis=-1)

    @property
    def aimed(self) -> NDArray[np.bool_]:
        """Which lanes were adversaries, (N,)."""
        return np.concatenate([part.lanes.aimed for part in self.found])

    @property
    def profile(self) -> Array:
        """The largest share by sample, (2, n + m, K): of random runs, of adversaries."""
        return np.asarray(np.max([part.peaks.profile for part in self.found], axis=0))

    @property
    def outcome(self) -> Outcome:
        """What it came to."""
        if not self.found:
            return "interrupted"
        entered = any(own.proven and own.distance < 0 for own in self.passed)
        if entered or np.isfinite(self.all("left")).any() or any(map(_beyond, self.went.values())):
            return "falsified"
        if self.runs < self.asked:
            return "interrupted"
        return "not falsified" if (self.all("slack") <= _RESOLVED).all() else "no result"

    @property
    def went(self) -> dict[str, Went]:
        """Where every input was."""
        proven = {use.input: (float(use.range[0]), float(use.range[1])) for use in self.setting.result.inputs}
        low = np.min([part.low for part in self.found], axis=0)
        high = np.max([part.high for part in self.found], axis=0)
        return {
            name: Went(least=_finite(low[j]), greatest=_finite(high[j]), proven=proven.get(name))
            for j, name in enumerate(self.setting.spec.inputs)
        }

    @property
    def passed(self) -> tuple[Passed, ...]:
        """How near any run came to each obstacle."""
        near = np.concatenate([part.near for part in self.found], axis=-1)
        proven = {own.index for own in self.setting.result.clearance if own.verdict is Verdict.CERTIFIED}
        return tuple(
            Passed(index=i, distance=_finite(gaps.min()), run=int(gaps.argmin()), proven=i in proven)
            for i, gaps in enumerate(near)
        )


def summary(campaign: Campaign) -> Summary:
    """A campaign of one run at least, as its record."""
    own, n = campaign.setting, len(campaign.setting.spec.states)
    attained = {name: _attained(campaign, i) for i, name in enumerate(own.names)}
    left = np.isfinite(campaign.all("left"))
    return Summary(
        format=FORMAT,
        name=own.spec.name,
        outcome=campaign.outcome,
        certificate=campaign.certificate,
        seed=campaign.attack.seed,
        duration=own.samples * own.Ts,
        asked=campaign.asked,
        runs=campaign.runs,
        adversaries=int(campaign.aimed.sum()),
        controller=campaign.code,
        error=_finite(campaign.all("slack").max()),
        stages=tuple(float(k) * own.Ts for k in own.stages),
        states={name: attained[name] for name in own.names[:n]},
        inputs={name: attained[name] for name in own.names[n:]},
        went=campaign.went,
        obstacles=campaign.passed,
        outside=int(left.sum()),
        violations=tuple(_violation(campaign, int(run)) for run in np.flatnonzero(left)[:_LISTED]),
    )


def _attained(campaign: Campaign, index: int) -> Attained:
    share, aimed = campaign.all("share")[index], campaign.aimed
    first = [int(k) for k in campaign.setting.stages if k < campaign.setting.samples]
    by_stage = np.maximum.reduceat(campaign.profile[:, index], first, axis=1)

    def peak(group: NDArray[np.bool_]) -> Peak | None:
        lanes = np.flatnonzero(group)
        if not len(lanes):
            return None
        run = int(lanes[np.argmax(share[lanes])])
        value, bound, when = (_finite(campaign.all(name)[index, run]) for name in ("value", "bound", "when"))
        return Peak(share=_finite(share[run]), value=value, bound=bound, run=run, t=when)

    return Attained(
        random=peak(~aimed),
        adversary=peak(aimed),
        random_by_stage=tuple(map(_finite, by_stage[0])),
        adversary_by_stage=tuple(map(_finite, by_stage[1])),
    )


def _violation(campaign: Campaign, run: int) -> Violation:
    index, attack = int(campaign.all("what")[run]), campaign.attack
    names, aim = campaign.setting.names, attack.aims[run] if run < len(attack.aims) else None
    return Violation(
        of=names[index],
        run=run,
        t=float(campaign.all("left")[run]),
        value=_finite(campaign.all("value")[index, run]),
        bound=_finite(campaign.all("bound")[index, run]),
        aimed="" if aim is None else names[aim.index],
    )


def _beyond(went: Went) -> bool:
    """Whether an input left what is proven, but for the rounding of a plan."""
    if went.proven is None:
        return False
    room = _ROUNDED * max(abs(went.least), abs(went.greatest))
    return went.least < went.proven[0] - room or went.greatest > went.proven[1] + room


def _finite(value: float) -> float:
    """A number that JSON has: the largest for what grew beyond all of them."""
    return float(np.nan_to_num(value, nan=np.finfo(float).max))
