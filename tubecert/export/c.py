"""The controller in C99: a header, a source without allocation, recursion or loops without a bound, and a self-test."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from tubecert.export.blocks import INTEGRATION, NODES
from tubecert.export.controller import Controller, Pieces
from tubecert.export.listing import decimal, lines
from tubecert.export.program import GREATEST, LEAST, RATIO, Port, Program
from tubecert.export.sweeps import in_c
from tubecert.export.vectors import Vectors
from tubecert.export.words import TIMING, heading, promise

_UNSAFE: Final = (
    "__FAST_MATH__", "__ASSOCIATIVE_MATH__", "__RECIPROCAL_MATH__", "__NO_SIGNED_ZEROS__", "_M_FP_FAST",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class C:
    """Expressions of C99, in `float` or in `double`."""

    single: bool

    @property
    def real(self) -> str:
        """The type."""
        return "float" if self.single else "double"

    def number(self, value: Fraction) -> str:
        """A constant."""
        text = decimal(value, single=self.single)
        if not self.single:
            return text
        return f"{text[:-1]}f)" if text.endswith(")") else f"{text}f"

    def entry(self, name: str, index: int) -> str:
        """An entry of a vector that goes in."""
        return f"{name}[{index}]"

    def call(self, name: str, argument: str) -> str:
        """A function."""
        return f"{name}{'f' if self.single else ''}({argument})"

    def choice(self, name: str, a: str, b: str) -> str:
        """A choice between two."""
        if name == LEAST:
            return f"{a} < {b} ? {a} : {b}"
        if name == GREATEST:
            return f"{a} > {b} ? {a} : {b}"
        zero, one = self.number(Fraction(0)), self.number(Fraction(1))
        if name == RATIO:
            return f"({a} > {zero} && {b} > {zero}) ? {a} / {b} : {zero}"
        return f"{a} > {b} ? {b} / {a} : {one}"


def header(c: Controller, language: C) -> str:
    """NAME.h"""
    return "\n".join(_header(c, language)) + "\n"


def source(c: Controller, language: C) -> str:
    """NAME.c"""
    return "\n".join(_source(c, language)) + "\n"


def self_test(c: Controller, language: C, vectors: Vectors) -> str:
    """NAME_test.c"""
    return "\n".join(_self_test(c, language, vectors)) + "\n"


def _comment(texts: Sequence[str]) -> Iterator[str]:
    yield f"/* {texts[0]}"
    for text in texts[1:]:
        yield f" * {text}".rstrip()
    yield " */"


def _header(c: Controller, language: C) -> Iterator[str]:
    name, big = c.name, c.name.upper()
    yield from _comment((heading(c), "", f"Certificate: {c.hash}", "", *promise(c), "", *TIMING))
    yield f"#ifndef {big}_H"
    yield f"#define {big}_H"
    yield ""
    yield "#include <stdint.h>"
    yield ""
    yield f"#define {big}_STATES {len(c.states)} /* {', '.join(c.states)} */"
    yield f"#define {big}_INPUTS {len(c.inputs)} /* {', '.join(c.inputs)} */"
    yield f"#define {big}_SAMPLE_TIME {language.number(c.sample_time)} /* s */"
    yield f"#define {big}_DELAY {language.number(c.delay)} /* s, from a sample to the input computed from it */"
    if c.horizon is not None:
        yield f"#define {big}_HORIZON {language.number(c.horizon)} /* s */"
    yield f"#define {big}_LEVEL {language.number(c.level)} /* d(x*, x) stays below it */"
    yield f"#define {big}_REACH {language.number(c.reach)} /* and d(x*, y), y being measured or predicted */"
    yield f"#define {big}_ADDS_PLAN {int(c.adds_plan)} /* 1: u* is in what step gives; 0: add feedforward(t) */"
    yield ""
    yield "/* What step returns: 0, or a sum of these. */"
    yield f"#define {big}_OVER 1 /* the horizon is over: the proof says nothing any more */"
    yield f"#define {big}_OUTSIDE 2 /* what was measured is not in the tube: an assumption does not hold */"
    yield f"#define {big}_NO_FEEDBACK 4 /* no input could contract here: an assumption does not hold */"
    yield ""
    yield f"typedef {language.real} {name}_real;"
    yield ""
    yield "/* What the controller keeps between samples; nobody else writes to it. */"
    yield "typedef struct {"
    yield "    uint32_t sample;"
    yield f"    {name}_real y[{big}_STATES];"
    yield f"    {name}_real f[{big}_STATES];"
    for field in ("q", "feedback", "held", "before"):
        yield f"    {name}_real {field}[{big}_INPUTS];"
    yield f"}} {name}_state;"
    yield ""
    yield f"extern const char {name}_certificate[]; /* its hash */"
    yield ""
    yield "/* Forgets everything; u acts at once, for what is measured at t = 0. */"
    yield f"int {name}_start({_state(c)}, {_in(c, 'y', 'STATES')}, {_out(c, 'u', 'INPUTS')});"
    yield ""
    yield "/* At every sample: u acts from a delay after it on. */"
    yield f"int {name}_step({_state(c)}, {_in(c, 'y', 'STATES')}, {_out(c, 'u', 'INPUTS')});"
    yield ""
    yield "/* u*(t), t in s since the start. */"
    yield f"void {name}_feedforward({name}_real t, {_out(c, 'u', 'INPUTS')});"
    yield ""
    yield "#endif"


def _state(c: Controller) -> str:
    return f"{c.name}_state *c"


def _in(c: Controller, name: str, size: str) -> str:
    return f"const {c.name}_real {name}[{c.name.upper()}_{size}]"


def _out(c: Controller, name: str, size: str) -> str:
    return f"{c.name}_real {name}[{c.name.upper()}_{size}]"


def _source(c: Controller, language: C) -> Iterator[str]:
    big = c.name.upper()
    yield from _comment((heading(c), f"Certificate: {c.hash}", "", *promise(c)))
    yield f'#include "{c.name}.h"'
    yield ""
    yield "#include <float.h>"
    yield "#include <math.h>"
    yield ""
    yield f"#if {' || '.join(f'defined({flag})' for flag in _UNSAFE)}"
    yield '#error "compile without -ffast-math: it changes the arithmetic"'
    yield "#endif"
    yield "#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0"
    yield '#error "compile without -ffinite-math-only: it removes the checks of what is measured"'
    yield "#endif"
    yield "#if !defined(FLT_EVAL_METHOD) || FLT_EVAL_METHOD != 0"
    yield '#error "every operation must be done in its own type (on x86: -msse2 -mfpmath=sse)"'
    yield "#endif"
    digits = ("FLT", 24) if language.single else ("DBL", 53)
    yield f"#if FLT_RADIX != 2 || {digits[0]}_MANT_DIG != {digits[1]}"
    yield f'#error "{language.real} is not that of IEEE 754"'
    yield "#endif"
    yield "#if defined(__clang__)"
    yield "#pragma STDC FP_CONTRACT OFF"
    yield "#if __clang_major__ >= 12 /* of single flags, as -freciprocal-math, it tells the preprocessor nothing */"
    yield "#pragma float_control(precise, on)"
    yield "#endif"
    yield "#endif"
    yield ""
    yield f"typedef {c.name}_real real;"
    yield f"#define N {big}_STATES"
    yield f"#define M {big}_INPUTS"
    yield f"typedef char size_of_real[sizeof(real) == {4 if language.single else 8} ? 1 : -1];"
    yield f"typedef char number_of_states[N == {len(c.states)} ? 1 : -1];"
    yield f"typedef char number_of_inputs[M == {len(c.inputs)} ? 1 : -1];"
    yield ""
    yield f'const char {c.name}_certificate[] = "{c.hash}";'
    if c.pieces is not None:
        yield from _tables(c.pieces, language)
    for program in c.programs:
        yield from _function(program, language)
    yield from _plan(c, language)
    yield from _mean(c, language)
    if c.swept is not None:
        yield from in_c(c.swept, len(c.states), language.number(Fraction(0)))
    yield from _law(c, language)
    if c.predicts:
        yield from _predicted(c, language)
    yield from _entries(c, language)


def _tables(pieces: Pieces, language: C) -> Iterator[str]:
    count = len(pieces.start)
    yield ""
    yield "/* The plan: every piece begins at START; x* and u* are polynomials of the time since then. */"
    yield f"#define PIECES {count}"
    yield "static const real START[] = {"
    yield from _rows([language.number(q) for q in pieces.start])
    yield "};"
    for name, table, sizes in (("X", pieces.x, "[N][4]"), ("U", pieces.u, "[M][2]")):
        yield f"static const real {name}[]{sizes} = {{"
        for piece in table:
            rows = (f"{{{', '.join(language.number(q) for q in row)}}}" for row in piece)
            yield f"    {{{', '.join(rows)}}},"
        yield "};"
        yield f"typedef char length_of_{name}[sizeof {name} / sizeof {name}[0] == PIECES ? 1 : -1];"
    yield "typedef char length_of_START[sizeof START / sizeof START[0] == PIECES ? 1 : -1];"


def _rows(texts: Sequence[str], width: int = 8) -> Iterator[str]:
    for i in range(0, len(texts), width):
        yield f"    {', '.join(texts[i : i + width])},"


def _function(program: Program, language: C) -> Iterator[str]:
    found = lines(program, language)
    texts = [text for _, text in found.named] + [text for _, _, text in found.results]
    inputs = [f"const real {port.name}[{len(port.places)}]" for port in program.inputs]
    outputs = [f"real out_{port.name}[{len(port.places)}]" for port in program.outputs]
    yield ""
    yield f"/* {program.words} */"
    yield f"static void {program.name}({', '.join((*inputs, *outputs))})"
    yield "{"
    for name, text in found.named:
        yield f"    const real {name} = {text};"
    for port in program.inputs:
        if not _read(port, texts):
            yield f"    (void){port.name};"
    for name, index, text in found.results:
        yield f"    out_{name}[{index}] = {text};"
    yield "}"


def _read(port: Port, texts: Sequence[str]) -> bool:
    """Whether anything of a vector is read."""
    return any(step in text for text in texts for step in _entries_of(port))


def _entries_of(port: Port) -> list[str]:
    return [f"{port.name}[{i}]" for i in range(len(port.places))]


def _plan(c: Controller, language: C) -> Iterator[str]:
    yield ""
    if c.pieces is not None:
        steps = max(1, (len(c.pieces.start) - 1).bit_length())
        yield "/* The piece that a time lies in. */"
        yield "static int piece(real t)"
        yield "{"
        yield "    int low = 0, high = PIECES - 1, k;"
        yield f"    for (k = 0; k < {steps}; k++) {{"
        yield "        const int middle = (low + high + 1) / 2;"
        yield "        if (low < high) {"
        yield "            if (t >= START[middle]) {"
        yield "                low = middle;"
        yield "            } else {"
        yield "                high = middle - 1;"
        yield "            }"
        yield "        }"
        yield "    }"
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


def _mean(c: Controller, language: C) -> Iterator[str]:
    if c.adds_plan:
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


def _law(c: Controller, language: C) -> Iterator[str]:
    big, zero = c.name.upper(), language.number(Fraction(0))
    yield ""
    yield "/* The feedback at (x*(t), y), with u* where that is held; what step returns. */"
    yield "static int feedback(const real y[N], real t, real u[M])"
    yield "{"
    ends = "" if c.swept is None else ", first[N], last[N]"
    yield f"    real f[N], xs[N], us[M], vs[N], kappa[M], told[3]{ends};"
    yield "    int status = 0, i;"
    yield "    on_plan(t, xs, us);"
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


def _predicted(c: Controller, language: C) -> Iterator[str]:
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


def _entries(c: Controller, language: C) -> Iterator[str]:
    name, big, zero = c.name, c.name.upper(), language.number(Fraction(0))
    yield ""
    yield f"void {name}_feedforward(real t, real u[M])"
    yield "{"
    yield "    real x[N];"
    yield "    on_plan(t, x, u);"
    yield "}"
    yield ""
    yield f"int {name}_start({name}_state *c, const real y[N], real u[M])"
    yield "{"
    yield f"    const int status = feedback(y, {zero}, u);"
    yield "    int i;"
    yield "    c->sample = 0;"
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
    yield f"int {name}_step({name}_state *c, const real y[N], real u[M])"
    yield "{"
    yield f"    const real t = (real)c->sample * {big}_SAMPLE_TIME;"
    yield f"    real f[N], q[M], mean[M], estimate[M]{', x[N]' if c.predicts else ''};"
    if not c.adds_plan:
        yield "    real played[M];"
    yield "    int status, i;"
    yield "    drift(y, f);"
    yield "    for (i = 0; i < M; i++) {"
    yield "        q[i] = c->q[i];"
    yield "        estimate[i] = c->q[i];"
    yield "    }"
    yield "    if (c->sample > 0) {"
    if c.adds_plan:
        yield "        applied(c->held, c->before, mean);"
    else:
        yield f"        mean_of_plan((real)(c->sample - 1) * {big}_SAMPLE_TIME, t, played);"
        yield "        applied(c->held, c->before, played, mean);"
    yield "        estimator(y, f, c->y, c->f, c->q, mean, q, estimate);"
    yield "    }"
    if c.predicts:
        yield "    predicted(y, t, c->feedback, x);"
        yield f"    status = feedback(x, t + {big}_DELAY, c->feedback);"
    else:
        yield "    status = feedback(y, t, c->feedback);"
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


def _self_test(c: Controller, language: C, vectors: Vectors) -> Iterator[str]:
    name, count = c.name, len(vectors.y)
    yield from _comment((f"{c.system}: the self-test of its controller.", f"Certificate: {c.hash}"))
    yield f'#include "{name}.h"'
    yield ""
    yield "#include <stdio.h>"
    yield ""
    yield f"#define SAMPLES {count}"
    yield f"#define TOLERANCE {language.number(Fraction(vectors.tolerance))}"
    yield f"static const {name}_real MEASURED[SAMPLES][{len(c.states)}] = {{"
    for row in vectors.y:
        yield f"    {{{', '.join(language.number(Fraction(value)) for value in row)}}},"
    yield "};"
    yield "/* of start, and of every step, as the producer of this file computed them */"
    yield f"static const {name}_real EXPECTED[SAMPLES + 1][{len(c.inputs)}] = {{"
    for row in vectors.u:
        yield f"    {{{', '.join(language.number(Fraction(value)) for value in row)}}},"
    yield "};"
    zero = language.number(Fraction(0))
    yield ""
    yield "int main(void)"
    yield "{"
    yield f"    {name}_state state;"
    yield f"    {name}_real u[{len(c.inputs)}], worst = {zero};"
    yield "    int k, i;"
    yield "    for (k = 0; k <= SAMPLES; k++) {"
    yield "        if (k == 0) {"
    yield f"            (void){name}_start(&state, MEASURED[0], u);"
    yield "        } else {"
    yield f"            (void){name}_step(&state, MEASURED[k - 1], u);"
    yield "        }"
    yield f"        for (i = 0; i < {len(c.inputs)}; i++) {{"
    yield f"            const {name}_real error = u[i] - EXPECTED[k][i];"
    yield f"            const {name}_real size = error < {zero} ? -error : error;"
    yield "            if (!(size <= worst)) {"
    yield "                worst = size;"
    yield "            }"
    yield "        }"
    yield "    }"
    yield "    if (!(worst <= TOLERANCE)) {"
    yield '        printf("the self-test fails: the largest difference is %g\\n", (double)worst);'
    yield "        return 1;"
    yield "    }"
    yield '    printf("the self-test passes: the largest difference is %g\\n", (double)worst);'
    yield "    return 0;"
    yield "}"
