"""A campaign: adversaries, then random runs, as vectors; what is finished stays when the user interrupts.

Trusted: no; it can falsify a certificate, and never supports one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import Final, Literal, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.executor import Serial
from tubecert.progress import Progress
from tubecert.simulation.halving import resolved
from tubecert.simulation.lanes import Found, combined
from tubecert.simulation.sampled.attack import Attack, Flags
from tubecert.simulation.sampled.loop import DIVERGED, Controllers, Vector, gap, linear
from tubecert.simulation.sampled.setting import Setting
from tubecert.simulation.vectors import finished, vectors_of
from tubecert.verdict import Verdict

FORMAT: Final = "tubecert-sampled-simulation/1"
_FIRST: Final = 64  # of the first vector: who interrupts soon has these
LANES: Final = 1024  # of a vector: the more, the cheaper is each
_PLANS: Final = 256  # of a vector whose lanes have plans of their own, which are kept
_TOLERANCE: Final = 1e-3  # of a half-width, asked of the integration
_RESOLVED: Final = 0.01  # of a half-width, that a run may be wrong by
_ROUNDING: Final = 1e-9  # of a bound: that of floats
_SINGLE: Final = 2.0**-22  # of an input: how far that of a plan in single precision is off
_APART: Final = 16  # numbers of runs that are drawn
_DRAWN: Final = 512  # of the first
_LISTED: Final = 20  # of the violations


class Seen(NamedTuple):
    """What is left of a vector of lanes: peaks, `error` (N,), `path` (K, n, D) of some, the `plan` (K, n) of the first.

    `profile` (2, n + m, K): `loop.Sampled`.
    """

    found: Found
    error: Array
    profile: Array
    path: Array
    plan: Array


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
    attack = Attack(setting=setting, seed=seed)
    asked, size = len(attack.aims) + runs, LANES if setting.spec.trajectory.bundle is None else _PLANS
    vectors, made = vectors_of(asked, min(_FIRST, size), size), controllers or partial(linear, setting.tables)
    found = finished(partial(vector, attack, made), vectors, Serial(), report)
    code: Literal["c", "floats"] = "c" if controllers else "floats"
    return Campaign(attack=attack, certificate=certificate, asked=asked, controller=code, found=tuple(found))


def vector(attack: Attack, made: Controllers, numbers: range) -> Seen:
    """What is seen of some lanes."""
    own = Vector(attack, attack.lanes(numbers.start, numbers.stop), made)
    best = resolved(own, _TOLERANCE)
    drawn = [place for place, number in enumerate(numbers) if number % _APART == 0 and number < _DRAWN]
    path, plan = best.found.seen["x"][..., drawn], own.course.x[:: len(attack.setting.lengths), :, 0]
    return Seen(best.found._replace(seen={}), best.error, own.profile, path, plan)


class Peak(NamedTuple):
    """The largest |x - x*| of a state, or |u - u*| of an input, as a share of its bound: in which run, at t in s."""

    share: float
    value: float
    bound: float
    run: int
    t: float


class Violation(NamedTuple):
    """How far a run was outside: by `of`; `aimed`: what an adversary wanted, else empty."""

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
        room = _SINGLE * max(abs(self.least), abs(self.greatest))
        low, high = self.proven or (self.least, self.greatest)
        return self.least < low - room or self.greatest > high + room


class Passed(NamedTuple):
    """How near runs came to an obstacle (negative: into it), and whether none is proven to meet it."""

    distance: float
    run: int
    proven: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Campaign:
    """What was run of what was `asked`: vectors of lanes in the order of their numbers, with what was seen of them.

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

    @cached_property
    def peaks(self) -> Found:
        """Those of all lanes."""
        return combined([seen.found for seen in self.found], lambda *parts: np.concatenate(parts, axis=-1))

    @property
    def runs(self) -> int:
        """How many were made."""
        return len(self.peaks.stopped)

    @property
    def aimed(self) -> Flags:
        """Which lanes were adversaries, (N,)."""
        return np.arange(self.runs) < len(self.attack.aims)

    @cached_property
    def arrays(self) -> dict[str, Array]:
        """Of every state, then of every input, and every lane, (n + m, N): the largest `share`, `when` in s, of what.

        `value` of `bound`; and what each lane may be wrong by, as a share of a half-width, `error` (N,).
        """
        own, names = self.setting, self.setting.names
        share = np.maximum(0.0, np.stack([self.peaks.peak[name] for name in names]))
        when = np.stack([self.peaks.peak_time[name] for name in names])
        samples = np.minimum((when / own.Ts + _ROUNDING).astype(np.int64), own.samples - 1)
        bound = np.stack([own.at(samples[i])[i] for i in range(len(names))])
        error = np.concatenate([seen.error for seen in self.found])
        return {"share": share, "when": when, "value": share * bound, "bound": bound, "error": error}

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
        return float(_finite(self.arrays["error"].max()))

    @property
    def attained(self) -> float:
        """The largest share of any half-width."""
        return float(self.by_stage[:, : self.setting.loop.states].max())

    def peak(self, index: int, group: Flags) -> Peak | None:
        """Of a state or an input in some lanes (N,); None if there are none."""
        if not group.any():
            return None
        return self._peak(index, int(np.argmax(np.where(group, self.arrays["share"][index], -1.0))))

    def _peak(self, index: int, number: int) -> Peak:
        names = ("share", "value", "bound", "when")
        share, value, bound, t = (float(_finite(self.arrays[name][index, number])) for name in names)
        return Peak(share, value, bound, number, t)

    @property
    def went(self) -> dict[str, Went]:
        """Where every input was."""
        proven = {use.input: (float(use.range[0]), float(use.range[1])) for use in self.setting.result.inputs}
        low, high = _finite(self.peaks.least.min(axis=1)), _finite(self.peaks.greatest.max(axis=1))
        ends = zip(self.setting.spec.inputs, low.tolist(), high.tolist(), strict=True)
        return {name: Went(least, greatest, proven.get(name)) for name, least, greatest in ends}

    @property
    def passed(self) -> list[Passed]:
        """How near runs came to each obstacle, in their order."""
        proven = {own.index for own in self.setting.result.clearance if own.verdict is Verdict.CERTIFIED}
        gaps = [_finite(-self.peaks.peak[gap(i)]) for i in range(len(self.setting.spec.obstacles))]
        return [Passed(float(own.min()), int(own.argmin()), i in proven) for i, own in enumerate(gaps)]

    @cached_property
    def outside(self) -> list[int]:
        """Runs that left the tube by more than their error and the rounding of the plan's inputs."""
        own, n = self.setting, self.setting.loop.states
        states, inputs = np.split(own.bounds.T, [n])
        gain = np.max(abs(own.tables.N) @ states / inputs, axis=1)
        error = np.where(np.isfinite(self.arrays["error"]), self.arrays["error"], 0.0)
        most = max((max(abs(went.least), abs(went.greatest)) for went in self.went.values()), default=0.0)
        room = np.concatenate([np.ones(n), gain])[:, None] * error
        room[n:] += _SINGLE * most / inputs.min(axis=1)[:, None]
        beyond = (self.arrays["share"] > 1 + _ROUNDING + room).any(axis=0) | (self.peaks.stopped == DIVERGED)
        return np.flatnonzero(beyond).tolist()

    @property
    def violations(self) -> list[Violation]:
        """How the first of them did, by what was furthest outside."""
        return [self._violation(number) for number in self.outside[:_LISTED]]

    def _violation(self, number: int) -> Violation:
        names, aims, index = self.setting.names, self.attack.aims, self.arrays["share"][:, number].argmax()
        aimed = names[aims[number, 2]] if number < len(aims) else ""
        return Violation(names[index], aimed, self._peak(int(index), number))

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
