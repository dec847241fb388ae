"""A campaign: adversaries, then random runs, by chunks; what is finished stays when the user interrupts.

Trusted: no; it can falsify a certificate, and never supports one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import ceil
from typing import Final, Literal, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.progress import Phase, Progress, Step
from tubecert.simulation.lanes import ends
from tubecert.simulation.sampled.attack import Attack, Flags, Lanes
from tubecert.simulation.sampled.families import course_of, courses
from tubecert.simulation.sampled.loop import SINGLE, Controllers, Seen, linear, run
from tubecert.simulation.sampled.setting import Setting
from tubecert.verdict import Verdict

FORMAT: Final = "tubecert-sampled-simulation/1"
_FIRST: Final = 64  # of the first chunk: who interrupts soon has these
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
    """All adversaries and `runs` random runs, or what an interruption leaves; `controllers`: else tables in floats."""
    attack, found = Attack(setting=setting, seed=seed), list[Seen]()
    asked, size = len(attack.aims) + runs, LANES if setting.spec.trajectory.bundle is None else _PLANS
    try:
        for first, last in pairwise(ends(asked, min(_FIRST, size), size)):
            if report is not None:
                report(Step(phase=Phase.SIMULATION, done=first, of=asked))
            found.append(chunk(attack, attack.lanes(first, last), controllers))
    except KeyboardInterrupt:
        if not found:
            raise
    code: Literal["c", "floats"] = "c" if controllers else "floats"
    return Campaign(attack=attack, certificate=certificate, asked=asked, controller=code, found=tuple(found))


def chunk(attack: Attack, lanes: Lanes, controllers: Controllers | None = None) -> Seen:
    """What is seen of some lanes, in steps that are short enough if any are."""
    setting, bundle = attack.setting, attack.setting.spec.trajectory.bundle
    course = course_of(setting) if bundle is None else courses(setting, bundle, lanes.draws.plan)
    made = controllers or partial(linear, setting.tables)
    size = float(abs(setting.loop.A).sum(axis=1).max() * setting.lengths.max())
    for finer in range(_FINER):
        seen = run(attack, lanes, course, made, max(1, ceil(size / _PACE)) * 4**finer)
        if (seen.slack <= _RESOLVED).all() or np.isfinite(seen.left).any():
            break
    return seen


class Peak(NamedTuple):
    """The largest |x - x*| of a state, or |u - u*| of an input, as a share of its bound: in which run, at t in s."""

    share: float
    value: float
    bound: float
    run: int
    t: float


class Violation(NamedTuple):
    """How far a run was outside, at t for the first time: by `of`; `aimed`: what an adversary wanted, else empty."""

    of: str
    aimed: str
    peak: Peak


class Went(NamedTuple):
    """Where an input was in all runs, and where it is proven to stay."""

    least: float
    greatest: float
    proven: tuple[float, float] | None

    @property
    def beyond(self) -> bool:
        """Whether it left what is proven, but for the rounding of a plan."""
        room = SINGLE * max(abs(self.least), abs(self.greatest))
        low, high = self.proven or (self.least, self.greatest)
        return self.least < low - room or self.greatest > high + room


class Passed(NamedTuple):
    """How near runs came to an obstacle (negative: into it), and whether none is proven to meet it."""

    distance: float
    run: int
    proven: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Campaign:
    """What was run of what was `asked`: chunks of lanes in the order of their numbers, with what was seen of them.

    `controller`: the exported C code, or its tables in floats.
    """

    attack: Attack
    certificate: str
    asked: int
    controller: Literal["c", "floats"]
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
    def by_stage(self) -> Array:
        """The same in every stage that was reached, (2, n + m, G)."""
        starts = [int(k) for k in self.setting.stages if k < self.setting.samples]
        return _finite(np.maximum.reduceat(self.profile, starts, axis=2))

    @property
    def outcome(self) -> Literal["falsified", "no result", "interrupted", "not falsified"]:
        """What it came to."""
        entered = any(own.proven and own.distance < 0 for own in self.passed)
        if entered or self.outside or any(own.beyond for own in self.went.values()):
            return "falsified"
        if self.runs < self.asked:
            return "interrupted"
        return "not falsified" if self.error <= _RESOLVED else "no result"

    @property
    def error(self) -> float:
        """The largest error of an integration, as a share of a half-width."""
        return float(_finite(self.all("slack").max()))

    @property
    def attained(self) -> float:
        """The largest share of any half-width."""
        return float(self.by_stage[:, : self.setting.loop.states].max())

    def peak(self, index: int, group: Flags) -> Peak | None:
        """Of a state or an input in some lanes (N,); None if there are none."""
        if not group.any():
            return None
        return self._peak(index, int(np.argmax(np.where(group, self.all("share")[index], -1.0))))

    def _peak(self, index: int, number: int) -> Peak:
        names = ("share", "value", "bound", "when")
        share, value, bound, t = (float(_finite(self.all(name)[index, number])) for name in names)
        return Peak(share, value, bound, number, t)

    @property
    def went(self) -> dict[str, Went]:
        """Where every input was."""
        proven = {use.input: (float(use.range[0]), float(use.range[1])) for use in self.setting.result.inputs}
        low = _finite(np.min([seen.low for seen in self.found], axis=0)).tolist()
        high = _finite(np.max([seen.high for seen in self.found], axis=0)).tolist()
        ends = zip(self.setting.spec.inputs, low, high, strict=True)
        return {name: Went(least, greatest, proven.get(name)) for name, least, greatest in ends}

    @property
    def passed(self) -> list[Passed]:
        """How near runs came to each obstacle, in their order."""
        proven = {own.index for own in self.setting.result.clearance if own.verdict is Verdict.CERTIFIED}
        gaps = enumerate(_finite(self.all("near")))
        return [Passed(float(near.min()), int(near.argmin()), i in proven) for i, near in gaps]

    @property
    def outside(self) -> list[int]:
        """Runs that left the tube."""
        return [int(number) for number in np.flatnonzero(np.isfinite(self.all("left")))]

    @property
    def violations(self) -> list[Violation]:
        """How the first of them did."""
        return [self._violation(number) for number in self.outside[:_LISTED]]

    def _violation(self, number: int) -> Violation:
        names, aims, index = self.setting.names, self.attack.aims, int(self.all("what")[number])
        aimed, left = names[aims[number, 2]] if number < len(aims) else "", float(self.all("left")[number])
        return Violation(names[index], aimed, self._peak(index, number)._replace(t=left))

    @property
    def summary(self) -> dict[str, object]:
        """What `summary.json` holds; times in s, `stages` when they begin."""
        own, told = self.setting, ("outcome", "certificate", "asked", "runs", "controller", "error")
        attained = {name: self._attained(i) for i, name in enumerate(own.names)}
        return {
            "format": FORMAT,
            "name": own.spec.name,
            **{name: getattr(self, name) for name in told},
            "seed": self.attack.seed,
            "duration": own.samples * own.Ts,
            "adversaries": int(self.aimed.sum()),
            "stages": (own.stages * own.Ts).tolist(),
            "states": {name: attained[name] for name in own.spec.states},
            "inputs": {name: attained[name] for name in own.spec.inputs},
            "went": {name: went._asdict() for name, went in self.went.items()},
            "obstacles": [passed._asdict() for passed in self.passed],
            "outside": len(self.outside),
            "violations": [
                {"of": of, "aimed": aimed, **peak._asdict()} for of, aimed, peak in self.violations
            ],
        }

    def _attained(self, index: int) -> dict[str, object]:
        found = dict[str, object]()
        for g, (name, group) in enumerate((("random", ~self.aimed), ("adversary", self.aimed))):
            peak = self.peak(index, group)
            found[name] = peak and peak._asdict()
            found[f"{name}_by_stage"] = self.by_stage[g, index].tolist()
        return found


def _finite(values: Array) -> Array:
    """Numbers that JSON has: the largest for what grew beyond all of them."""
    return np.nan_to_num(values, nan=np.finfo(float).max)
