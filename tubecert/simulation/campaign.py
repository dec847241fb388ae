"""A campaign: adversaries, then random runs, by chunks; what is finished stays when the user interrupts.

Trusted: no; it can falsify a certificate, and never supports one.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial
from math import ceil
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.progress import Phase, Progress, Step
from tubecert.simulation.attack import Attack, Flags, Lanes
from tubecert.simulation.families import course_of, courses
from tubecert.simulation.record import FORMAT, Attained, Code, Outcome, Passed, Peak, Summary, Violation, Went
from tubecert.simulation.sampled import SINGLE, Controllers, Linear, Seen, run
from tubecert.simulation.setting import Setting
from tubecert.verdict import Verdict

LANES: Final = 1024  # of a chunk: the more, the cheaper is each
_PLANS: Final = 256  # of a chunk whose lanes have plans of their own, which are kept
_RESOLVED: Final = 0.01  # of a half-width, that a run may be wrong by
_PACE: Final = 0.15  # |A| times the length of a step of RK4
_FINER: Final = 3  # times that steps are made shorter, four times each, where they were too long
_LISTED: Final = 20  # of the violations


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
    attack, found = Attack(setting=setting, seed=seed), list[Seen]()
    asked, size = len(attack.aims) + runs, LANES if setting.spec.trajectory.bundle is None else _PLANS
    with suppress(KeyboardInterrupt):
        for first in range(0, asked, size):
            if report is not None:
                report(Step(phase=Phase.SIMULATION, done=first, of=asked))
            found.append(chunk(attack, attack.lanes(first, min(first + size, asked)), controllers))
    return Campaign(
        attack=attack,
        certificate=certificate,
        asked=asked,
        code="c" if controllers else "floats",
        found=tuple(found),
    )


def chunk(attack: Attack, lanes: Lanes, controllers: Controllers | None = None) -> Seen:
    """What is seen of some lanes, in steps that are short enough if any are."""
    setting, bundle = attack.setting, attack.setting.spec.trajectory.bundle
    course = course_of(setting) if bundle is None else courses(setting, bundle, lanes.draws["plan"])
    made = controllers or partial(Linear, setting.tables)
    size = float(abs(setting.loop.A).sum(axis=1).max() * setting.lengths.max())
    for finer in range(_FINER):
        seen = run(attack, lanes, course, made, max(1, ceil(size / _PACE)) * 4**finer)
        if (seen.slack <= _RESOLVED).all() or np.isfinite(seen.left).any():
            break
    return seen


@dataclass(frozen=True, kw_only=True, eq=False)
class Campaign:
    """What was run of what was `asked`: chunks of lanes in the order of their numbers, with what was seen of them."""

    attack: Attack
    certificate: str
    asked: int
    code: Code
    found: tuple[Seen, ...]

    @property
    def setting(self) -> Setting:
        """What all runs share."""
        return self.attack.setting

    @property
    def runs(self) -> int:
        """How many were made."""
        return sum(seen.N for seen in self.found)

    def all(self, name: str) -> Array:
        """A field of `Seen` by lanes, of all of them, lanes last."""
        return np.concatenate([getattr(seen, name) for seen in self.found], axis=-1)

    @property
    def aimed(self) -> Flags:
        """Which lanes were adversaries, (N,)."""
        return np.arange(self.runs) < len(self.attack.aims)

    @property
    def profile(self) -> Array:
        """The largest share by sample, (2, n + m, K): of random runs, of adversaries."""
        return np.asarray(np.max([seen.profile for seen in self.found], axis=0))

    @property
    def outcome(self) -> Outcome:
        """What it came to."""
        return self.summary.outcome if self.found else "interrupted"

    @cached_property
    def summary(self) -> Summary:
        """A campaign of one run at least, as its record."""
        own, names, left = self.setting, self.setting.names, np.isfinite(self.all("left"))
        attained = {name: _attained(self, i) for i, name in enumerate(names)}
        went, passed = _went(self), _passed(self)
        entered = any(each.proven and each.distance < 0 for each in passed)
        outcome: Outcome = "not falsified" if (self.all("slack") <= _RESOLVED).all() else "no result"
        if entered or left.any() or any(map(_beyond, went.values())):
            outcome = "falsified"
        elif self.runs < self.asked:
            outcome = "interrupted"
        return Summary(
            format=FORMAT,
            name=own.spec.name,
            outcome=outcome,
            certificate=self.certificate,
            seed=self.attack.seed,
            duration=own.samples * own.Ts,
            asked=self.asked,
            runs=self.runs,
            adversaries=int(self.aimed.sum()),
            controller=self.code,
            error=_finite(self.all("slack").max()),
            stages=tuple(float(k) * own.Ts for k in own.stages),
            states={name: attained[name] for name in own.spec.states},
            inputs={name: attained[name] for name in own.spec.inputs},
            went=went,
            obstacles=passed,
            outside=int(left.sum()),
            violations=tuple(_violation(self, run) for run in np.flatnonzero(left)[:_LISTED].tolist()),
        )


def _went(campaign: Campaign) -> dict[str, Went]:
    """Where every input was."""
    proven = {use.input: (float(use.range[0]), float(use.range[1])) for use in campaign.setting.result.inputs}
    low = np.min([seen.low for seen in campaign.found], axis=0)
    high = np.max([seen.high for seen in campaign.found], axis=0)
    return {
        name: Went(least=_finite(least), greatest=_finite(greatest), proven=proven.get(name))
        for name, least, greatest in zip(campaign.setting.spec.inputs, low, high, strict=True)
    }


def _beyond(went: Went) -> bool:
    """Whether an input left what is proven, but for the rounding of a plan."""
    room = SINGLE * max(abs(went.least), abs(went.greatest))
    low, high = went.proven or (went.least, went.greatest)
    return went.least < low - room or went.greatest > high + room


def _passed(campaign: Campaign) -> tuple[Passed, ...]:
    """How near any run came to each obstacle."""
    proven = {own.index for own in campaign.setting.result.clearance if own.verdict is Verdict.CERTIFIED}
    return tuple(
        Passed(index=i, distance=_finite(gaps.min()), run=int(gaps.argmin()), proven=i in proven)
        for i, gaps in enumerate(campaign.all("near"))
    )


def _attained(campaign: Campaign, index: int) -> Attained:
    starts = [int(k) for k in campaign.setting.stages if k < campaign.setting.samples]
    by_stage = np.maximum.reduceat(campaign.profile[:, index], starts, axis=1)
    random, adversary = (tuple(map(_finite, own)) for own in by_stage)
    return Attained(
        random=_peak(campaign, index, ~campaign.aimed),
        adversary=_peak(campaign, index, campaign.aimed),
        random_by_stage=random,
        adversary_by_stage=adversary,
    )


def _peak(campaign: Campaign, index: int, group: Flags) -> Peak | None:
    if not group.any():
        return None
    run = int(np.argmax(np.where(group, campaign.all("share")[index], -1.0)))
    share, value, bound, t = (
        _finite(campaign.all(name)[index, run]) for name in ("share", "value", "bound", "when")
    )
    return Peak(share=share, value=value, bound=bound, run=run, t=t)


def _violation(campaign: Campaign, run: int) -> Violation:
    index, aims, names = int(campaign.all("what")[run]), campaign.attack.aims, campaign.setting.names
    return Violation(
        of=names[index],
        run=run,
        t=float(campaign.all("left")[run]),
        value=_finite(campaign.all("value")[index, run]),
        bound=_finite(campaign.all("bound")[index, run]),
        aimed=names[aims[run, 2]] if run < len(aims) else "",
    )


def _finite(value: float) -> float:
    """A number that JSON has: the largest for what grew beyond all of them."""
    return float(np.nan_to_num(value, nan=np.finfo(float).max))
