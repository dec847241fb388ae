"""A campaign: adversaries, then random runs, as vectors; what is finished stays when the user interrupts.

Trusted: no; it can falsify a certificate, and never supports one.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial, reduce
from typing import Final, Literal

import numpy as np

from tubecert.controller.recursion import linear
from tubecert.executor import Serial
from tubecert.progress import Progress
from tubecert.records import to_json
from tubecert.simulation.sampled.attack import Attack, Flags
from tubecert.simulation.sampled.loop import DIVERGED, Controllers, Seen, resolved
from tubecert.simulation.sampled.setting import Setting
from tubecert.simulation.told import Clearance, Peak, Violation, Went
from tubecert.simulation.vectors import finished, vectors_of
from tubecert.verdict import Verdict

FORMAT: Final = "tubecert-sampled-simulation/1"
_FIRST: Final = 64  # of the first vector: who interrupts soon has these
LANES: Final = 1024  # of a vector: the more, the cheaper is each
_PLANS: Final = 256  # of a vector whose lanes have plans of their own, which are kept
_RESOLVED: Final = 0.01  # of a half-width, that a run may be wrong by
_ROUNDING: Final = 1e-9  # of a bound: that of floats
_SINGLE: Final = 2.0**-22  # of an input: how far that of a plan in single precision is off
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
    attack = Attack(setting, seed)
    asked, size = len(attack.aims) + runs, LANES if setting.spec.trajectory.bundle is None else _PLANS
    vectors, made = vectors_of(asked, min(_FIRST, size), size), controllers or partial(linear, setting.tables)
    found = finished(partial(resolved, attack, made), vectors, Serial(), report)
    return Campaign(attack, certificate, asked, "c" if controllers else "floats", found)


def _beyond(own: Went) -> bool:
    """Whether an input left what is proven, but for the rounding of a plan."""
    room = _SINGLE * max(abs(own.least), abs(own.greatest))
    low, high = own.proven or (own.least, own.greatest)
    return own.least < low - room or own.greatest > high + room


class Campaign:
    """What was found in `runs` of those that were `asked`, with the `controller` as exported C code or in floats.

    `aimed` (N,): which were adversaries. `peaks`: of every state, then of every input, the largest `share`, (n + m, N),
    its `value` of a `bound`, its time `t` in s; the largest of random runs and of adversaries by sample, `profile`
    (2, n + m, K), in every stage that was reached, `by_stage` (2, n + m, G), of any half-width, `attained`. `errors`
    (N,) of the integration as shares of a half-width, the largest `error`. Where inputs `went`, how near runs came to
    `obstacles`, which of these are proven to be `clear`; which runs were `outside` of the tube by more than their error
    and the plan's rounding; `x` of some runs.
    """

    def __init__(
        self,
        attack: Attack,
        certificate: str,
        asked: int,
        controller: Literal["c", "floats"],
        found: Sequence[Seen],
    ) -> None:
        self.attack, self.certificate, self.asked, self.controller = attack, certificate, asked, controller
        self.setting, self.x, (n, m) = attack.setting, found[0].x, attack.setting.loop.B.shape
        joined = (np.concatenate(each, axis=-1) for each in zip(*(part[:4] for part in found), strict=True))
        most, node, self._stopped, self.errors = joined
        own, finite, self.runs = self.setting, np.nan_to_num, len(self._stopped)
        self.aimed: Flags = np.arange(self.runs) < len(attack.aims)
        share, into, ends = np.split(most, [n + m, len(most) - 2 * m])
        bound = np.take_along_axis(own.limits.T, node[: n + m], axis=1)
        self.peaks = {"share": share, "value": share * bound, "bound": bound, "t": own.t[node[: n + m]]}
        self.profile = reduce(np.maximum, (part.profile for part in found))
        begun = own.stages[own.stages < own.samples]
        self.by_stage = finite(np.maximum.reduceat(self.profile, begun, axis=2))
        self.attained, self.error = float(self.by_stage[:, :n].max()), float(finite(self.errors.max()))

        proven = {use.input: (float(use.range[0]), float(use.range[1])) for use in own.result.inputs}
        went = zip(own.spec.inputs, *finite(ends.max(axis=1)).reshape(2, m).tolist(), strict=True)
        self.went = {
            name: Went(least=-low, greatest=high, proven=proven.get(name)) for name, low, high in went
        }
        self.clear = {each.index for each in own.result.clearance if each.verdict is Verdict.CERTIFIED}
        depths, runs = finite(into.max(axis=1)).tolist(), into.argmax(axis=1).tolist()
        self.obstacles = [
            Clearance(clearance=-depth, t=float(own.t[at[run]]), collides=depth >= 0, run=run)
            for depth, at, run in zip(depths, node[n + m : len(most) - 2 * m], runs, strict=True)
        ]
        self.outside = self._outside()

    def _outside(self) -> list[int]:
        own, n = self.setting, self.setting.loop.states
        states, inputs = np.split(own.bounds.T, [n])
        gain = np.max(abs(own.tables.N) @ states / inputs, axis=1)
        error = np.where(np.isfinite(self.errors), self.errors, 0.0)
        room = np.concatenate([np.ones(n), gain])[:, None] * error
        most = max(max(abs(went.least), abs(went.greatest)) for went in self.went.values())
        room[n:] += _SINGLE * most / inputs.min(axis=1)[:, None]
        beyond = (self.peaks["share"] > 1 + _ROUNDING + room).any(axis=0) | (self._stopped == DIVERGED)
        return np.flatnonzero(beyond).tolist()

    @property
    def outcome(self) -> Literal["falsified", "no result", "interrupted", "not falsified"]:
        """What it came to."""
        entered = any(own.collides and i in self.clear for i, own in enumerate(self.obstacles))
        if entered or self.outside or any(map(_beyond, self.went.values())):
            return "falsified"
        if self.runs < self.asked:
            return "interrupted"
        return "not falsified" if self.error <= _RESOLVED else "no result"

    def peak(self, index: int, group: Flags) -> Peak | None:
        """Of a state or an input in some lanes (N,); None if there are none."""
        if not group.any():
            return None
        number = int(np.argmax(np.where(group, self.peaks["share"][index], -1.0)))
        return Peak(run=number, **self._met(index, number))

    def _met(self, index: int, number: int) -> dict[str, float]:
        return {name: float(own[index, number]) for name, own in self.peaks.items()}

    @property
    def violations(self) -> list[Violation]:
        """How the first of them did, by what was furthest outside."""
        names, found = self.setting.names, []
        aims = [names[target] for target in self.attack.aims[:, 2]]
        for number in self.outside[:_LISTED]:
            index = int(self.peaks["share"][:, number].argmax())
            aimed = aims[number] if number < len(aims) else ""
            met = self._met(index, number)
            found.append(Violation(of=names[index], aimed=aimed, run=number, **met))
        return found

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
            "outside": len(self.outside),
            **{name: to_json(getattr(self, name)) for name in ("went", "obstacles", "violations")},
        }

    def _attained(self, index: int) -> dict[str, object]:
        found = dict[str, object]()
        for g, (name, group) in enumerate((("random", ~self.aimed), ("adversary", self.aimed))):
            peak = self.peak(index, group)
            found[name] = to_json(peak)
            found[f"{name}_by_stage"] = self.by_stage[g, index].tolist()
        return found
