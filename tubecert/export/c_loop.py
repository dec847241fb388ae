"""The loop of a controller in C99: its plan, feedback, prediction and the functions that a program calls."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Final

from tubecert.export.blocks import INTEGRATION, NODES
from tubecert.export.c_language import C, last_not_after
from tubecert.export.controller import Boxes, Controller, Steering


def plan_in_c(c: Steering, language: C) -> Iterator[str]:
    """x*(t) and u*(t); where the plan has knots, also the search of the piece; of a family, whether it is one of it."""
    yield ""
    if c.boxes is not None:
        yield from _belongs_in_c(c.boxes, language)
        return
    if c.pieces is not None:
        yield "/* The piece that a time lies in. */"
        yield "static int piece(real t)"
        yield "{"
        yield "    int low = 0, high = PIECES - 1, k;"
        yield from last_not_after("START", len(c.pieces.start), "t")
        yield "    return low;"
        yield "}"
        yield ""
    yield "/* x*(t) and u*(t); beyond the horizon those at its end. */"
    yield "static void on_plan(real t, real x[N], real u[M])"
    yield "{"
    if c.horizon is not None:
        yield f"    const real s = t < {c.name.upper()}_HORIZON ? t : {c.name.upper()}_HORIZON;"
    else:
        yield "    const real s = t;"
    if c.pieces is None:
        yield "    plan(&s, x, u);"
    else:
        yield "    const int k = piece(s);"
        yield "    const real r = s - START[k];"
        yield "    int i;"
        yield "    for (i = 0; i < N; i++) {"
        yield "        x[i] = X[k][i][0] + r * (X[k][i][1] + r * (X[k][i][2] + r * X[k][i][3]));"
        yield "    }"
        yield "    for (i = 0; i < M; i++) {"
        yield "        u[i] = U[k][i][0] + r * U[k][i][1];"
        yield "    }"
    yield "}"


def _belongs_in_c(boxes: Boxes, language: C) -> Iterator[str]:
    """The boxes of a family, and whether x* and u* lie in them."""
    yield "/* The boxes that x* and u* of every plan keep to. */"
    for name, ends in (("X", boxes.x), ("U", boxes.u)):
        for words, k in (("LEAST", 0), ("MOST", 1)):
            numbers = ", ".join(language.number(each[k]) for each in ends)
            yield f"static const real {words}_{name}[] = {{{numbers}}};"
    yield ""
    yield "/* 1 where x* or u* is not in its box. */"
    yield "static int strays(const real x[N], const real u[M])"
    yield "{"
    yield "    int found = 0, i;"
    for name, size in (("x", "N"), ("u", "M")):
        big = name.upper()
        yield f"    for (i = 0; i < {size}; i++) {{"
        yield f"        found = {name}[i] >= LEAST_{big}[i] && {name}[i] <= MOST_{big}[i] ? found : 1;"
        yield "    }"
    yield "    return found;"
    yield "}"


def mean_in_c(c: Controller, language: C) -> Iterator[str]:
    """The mean of u* over a sample, where u* is played by itself."""
    if c.adds_plan or c.boxes is not None:
        return
    half = language.number(Fraction(1, 2))
    yield ""
    yield "/* The mean of u* over a sample. */"
    yield "static void mean_of_plan(real begin, real end, real mean[M])"
    yield "{"
    if c.gauss is not None:
        yield "    real x[N], a[M], b[M], c[M];"
        for name, share in zip("abc", NODES, strict=True):
            yield f"    on_plan(begin + {language.number(share * c.sample_time)}, x, {name});"
        yield "    (void)end;"
        yield "    gauss(a, b, c, mean);"
    elif c.pieces is not None:
        yield "    const real length = end - begin;"
        yield "    int k = piece(begin), i, j;"
        yield "    for (i = 0; i < M; i++) {"
        yield f"        mean[i] = {language.number(Fraction(0))};"
        yield "    }"
        yield f"    for (j = 0; j < {c.pieces.most}; j++) {{"
        yield "        const real until = k + 1 < PIECES && START[k + 1] < end ? START[k + 1] : end;"
        yield f"        const real middle = {half} * (begin + until) - START[k];"
        yield "        const real share = (until - begin) / length;"
        yield "        for (i = 0; i < M; i++) {"
        yield "            mean[i] = mean[i] + share * (U[k][i][0] + middle * U[k][i][1]);"
        yield "        }"
        yield "        begin = until;"
        yield "        k = begin < end && k + 1 < PIECES ? k + 1 : k;"
        yield "    }"
    yield "}"


_FED: Final = "The feedback at (x*(t), y), with u* where that is held; what step returns."


def feedback_in_c(c: Steering, language: C, words: str = _FED) -> Iterator[str]:
    """The feedback at one time and state."""
    big, zero = c.name.upper(), language.number(Fraction(0))
    yield ""
    yield f"/* {words} */"
    ends = "" if c.swept is None else ", first[N], last[N]"
    if c.boxes is None:
        yield "static int feedback(const real y[N], real t, real u[M])"
        yield "{"
        yield f"    real f[N], xs[N], us[M], vs[N], kappa[M], told[3]{ends};"
        yield "    int status = 0, i;"
        yield "    on_plan(t, xs, us);"
    else:
        yield "static int feedback(const real y[N], const real xs[N], const real us[M], real t, real u[M])"
        yield "{"
        yield f"    real f[N], vs[N], kappa[M], told[3]{ends};"
        yield "    int status = 0, i;"
        if c.horizon is None:
            yield "    (void)t;"
    yield "    drift(y, f);"
    yield "    flow(xs, us, vs);"
    if c.swept is not None:
        yield "    geodesic(xs, y, first, last);"
    yield f"    law(y, f, xs, vs, us, {'' if c.swept is None else 'first, last, '}kappa, told);"
    yield "    for (i = 0; i < M; i++) {"
    yield f"        u[i] = kappa[i]{' + us[i]' if c.adds_plan else ''};"
    yield "    }"
    if c.horizon is not None:
        yield f"    status += t > {big}_HORIZON ? {big}_OVER : 0;"
    yield f"    status += told[0] < {big}_REACH * {big}_REACH ? 0 : {big}_OUTSIDE;"
    if c.swept is None:  # else it is known up to what computed geodesics lose
        yield f"    status += told[1] > {zero} && !(told[2] > {zero}) ? {big}_NO_FEEDBACK : 0;"
    yield "    return status;"
    yield "}"


def prediction_in_c(c: Controller, language: C) -> Iterator[str]:
    """The state when an input begins to act."""
    yield ""
    yield "/* The state when the input of this sample begins to act, theorem H-P. */"
    yield "static void predicted(const real y[N], real t, const real acting[M], real x[N])"
    yield "{"
    yield "    real from[N], a[M], b[M], c[M];"
    if not c.adds_plan:
        yield f"    const real h = {language.number(c.delay / INTEGRATION)};"
        yield "    real xs[N];"
    yield "    int i, k;"
    yield "    for (i = 0; i < N; i++) {"
    yield "        x[i] = y[i];"
    yield "    }"
    yield f"    for (k = 0; k < {INTEGRATION}; k++) {{"
    if not c.adds_plan:
        for name, share in zip("abc", (Fraction(0), Fraction(1, 2), Fraction(1)), strict=True):
            yield f"        on_plan(t + ((real)k + {language.number(share)}) * h, xs, {name});"
    else:
        yield "        (void)t;"
    yield "        for (i = 0; i < M; i++) {"
    for name in "abc":
        yield f"            {name}[i] = acting[i]{'' if c.adds_plan else f' + {name}[i]'};"
    yield "        }"
    yield "        for (i = 0; i < N; i++) {"
    yield "            from[i] = x[i];"
    yield "        }"
    yield "        predictor(from, a, b, c, x);"
    yield "    }"
    yield "}"


def _fed_in_c(c: Controller) -> Iterator[str]:
    """The feedback of a sample; with a clock of its own it is held until the next one."""
    big, pad = c.name.upper(), "    " if c.every > 1 else ""
    if c.every > 1:
        yield "    if (c->since == 0) {"
    if c.predicts:
        yield f"    {pad}predicted(y, t, c->feedback, x);"
        yield f"    {pad}status = feedback(x, t + {big}_DELAY, c->feedback);"
    else:
        yield f"    {pad}status = feedback(y, {handed(c)}t, c->feedback);"
    if c.every > 1:
        yield "    } else {"
        yield f"        status = {'0' if c.horizon is None else f't > {big}_HORIZON ? {big}_OVER : 0'};"
        yield "    }"
        yield "    c->since++;"
        yield f"    if (c->since == {big}_EVERY) {{"
        yield "        c->since = 0;"
        yield "    }"


def handed(c: Steering) -> str:
    """What stands for the plan where it is handed in."""
    return "" if c.boxes is None else "xs, us, "


def entries_in_c(c: Controller, language: C) -> Iterator[str]:
    """`NAME_feedforward`, `NAME_start` and `NAME_step`."""
    name, big, zero = c.name, c.name.upper(), language.number(Fraction(0))
    if c.boxes is None:
        yield ""
        yield f"void {name}_feedforward(real t, real u[M])"
        yield "{"
        yield "    real x[N];"
        yield "    on_plan(t, x, u);"
        yield "}"
    plan = "" if c.boxes is None else "const real xs[N], const real us[M], "
    played = "const real mean_us[M], " if c.boxes is not None and not c.held else ""
    yield ""
    yield f"int {name}_start({name}_state *c, const real y[N], {plan}real u[M])"
    yield "{"
    status = f"feedback(y, {handed(c)}{zero}, u)"
    if c.boxes is None:
        yield f"    const int status = {status};"
    else:
        yield f"    const int status = (strays(xs, us) > 0 ? {big}_STRAYS : 0) + {status};"
    yield "    int i;"
    yield "    c->sample = 0;"
    if c.every > 1:
        yield "    c->since = 0;"
    yield "    for (i = 0; i < N; i++) {"
    yield f"        c->y[i] = {zero};"
    yield f"        c->f[i] = {zero};"
    yield "    }"
    yield "    for (i = 0; i < M; i++) {"
    yield f"        c->q[i] = {zero};"
    yield "        c->feedback[i] = u[i];"
    yield "        c->held[i] = u[i];"
    yield "        c->before[i] = u[i];"
    yield "    }"
    yield "    return status;"
    yield "}"
    yield ""
    yield f"int {name}_step({name}_state *c, const real y[N], {plan}{played}real u[M])"
    yield "{"
    yield f"    const real t = (real)c->sample * {big}_SAMPLE_TIME;"
    yield f"    real f[N], q[M], mean[M], estimate[M]{', x[N]' if c.predicts else ''};"
    if not c.adds_plan and c.boxes is None:
        yield "    real played[M];"
    yield "    int status, i;"
    if c.boxes is not None:
        yield "    int astray = strays(xs, us);"
    yield "    drift(y, f);"
    yield "    for (i = 0; i < M; i++) {"
    yield "        q[i] = c->q[i];"
    yield "        estimate[i] = c->q[i];"
    yield "    }"
    yield "    if (c->sample > 0) {"
    if c.adds_plan:
        yield "        applied(c->held, c->before, mean);"
    elif c.boxes is not None:
        yield "        astray = strays(xs, mean_us) > 0 ? 1 : astray;"
        yield "        applied(c->held, c->before, mean_us, mean);"
    else:
        yield f"        mean_of_plan((real)(c->sample - 1) * {big}_SAMPLE_TIME, t, played);"
        yield "        applied(c->held, c->before, played, mean);"
    yield "        estimator(y, f, c->y, c->f, c->q, mean, q, estimate);"
    yield "    }"
    yield from _fed_in_c(c)
    if c.boxes is not None:
        yield f"    status += astray > 0 ? {big}_STRAYS : 0;"
    yield "    for (i = 0; i < M; i++) {"
    yield "        c->before[i] = c->held[i];"
    yield "        c->held[i] = c->feedback[i] - estimate[i];"
    yield "        c->q[i] = q[i];"
    yield "        u[i] = c->held[i];"
    yield "    }"
    yield "    for (i = 0; i < N; i++) {"
    yield "        c->y[i] = y[i];"
    yield "        c->f[i] = f[i];"
    yield "    }"
    yield "    if (c->sample < UINT32_MAX) {"
    yield "        c->sample++;"
    yield "    }"
    yield "    return status;"
    yield "}"
