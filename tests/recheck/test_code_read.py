"""What a compiler makes of a text of C that recheck reads is what recheck makes of it; everything else is refused."""

from __future__ import annotations

import pytest
from controllers import CONTROLLERS
from flint import arb, ctx
from followed import bounds, covered, in_recheck, texts
from tubecert.recheck.code.constants import of_plan
from tubecert.recheck.code.reader import read_code
from tubecert.recheck.code.words import UnreadError

# of the controller "turning": what is changed, and into what; C does something else than the words at first sight
OTHERWISE = {
    "one less": ("u[i] = kappa[i] + us[i];", "u[i] = --kappa[i] + us[i];"),
    "a place to the base 8": ("out_f[1] = r0;", "out_f[01] = r0;"),
    "a number to the base 8": ("0.0, 0.03,\n", "0.0, 010,\n"),
    "a number of many digits": ("0.0, 0.03,\n", "0.0, 12345678901234567890123,\n"),
    "entries that are whole numbers": ("const real before[2],", "const int before[2],"),
    "an argument that is a whole number": ("table_bend(real x)", "table_bend(int x)"),
    "a function of whole numbers": ("static real table_bend", "static int table_bend"),
    "a variable that is a whole number": ("    real s;\n    for", "    int s;\n    for"),
    "a vector of whole numbers": ("    real from[N], a[M]", "    int from[N], a[M]"),
    "a whole number from another one": ("u[i] = kappa[i] + us[i];", "u[i] = kappa[i] + us[i]; i = 0.5;"),
    "a truth that is a number": ("if (c->sample > 0) {", "if (t) {"),
    "lines of a comment that go on": (
        "u[i] = kappa[i] + us[i];",
        "u[i] = kappa[i] + us[i]; /* *\\\n/ u[i] = 0.0; /* */",
    ),
    "a trigraph": ("u[i] = kappa[i] + us[i];", "u[i] = kappa[i] + us[i]; /* *??/\n/ u[i] = 0.0; /* */"),
    "two tables in one line": (
        "static const real at_bend[] =",
        "static const real at_bend[5], other[] =",
    ),
    "a variable that hides another one": (
        "    return cubic_bend[low][0]",
        "    if (0 < 1) {\n        real s = 0.0;\n        low = low + 0;\n    }\n    return cubic_bend[low][0]",
    ),
    "a variable that hides a table": (
        "    int low = 0, high = 4, k;",
        "    int low = 0, high = 4, k, at_bend;",
    ),
    "a number that is written where it is pointed to": (
        "static void plan(const real t[1], real out_x[3], real out_u[2])\n{\n    (void)t;",
        "static void plan(real t[1], real out_x[3], real out_u[2])\n{\n    t[0] = 1.0;",
    ),
    "what is constant is written": (
        "static void drift(const real x[3], real out_f[3])\n{\n",
        "static void drift(const real x[3], real out_f[3])\n{\n    x[0] = 0.0;\n",
    ),
    "a state that is a copy": ("turning_step(turning_state *c", "turning_step(turning_state c"),
}


@pytest.fixture(scope="module")
def turning():
    return texts(CONTROLLERS["turning"](), "double")


@pytest.mark.slow
def test_the_text_itself_is_read(turning):
    assert read_code(*turning).name == "turning"


@pytest.mark.parametrize("change", sorted(OTHERWISE))
def test_what_c_means_otherwise_is_refused(change, turning):
    header, source = turning
    assert source.count(OTHERWISE[change][0]) >= 1
    with pytest.raises(UnreadError):
        read_code(header, source.replace(*OTHERWISE[change], 1))


@pytest.mark.parametrize(
    ("old", "new", "more"),
    [
        ("_DELAY 0.002 /* s,", "_DELAY 0.002 /* s */ * 1.5 /* s,", ""),
        ("_DELAY 0.002 ", "_DELAY 0.003 ", "/*\n#define TURNING_DELAY 0.002\n*/\n"),
        ("_DELAY 0.002 ", "_DELAY 0.003 ", "#define TURNING_DELAY 0.002\n"),
        ("#define TURNING_DELAY", "/*\n#define TURNING_DELAY 0.002\n*/\n#define TURNING_SLOW", ""),
    ],
    ids=["behind its comment", "in a comment", "twice", "in a comment of the header"],
)
def test_a_macro_is_what_the_preprocessor_makes_of_it(old, new, more, turning):
    header, source = turning
    assert old in header
    with pytest.raises(UnreadError):
        read_code(header.replace(old, new), source.replace("\n/* f(x) */\n", f"\n{more}\n/* f(x) */\n"))


