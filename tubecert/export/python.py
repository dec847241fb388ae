"""The controller in Python: one file that needs numpy only."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Final

from tubecert.export import tables
from tubecert.export.blocks import INTEGRATION, NODES
from tubecert.export.controller import Boxes, Controller, Pieces, Steering
from tubecert.export.listing import decimal, lines
from tubecert.export.program import GREATEST, LEAST, RATIO, TABLE, Program
from tubecert.export.sweeps import in_python
from tubecert.export.vectors import Vectors
from tubecert.export.words import heading, promise, timing

_WIDTH: Final = 96


class _Python:
    """Expressions of Python."""

    def number(self, value: Fraction) -> str:
        """A constant."""
        return decimal(value)

    def entry(self, name: str, index: int) -> str:
        """An entry of a vector that goes in."""
        return f"{name}[{index}]"

    def call(self, name: str, argument: str) -> str:
        """A function."""
        if name.startswith(TABLE):
            return f"{name}({argument})"
        return f"math.{name}({argument})"

    def choice(self, name: str, a: str, b: str) -> str:
        """A choice between two."""
        if name == LEAST:
            return f"{a} if {a} < {b} else {b}"
        if name == GREATEST:
            return f"{a} if {a} > {b} else {b}"
        if name == RATIO:
            return f"{a} / {b} if {a} > 0.0 and {b} > 0.0 else 0.0"
        return f"{b} / {a} if {a} > {b} else 1.0"


def python(controller: Controller, vectors: Vectors) -> str:
    """The text of the module."""
    return "\n".join(_module(controller, vectors)) + "\n"


def _module(c: Controller, vectors: Vectors) -> Iterator[str]:
    yield f'"""{heading(c)}'
    yield ""
    yield from (*promise(c), "", *timing(c))
    yield '"""'
    yield ""
    yield "import math"
    yield "import sys"
    yield ""
    yield "import numpy as np"
    yield ""
    yield f'CERTIFICATE = "{c.hash}"'
    yield f"STATES = {entries([repr(name) for name in c.states])}"
    yield f"INPUTS = {entries([repr(name) for name in c.inputs])}"
    yield f"SAMPLE_TIME = {decimal(c.sample_time)}  # s"
    yield f"DELAY = {decimal(c.delay)}  # s, from a sample to the input that is computed from it"
    yield f"HORIZON = {'math.inf' if c.horizon is None else decimal(c.horizon)}  # s"
    yield f"LEVEL = {decimal(c.level)}  # d(x*, x) stays below it"
    yield f"REACH = {decimal(c.reach)}  # and d(x*, y) below this, y being what was measured, or predicted from it"
    if c.pieces is not None:
        yield f"MEETS = {c.pieces.most}  # so many pieces of the plan can meet one sample"
    if c.every > 1:
        yield f"EVERY = {c.every}  # samples from one feedback to the next"
    outside = "feedforward(t)" if c.boxes is None else "u*(t)"
    yield f"ADDS_PLAN = {c.adds_plan}  # whether u* is in what step returns; else add {outside} all the time"
    yield from functions(c)
    if c.swept is not None:
        yield from in_python(c.swept, len(c.states))
    yield from plan_in_python(c)
    yield from _mean(c)
    yield from _class(c)
    yield from _test(c, vectors)


def functions(c: Steering) -> Iterator[str]:
    """Tables and every program."""
    if c.pieces is not None:
        yield from _tables(c.pieces)
    for table in c.tables:
        yield from tables.in_python(table)
    for program in c.programs:
        yield from _function(program)


def entries(texts: Sequence[str]) -> str:
    """A tuple."""
    return f"({', '.join(texts)}{',' if len(texts) == 1 else ''})"


def _tables(pieces: Pieces) -> Iterator[str]:
    yield ""
    yield "# The plan: every piece begins at START; x* and u* are polynomials of the time since then."
    yield f"START = {entries([decimal(q) for q in pieces.start])}"
    for name, table in (("X", pieces.x), ("U", pieces.u)):
        yield f"{name} = ("
        for piece in table:
            yield f"    {entries([entries([decimal(q) for q in row]) for row in piece])},"
        yield ")"


def _function(program: Program) -> Iterator[str]:
    found = lines(program, _Python())
    yield ""
    yield ""
    yield f"def {program.name}({', '.join(port.name for port in program.inputs)}):"
    yield f'    """{program.words}."""'
    for name, text in found.named:
        yield f"    {name} = {text}"
    for port in program.outputs:
        texts = [text for name, _, text in found.results if name == port.name]
        yield f"    out_{port.name} = ("
        for text in texts:
            yield f"        {text},"
        yield "    )"
    yield f"    return {', '.join(f'out_{port.name}' for port in program.outputs)}"


