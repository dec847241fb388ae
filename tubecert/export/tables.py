"""Functions of tables in code: the piece by halving, then a cubic of the distance from where it begins.

The first and the last piece go on beyond the ends of a table, where no certificate says anything. Numbers are those of
the certificate, each rounded once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.export.c_language import C, last_not_after
from tubecert.export.listing import decimal
from tubecert.expression.lookup import Lookup


def in_c(table: Lookup, language: C) -> Iterator[str]:
    """Its numbers and its function in C99."""
    own, count = table.name, len(table.pieces)
    yield ""
    yield f"/* The function of the table {own}: pieces begin at `at`, cubics by powers of the distance from there. */"
    yield f"static const real at_{own}[] = {{"
    yield from _rows([language.number(q) for q in table.knots[:-1]])
    yield "};"
    yield f"static const real cubic_{own}[][4] = {{"
    for piece in table.pieces:
        yield f"    {{{', '.join(language.number(q) for q in piece)}}},"
    yield "};"
    yield f"typedef char length_of_{own}[sizeof cubic_{own} / sizeof cubic_{own}[0] == {count} ? 1 : -1];"
    yield ""
    yield f"static real table_{own}(real x)"
    yield "{"
    yield f"    int low = 0, high = {count - 1}, k;"
    yield "    real s;"
    yield from last_not_after(f"at_{own}", count, "x")
    yield f"    s = x - at_{own}[low];"
    c = [f"cubic_{own}[low][{k}]" for k in range(4)]
    yield f"    return {c[0]} + s * ({c[1]} + s * ({c[2]} + s * {c[3]}));"
    yield "}"


def in_python(table: Lookup) -> Iterator[str]:
    """The same in Python."""
    own = table.name
    yield ""
    yield ""
    yield f"AT_{own} = ({', '.join(decimal(q) for q in table.knots[:-1])},)"
    yield f"CUBIC_{own} = ("
    for piece in table.pieces:
        yield f"    ({', '.join(decimal(q) for q in piece)}),"
    yield ")"
    yield ""
    yield ""
    yield f"def table_{own}(x):"
    yield f'    """The function of the table {own}."""'
    yield f"    low, high = 0, len(AT_{own}) - 1"
    yield "    while low < high:"
    yield "        middle = (low + high + 1) // 2"
    yield f"        low, high = (middle, high) if x >= AT_{own}[middle] else (low, middle - 1)"
    yield f"    s, c = x - AT_{own}[low], CUBIC_{own}[low]"
    yield "    return c[0] + s * (c[1] + s * (c[2] + s * c[3]))"


def looked_up(table: Lookup, x: Array, real: type) -> Array:
    """The same of many numbers, in one type."""
    begin: Array = np.array([float(q) for q in table.knots[:-1]], dtype=real)
    c: Array = np.array([[float(q) for q in piece] for piece in table.pieces], dtype=real)
    k = np.clip(np.searchsorted(begin, x, side="right") - 1, 0, len(begin) - 1)
    s, own = x - begin[k], c[k]
    return np.asarray(own[..., 0] + s * (own[..., 1] + s * (own[..., 2] + s * own[..., 3])))


def _rows(texts: Sequence[str], width: int = 8) -> Iterator[str]:
    for i in range(0, len(texts), width):
        yield f"    {', '.join(texts[i : i + width])},"
