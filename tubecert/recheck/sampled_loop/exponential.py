"""e^(A t) and its integral, enclosed: by one exponential of a block matrix, for a time or for a range of times."""

from __future__ import annotations

from collections.abc import Sequence

from flint import arb, arb_mat

from tubecert.recheck.balls import Ball

Blocks = Sequence[Sequence[arb_mat]]


def zeros(p: int, q: int) -> arb_mat:
    """The zero matrix (p, q)."""
    return arb_mat(p, q)


def identity(n: int) -> arb_mat:
    """The unit matrix."""
    return arb_mat(n, n, [arb(int(i == j)) for i in range(n) for j in range(n)])


def joined(blocks: Blocks) -> arb_mat:
    """A matrix of blocks: those of one row are equally high, those of one column equally wide."""
    width = sum(block.ncols() for block in blocks[0])
    flat: list[arb] = []
    for row in blocks:
        tables: list[list[list[arb]]] = [
            block.tolist() if block.ncols() else [[]] * block.nrows() for block in row
        ]
        for lines in zip(*tables, strict=True):
            flat += [x for line in lines for x in line]
    return arb_mat(sum(row[0].nrows() for row in blocks), width, flat)


def flow(A: arb_mat, t: Ball) -> tuple[arb_mat, arb_mat]:
    """e^(A t) and int_0^t e^(A s) ds, both (n, n), for every t of the ball: e^[[A t, I t], [0, 0]] holds both."""
    n = A.nrows()
    whole = joined([[A * t, identity(n) * t], [zeros(n, n), zeros(n, n)]]).exp().tolist()
    first, second = ([x for row in whole[:n] for x in row[a : a + n]] for a in (0, n))
    return arb_mat(n, n, first), arb_mat(n, n, second)


def sizes(a: arb_mat) -> arb_mat:
    """The entries' largest magnitudes."""
    return arb_mat(a.nrows(), a.ncols(), [x.abs_upper() for x in a.entries()])


def around_zero(a: arb_mat) -> arb_mat:
    """Balls around 0 as large as the entries: r times such a column is a ball around 0 as large as |r| times it."""
    return arb_mat(a.nrows(), a.ncols(), [arb(0, x.abs_upper()) for x in a.entries()])
