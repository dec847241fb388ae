"""The loops of computed geodesics, (H.39), in C99 and in Python: their order is that of `reference.speeds`."""

from __future__ import annotations

from collections.abc import Iterator

from tubecert.export.geodesics import Swept


def in_c(own: Swept, states: int, zero: str) -> Iterator[str]:
    """The function `geodesic` of C; `zero` is a number of its type."""
    yield ""
    yield "/* A geodesic from x to y, made of panels with a constant second derivative: its speeds at both ends. */"
    yield "static void geodesic(const real x[N], const real y[N], real first[N], real last[N])"
    yield "{"
    size = own.nodes * states
    yield f"    real w[{size}], a[N], b[N], p[N], v[N], q[N], s[N];"
    yield "    int i, j, k;"
    yield f"    for (j = 0; j < {size}; j++) {{"
    yield f"        w[j] = {zero};"
    yield "    }"
    yield f"    for (k = 0; k <= {own.sweeps}; k++) {{"
    yield "        for (i = 0; i < N; i++) {"
    yield f"            p[i] = {zero};"
    yield f"            v[i] = {zero};"
    yield "        }"
    yield f"        for (j = 0; j < {own.nodes}; j++) {{"
    yield "            for (i = 0; i < N; i++) {"
    yield "                a[i] = w[j * N + i];"
    yield "            }"
    yield "            onward(p, v, a, q, s);"
    yield "            for (i = 0; i < N; i++) {"
    yield "                p[i] = q[i];"
    yield "                v[i] = s[i];"
    yield "            }"
    yield "        }"
    yield "        for (i = 0; i < N; i++) {"
    yield "            first[i] = (y[i] - x[i]) - p[i];"
    yield "            last[i] = first[i] + v[i];"
    yield "            p[i] = x[i];"
    yield "            v[i] = first[i];"
    yield "        }"
    yield f"        if (k < {own.sweeps}) {{"
    yield f"            for (j = 0; j < {own.nodes}; j++) {{"
    yield "                for (i = 0; i < N; i++) {"
    yield "                    a[i] = w[j * N + i];"
    yield "                }"
    yield "                halfway(p, v, a, q, s);"
    yield "                symbols(q, s, b);"
    yield "                onward(p, v, a, q, s);"
    yield "                for (i = 0; i < N; i++) {"
    yield "                    p[i] = q[i];"
    yield "                    v[i] = s[i];"
    yield "                    w[j * N + i] = b[i];"
    yield "                }"
    yield "            }"
    yield "        }"
    yield "    }"
    yield "}"


def in_python(own: Swept, states: int) -> Iterator[str]:
    """The function `geodesic` of Python."""
    yield ""
    yield ""
    yield f"PANELS = {own.nodes}"
    yield f"SWEEPS = {own.sweeps}"
    yield ""
    yield ""
    yield "def geodesic(x, y):"
    yield '    """A geodesic from x to y, made of panels with a constant second derivative: its speeds at both ends."""'
    yield f"    w = [(0.0,) * {states}] * PANELS"
    yield "    for k in range(SWEEPS + 1):"
    yield f"        p = v = (0.0,) * {states}"
    yield "        for each in w:"
    yield "            p, v = onward(p, v, each)"
    yield "        first = tuple((b - a) - c for a, b, c in zip(x, y, p))"
    yield "        last = tuple(a + b for a, b in zip(first, v))"
    yield "        p, v = x, first"
    yield "        for j in range(PANELS if k < SWEEPS else 0):"
    yield "            bent = symbols(*halfway(p, v, w[j]))"
    yield "            p, v = onward(p, v, w[j])"
    yield "            w[j] = bent"
    yield "    return first, last"


def counted(own: Swept, states: int) -> dict[str, int]:
    """How often each operation is done for one geodesic."""
    times = (
        (own.symbols, own.nodes * own.sweeps),
        (own.halfway, own.nodes * own.sweeps),
        (own.onward, own.nodes * (2 * own.sweeps + 1)),
    )
    found = {"sub": 2 * states * (own.sweeps + 1), "add": states * (own.sweeps + 1)}
    for program, count in times:
        for name, number in program.operations.items():
            found[name] = found.get(name, 0) + count * number
    return found
