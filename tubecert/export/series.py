"""Programs on truncated power series: how what comes out moves with time, to the fifth derivative. Trusted.

A series is a list of intervals: the coefficients of powers 0 to 5 of a step ahead of any time in a range, so that the
last one encloses the fifth derivative over 120 at every time of that range. All outward.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, TypeAlias

from tubecert.enclosure import interval
from tubecert.enclosure.interval import Interval
from tubecert.export.followed import UncoveredError
from tubecert.export.program import Program, Step

ORDER: Final = 5
Series: TypeAlias = list[Interval]


def constant(value: Interval) -> Series:
    """What does not move."""
    return [value, *[Interval.of(0)] * ORDER]


def moving(value: Interval, speed: Interval) -> Series:
    """What moves with a constant speed."""
    return [value, speed, *[Interval.of(0)] * (ORDER - 1)]


def added(a: Series, b: Series) -> Series:
    """a + b."""
    return [p + q for p, q in zip(a, b, strict=True)]


def subtracted(a: Series, b: Series) -> Series:
    """a - b."""
    return [p - q for p, q in zip(a, b, strict=True)]


def multiplied(a: Series, b: Series) -> Series:
    """a b."""
    return [_sum([a[j] * b[k - j] for j in range(k + 1)]) for k in range(ORDER + 1)]


def divided(a: Series, b: Series) -> Series:
    """a/b, from b c = a."""
    found: Series = []
    for k in range(ORDER + 1):
        found.append((a[k] - _sum([b[j] * found[k - j] for j in range(1, k + 1)])) / b[0])
    return found


def run(program: Program, given: Mapping[str, Sequence[Series]]) -> dict[str, list[Series]]:
    """What comes out of a program; raises `UncoveredError` for operations that have no derivatives."""
    memory: list[Series] = []
    for step in program.steps:
        memory.append(_step(step, memory, given))
    return {port.name: [memory[place] for place in port.places] for port in program.outputs}


def _step(step: Step, memory: Sequence[Series], given: Mapping[str, Sequence[Series]]) -> Series:
    if step.operation == "input":
        return given[step.name][step.index]
    if step.operation == "constant":
        return constant(Interval.of(step.value))
    args = [memory[place] for place in step.places]
    match step.operation:
        case "neg":
            return [-each for each in args[0]]
        case "add":
            return added(*args)
        case "sub":
            return subtracted(*args)
        case "mul":
            return multiplied(*args)
        case "div":
            return divided(*args)
        case "call":
            return _called(step.name, args[0])
    raise UncoveredError("the integration of a prediction with cases in it")


def _called(name: str, a: Series) -> Series:
    """y = g(a): k y_k = sum of j a_j s_(k-j), s being the series of the slope g'(a)."""
    one = constant(Interval.of(1))
    match name:
        case "sqrt":
            return _root(a)
        case "exp" | "tan" | "tanh":
            return _by_itself(name, a)
        case "sin" | "cos" | "sinh" | "cosh":
            return _wave(name, a)
        case "log":
            return _along(interval.log(a[0]), divided(one, a), a)
        case "atan":
            return _along(interval.atan(a[0]), divided(one, added(one, multiplied(a, a))), a)
        case "asin":
            return _along(interval.asin(a[0]), divided(one, _root(subtracted(one, multiplied(a, a)))), a)
        case "acos":
            return [-each for each in _along(-interval.acos(a[0]), _called_slope(a), a)]
    raise UncoveredError(f"the integration of a prediction with {name} in it")


def _called_slope(a: Series) -> Series:
    one = constant(Interval.of(1))
    return divided(one, _root(subtracted(one, multiplied(a, a))))


def _along(first: Interval, slope: Series, a: Series) -> Series:
    found = [first]
    for k in range(1, ORDER + 1):
        found.append(_term(k, slope, a))
    return found


def _term(k: int, slope: Series, a: Series) -> Interval:
    return _sum([j * a[j] * slope[k - j] for j in range(1, k + 1)]) / Interval.of(k)


def _root(a: Series) -> Series:
    """From y y = a."""
    found = [interval.sqrt(a[0])]
    for k in range(1, ORDER + 1):
        rest = _sum([found[j] * found[k - j] for j in range(1, k)])
        found.append((a[k] - rest) / (2 * found[0]))
    return found


def _by_itself(name: str, a: Series) -> Series:
    """Where the slope is a function of the value: exp, 1 + tan^2, 1 - tanh^2."""
    function = {"exp": interval.exp, "tan": interval.tan, "tanh": interval.tanh}[name]
    found, slope = [function(a[0])], list[Interval]()
    for k in range(1, ORDER + 1):
        square = _sum([found[j] * found[k - 1 - j] for j in range(k)])
        own = Interval.of(int(k == 1))
        slope.append({"exp": found[-1], "tan": own + square, "tanh": own - square}[name])
        found.append(_sum([j * a[j] * slope[k - j] for j in range(1, k + 1)]) / Interval.of(k))
    return found


def _wave(name: str, a: Series) -> Series:
    """The sine and the cosine together, or the hyperbolic ones."""
    plain = name in ("sin", "cos")
    s = [interval.sin(a[0]) if plain else interval.sinh(a[0])]
    c = [interval.cos(a[0]) if plain else interval.cosh(a[0])]
    for k in range(1, ORDER + 1):
        up, along = _term(k, c, a), _term(k, s, a)
        s.append(up)
        c.append(-along if plain else along)
    return s if name in ("sin", "sinh") else c


def _sum(terms: Sequence[Interval]) -> Interval:
    return sum(terms, Interval.of(0))
