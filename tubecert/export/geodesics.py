"""Computed geodesics as programs: (H.39), and the feedback that is made of their ends, (H.40).

In: a model whose metric is not constant, and how many nodes and sweeps. Out: the programs; which loops run them, every
language says for itself, in one order of operations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from tubecert.export.program import GREATEST, LEAST, RATIO, Place, Program, Writer
from tubecert.expression import derivatives, free_symbols
from tubecert.model import ControlAffineModel
from tubecert.spec import Picard

Rows = Sequence[Sequence[Place]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Swept:
    """How geodesics are computed: `nodes` panels in `sweeps`.

    `symbols`: the second derivative -Gamma(x)(v, v) at a state and a speed; `halfway` and `onward`: state and speed
    half a panel and a whole one later; `dual`: W(x) by rows, which is not exported.
    """

    nodes: int
    sweeps: int
    symbols: Program
    halfway: Program
    onward: Program
    dual: Program

    @property
    def programs(self) -> tuple[Program, ...]:
        """Those that are exported."""
        return (self.symbols, self.halfway, self.onward)


def swept(model: ControlAffineModel, asked: Picard) -> Swept:
    """The programs of computed geodesics."""
    h = Fraction(1, asked.nodes)
    return Swept(
        nodes=asked.nodes,
        sweeps=asked.sweeps,
        symbols=_symbols(model),
        halfway=_moved(model, "halfway", h / 2, "state and speed half a panel later"),
        onward=_moved(model, "onward", h, "state and speed a panel later"),
        dual=_dual(model),
    )


def _moved(model: ControlAffineModel, name: str, length: Fraction, words: str) -> Program:
    """x + t v + t^2 w/2 and v + t w."""
    writer, n = Writer(), len(model.states)
    x, v, w = (writer.input(each, n) for each in ("x", "v", "w"))
    t, half = writer.constant(length), writer.constant(length**2 / 2)
    triples = list(zip(x, v, w, strict=True))
    writer.output(
        "x", [writer.add(writer.add(a, writer.mul(t, b)), writer.mul(half, c)) for a, b, c in triples]
    )
    writer.output("v", [writer.add(b, writer.mul(t, c)) for _, b, c in triples])
    return writer.finished(name, words)


def _dual(model: ControlAffineModel) -> Program:
    writer = Writer()
    names = dict(zip(model.states, writer.input("x", len(model.states)), strict=True))
    writer.output("W", [place for row in writer.matrix(model.W, names) for place in row])
    return writer.finished("dual", "W(x)")


def _symbols(model: ControlAffineModel) -> Program:
    """(5.2): W_v eta - W (eta'W_l eta)_l/2, eta = M v."""
    writer, n = Writer(), range(len(model.states))
    x, v = writer.input("x", len(n)), writer.input("v", len(n))
    names = dict(zip(model.states, x, strict=True))
    W = writer.matrix(model.W, names)
    eta = solved(writer, W, v)
    turned = []  # W_l eta
    for l in n:
        slopes = derivatives([e for row in model.W for e in row], model.states[l])
        entries = writer.expressions(slopes, names)
        turned.append([writer.dot(entries[i * len(n) : (i + 1) * len(n)], eta) for i in n])
    forms = [writer.dot(eta, each) for each in turned]
    half = writer.constant(Fraction(1, 2))
    along = [writer.dot(v, [each[i] for each in turned]) for i in n]
    writer.output("w", [writer.sub(along[i], writer.mul(half, writer.dot(W[i], forms))) for i in n])
    return writer.finished("symbols", "the second derivative of a geodesic at the state x, of the speed v")


def solved(writer: Writer, W: Rows, v: Sequence[Place]) -> list[Place]:
    """M v: W = L D L' without pivots, as W is positive definite."""
    n = len(v)
    low: list[list[Place]] = [[] for _ in range(n)]
    pivots: list[Place] = []
    for j in range(n):
        scaled = [writer.mul(a, d) for a, d in zip(low[j], pivots, strict=True)]
        pivots.append(writer.sub(W[j][j], writer.dot(low[j], scaled)))
        for i in range(j + 1, n):
            rest = writer.sub(W[i][j], writer.dot(low[i][:j], scaled))
            low[i].append(writer.div(rest, pivots[j]))
    found: list[Place] = []
    for i in range(n):
        found.append(writer.sub(v[i], writer.dot(low[i], found)))
    found = [writer.div(a, d) for a, d in zip(found, pivots, strict=True)]
    for i in reversed(range(n)):
        later = range(i + 1, n)
        found[i] = writer.sub(found[i], writer.dot([low[k][i] for k in later], [found[k] for k in later]))
    return found


def law(model: ControlAffineModel, most: Fraction) -> Program:
    """(H.40); `most` is du."""
    writer, n = Writer(), range(len(model.states))
    y = writer.input("y", len(n))
    f, xs, vs = (writer.input(name, len(n)) for name in ("f", "xs", "vs"))
    us = writer.input("us", len(model.inputs))
    first, last = writer.input("first", len(n)), writer.input("last", len(n))
    here, there = (dict(zip(model.states, each, strict=True)) for each in (xs, y))
    B = writer.matrix(model.B, there)
    p0 = solved(writer, writer.matrix(model.W, here), first)
    p1 = solved(writer, writer.matrix(model.W, there), last)
    square = writer.dot(last, p1)
    moved = [writer.add(f[i], writer.dot(B[i], us)) for i in n]
    slope = writer.sub(writer.dot(p1, moved), writer.dot(p0, vs))
    excess = writer.add(slope, writer.mul(writer.constant(model.rate), square))
    begin = writer.matrix(model.B, here)
    c = [writer.dot([begin[i][j] for i in n], p0) for j in range(len(us))]
    size = writer.dot(c, c)
    norm = writer.call("sqrt", size)
    length = writer.call("sqrt", writer.choose(GREATEST, square, writer.constant(0)))
    limit = writer.mul(writer.constant(most), length)
    wanted = writer.choose(RATIO, excess, norm)
    share = writer.choose(RATIO, writer.choose(LEAST, wanted, limit), norm)
    writer.output("kappa", [writer.neg(writer.mul(share, each)) for each in c])
    writer.output("told", [square, excess, size])
    return writer.finished("law", "the feedback of least norm; told: d^2, alpha/2 and |c|^2")


def varies(model: ControlAffineModel) -> bool:
    """Whether the metric depends on the state."""
    return bool(free_symbols([e for row in model.W for e in row]))
