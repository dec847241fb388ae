"""The controller of a certificate C in C99: a header, a source, and a self-test."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from tubecert.export.c import compared, judged, numbers_in_c, preamble
from tubecert.export.c_language import C, comment
from tubecert.export.c_loop import feedback_in_c, handed, plan_in_c
from tubecert.export.continuous.vectors import Vectors
from tubecert.export.continuous.words import PROMISE, calls, heading
from tubecert.export.controller import Continuous


def header(c: Continuous, language: C) -> str:
    """NAME.h"""
    return "\n".join(_header(c, language)) + "\n"


def source(c: Continuous, language: C) -> str:
    """NAME.c"""
    return "\n".join(_source(c, language)) + "\n"


def self_test(c: Continuous, language: C, vectors: Vectors) -> str:
    """NAME_test.c"""
    return "\n".join(_self_test(c, language, vectors)) + "\n"


def _header(c: Continuous, language: C) -> Iterator[str]:
    name, big = c.name, c.name.upper()
    yield from comment((heading(c), "", f"Certificate: {c.hash}", "", *PROMISE, "", *calls(c)))
    yield f"#ifndef {big}_H"
    yield f"#define {big}_H"
    yield ""
    yield "#include <stdint.h>"
    yield ""
    yield f"#define {big}_STATES {len(c.states)} /* {', '.join(c.states)} */"
    yield f"#define {big}_INPUTS {len(c.inputs)} /* {', '.join(c.inputs)} */"
    yield f"#define {big}_SAMPLE_TIME {language.number(c.sample_time)} /* s, of the adaptation */"
    if c.horizon is not None:
        yield f"#define {big}_HORIZON {language.number(c.horizon)} /* s */"
    yield f"#define {big}_REACH {language.number(c.reach)} /* d(x*, x) stays below it */"
    yield ""
    yield "/* What law returns: 0, or a sum of these. */"
    yield f"#define {big}_OVER 1 /* the horizon is over: the proof says nothing any more */"
    yield f"#define {big}_OUTSIDE 2 /* the state is not in the tube: an assumption does not hold */"
    yield f"#define {big}_NO_FEEDBACK 4 /* no input could contract here: an assumption does not hold */"
    if c.boxes is not None:
        yield f"#define {big}_STRAYS 8 /* the plan is not in the boxes of the family: an assumption does not hold */"
    yield ""
    yield f"typedef {language.real} {name}_real;"
    yield ""
    yield "/* What the controller keeps between samples; nobody else writes to it. */"
    yield "typedef struct {"
    yield "    uint32_t sample;"
    yield f"    {name}_real s_hat[{big}_STATES];"
    yield f"    {name}_real sigma_hat[{big}_INPUTS];"
    yield f"    {name}_real u_a[{big}_INPUTS];"
    yield f"}} {name}_state;"
    yield ""
    yield f"extern const char {name}_certificate[]; /* its hash */"
    for words, kind, own, given in _entries(c):
        yield ""
        yield f"/* {words} */"
        yield f"{kind} {name}_{own}({', '.join(given)});"
    yield ""
    yield "#endif"


def _entries(c: Continuous) -> Iterator[tuple[str, str, str, tuple[str, ...]]]:
    """What is called: words, type, name and what is given."""
    big, real, state = c.name.upper(), f"{c.name}_real", f"{c.name}_state *c"
    x, xhat = f"const {real} x[{big}_STATES]", f"{real} xhat[{big}_STATES]"
    yield (
        "At t = 0: forgets everything; xhat is where the predictor starts.",
        "void",
        "start",
        (state, x, xhat),
    )
    yield (
        "At every later sample: the adaptation, from the state and xhat of that instant.",
        "void",
        "step",
        (state, x, f"const {xhat}"),
    )
    plan = () if c.boxes is None else (f"const {real} xs[{big}_STATES]", f"const {real} us[{big}_INPUTS]")
    yield (
        "At every instant: u, for the state x, `since` s after the last sample.",
        "int",
        "law",
        (f"const {state}", f"{real} since", x, *plan, f"{real} u[{big}_INPUTS]"),
    )
    yield (
        "At every instant: xhat', u being the input that acts.",
        "void",
        "predictor",
        (f"const {state}", x, f"const {xhat}", f"const {real} u[{big}_INPUTS]", f"{real} rate[{big}_STATES]"),
    )
    if c.boxes is None:
        yield (
            "u*(t), t in s since the start.",
            "void",
            "feedforward",
            (f"{real} t", f"{real} u[{big}_INPUTS]"),
        )


def _source(c: Continuous, language: C) -> Iterator[str]:
    yield from preamble(c, language, (heading(c), f"Certificate: {c.hash}", "", *PROMISE))
    yield from plan_in_c(c, language)
    yield from feedback_in_c(c, language, "u* and the feedback at (x*(t), y); what law returns.")
    yield from _adaptation(c, language)
    yield from _acting(c)


def _adaptation(c: Continuous, language: C) -> Iterator[str]:
    """`NAME_start` and `NAME_step`."""
    name, zero = c.name, language.number(Fraction(0))
    yield ""
    yield f"void {name}_start({name}_state *c, const real x[N], real xhat[N])"
    yield "{"
    yield "    int i;"
    yield "    c->sample = 0;"
    yield "    for (i = 0; i < N; i++) {"
    yield f"        c->s_hat[i] = {zero};"
    yield "        xhat[i] = x[i];"
    yield "    }"
    yield "    for (i = 0; i < M; i++) {"
    yield f"        c->sigma_hat[i] = {zero};"
    yield f"        c->u_a[i] = {zero};"
    yield "    }"
    yield "}"
    yield ""
    yield f"void {name}_step({name}_state *c, const real x[N], const real xhat[N])"
    yield "{"
    yield f"    const real since = {name.upper()}_SAMPLE_TIME;"
    yield "    real s[N], q[M], estimate[M], u_a[M];"
    yield "    int i;"
    yield "    filtered(&since, c->u_a, c->sigma_hat, u_a);"
    yield "    estimator(x, xhat, s, q, estimate);"
    yield "    for (i = 0; i < N; i++) {"
    yield "        c->s_hat[i] = s[i];"
    yield "    }"
    yield "    for (i = 0; i < M; i++) {"
    yield "        c->u_a[i] = u_a[i];"
    yield "        c->sigma_hat[i] = estimate[i];"
    yield "    }"
    yield "    if (c->sample < UINT32_MAX) {"
    yield "        c->sample++;"
    yield "    }"
    yield "}"


def _acting(c: Continuous) -> Iterator[str]:
    """`NAME_law`, `NAME_predictor` and `NAME_feedforward`."""
    name = c.name
    yield ""
    plan = "" if c.boxes is None else "const real xs[N], const real us[M], "
    yield f"int {name}_law(const {name}_state *c, real since, const real x[N], {plan}real u[M])"
    yield "{"
    yield f"    const real t = (real)c->sample * {name.upper()}_SAMPLE_TIME + since;"
    status = f"feedback(x, {handed(c)}t, u)"
    if c.boxes is not None:
        status = f"(strays(xs, us) > 0 ? {name.upper()}_STRAYS : 0) + {status}"
    yield f"    const int status = {status};"
    yield "    real u_a[M];"
    yield "    int i;"
    yield "    filtered(&since, c->u_a, c->sigma_hat, u_a);"
    yield "    for (i = 0; i < M; i++) {"
    yield "        u[i] = u[i] + u_a[i];"
    yield "    }"
    yield "    return status;"
    yield "}"
    yield ""
    given = "const real x[N], const real xhat[N], const real u[M], real rate[N]"
    yield f"void {name}_predictor(const {name}_state *c, {given})"
    yield "{"
    yield "    real v[N];"
    yield "    flow(x, u, v);"
    yield "    observer(v, x, xhat, c->s_hat, rate);"
    yield "}"
    if c.boxes is not None:
        return
    yield ""
    yield f"void {name}_feedforward(real t, real u[M])"
    yield "{"
    yield "    real x[N];"
    yield "    on_plan(t, x, u);"
    yield "}"


def _self_test(c: Continuous, language: C, vectors: Vectors) -> Iterator[str]:
    name, big, n, m = c.name, c.name.upper(), len(c.states), len(c.inputs)
    zero = language.number(Fraction(0))
    yield from comment((f"{c.system}: the self-test of its controller.", f"Certificate: {c.hash}"))
    yield f'#include "{name}.h"'
    yield ""
    yield "#include <stdio.h>"
    yield ""
    yield f"#define ROWS {len(vectors.given)}"
    yield f"#define TOLERANCE {language.number(Fraction(vectors.tolerance))}"
    yield "/* the time since the last sample (0: a sample), the state, and xhat */"
    yield f"static const {name}_real GIVEN[ROWS][{len(vectors.given[0])}] = {{"
    yield from numbers_in_c(vectors.given, language)
    yield "};"
    yield "/* u and xhat', as the producer of this file computed them */"
    yield f"static const {name}_real EXPECTED[ROWS][{m + n}] = {{"
    yield from numbers_in_c(vectors.expected, language)
    yield "};"
    yield ""
    yield "int main(void)"
    yield "{"
    yield f"    {name}_state state;"
    yield f"    {name}_real xhat[{big}_STATES], found[{m + n}], worst = {zero};"
    yield "    int k, i;"
    yield "    for (k = 0; k < ROWS; k++) {"
    yield f"        const {name}_real *x = GIVEN[k] + 1;"
    yield "        if (k == 0) {"
    yield f"            {name}_start(&state, x, xhat);"
    yield f"        }} else if (!(GIVEN[k][0] > {zero})) {{"
    yield f"            {name}_step(&state, x, x + {big}_STATES);"
    yield "        }"
    plan = "" if c.boxes is None else f"x + {2 * n}, x + {3 * n}, "
    yield f"        (void){name}_law(&state, GIVEN[k][0], x, {plan}found);"
    yield f"        {name}_predictor(&state, x, x + {big}_STATES, found, found + {big}_INPUTS);"
    yield f"        for (i = 0; i < {m + n}; i++) {{"
    yield from compared(c, "found", zero)
    yield "    for (i = 0; i < " + f"{big}_STATES; i++) {{"
    yield "        if (!(xhat[i] <= GIVEN[0][1 + i]) || !(xhat[i] >= GIVEN[0][1 + i])) {"
    yield "            worst = 2 * TOLERANCE;"
    yield "        }"
    yield "    }"
    yield from judged()
