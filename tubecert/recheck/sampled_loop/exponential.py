"""e^(A t) and its integral, enclosed: by one exponential of a block matrix, for a time or for a range of times."""

from __future__ import annotations

from collections.abc import Sequence

from flint import arb, arb_mat

from tubecert.recheck.balls import Ball

Blocks = Sequence[Sequence[arb_mat]]


def zeros(p: int, q: int) -> arb_mat:
    """The zero matrix (p, q)."""
    return arb_mat(p, q)


def diagonal(entries: Sequence[Ball | int]) -> arb_mat:
    """A square matrix with these entries on its diagonal."""
    n = len(entries)
    return arb_mat(n, n, [entries[i] if i == j else 0 for i in range(n) for j in range(n)])


def identity(n: int) -> arb_mat:
    """The unit matrix."""
    return diagonal([1] * n)


def column(entries: Sequence[Ball]) -> arb_mat:
    """A matrix of one column."""
    return arb_mat(len(entries), 1, list(entries))


def joined(blocks: Blocks) -> arb_mat:
    """A matrix of blocks: those of one row are equally high, those of one column equally wide."""
    width = sum(block.ncols() for block in blocks[0])
    flat: list[arb] = []
    for row in blocks:
        tables: list[list[list[arb]]] = [block.tolist() for block in row]
        for lines in zip(*tables, strict=True):
            flat += [x for line in lines for x in line]
    return arb_mat(sum(row[0].nrows() for row in blocks), width, flat)


def parted(a: arb_mat, at: int) -> tuple[arb_mat, arb_mat]:
    """The columns before one, and the others."""
    left, right = ([x for row in a.tolist() for x in row[part]] for part in (slice(at), slice(at, None)))
    return arb_mat(a.nrows(), at, left), arb_mat(a.nrows(), a.ncols() - at, right)


def flow(A: arb_mat, t: Ball) -> tuple[arb_mat, arb_mat]:
    """e^(A t) and int_0^t e^(A s) ds, both (n, n), for every t of the ball: e^[[A t, I t], [0, 0]] holds both."""
    n = A.nrows()
    whole = joined([[A * t, identity(n) * t], [zeros(n, 2 * n)]]).exp().tolist()
    return parted(arb_mat(whole[:n]), n)


def sizes(a: arb_mat) -> arb_mat:
    """The entries' largest magnitudes."""
    return arb_mat(a.nrows(), a.ncols(), [x.abs_upper() for x in a.entries()])


def around_zero(a: arb_mat) -> arb_mat:
    """Balls around 0 as large as the entries: r times such a column is a ball around 0 as large as |r| times it."""
    return arb_mat(a.nrows(), a.ncols(), [arb(0, x.abs_upper()) for x in a.entries()])
