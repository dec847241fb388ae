"""`tube.windows`: parts of the plan, one after another, in which the tube of B, C and H has a width of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from fractions import Fraction
from itertools import pairwise
from typing import Final

from tubecert.digits import near
from tubecert.spec import codes
from tubecert.spec.document import Scalar
from tubecert.spec.names import Names
from tubecert.spec.reader import Field
from tubecert.spec.types import Disturbance, Hardware, Spec, Trajectory, Tube

KEY: Final = "windows"
KEYS: Final = tuple(item.name for item in fields(Tube))  # of `tube`
MOST: Final = 200
_USUAL: Final = 20


def with_windows(tube: Tube | None, entries: Mapping[str, Field], names: Names) -> Tube | None:
    """The tube with its windows: how many, or the times between them; None if they are unsound."""
    field = entries.get(KEY)
    if tube is None or field is None:
        return tube
    found = _count(field) if isinstance(field.node, Scalar) else _times(field, names)
    if found is not None and tube.auto:
        field.fail(
            codes.RANGE,
            f"{field.path} beside coordinates of the tube",
            "give epsilon and rho_a, and leave half_widths and coordinates out",
        )
        return None
    return None if found is None else replace(tube, windows=found)


def _count(field: Field) -> int | None:
    text = field.node.text if isinstance(field.node, Scalar) else ""
    if text.isdecimal() and len(text) <= len(str(MOST)) and 1 <= int(text) <= MOST:
        return int(text)
    field.fail(
        codes.RANGE,
        f"{field.path} is not a number of windows from 1 to {MOST}",
        "write windows: 10, or the times between them: windows: [1.5, 3]",
    )
    return None


def _times(field: Field, names: Names) -> tuple[Fraction, ...] | None:
    items = field.items(None, "times")
    found = [item.number(names.values, above=0) for item in items or ()]
    times = tuple(t for t in found if t is not None)
    if items is None or len(times) < len(found):
        return None
    if not times or len(times) >= MOST:
        field.fail(
            codes.RANGE, f"{field.path} has {len(times)} times", f"give 1 to {MOST - 1}, or windows: 10"
        )
        return None
    for item, (earlier, later) in zip((items or ())[1:], pairwise(times), strict=True):
        if later <= earlier:
            item.fail(codes.RANGE, f"{item.path} is not after the one before", "let the times increase")
            return None
    return times


def check_windows(
    field: Field | None, tube: Tube, plan: Trajectory, machine: Hardware | None, wind: Disturbance | None
) -> None:
    """Reports what windows cannot be had with: `field` is that of the tube."""
    own = None if field is None or tube.windows is None else field.mapping(optional=KEYS)
    if own is None or KEY not in own:
        return
    at = own[KEY]
    if (machine is not None and machine.largest is not None) or (wind is not None and wind.bound is None):
        at.fail(
            codes.RANGE,
            f"{at.path} beside a number that is to be largest",
            "give the number, or leave the windows out: each candidate would need windows of its own",
        )
    elif machine is not None and machine.geodesic is not None:
        at.fail(
            codes.RANGE,
            f"{at.path} beside hardware.geodesic: computed geodesics are covered in one window only",
            "leave one of the two out",
        )
    elif plan.horizon is None or plan.bundle is not None:
        at.fail(
            codes.RANGE,
            f"{at.path} of a plan that has no end or is not known",
            "give trajectory.horizon, or leave the windows out",
        )
    else:
        _check_lengths(at, ends_of(tube.windows or 1, plan.horizon), plan.horizon, machine)


def _check_lengths(
    field: Field, ends: tuple[Fraction, ...], horizon: Fraction, machine: Hardware | None
) -> None:
    pad = Fraction(0) if machine is None else pad_of(machine)
    if ends[-1] != horizon or any(b <= a for a, b in pairwise(ends)):
        field.fail(
            codes.RANGE,
            f"{field.path} does not end before the horizon of {near(horizon)} s",
            "give times between 0 and the horizon",
        )
    elif min(b - a for a, b in pairwise(ends)) < pad:
        field.fail(
            codes.RANGE,
            f"{field.path}: a window is shorter than two samples and the delay, {near(pad)} s",
            "take fewer of them, or a faster computer",
        )


def ends_of(windows: int | tuple[Fraction, ...], horizon: Fraction) -> tuple[Fraction, ...]:
    """Where windows begin and end, from 0 to the horizon, in s."""
    if isinstance(windows, int):
        return tuple(horizon * k / windows for k in range(windows + 1))
    return (Fraction(0), *windows, horizon)


def pad_of(machine: Hardware) -> Fraction:
    """What theorem HW looks back at most, in s: two samples of the slower clock, and the delay."""
    Ts = machine.sample_time
    delay = Ts if machine.one_sample else machine.delay
    if Ts is None or delay is None:
        raise ValueError("windows need a machine of which every number is given")
    return 2 * max(Ts, machine.feedback_time or Ts) + delay


def more_windows(spec: Spec) -> int | None:
    """How many windows H might be tried in: 20, or twice as many as there are; None where there can be no more."""
    machine, plan, tube, wind = spec.hardware, spec.trajectory, spec.tube, spec.disturbance
    if machine is None or plan.horizon is None or not plan.moves or tube.auto:
        return None
    if machine.largest is not None or machine.geodesic is not None:
        return None
    if wind is not None and wind.bound is None:
        return None
    now = max(1, len(windows_of(spec)) - 1)
    most = min(MOST, int(plan.horizon / pad_of(machine)))
    found = min(most, max(_USUAL, 2 * now if now >= _USUAL else 0))
    return found if found > now else None


def windows_of(spec: Spec) -> tuple[Fraction, ...]:
    """Where the windows of a specification begin and end, from 0 to the horizon; empty without windows."""
    windows, horizon = spec.tube.windows, spec.trajectory.horizon
    return () if windows is None or horizon is None else ends_of(windows, horizon)
