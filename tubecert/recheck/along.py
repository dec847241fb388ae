"""Theorem HW at printed numbers, on balls: windows of the plan, each with constants and a level of its own.

Implements: theory 8.9 (H.20)-(H.25). Every window is theorem H with what acts in its pad, which begins in the window
before: the larger of two bounds, and the larger of two levels. D goes from window to window.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, exact, larger, root, smaller
from tubecert.recheck.conditions import Setting
from tubecert.recheck.digital import Evaluation, Loop
from tubecert.recheck.filtering import Distance
from tubecert.recheck.recipe import Digital, MachineNumbers, Promise


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """One window as the theorem sees it: its constants, its numbers (with its own level) and its length in s."""

    setting: Setting
    machine: MachineNumbers
    at: Digital
    length: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class Passed:
    """What follows in one window: `level` is the larger of its level and of the one before, `reach` sqrt(a_j) rho_j."""

    level: Fraction
    loop: Loop
    reach: Ball


def pad(at: Digital) -> Fraction:
    """How far a window looks back: two samples of the slower clock, and the delay."""
    return 2 * max(at.sample_time, at.feedback_time) + at.delay


def along(windows: Sequence[Window], promise: Promise) -> tuple[Passed, ...] | None:
    """What theorem HW gives; None where a condition beside those of the levels, (H.25), is not proven."""
    for window in windows:
        if window.setting.gain is not None:  # (H.21) and (H.22) are stated for a B that is known
            return None
        if not window.at.sensible or promise.predicts != (window.at.prediction is not None):
            return None
        if window.length < pad(window.at):
            return None
    found = []
    for window, stage in zip(windows, stages(windows, promise), strict=True):
        if not stage.serves():
            return None
        reach = root(window.setting.n.lower) * exact(window.setting.rho)
        found.append(Passed(level=stage.at.level, loop=stage.left, reach=reach))
    return tuple(found)


def stages(windows: Sequence[Window], promise: Promise) -> tuple[Stage, ...]:
    """Every window after the one before it, whether its conditions hold or not."""
    found: list[Stage] = []
    for window in windows:
        found.append(Stage(window, promise, found[-1] if found else None))
    return tuple(found)


class Stage(Evaluation):
    """One window after another one, or the first one; `left` is what follows in it."""

    def __init__(self, window: Window, promise: Promise, before: Stage | None) -> None:
        if window.setting.gain is not None:  # the filter of such a loop forgets at omega_b, not at omega
            raise ValueError("windows are proven for a B that is known")
        self.before, self.length, self.own_level = before, window.length, window.at.level
        system = replace(window.setting.system, horizon=window.length)
        setting = replace(window.setting, system=system)
        at = window.at
        if before is not None:
            # theorem H with what is left of the error of the estimate, instead of that at the start
            setting = replace(setting, n=replace(setting.n, h_initial=before.remembered()))
            at = replace(at, level=max(at.level, before.own_level))
        super().__init__(setting, window.machine, promise, at)
        self.own = self.kb, self.ups, self.X
        if before is not None:
            self.kb, self.ups, self.X = map(larger, self.own, before.own)
        self.noisy = self._noise()
        self.left = self.course()

    def remembered(self) -> Ball:
        """What bounds the noise-free error of the estimate where the pad of the next window begins: (H.22)."""
        if self.at.bandwidth is None:
            return arb(0)
        waited = exact(self.at.bandwidth) * exact(self.length - pad(self.at))
        return self.S + larger(self.n.h_initial - self.S, arb(0)) * (-waited).exp()

    def _noise(self) -> tuple[Ball, Ball, Ball]:
        """The largest so far: of the two parts of (H.23), and of what noise of a bounded rate does."""
        direct = 2 * self.th / self.Ts * self.explained
        turning = self.n.B_pinv_x * (self.Y + 2 * self.nbar / self.Ts) * self.nbar
        drifting = self.m.noise_explained * exact(self.promise.drift or 0)
        now = direct, turning, drifting
        return now if self.before is None else tuple(map(larger, now, self.before.noisy))  # type: ignore[return-value]

    def ripple(self) -> Ball:
        """(H.23)."""
        direct, turning, drifting = self.noisy
        found = direct + turning
        return found if self.promise.drift is None else smaller(found, drifting)

    def begun(self, d0: Ball, d1: Ball, steep: tuple[Ball, Ball]) -> tuple[Ball, Ball]:
        """A later window begins where the one before ends, and as much higher as its saw-teeth may be ahead."""
        if self.before is None:
            return d0, d1
        last = self.before
        start = last.at_end()
        for T, now, then in zip((self.Ts, self.Tf), steep, last.left.steep, strict=True):
            swing = self.tooth(T) / self.lam * -(-self.lam * T).expm1()
            start = start + larger(now - then, arb(0)) * swing
        start = larger(start, self.floor)
        return start, start

    def at_end(self) -> Ball:
        """D at the end of the window; the first one's begins when its first samples have acted."""
        whole = exact(self.length)
        passed = whole - self.first_phase if self.before is None else whole
        return _filtered(self.left.bound, self.at).at(passed)

    def peak(self, bound: Distance) -> Ball:
        """Sup D over the length of the window; without a filter D is monotone."""
        if self.at.bandwidth is not None:
            return bound.supremum()
        return larger(bound.d0, _filtered(bound, self.at).at(exact(self.length)))


def _filtered(bound: Distance, at: Digital) -> Distance:
    """Without a filter nothing of an initial error is left."""
    return bound if at.bandwidth is not None else replace(bound, H0=bound.S)