def plan_in_python(c: Steering) -> Iterator[str]:
    """x*(t) and u*(t); where the plan has knots, also the search of the piece; of a family, whether it is one of it."""
    yield ""
    yield ""
    if c.boxes is not None:
        yield from _belongs_in_python(c.boxes)
        return
    yield "def on_plan(t):"
    yield '    """x*(t) and u*(t); beyond the horizon those at its end."""'
    if c.horizon is not None:
        yield "    t = t if t < HORIZON else HORIZON"
    if c.pieces is None:
        yield "    return plan((t,))"
        return
    yield "    k = piece(t)"
    yield "    s = t - START[k]"
    yield "    x = tuple(a[0] + s * (a[1] + s * (a[2] + s * a[3])) for a in X[k])"
    yield "    return x, tuple(a[0] + s * a[1] for a in U[k])"
    yield ""
    yield ""
    yield "def piece(t):"
    yield '    """The piece that a time lies in."""'
    yield "    low, high = 0, len(START) - 1"
    yield "    while low < high:"
    yield "        middle = (low + high + 1) // 2"
    yield "        low, high = (middle, high) if t >= START[middle] else (low, middle - 1)"
    yield "    return low"


def _belongs_in_python(boxes: Boxes) -> Iterator[str]:
    """The boxes of a family, and whether x* and u* lie in them."""
    yield "# The boxes that x* and u* of every plan keep to: least and most of each."
    for name, ends in (("BOX_X", boxes.x), ("BOX_U", boxes.u)):
        yield f"{name} = {entries([f'({decimal(low)}, {decimal(high)})' for low, high in ends])}"
    yield ""
    yield ""
    yield "def strays(x, u):"
    yield '    """Whether x* or u* is not in its box."""'
    yield "    pairs = (*zip(x, BOX_X), *zip(u, BOX_U))"
    yield "    return not all(low <= value <= high for value, (low, high) in pairs)"


def _mean(c: Controller) -> Iterator[str]:
    """The mean of u* over a sample, where it is not held."""
    if c.adds_plan or c.boxes is not None:
        return
    yield ""
    yield ""
    yield "def mean_of_plan(begin, end):"
    yield '    """The mean of u* over a sample."""'
    if c.gauss is not None:
        nodes = [f"on_plan(begin + {decimal(q * c.sample_time)})[1]" for q in NODES]
        yield f"    return gauss({', '.join(nodes)})"
        return
    yield "    k, length, total = piece(begin), end - begin, [0.0] * len(INPUTS)"
    yield "    for _ in range(MEETS):"
    yield "        until = START[k + 1] if k + 1 < len(START) and START[k + 1] < end else end"
    yield "        middle = 0.5 * (begin + until) - START[k]"
    yield "        share = (until - begin) / length"
    yield "        total = [p + share * (a[0] + middle * a[1]) for p, a in zip(total, U[k])]"
    yield "        begin = until"
    yield "        k = k if begin == end or k + 1 == len(START) else k + 1"
    yield "    return tuple(total)"


