"""What exported code says of itself: what it is about, what the proof covers, and who has to do what."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from tubecert.export.blocks import INTEGRATION, NODES
from tubecert.export.controller import Continuous, Controller, Steering
from tubecert.export.program import TABLE
from tubecert.export.sweeps import counted

_EXACT: Final = (
    "What the proof covers: the loop of theorem H in EXACT arithmetic. The rounding of this code is not",
    "covered: exact arithmetic is assumed, and so are the exact mean of u* over a sample and, where the",
    "feedback predicts, the exact solution of its model. To have it covered, certify the specification with",
    "hardware: {arithmetic: double} (or single).",
)
_HANDED: Final = (
    "What the proof covers: the loop of theorem H in EXACT arithmetic, for every plan of the family. The rounding",
    "of this code, and of what is handed in, is not covered: exact arithmetic is assumed.",
)
_ROUNDED: Final = (
    "What the proof covers: the loop of theorem H-R, which is this code with the rounding of its arithmetic.",
    "Assumed of the computer: IEEE 754 with subnormal numbers, rounded to nearest, functions of math.h within",
    "4 units in the last place, inputs that act as they are given, measurements that are the numbers handed",
    "in, and times given to `feedforward` that are off by their last digit at most.",
)
TIMING: Final = (
    "`start` with what is measured at t = 0 gives the input that acts at once. Then",
    "`step` at t = 0, SAMPLE_TIME, 2 SAMPLE_TIME, ... gives the input that acts from DELAY after the",
    "sample until the next one replaces it. The actuator holds it. `step` at t = 0 takes the measurement",
    "that `start` has taken. Every sample is taken exactly once, at its time.",
)


_PLANNED: Final = (
    "The plan is handed in: `start` and `step` are given x* and u* of the instant of their sample.{mean}",
    "It may be any plan that keeps to the boxes of the certificate, is continuous in x*, and satisfies the",
    "dynamics up to the defect that is stated there. A planner may replace it where the new one begins at x*",
    "of the old one. Status 8 says that a number that was handed in is not in its box (nor is one that rounding",
    "has carried beyond the end). It cannot say more: whether x* goes from sample to sample as the dynamics do,",
    "what lies between samples, and whether mean_us is the mean of the u* that acted, are for the planner to",
    "keep (tubecert check --family examines a plan).",
)
_MEAN: Final = (
    "\n`step` is also given mean_us, the mean of u* since the sample before (at the first one not read)."
)


def timing(controller: Controller) -> tuple[str, ...]:
    """Who has to do what, and when."""
    if controller.boxes is None:
        return TIMING
    mean = "" if controller.held else _MEAN
    return (*TIMING, "", *"\n".join(_PLANNED).format(mean=mean).split("\n"))


_SWEPT: Final = (
    "The metric is not constant. What is lost because its geodesics are computed, of panels with a constant",
    "second derivative, is part of the proof (theorem H-G).",
)


def promise(controller: Controller) -> tuple[str, ...]:
    """What the proof says of rounding, and of computed geodesics."""
    rounding: tuple[str, ...] = _EXACT if controller.lost is None else _ROUNDED
    if controller.boxes is not None:
        rounding = _HANDED
    return rounding if controller.swept is None else (*rounding, *_SWEPT)


def brief(controller: Controller | Continuous) -> str:
    """The same in a line."""
    if isinstance(controller, Continuous):
        return "the proof is about feedback in continuous time, which no program is: that is assumed"
    if controller.lost is None:
        return "the proof is about exact arithmetic: rounding is not covered"
    return "the proof covers the rounding of this code"


def heading(controller: Controller) -> str:
    """The first line of every file."""
    return f"{controller.system}: the controller of certificate H. Written by tubecert export; do not edit."


def readme(c: Controller, files: Mapping[str, str], *, precision: str | None) -> str:
    """README.md of the folder; the precision of C, None for Python."""
    return "\n".join(_readme(c, files, precision)) + "\n"


def introduced(c: Steering, files: Mapping[str, str]) -> Iterator[str]:
    """What every README begins with: the certificate, and what each file is."""
    yield f"# The controller of {c.system}"
    yield ""
    yield "Written by `tubecert export` from the certificate"
    yield f"`{c.hash}`."
    yield "Do not edit: it is these very files that belong to it."
    yield ""
    for name, what in sorted(files.items()):
        yield f"- `{name}`: {what}"
    yield ""


def _readme(c: Controller, files: Mapping[str, str], precision: str | None) -> Iterator[str]:
    yield from introduced(c, files)
    yield "## What is proven of it"
    yield ""
    yield "The certificate proves that this loop keeps the state in its tube, for the noise, wind and uncertainty"
    yield f"that it names, with this sample time and delay. Arithmetic: `{precision or 'double'}`."
    yield ""
    yield from promise(c)
    yield ""
    yield "Nor is a clock that jitters, an actuator that lags, or an input that is clipped somewhere else."
    yield ""
    yield "## How to call it"
    yield ""
    yield from timing(c)
    yield ""
    if not c.adds_plan and c.boxes is not None:
        yield "u\\* is *not* in what `step` gives: the certificate is about a feedforward that acts in continuous time."
        yield "What acts on the plant is, at every time t, u\\*(t) and what `step` gave. If your actuator can only hold"
        yield "its input, certify that: `hardware: {feedforward: held}`."
        yield ""
    elif not c.adds_plan:
        yield "u\\* is *not* in what `step` gives: the certificate is about a feedforward that acts in continuous time."
        yield "What acts on the plant is, at every time t, `feedforward(t)` and what `step` gave. If your actuator can"
        yield "only hold its input, certify that: `hardware: {feedforward: held}`."
        yield ""
    if c.predicts:
        yield "The feedback is that of the state which is predicted to the instant at which it acts (theorem H-P)."
        yield ""
    yield "| | |"
    yield "|---|---|"
    yield f"| measured, in this order | {', '.join(c.states)} |"
    yield f"| inputs, in this order | {', '.join(c.inputs)} |"
    yield f"| sample time | {float(c.sample_time):.9g} s |"
    if c.every > 1:
        yield f"| samples from one feedback to the next | {c.every}; in between, `step` holds it |"
    yield f"| delay, from a sample to its input | {float(c.delay):.9g} s |"
    yield f"| horizon | {'none' if c.horizon is None else f'{float(c.horizon):.9g} s'} |"
    for name, (low, high) in zip(c.inputs, c.ranges, strict=True):
        yield f"| proven range of {name} | [{low:.9g}, {high:.9g}] |"
    yield from boxed(c)
    yield ""
    yield "`step` (in Python: `status`) returns 0, or a sum of 1 (the horizon is over), 2 (what was measured cannot be"
    yield "the state of this loop: an assumption does not hold) and 4 (no input could contract here: the same)."
    if c.boxes is not None:
        yield "8: the plan is not in its boxes."
    yield ""
    yield "## What a step costs"
    yield ""
    yield "At most, whatever is measured (assignments, comparisons and indices are not counted):"
    yield ""
    yield "| operation | times |"
    yield "|---|---|"
    for name, count in sorted(operations(c).items()):
        what = "a search, a cubic" if name.startswith(TABLE) else ""
        yield f"| {OPERATIONS.get(name, name)}{what and f' ({what})'} | {count} |"
    if precision is not None:
        yield ""
        yield "There is no allocation, no recursion, and no loop without a bound."


def boxed(c: Steering) -> Iterator[str]:
    """Rows of a table: the boxes of a family of plans."""
    if c.boxes is not None:
        for name, (low, high) in zip((*c.states, *c.inputs), (*c.boxes.x, *c.boxes.u), strict=True):
            yield f"| {name}\\* of every plan | [{float(low):.9g}, {float(high):.9g}] |"


OPERATIONS: Final = {
    "add": "addition",
    "sub": "subtraction",
    "mul": "multiplication",
    "div": "division",
    "neg": "change of sign",
    "ratio": "division, or 0",
    "shrink": "division, or 1",
    "least": "smaller of two",
    "greatest": "larger of two",
}


def operations(c: Controller) -> dict[str, int]:
    """How often a step does each operation, at most."""
    looks = 1 + (len(NODES) if c.gauss is not None else 0)
    looks += 3 * INTEGRATION if c.predictor is not None and not c.adds_plan else 0
    times = [
        (c.plan, looks),
        (c.drift, 2),
        (c.flow, 1),
        (c.law, 1),
        (c.applied, 1),
        (c.gauss, 1),
        (c.predictor, INTEGRATION),
        (c.estimator, 1),
    ]
    found: dict[str, int] = {}
    for program, count in times:
        for name, number in program.operations.items() if program is not None else ():
            found[name] = found.get(name, 0) + count * number
    n, m = len(c.states), len(c.inputs)
    more = {"mul": 4, "add": 4, "sub": m}
    if c.pieces is not None:
        meets = 0 if c.adds_plan else c.pieces.most
        more = {
            "mul": 4 + looks * (3 * n + m) + meets * (1 + 2 * m),
            "add": 4 + looks * (3 * n + m) + meets * (1 + 2 * m),
            "sub": 1 + m + looks + 2 * meets,
            "div": meets,
        }
    more["add"] += m if c.adds_plan else 0
    if c.predictor is not None:
        more["add"] += 3 * INTEGRATION * (m + 2)
        more["mul"] += 3 * INTEGRATION
    swept = {} if c.swept is None else counted(c.swept, n)
    for name, number in (*more.items(), *swept.items()):
        found[name] = found.get(name, 0) + number
    return {name: number for name, number in found.items() if number}