# of the controller "path", whose plan goes through knots
OF_KNOTS = {
    "fewer numbers than there are": ("X[][N][4] =", "X[][N][1] ="),
    "more than there are": ("U[][M][2] =", "U[][M][3] ="),
    "rows of another length": ("START[] =", "START[5] ="),
}


_BLOCK = (
    "#if !defined(FLT_EVAL_METHOD) || FLT_EVAL_METHOD != 0\n"
    '#error "every operation must be done in its own type (on x86: -msse2 -mfpmath=sse)"\n'
)


@pytest.mark.parametrize(
    "own", ["const real idle = 0.0;", "#define M TURNING_INPUTS", "/* */ typedef char c;"]
)
def test_nothing_is_compiled_in_some_cases_only(own, turning):
    header, source = turning
    assert source.count(_BLOCK) == 1
    without = source.replace("#define M TURNING_INPUTS\n", "") if "define" in own else source
    with pytest.raises(UnreadError, match=r"above or between|no word|does not belong"):
        read_code(header, without.replace(_BLOCK, f"{_BLOCK}{own}\n"))


def test_a_statement_is_not_hidden_from_the_compiler(turning):
    """The lines are the same, in the same order: below them what is compiled, and between them nothing."""
    header, source = turning
    begin, end = source.index(_BLOCK), source.index("typedef turning_real real;")
    block, line = source[begin:end], "        u[i] = kappa[i] + us[i];\n"
    head, tail = block.split("#endif\n", 1)
    inside = source.replace(block, "").replace(line, f"{head}{line}#endif\n{tail}")
    below = f"{source.replace(block, '')}{block}"
    for changed in (inside, below):
        assert changed.count(line) == 1
        with pytest.raises(UnreadError, match="above or between"):
            read_code(header, changed)


@pytest.fixture(scope="module")
def path():
    return texts(CONTROLLERS["path"](), "double")


@pytest.mark.parametrize("change", sorted(OF_KNOTS))
def test_tables_have_the_sizes_of_their_numbers(change, path):
    header, source = path
    assert source.count(OF_KNOTS[change][0]) == 1
    with pytest.raises(UnreadError, match="other sizes"):
        read_code(header, source.replace(*OF_KNOTS[change]))


def in_plan(header, source):
    with ctx.workprec(200):
        return list(of_plan(read_code(header, source), in_recheck("path").case.curve, arb("0.081")))


@pytest.mark.parametrize("precision", ["double", "single"])
def test_the_plan_through_knots_is_that_of_the_certificate(precision):
    assert in_plan(*texts(CONTROLLERS["path"](), precision)) == []


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("2915.0, (-195500", "2915.0001, (-195500", "X"),
        ("{0.30000000000000004, (-30.0)}", "{0.30000000000000004, (-30.0000001)}", "U"),
        ("0.02, 0.3,\n", "0.02, 0.30000000001,\n", "START"),
        ("t >= START[middle]", "t >= START[middle] - 0.001", "the pieces of the plan"),
        (
            "k < 2; k++) {\n        const int middle",
            "k < 1; k++) {\n        const int middle",
            "the pieces of the plan",
        ),
    ],
)
def test_every_number_of_a_plan_through_knots_is_looked_at(old, new, named, path):
    """Also of pieces that the self-test does not come to."""
    header, source = path
    assert source.count(old) == 1
    assert in_plan(header, source.replace(old, new)) == [named]


def test_no_bound_is_given_where_pieces_are_found_in_another_way():
    """At the knots themselves it is the same piece."""
    header, source = texts(covered("path"), "double")
    changed = source.replace("t >= START[middle]", "t >= START[middle] - 0.001")
    assert changed != source
    with pytest.raises(UnreadError, match="another way"):
        bounds(covered("path"), in_recheck("path"), (header, changed))
