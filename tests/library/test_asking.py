"""One way to ask: a function of the library and the command of its name read the same words, and tell the same."""

import inspect
from fractions import Fraction

import numpy as np
import pytest
import sympy
from commands import run
from systems import SMALL

import tubecert as tc
from tubecert.asking import Choice, Exact, Names, asked_by, exact, flag, question, read, words_of
from tubecert.cli.adapter import said

WORDS = {"gap": Exact("A gap.", below=1, word="auto"), "runs": Exact("Runs.", whole=True, least=0, most=8)}
ASKED = ("certify", "synth", "verify", "simulate", "sweep", "recheck", "report")


@question(WORDS, ("gap", "runs"))
def asked(*, gap=None, runs=None):
    return gap, runs


@pytest.mark.parametrize("gap", ["1/10", 0.1, np.float64(0.1), Fraction(1, 10), sympy.Rational(1, 10)])
def test_numbers_of_every_library_are_read_exactly(gap):
    assert asked(gap=gap, runs=np.int64(3)) == (Fraction(1, 10), 3)


def test_everything_wrong_is_told_at_once_and_where_it_was_asked():
    for options, places in ((False, ("gap", "runs")), (True, ("--gap", "--runs"))):
        with asked_by(options=options), pytest.raises(tc.SpecError) as caught:
            asked(gap=1, runs="1/2")
        assert [str(each.location) for each in caught.value.findings] == [*places]


@pytest.mark.parametrize("given", [{"runs": -1}, {"runs": 9}, {"runs": "x"}, {"gap": [1]}, {"gap": True}])
def test_what_a_kind_does_not_take_is_refused(given):
    with pytest.raises(tc.SpecError):
        read(WORDS, given)


def test_what_goes_together_is_told_to_lack_its_half():
    with pytest.raises(tc.SpecError, match="gap is missing beside runs"):
        asked(runs=1)
    assert asked(gap="auto", runs=0) == ("auto", 0)
    with pytest.raises(AssertionError):
        exact("auto")
    with pytest.raises(TypeError, match=r"asked\(\) got .* argument 'gaps'; it takes gap, runs"):
        asked(gaps=1)


def test_words_are_known_and_names_are_lists():
    assert Choice("", words=("A", "all")).read("conditions", "a") == "A"
    assert Names("").read("x", " a, b,a ") == ("a", "b") == Names("").read("x", ["a", "b"])
    with pytest.raises(tc.SpecError, match="did you mean auto"):
        Choice("", words=("auto", "sos")).read("route", "aut")


@pytest.mark.parametrize("name", ASKED)
def test_a_command_has_every_word_of_its_function(name):
    function = getattr(tc, name)
    told = " ".join(run(name, "--help").stdout.split())
    for word, kind in words_of(function).items():
        shown = f"{kind.metavar} " if kind.place else f"{kind.called or flag(word)} "
        assert shown in told or (name, word) == ("verify", "metric")
        assert word in inspect.signature(function).parameters or kind.untold
        assert "Exact" not in str(inspect.signature(function))
        assert (name, word) == ("verify", "metric") or " ".join(kind.help.split()) in told


def test_every_command_that_asks_is_a_function():
    assert {*ASKED, "check", "compare", "export"} <= {*said().commands} & {*dir(tc)}
    assert dir(tc) == sorted(tc.__all__)
    with pytest.raises(AttributeError, match="it is called synth"):
        _ = tc.synthesise


def test_a_command_and_its_function_say_the_same(tmp_path):
    (tmp_path / "s.yaml").write_text(SMALL)
    done = run("certify", tmp_path / "s.yaml", "--rho-a", "-1", "--gap", "3", "--bandwidth", "1")
    with pytest.raises(tc.SpecError) as caught:
        tc.certify(tmp_path / "s.yaml", rho_a=-1, gap=3, bandwidth=1)
    own = str(caught.value).replace("rho_a", "--rho-a").replace("adaptation_rate", "--adaptation-rate")
    own = own.replace("gap:", "--gap:").replace("bandwidth", "--bandwidth")
    assert done.exit_code == 2
    assert done.stderr.removesuffix("3 errors\n").strip() == own.strip()


@pytest.mark.parametrize("name", [*ASKED, "export", "compare"])
def test_what_is_neither_a_value_nor_a_file_is_refused(name):
    more = {"sweep": ({"tube.epsilon": [1]},), "export": ("folder",), "compare": (3,)}.get(name, ())
    folder = {"folder": "folder"} if name == "sweep" else {}
    with pytest.raises(tc.SpecError, match="is no text and no path"):
        getattr(tc, name)(3, *more, **folder)