def _class(c: Controller) -> Iterator[str]:
    m, family = len(c.inputs), c.boxes is not None
    plan, handed = (", xs, us", ", xs, us") if family else ("", "")
    played = ", mean_us" if family and not c.held else ""
    if not family:
        yield ""
        yield ""
        yield "def feedforward(t):"
        yield '    """u*(t), (m,), t in s since the start."""'
        yield "    return np.array(on_plan(t)[1])"
    yield ""
    yield ""
    yield "class Controller:"
    yield '    """The controller: `start` at t = 0, then `step` at every sample, the first one at t = 0 as well.'
    yield ""
    yield "    `status` is 0, or a sum of: 1, the horizon is over; 2, what was measured is not in the tube;"
    yield f"    4, no feedback can contract there{'; 8, the plan is not in its boxes' if family else ''}."
    yield '    """'
    yield ""
    yield "    def __init__(self):"
    yield "        self.sample = 0"
    yield "        self.status = 0"
    yield "        self.y = self.f = None"
    yield f"        self.q = (0.0,) * {m}"
    yield f"        self.feedback = self.held = self.before = (0.0,) * {m}"
    yield ""
    yield f"    def start(self, y{plan}):"
    yield '        """Forgets everything; the input (m,) that acts at once, for what is measured at t = 0, (n,)."""'
    yield "        self.__init__()"
    if family:
        yield "        xs, us = tuple(map(float, xs)), tuple(map(float, us))"
    yield f"        self.feedback = self._law(tuple(map(float, y)), 0.0{handed})"
    if family:
        yield "        self.status += 8 if strays(xs, us) else 0"
    yield "        self.held = self.before = self.feedback"
    yield "        return np.array(self.held)"
    yield ""
    yield f"    def step(self, y{plan}{played}):"
    yield '        """The input (m,) that acts from DELAY s after this sample on, for what is measured now, (n,)."""'
    yield "        y = tuple(map(float, y))"
    if family:
        yield "        xs, us = tuple(map(float, xs)), tuple(map(float, us))"
        yield "        astray = strays(xs, us)"
    yield "        self.status = 0"
    yield "        t = self.sample * SAMPLE_TIME"
    yield "        f = drift(y)"
    yield "        estimate = self.q"
    yield "        if self.sample > 0:"
    mean = "" if c.adds_plan else ", mean_of_plan((self.sample - 1) * SAMPLE_TIME, t)"
    if played:
        mean = ", mean_us"
        yield "            mean_us = tuple(map(float, mean_us))"
        yield "            astray = astray or strays(xs, mean_us)"
    yield f"            mean = applied(self.held, self.before{mean})"
    yield "            self.q, estimate = estimator(y, f, self.y, self.f, self.q, mean)"
    fed = f"self.feedback = self._law({'self._predicted(y, t), t + DELAY' if c.predicts else 'y, t'}{handed})"
    if c.every > 1:
        yield "        self.status = 1 if t > HORIZON else 0"
        yield "        if self.sample % EVERY == 0:"
        yield f"            {fed}"
    else:
        yield f"        {fed}"
    if family:
        yield "        self.status += 8 if astray else 0"
    yield "        self.before = self.held"
    yield "        self.held = tuple(p - q for p, q in zip(self.feedback, estimate))"
    yield "        self.y, self.f = y, f"
    yield "        self.sample += 1"
    yield "        return np.array(self.held)"
    yield ""
    yield f"    def _law(self, y, t{', x, u' if family else ''}):"
    if not family:
        yield "        x, u = on_plan(t)"
    ends = "" if c.swept is None else ", *geodesic(x, y)"
    yield f"        kappa, (square, excess, size) = law(y, drift(y), x, flow(x, u), u{ends})"
    yield "        self.status = 1 if t > HORIZON else 0"
    yield "        self.status += 0 if square < REACH * REACH else 2"
    if c.swept is None:  # else it is known up to what computed geodesics lose
        yield "        self.status += 4 if excess > 0.0 and not size > 0.0 else 0"
    yield f"        return {'tuple(p + q for p, q in zip(kappa, u))' if c.adds_plan else 'kappa'}"
    if c.predicts:
        yield ""
        yield "    def _predicted(self, y, t):"
        yield '        """The state when the input of this sample begins to act, theorem H-P."""'
        yield f"        h = {decimal(c.delay / INTEGRATION)}"
        yield f"        for k in range({INTEGRATION}):"
        if c.adds_plan:
            yield "            a = b = c = self.feedback"
        else:
            yield "            a, b, c = ("
            yield "                tuple(p + q for p, q in zip(self.feedback, on_plan(t + (k + s) * h)[1]))"
            yield "                for s in (0.0, 0.5, 1.0)"
            yield "            )"
        yield "            y = predictor(y, a, b, c)"
        yield "        return y"


def _test(c: Controller, vectors: Vectors) -> Iterator[str]:
    yield ""
    yield ""
    yield "# What is measured, and what the producer of this file computed for it: the self-test."
    yield "MEASURED = ("
    for row in vectors.given:
        yield f"    {entries([repr(value) for value in row])},"
    yield ")"
    yield "EXPECTED = ("
    for row in vectors.u:
        yield f"    {entries([repr(value) for value in row])},"
    yield ")"
    yield f"TOLERANCE = {vectors.tolerance!r}"
    yield ""
    yield ""
    yield "def self_test():"
    yield '    """The largest difference to what the producer computed; ValueError where it is too large."""'
    yield "    controller = Controller()"
    if c.boxes is None:
        yield "    found = [controller.start(MEASURED[0]), *(controller.step(y) for y in MEASURED)]"
    else:
        n, m = len(c.states), len(c.inputs)
        ends = [0, n, 2 * n, 2 * n + m, *(() if c.held else (2 * n + 2 * m,))]
        cuts = ", ".join(f"row[{a}:{b}]" for a, b in pairwise(ends))
        yield f"    rows = [({cuts}) for row in MEASURED]"
        yield "    found = [controller.start(*rows[0][:3]), *(controller.step(*row) for row in rows)]"
    yield "    worst = float(np.max(np.abs(np.array(found) - np.array(EXPECTED))))"
    yield "    if not worst <= TOLERANCE:"
    yield '        raise ValueError(f"the self-test fails: the largest difference is {worst}")'
    yield "    return worst"
    yield ""
    yield ""
    yield 'if __name__ == "__main__":'
    yield '    sys.stdout.write(f"the self-test passes: the largest difference is {self_test():.3g}\\n")'
