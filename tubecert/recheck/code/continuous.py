"""The text of the exported C of a certificate C against its formulas; see `examination`, which is about H."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from flint import ctx

from tubecert.recheck.balls import exact, root
from tubecert.recheck.code.constants import is_number, of_boxes, of_plan, of_tables
from tubecert.recheck.code.examination import Agreement, apart, place_of
from tubecert.recheck.code.reader import Code
from tubecert.recheck.code.run import Machine, Vector
from tubecert.recheck.code.seen import KINDS, Rounded, known
from tubecert.recheck.code.shape import ball_of, law_of
from tubecert.recheck.code.tree import Number
from tubecert.recheck.continuous import Adapted, loop_of
from tubecert.recheck.controller import BITS

_MOST = Fraction(1, 10**6)  # that a printed bound is above what it bounds, of that


def examine(
    text: str,
    file: str,
    code: Code,
    given: Sequence[Sequence[Fraction]],
    answered: Sequence[Sequence[float]] | None = None,
) -> Agreement:
    """The code of a certificate C; raises `CertificateError`, and `UnreadError` for what it does not follow.

    `given`: rows of a time since the last sample, a state and an xhat; `answered` is what compiled code made of them.
    """
    formulas = loop_of(text, file)
    with ctx.workprec(BITS):
        expected = list(formulas.answers(given))
        difference, share = apart(code.real, expected, _answers(code, formulas, given), answered)
        return Agreement(
            difference=difference, share=share, losses=(), otherwise=tuple(otherwise(code, formulas))
        )


def _answers(code: Code, formulas: Adapted, given: Sequence[Sequence[Fraction]]) -> Iterator[Vector]:
    """Of the text: a sample where there is one, then the law and the predictor."""
    machine = Machine(code, Rounded(KINDS[code.real], decides=True), {"piece": place_of(formulas)})
    n, m, state = len(formulas.case.system.states), len(formulas.case.system.inputs), machine.state()
    for k, row in enumerate(given):
        since = known(exact(row[0]))
        x: Vector = [known(exact(q)) for q in row[1 : 1 + n]]
        xhat: Vector = [known(exact(q)) for q in row[1 + n : 1 + 2 * n]]
        parts = (row[1 + 2 * n : 1 + 3 * n], row[1 + 3 * n :])
        plan: list[Vector] = [[known(exact(q)) for q in part] for part in parts if part]
        u: Vector = [None] * m
        rate: Vector = [None] * n
        if k == 0:
            machine.call(f"{code.name}_start", state, x, [None] * n)
        elif row[0] == 0:
            machine.call(f"{code.name}_step", state, x, xhat)
        machine.call(f"{code.name}_law", state, since, x, *plan, u)
        machine.call(f"{code.name}_predictor", state, x, xhat, u, rate)
        yield [*u, *rate]


def otherwise(code: Code, formulas: Adapted) -> Iterator[str]:
    """Names of numbers that are not those of the certificate, to the bit; the reach is a bound, from above."""
    case, gains, big, m = formulas.case, formulas.gains, code.name.upper(), len(formulas.case.system.inputs)
    wanted = {"SAMPLE_TIME": gains.sample_time}
    if case.curve.horizon is not None:
        wanted["HORIZON"] = case.curve.horizon
    for name, value in wanted.items():
        if not is_number(code, code.macros.get(f"{big}_{name}"), value):
            yield name
    reach = code.macros.get(f"{big}_REACH")
    unit = KINDS[code.real].unit
    found = KINDS[code.real].nearest(reach.text) if isinstance(reach, Number) else exact(Fraction(0))
    low, high = formulas.reach * (1 - unit), formulas.reach * (1 + 2 * unit + exact(_MOST))
    if not (low < found < high):
        yield "REACH"
    yield from of_tables(code, formulas)
    yield from of_boxes(code, formulas)
    widths = [root(row[i]) * formulas.reach for i, row in enumerate(formulas.dual)]
    yield from of_plan(code, case.curve, min(widths, key=float))
    if not is_number(code, Number(ball_of(code.functions["estimator"], m)), gains.projection_radius):
        yield "the radius of the clip"
    if not is_number(code, Number(law_of(code.functions["law"], m).gain), case.bound("feedback_gain")):
        yield "the gain"
