"""The parser: what it accepts, what it owes, and what it says about everything else."""

import keyword
import string
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import SYMBOLS, texts

from tubecert.expression import (
    ZERO,
    ExpressionError,
    Parsed,
    constant,
    cos,
    free_symbols,
    parse,
    parse_number,
    sin,
    sqrt,
    symbol,
    to_text,
)
from tubecert.expression.meant import elsewhere, mistyped, near

x, y, t = (SYMBOLS[name] for name in ("x", "y", "t"))


def read(text: str, *, kinks: bool = False) -> Parsed:
    return parse(text, symbols=SYMBOLS, kinks=kinks)


def refusal(text: str, *, kinks: bool = False) -> ExpressionError:
    with pytest.raises(ExpressionError) as caught:
        read(text, kinks=kinks)
    error = caught.value
    assert 0 <= error.offset <= len(text)
    assert error.width >= 1
    assert error.message
    return error


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x", x),
        ("  x\n\t+ y ", x + y),
        ("-x**2", -(x**2)),
        ("2**3**2 * 0 + x", x),
        ("x - y - t", (x - y) - t),
        ("x/y/t", (x / y) / t),
        ("x**-1", x**-1),
        ("+-+x", -x),
        ("sin(x)*cos((y))", sin(x) * cos(y)),
        ("sqrt(1 + x**2)", sqrt(1 + x**2)),
        ("x**(1 + 1)", x**2),
    ],
)
def test_what_expressions_mean(text: str, expected: object) -> None:
    assert read(text).expression is expected


def test_power_towers_are_right_associative() -> None:
    assert read("x**2**3").expression is x**8
    assert refusal("2**3**3").kind == "limit"


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("0.1", Fraction(1, 10)),
        ("1e-3", Fraction(1, 1000)),
        (".5", Fraction(1, 2)),
        ("5.", Fraction(5)),
        ("1E+2", Fraction(100)),
        ("1e300", Fraction(10) ** 300),
        ("0.1234567890123456789012345678901234567", Fraction("0.1234567890123456789012345678901234567")),
        ("1/3", Fraction(1, 3)),
        ("-2*0.5", Fraction(-1)),
        ("(1 - 1/3)**2", Fraction(4, 9)),
        ("m/2", Fraction(3, 4)),
        (" 7 ", Fraction(7)),
        ("sqrt(4)", Fraction(2)),
    ],
)
def test_numbers_are_read_exactly_from_their_text(text: str, number: Fraction) -> None:
    assert parse_number(text, {"m": Fraction(3, 2)}) == number


@given(digits=st.integers(0, 10**20), places=st.integers(0, 15))
def test_decimals_never_pass_through_a_float(digits: int, places: int) -> None:
    words = str(digits).zfill(places + 1)
    text = f"{words[:-places]}.{words[-places:]}" if places else words
    assert parse_number(text) == Fraction(digits, 10**places)


