"""What the exported code of a certificate C says of itself: what is proven, what is assumed, and who has to do what."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Final

from tubecert.export.controller import Continuous
from tubecert.export.program import TABLE
from tubecert.export.words import OPERATIONS, boxed, introduced

PROMISE: Final = (
    "What the proof covers: the loop of theorem C, in EXACT arithmetic and in CONTINUOUS TIME. Its adaptation",
    "is sampled (`step`); its feedback is not: `law` acts at every instant, of the state at that instant, and",
    "`predictor` is integrated exactly. That is ASSUMED: this code, called at samples of any rate, is another",
    "loop, about which the certificate says nothing. Use it in analog hardware, in a model of the loop, or in",
    "an inner loop that is much faster than everything else, at your own judgement. For a computer that",
    "samples, give the specification a section hardware: certificate H is about that.",
)
CALLS: Final = (
    "`start` at t = 0 with the state then; it sets xhat. `step` at t = SAMPLE_TIME, 2 SAMPLE_TIME, ... with the",
    "state and xhat of that instant. In between, at every instant, `law` gives the input for the state at that",
    "instant, `since` being the time since the last sample, in [0, SAMPLE_TIME]; and `predictor` gives xhat',",
    "by which xhat moves. xhat is yours: nothing here integrates it.",
)


_PLANNED: Final = (
    "The plan is handed in: `law` is given x* and u* of the same instant, as a planner has them. It may be any",
    "plan that keeps to the boxes of the certificate, is continuous in x*, and satisfies the dynamics up to the",
    "defect that is stated there. Status 8 says that a number is not in its box (nor is one that rounding has",
    "carried beyond the end). It cannot say more: whether x* moves as the dynamics do is for the planner to keep.",
)


def calls(c: Continuous) -> tuple[str, ...]:
    """Who has to call what, and when."""
    return CALLS if c.boxes is None else (*CALLS, "", *_PLANNED)


def heading(c: Continuous) -> str:
    """The first line of every file."""
    return f"{c.system}: the controller of certificate C. Written by tubecert export; do not edit."


def readme(c: Continuous, files: Mapping[str, str], *, precision: str | None) -> str:
    """README.md of the folder; the precision of C, None for Python."""
    return "\n".join(_readme(c, files, precision)) + "\n"


def _readme(c: Continuous, files: Mapping[str, str], precision: str | None) -> Iterator[str]:
    yield from introduced(c, files)
    yield "## What is proven of it, and what is assumed"
    yield ""
    yield from PROMISE
    yield ""
    yield "Assumed as well: the state is known exactly and at once, inputs act as they are given, and every sample"
    yield f"is taken at its time. Arithmetic: `{precision or 'double'}`; its rounding is not covered."
    yield ""
    yield "## How to call it"
    yield ""
    yield from calls(c)
    yield ""
    yield from _called(c, precision)
    yield ""
    yield from _numbers(c)
    yield ""
    yield "`law` (in Python: `status`) returns 0, or a sum of 1 (the horizon is over), 2 (the state is not in the tube:"
    yield "an assumption does not hold) and 4 (no input could contract here: the same)."
    if c.boxes is not None:
        yield "8: the plan is not in its boxes."
    yield ""
    yield "## What a call costs"
    yield ""
    yield "At most (assignments, comparisons and indices are not counted):"
    yield ""
    yield "| operation | `law` | `predictor` | `step` |"
    yield "|---|---|---|---|"
    counts = operations(c)
    for name in sorted({name for each in counts.values() for name in each}):
        what = " (a search, a cubic)" if name.startswith(TABLE) else ""
        times = " | ".join(str(counts[key].get(name, 0)) for key in ("law", "predictor", "step"))
        yield f"| {OPERATIONS.get(name, name)}{what} | {times} |"
    if precision is not None:
        yield ""
        yield "There is no allocation, no recursion, and no loop without a bound."


def _called(c: Continuous, precision: str | None) -> Iterator[str]:
    """The inner loop, as it may be written; h is a step of it."""
    if precision is None:
        yield "```python"
        yield "controller = Controller()"
        yield "xhat = controller.start(x)"
        yield "# in an inner loop of steps h, `since` seconds after the last sample:"
        yield f"u = controller.law(since, x{'' if c.boxes is None else ', xs, us'})"
        yield "xhat = xhat + h * controller.predictor(x, xhat, u)  # or any better rule"
        yield "# at t = SAMPLE_TIME, 2 SAMPLE_TIME, ...:"
        yield "controller.step(x, xhat)"
        yield "```"
        return
    yield "```c"
    yield f"{c.name}_start(&state, x, xhat);"
    yield "/* in an inner loop of steps h, `since` seconds after the last sample: */"
    yield f"status = {c.name}_law(&state, since, x, {'' if c.boxes is None else 'xs, us, '}u);"
    yield f"{c.name}_predictor(&state, x, xhat, u, rate);"
    yield "xhat[i] += h * rate[i]; /* or any better rule */"
    yield "/* at t = SAMPLE_TIME, 2 SAMPLE_TIME, ...: */"
    yield f"{c.name}_step(&state, x, xhat);"
    yield "```"


def _numbers(c: Continuous) -> Iterator[str]:
    yield "| | |"
    yield "|---|---|"
    yield f"| state, in this order | {', '.join(c.states)} |"
    yield f"| inputs, in this order; u\\* is in them | {', '.join(c.inputs)} |"
    yield f"| sample time of the adaptation | {float(c.sample_time):.9g} s |"
    yield f"| bandwidth of its filter | {float(c.bandwidth):.9g} rad/s |"
    yield f"| gain of the predictor | {float(c.predictor_gain):.9g} 1/s |"
    yield f"| horizon | {'none' if c.horizon is None else f'{float(c.horizon):.9g} s'} |"
    yield from boxed(c)
    for name, (low, high) in zip(c.inputs, c.ranges, strict=True):
        known = math.isfinite(low) and math.isfinite(high)
        yield f"| proven range of {name} | {f'[{low:.9g}, {high:.9g}]' if known else 'none: it has no limits'} |"


def operations(c: Continuous) -> dict[str, dict[str, int]]:
    """How often each function does each operation, at most."""
    n, m = len(c.states), len(c.inputs)
    looks = {"mul": 2, "add": 1 + 2 * m}
    if c.pieces is not None:
        looks = {"mul": 2 + 3 * n + m, "add": 1 + 2 * m + 3 * n + m, "sub": 1}
    plan = () if c.plan is None else (c.plan,)
    of_law = (*plan, c.drift, c.flow, c.law, c.filter)
    return {
        "law": _added(looks, *(each.operations for each in of_law)),
        "predictor": _added(c.flow.operations, c.observer.operations),
        "step": _added(c.estimator.operations, c.filter.operations),
    }


def _added(*counts: Mapping[str, int]) -> dict[str, int]:
    found: dict[str, int] = {}
    for each in counts:
        for name, number in each.items():
            found[name] = found.get(name, 0) + number
    return found
