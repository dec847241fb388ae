"""Expressions that travel: copied, pickled, sent to another process and back, they are the same object."""

import copy
import pickle
import subprocess
import sys

import pytest
from hypothesis import given, settings
from strategies import read, texts

from tubecert.expression import ONE, PI, ZERO, Expression, derivatives, norm, sin, symbol, topological

x, y = symbol("x"), symbol("y")


def copies(e: Expression) -> list[Expression]:
    pickled = [pickle.loads(pickle.dumps(e, protocol)) for protocol in range(pickle.HIGHEST_PROTOCOL + 1)]
    return [*pickled, copy.copy(e), copy.deepcopy(e)]


@pytest.mark.parametrize("e", [ZERO, ONE, PI, x, x + y, 2 * x * y, x**-3, norm([x, y])], ids=repr)
def test_a_copy_is_the_same_object(e: Expression) -> None:
    assert all(other is e for other in copies(e))
    assert all(other is e for other in copies(pickle.loads(pickle.dumps([e, (e,)]))[1][0]))


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@given(text=texts())
def test_identity_survives_pickle(text: str) -> None:
    e = read(text)
    for other in (e, *derivatives([e], "x")):
        assert all(found is other for found in copies(other))


@pytest.mark.slow
def test_depth_needs_no_recursion() -> None:
    e = x
    for _ in range(20_000):
        e = sin(e) + 1
    assert all(other is e for other in copies(e))


def test_parts_that_are_shared_are_written_once() -> None:
    e = x + y
    for _ in range(60):
        e = sin(e) * e  # 2**60 paths
    assert len(pickle.dumps(e)) < 20_000
    assert pickle.loads(pickle.dumps(e)) is e


PROGRAM = """
import pickle, sys
from tubecert.expression import parse, symbol, to_text, topological
names = sys.argv[2]
symbols = {name: symbol(name) for name in names}
kept = [parse(text, symbols=symbols).expression for text in ("b*a + 1", "b + sin(a)", "c*b")[::int(sys.argv[1])]]
text = "sin(a) + b + 2*a*b*c + c*(a + b) + 1/(b + 1)**2"
if len(sys.argv) == 3:
    sys.stdout.buffer.write(pickle.dumps(parse(text, symbols=symbols).expression))
else:
    found = pickle.loads(sys.stdin.buffer.read())
    assert found is parse(text, symbols=symbols).expression, to_text(found)
    assert found - parse(text, symbols=symbols).expression is parse("0", symbols=symbols).expression
"""


@pytest.mark.slow
def test_a_process_with_another_history_reads_the_same_expression() -> None:
    """The order of sums and products is the order in which a process met their terms."""

    def run(*arguments: str, given: bytes = b"") -> bytes:
        command = [sys.executable, "-c", PROGRAM, *arguments]
        return subprocess.run(command, input=given, capture_output=True, check=True).stdout

    written = run("1", "abc")
    for history in (("1", "abc"), ("-1", "cba"), ("1", "bca")):
        run(*history, "read", given=written)


def test_an_unpickled_expression_is_not_kept_alive() -> None:
    e = sin(symbol("only_here") + 41)
    data = pickle.dumps(e)
    del e
    again = pickle.loads(data)
    assert len(topological([again])) == 4
    assert again is sin(symbol("only_here") + 41)