@pytest.mark.parametrize("text", [
    "nan", ".nan", "-.inf", "inf", "Infinity", "true", "No", "null", "~", "", "  ", "1:30", "0,1", "0x10",
    "1_000", "010", "1e10000000", "1e301", "1" * 41, "exp(1)", "sqrt(2)", "m", "1/0", "10 mm", "1e", "--",
    "1.2.3",
])  # fmt: skip
def test_what_is_not_a_number(text: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse_number(text)
    assert 0 <= caught.value.offset <= len(text)


def test_parameters_are_substituted_as_exact_constants() -> None:
    symbols = {"m": constant(Fraction(1, 3)), "x": x}
    assert parse("m*x + m*m", symbols=symbols).expression is x / 3 + Fraction(1, 9)


@pytest.mark.parametrize(
    ("text", "owed"),
    [
        ("x/y", [("nonzero", y, "x/y")]),
        ("x/x", [("nonzero", x, "x/x")]),
        ("0*tan(x)", [("nonzero", cos(x), "tan(x)")]),
        ("x**-2 * x**2", [("nonzero", x, "x**-2")]),
        ("x**2", []),
        ("1 + 0*sqrt(y)", [("positive", y, "sqrt(y)")]),
        ("x/2 + sqrt(3)", []),
        ("(x + 1)/(1/y)", [("nonzero", 1 / y, "(x + 1)/(1/y)"), ("nonzero", y, "1/y")]),
        ("1/x - 1/x", [("nonzero", x, "1/x"), ("nonzero", x, "1/x")]),
        ("sqrt(x)**2", [("positive", x, "sqrt(x)")]),
        ("(1/x)**0", [("nonzero", x, "1/x")]),
    ],
)
def test_obligations_are_recorded_before_simplification(text: str, owed: list[tuple[object, ...]]) -> None:
    parsed = read(text)
    assert [(item.kind, item.argument, item.text) for item in parsed.obligations] == owed
    for item in parsed.obligations:
        assert text[item.offset : item.offset + item.width] == item.text


def test_obligations_see_parameters_as_constants() -> None:
    symbols = {"m": constant(2), "x": x}
    assert parse("x/m + sqrt(m)", symbols=symbols).obligations == ()
    with pytest.raises(ExpressionError, match="not real"):
        parse("sqrt(-m)", symbols=symbols)


@pytest.mark.parametrize(
    ("text", "offset", "words"),
    [
        ("x^2", 1, "write ** for a power"),
        ("2x", 0, "write 2*x"),
        ("x + 2(y)", 5, "write 2*(...)"),
        ("x y", 2, "write x*y"),
        ("x(y)", 1, "not a function"),
        ("(x)(y)", 3, "write (...)*(...)"),
        ("x + z", 4, "unknown symbol z"),
        ("x + Y", 4, "did you mean y?"),
        ("sni(x)", 0, "did you mean sin?"),
        ("0x10", 0, "decimal"),
        ("1_000", 0, "write 1000"),
        ("2*1j", 2, "imaginary"),
        ("x.real", 1, "attributes"),
        ("x.__class__", 1, "attributes"),
        ("__import__('os').system('true')", 0, "unknown symbol"),
        ("x < y", 2, "compares"),
        ("x == y", 2, "compares"),
        ("x = y", 2, "assigns"),
        ("x := y", 2, "assigns"),
        ("'x'", 0, "quotes"),
        ('"x"', 0, "quotes"),
        ("sin(x, y)", 0, "one argument, not 2"),
        ("sin()", 4, "missing"),
        ("sin", 0, "sin(...)"),
        ("sin x", 0, "sin(...)"),
        ("sin(x=y)", 5, "assigns"),
        ("sin(*x)", 4, "missing"),
        ("x if y else t", 2, "unknown symbol if"),
        ("lambda: x", 0, "unknown symbol lambda"),
        ("[x for x in y]", 0, "parentheses"),
        ("{x}", 0, "parentheses"),
        ("x; y", 1, "one expression"),
        ("x, y", 1, "comma"),
        ("x // y", 2, "floor"),
        ("x % y", 2, "remainder"),
        ("x @ y", 2, "entry by entry"),
        ("~x", 0, "bit"),
        ("|x|", 0, "abs(x)"),
        ("x!", 1, "factorial"),
        ("x # y", 2, "comment"),
        ("x \\ y", 2, "backslashes"),
        ("x/0", 0, "division by zero"),
        ("0/0", 0, "division by zero"),
        ("x/(y - y)", 0, "division by zero"),
        ("x/(1 - 1)", 0, "division by zero"),
        ("0**-1", 0, "division by zero"),
        ("(x - x)**(-2)", 0, "division by zero"),
        ("x**y", 3, "not an integer"),
        ("x**0.5", 3, "sqrt"),
        ("x**1.5", 3, "not an integer"),
        ("x**13", 3, "beyond 12"),
        ("x**-13", 3, "beyond 12"),
        ("x +", 3, "ends"),
        ("x + * y", 4, "missing before *"),
        ("(x", 0, "never closed"),
        ("x)", 1, "never opened"),
        ("()", 1, "nothing"),
        ("", 0, "empty"),
        (" \n ", 0, "empty"),
        ("x \u2212 y", 2, "write -"),
        ("x\u00b2", 1, "write **2"),
        ("2\u00b7x", 1, "write *"),
        ("\u03bb*x", 0, "ASCII"),
        ("\u03c0*x", 0, "write pi"),
        ("x\u00a0+ y", 1, "a space"),
        ("x\x00", 1, "U+0000"),
        ("x + \U0001d465", 4, "ASCII"),
        ("sqrt(-1)", 0, "not real"),
        ("sqrt(1 - 1)", 0, "not differentiable"),
        ("1e400", 0, "beyond 300"),
        ("1.5.2", 0, "one decimal point"),
        ("007", 0, "write 7"),
        ("2e", 0, "exponent"),
    ],
)
def test_refusals_say_where_and_what_instead(text: str, offset: int, words: str) -> None:
    error = refusal(text)
    assert error.offset == offset
    assert words in f"{error.message} / {error.help}"


def test_kinks_are_for_the_uncertainty_only() -> None:
    assert "only allowed in h" in refusal("abs(x)").message
    assert "only allowed in h" in refusal("norm(x, y)").message
    assert read("abs(x) + norm(x, y)", kinks=True).expression is not ZERO
    assert read("norm(x, 0)", kinks=True).expression is read("abs(x)", kinks=True).expression
    assert "missing" in refusal("norm()", kinks=True).message
    assert "one argument" in refusal("abs(x, y)", kinks=True).message


def test_names_can_be_refused_with_a_reason() -> None:
    with pytest.raises(ExpressionError, match="u is an input") as caught:
        parse("x + u", symbols={"x": x}, refused={"u": "u is an input"})
    assert (caught.value.kind, caught.value.offset) == ("symbol", 4)


HOSTILE = {
    "power tower": "9**9**9",
    "nested powers": "((x**12)**12)**12",
    "nested powers of sums": "(((x + 1)**12 + 1)**12 + 1)**12",
    "huge constant": "(1e300**12)**12",
    "huge product": "*".join(["1e300"] * 40),
    "huge coefficient": "*".join(["(1e300*x)"] * 40),
    "huge power": "*".join(["x**12"] * 13),
    "tower of names": "**".join("x" * 1_300),
    "parentheses": "(" * 10_000 + "x" + ")" * 10_000,
    "some parentheses": "(" * 51 + "x" + ")" * 51,
    "calls": "sin(" * 900 + "x" + ")" * 900,
    "minus signs": "-" * 50_000 + "x",
    "some minus signs": "-" * 51 + "x",
    "long": "x+" * 2_000 + "x",
    "digits": "1" * 3_999,
    "exponent": "1e10000000",
    "exponent of exponent": "1e" + "9" * 3_000,
    "brackets": "[" * 200_000,
    "spaces": " " * 5_000 + "x",
}


@pytest.mark.timeout(30)
@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_expressions_are_refused(name: str) -> None:
    assert refusal(HOSTILE[name]).kind in ("limit", "syntax")


def test_limits_are_not_narrower_than_promised() -> None:
    total = "x" + "+x" * 1_999
    assert len(total) == 3_999
    assert read(total).expression is 2_000 * x
    assert read("(" * 50 + "x" + ")" * 50).expression is x
    assert read("-" * 50 + "x").expression is x
    assert read("(x**12)**12").expression is x**144
    assert parse_number("1" * 40) == int("1" * 40)
    distinct = "+".join(f"{i}*x*y" if i % 2 else f"sin({i}*x)" for i in range(250))
    assert free_symbols([read(distinct).expression]) == {"x", "y"}


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(text=texts())
def test_random_expressions_are_accepted(text: str) -> None:
    parsed = read(text)
    assert read(to_text(parsed.expression)).expression is parsed.expression


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(
    text=st.text(alphabet="xyt0123.e+-*/() ,^sincoqr", max_size=30)
    | st.text(alphabet=string.printable + "\u2212\u03bb", max_size=20)
)
def test_any_text_is_an_expression_or_a_located_error(text: str) -> None:
    try:
        error = None
        read(text, kinks=True)
    except ExpressionError as caught:
        error = caught
    assert error is None or (error.message and 0 <= error.offset <= len(text))


def test_symbols_may_hide_nothing() -> None:
    """A state may be called like a prefix of a function, or contain digits and underscores."""
    names = {name: symbol(name) for name in ("si", "sin_x", "x1", "e1", "E")}
    parsed = parse("si + sin_x + x1 + 2*e1 + 1e1*E", symbols=names)
    assert free_symbols([parsed.expression]) == set(names)


RESERVED_WORDS = ["pi", "sin", "cos", "tan", "exp", "sqrt", "abs", "norm", *keyword.kwlist]


@pytest.mark.parametrize("name", [*RESERVED_WORDS, "", "2x", "x y", "tau#", "_x", "x" * 41, "ω"])
def test_no_variable_can_have_a_name_that_reads_as_something_else(name: str) -> None:
    """sin(pi) with a state named pi would be a constant: no expression is read among such names."""
    for text in ("1", "x", f"2*{name}", f"sin({name})"):
        with pytest.raises(ExpressionError, match="cannot be the name of a variable"):
            parse(text, symbols={"x": x, name: symbol(name)})
    with pytest.raises(ExpressionError):
        parse_number("1", {name: Fraction(1)})


@pytest.mark.parametrize("text", ["0*tan(pi/2)", "0/(1 - sin(pi/2))", "0*sqrt(cos(pi/2))"])
def test_a_number_is_not_what_is_left_of_something_undefined(text: str) -> None:
    with pytest.raises(ExpressionError, match="not a rational number"):
        parse_number(text)


def test_what_powers_multiply_to_is_bounded_for_every_sign() -> None:
    assert refusal("((x**-12)**-12)**-12").kind == "limit"
    assert refusal("((x**12)**-12)**-2").kind == "limit"
    assert refusal("(((x + 1)**-12 + 1)**-12 + 1)**-12").kind == "limit"
    assert refusal("(1e40)**-12*(1e300)**-12").kind == "limit"
    assert refusal("(1e300)**-12*x").kind == "limit"


@pytest.mark.parametrize("word", sorted(elsewhere("functions")))
def test_words_of_other_languages_are_never_taken_for_typing_errors(word: str) -> None:
    """U7: sign was taken for sin, min for sin: what parses then means something else."""
    error = refusal(f"x + {word}(y)")
    assert error.kind == "symbol"
    assert "did you mean" not in error.help
    assert error.help == elsewhere("functions")[word]


@pytest.mark.parametrize(
    "word", ["sinq", "tann", "coss", "sih", "expo", "sqroot", "tanx", "sinus", "atann", "lag"]
)
def test_another_function_is_never_proposed(word: str) -> None:
    assert "did you mean" not in refusal(f"{word}(y)").help


@pytest.mark.parametrize(
    "word", ["dx", "xdot", "x_dot", "vx", "x0", "x_ref", "thetadot", "dtheta", "theta2", "tau", "m"]
)
def test_a_name_is_not_meant_by_its_derivative_its_index_or_a_part_of_it(word: str) -> None:
    """dz was told `did you mean z?`: with z in its place the model is another one, and nothing complains."""
    assert mistyped(word, ["x", "theta", "tau1", "mx"]) == []


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        *[("thetta", "theta"), ("thet", "theta"), ("thetaa", "theta"), ("tehta", "theta"), ("X", "x")],
        *[("xx", "x"), ("x_", "x"), ("mass", "masses")],
    ],
)
def test_a_typing_error_is_told(word: str, meant: str) -> None:
    assert mistyped(word, ["x", "theta", "masses"]) == [meant]


def test_a_key_is_not_meant_by_its_derivative() -> None:
    assert (near("dz", ["z"]), near("z_dot", ["z"]), near("zz", ["z"])) == ([], [], ["z"])


@pytest.mark.parametrize(
    ("word", "meant"), [("Sin", "sin"), ("TANH", "tanh"), ("tahn", "tanh"), ("exp_", None), ("lgo", "log")]
)
def test_the_same_letters_are_a_typing_error(word: str, meant: str | None) -> None:
    assert ("did you mean" in refusal(f"{word}(y)").help) == (meant is not None)
    assert meant is None or f"did you mean {meant}?" in refusal(f"{word}(y)").help
