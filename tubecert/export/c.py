"""The controller in C99: a header, a source without allocation, recursion or loops without a bound, and a self-test."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Final

from tubecert.export import tables
from tubecert.export.c_language import C, comment
from tubecert.export.c_loop import entries_in_c, feedback_in_c, mean_in_c, plan_in_c, prediction_in_c
from tubecert.export.controller import Controller, Pieces, Steering
from tubecert.export.listing import lines
from tubecert.export.program import Port, Program
from tubecert.export.sweeps import in_c
from tubecert.export.vectors import Vectors
from tubecert.export.words import heading, promise, timing

_UNSAFE: Final = (
    "__FAST_MATH__", "__ASSOCIATIVE_MATH__", "__RECIPROCAL_MATH__", "__NO_SIGNED_ZEROS__", "_M_FP_FAST",
)  # fmt: skip


def header(c: Controller, language: C) -> str:
    """NAME.h"""
    return "\n".join(_header(c, language)) + "\n"


def source(c: Controller, language: C) -> str:
    """NAME.c"""
    return "\n".join(_source(c, language)) + "\n"


def self_test(c: Controller, language: C, vectors: Vectors) -> str:
    """NAME_test.c"""
    return "\n".join(_self_test(c, language, vectors)) + "\n"


def _header(c: Controller, language: C) -> Iterator[str]:
    name, big = c.name, c.name.upper()
    yield from comment((heading(c), "", f"Certificate: {c.hash}", "", *promise(c), "", *timing(c)))
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
    if c.every > 1:
        yield f"#define {big}_EVERY {c.every} /* samples from one feedback to the next */"
    outside = "add feedforward(t)" if c.boxes is None else "add u*(t) at every t"
    yield f"#define {big}_ADDS_PLAN {int(c.adds_plan)} /* 1: u* is in what step gives; 0: {outside} */"
    yield ""
    yield "/* What step returns: 0, or a sum of these. */"
    yield f"#define {big}_OVER 1 /* the horizon is over: the proof says nothing any more */"
    yield f"#define {big}_OUTSIDE 2 /* what was measured is not in the tube: an assumption does not hold */"
    yield f"#define {big}_NO_FEEDBACK 4 /* no input could contract here: an assumption does not hold */"
    if c.boxes is not None:
        yield f"#define {big}_STRAYS 8 /* the plan is not in the boxes of the family: an assumption does not hold */"
    yield ""
    yield f"typedef {language.real} {name}_real;"
    yield ""
    yield "/* What the controller keeps between samples; nobody else writes to it. */"
    yield "typedef struct {"
    yield "    uint32_t sample;"
    if c.every > 1:
        yield "    uint32_t since; /* samples since the last feedback */"
    yield f"    {name}_real y[{big}_STATES];"
    yield f"    {name}_real f[{big}_STATES];"
    for field in ("q", "feedback", "held", "before"):
        yield f"    {name}_real {field}[{big}_INPUTS];"
    yield f"}} {name}_state;"
    yield ""
    yield f"extern const char {name}_certificate[]; /* its hash */"
    yield ""
    yield "/* Forgets everything; u acts at once, for what is measured at t = 0. */"
    plan = [_in(c, "xs", "STATES"), _in(c, "us", "INPUTS")] if c.boxes is not None else []
    start = ", ".join([_state(c), _in(c, "y", "STATES"), *plan, _out(c, "u", "INPUTS")])
    yield f"int {name}_start({start});"
    yield ""
    yield "/* At every sample: u acts from a delay after it on. */"
    plan += [_in(c, "mean_us", "INPUTS")] if plan and not c.held else []
    step = ", ".join([_state(c), _in(c, "y", "STATES"), *plan, _out(c, "u", "INPUTS")])
    yield f"int {name}_step({step});"
    yield ""
    if c.boxes is None:
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
    yield from preamble(c, language, (heading(c), f"Certificate: {c.hash}", "", *promise(c)))
    yield from plan_in_c(c, language)
    yield from mean_in_c(c, language)
    if c.swept is not None:
        yield from in_c(c.swept, len(c.states), language.number(Fraction(0)))
    yield from feedback_in_c(c, language)
    if c.predicts:
        yield from prediction_in_c(c, language)
    yield from entries_in_c(c, language)


def preamble(c: Steering, language: C, notes: Sequence[str]) -> Iterator[str]:
    """What a source begins with: what is asked of the compiler, the hash, tables and every program."""
    big = c.name.upper()
    yield from comment(notes)
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
    for table in c.tables:
        yield from tables.in_c(table, language)
    for program in c.programs:
        yield from _function(program, language)


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


def _self_test(c: Controller, language: C, vectors: Vectors) -> Iterator[str]:
    name, count, n, m = c.name, len(vectors.y), len(c.states), len(c.inputs)
    places = [] if c.boxes is None else [n, 2 * n] if c.held else [n, 2 * n, 2 * n + m]
    handed = ["MEASURED[{k}]", *(f"MEASURED[{{k}}] + {place}" for place in places)]
    start, step = ", ".join(handed[:3]), ", ".join(handed)
    yield from comment((f"{c.system}: the self-test of its controller.", f"Certificate: {c.hash}"))
    yield f'#include "{name}.h"'
    yield ""
    yield "#include <stdio.h>"
    yield ""
    yield f"#define SAMPLES {count}"
    yield f"#define TOLERANCE {language.number(Fraction(vectors.tolerance))}"
    yield f"static const {name}_real MEASURED[SAMPLES][{len(vectors.given[0])}] = {{"
    yield from numbers_in_c(vectors.given, language)
    yield "};"
    yield "/* of start, and of every step, as the producer of this file computed them */"
    yield f"static const {name}_real EXPECTED[SAMPLES + 1][{len(c.inputs)}] = {{"
    yield from numbers_in_c(vectors.u, language)
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
    yield f"            (void){name}_start(&state, {start.format(k=0)}, u);"
    yield "        } else {"
    yield f"            (void){name}_step(&state, {step.format(k='k - 1')}, u);"
    yield "        }"
    yield f"        for (i = 0; i < {len(c.inputs)}; i++) {{"
    yield from compared(c, "u", zero)
    yield from judged()


def numbers_in_c(rows: Sequence[Sequence[float]], language: C) -> Iterator[str]:
    """Rows of a table of a self-test."""
    for row in rows:
        yield f"    {{{', '.join(language.number(Fraction(value)) for value in row)}}},"


def compared(c: Steering, found: str, zero: str) -> Iterator[str]:
    """In a self-test: the largest difference of what was found, and the end of both loops."""
    name = c.name
    yield f"            const {name}_real error = {found}[i] - EXPECTED[k][i];"
    yield f"            const {name}_real size = error < {zero} ? -error : error;"
    yield "            if (!(size <= worst)) {"
    yield "                worst = size;"
    yield "            }"
    yield "        }"
    yield "    }"


def judged() -> Iterator[str]:
    """The end of a self-test."""
    yield "    if (!(worst <= TOLERANCE)) {"
    yield '        printf("the self-test fails: the largest difference is %g\\n", (double)worst);'
    yield "        return 1;"
    yield "    }"
    yield '    printf("the self-test passes: the largest difference is %g\\n", (double)worst);'
    yield "    return 0;"
    yield "}"
