"""What the checker says is left of a plant that is not linear, against closed forms: never below, and near."""

import json

import pytest
from flint import arb, arb_mat
from sampled_files import CART, SCALAR, changed, made, why_not

from tubecert.recheck.document import Node, read
from tubecert.recheck.plans import Plan
from tubecert.recheck.sampled_loop.claims import Case
from tubecert.recheck.sampled_loop.loop import Loop
from tubecert.recheck.sampled_loop.record import read_certificate
from tubecert.recheck.sampled_loop.remainders import Remainders
from tubecert.recheck.sampled_loop.windows import course_of
from tubecert.recheck.specification import read_sampled_specification
from tubecert.spec import load_text
from tubecert.spec.canonical import canonical

WAVE = "{kind: expressions, x: ['sin(t)'], u: ['cos(t)'], horizon: 7, afterwards: repeat}"
AT_ONE = {"trajectory": "{kind: equilibrium, at: [1], input: [1]}", "initial_state": "{at: [1]}"}
HOME = {
    "system": "{states: [x], inputs: [u], f: ['0'], B: [[1]]}",
    "safe_set": "{x: [-50, 50]}",
    "trajectory": "{kind: equilibrium, at: [0], input: [0]}",
    "initial_state": "{at: [0]}",
    "hardware": "{sample_time: 0.1}",
}


def scalar(f="0", B="1", more=""):
    return f"{{states: [x], inputs: [u], f: ['{f}'], B: [['{B}']]{more}}}"


def left(*, A=0, E=(), slow=False, **sections) -> Remainders:
    """Of x' = f + B u with some sections in place of those at home."""
    text = "tubecert: 1\nname: a\n" + "\n".join(f"{k}: {v}" for k, v in {**HOME, **sections}.items())
    given = read_sampled_specification(Node(json.loads(json.dumps(canonical(load_text(text)))), "spec"))
    course = course_of(given, Plan(given.trajectory.kind, None, None, None, None, None))
    nominal = arb_mat([[A]]), arb_mat([[1]]), arb_mat(1, len(E), list(E))
    return Remainders(course, nominal, 256, slow=slow)


RANGE = ", parameters: {p: [0.9, 1.1]}"
BENT = scalar("0", "1 + 0.1*x")
KNOWN = "{bounds: {h: 3, h_x: 0.2, h_t: 1}}"


@pytest.mark.parametrize(
    ("sections", "U", "through"),
    [
        ({"system": scalar("0.1*x**2")}, 0, (0.2 * 0.6 * 0.25, 0)),  # .1 W^2, in five levels
        ({"system": BENT}, 2, (0.1 * 0.6 * 2, 0)),
        ({"uncertainty": "{h: ['0.2*x']}"}, 0, (0, 0.1)),
        ({"uncertainty": "{h: ['0.2*x']}", "system": BENT}, 0, (0.05 * 0.1, 0.1)),
        ({"trajectory": WAVE, "uncertainty": "{h: ['0.2*x**2']}"}, 0, (0, 0.3 + 0.05)),
        ({"uncertainty": KNOWN}, 0, (0, 0.1)),
        ({"uncertainty": KNOWN, "system": BENT}, 0, (0.15, 0.1)),
        ({"uncertainty": "{bounds: {h: 3}}", "system": BENT}, 0, (0.15, 0)),
        ({"disturbance": "{E: [['1 + 0.2*x']], bound: [0.3]}", "E": [1]}, 0, (0.03, 0)),
        ({"disturbance": "{E: [['1 + 0.6*x', '1 + 0.8*x']], bound: 0.3}", "E": [1, 1]}, 0, (0.15, 0)),
        ({"trajectory": WAVE, "disturbance": "{E: [['1 + 0.2*x']], bound: 0.3}", "E": [1]}, 0, (0.09, 0.05)),
        ({"trajectory": "{kind: equilibrium, at: [0], input: [0.02]}"}, 0, (0.02, 0)),
        ({"trajectory": WAVE.replace("cos(t)'", "cos(t) + 0.02'")}, 0, (0.02, 0.05)),
        ({"trajectory": "{kind: expressions, x: ['0.1*t'], u: ['0.1'], horizon: 2, afterwards: rest}"}, 0, (0.1, 0)),
        ({**AT_ONE, "system": scalar("-p*x", more=RANGE), "A": -1}, 0, (0.1 + 0.05, 0)),
        ({**AT_ONE, "system": scalar("-p*x", more=RANGE), "A": -1, "slow": True}, 0, (0.05, 0)),
    ],
)  # fmt: skip
def test_what_is_left(sections, U, through):
    own = left(**sections)
    found = own.rho([arb("0.5")], [arb(U)], own.slow([arb("0.5")]))
    for ball, exact in zip(found, through, strict=True):
        assert exact * (1 - 1e-9) <= float(ball.abs_upper()) <= exact * 1.03 + 1e-6


@pytest.mark.parametrize(
    ("sections", "size", "rate", "first"),
    [
        ({"uncertainty": "{h: ['0.3*sin(2*t) + 0.2*x']}", "trajectory": WAVE}, 0.6, 0.8, 0),
        ({"uncertainty": "{h: ['0.3*cos(2*t)']}", "trajectory": WAVE}, 0.3, 0.6, 0.3),
        ({"uncertainty": KNOWN, "trajectory": WAVE}, 3, 1.2, 3),
        ({"disturbance": "{E: [[1]], bound: 0.3, rate: 2}", "E": [1]}, 0.3, 2, 0.3),
        ({"trajectory": WAVE, "system": scalar("(p - 1)*x**2", more=RANGE), "slow": True}, 0.1, 0.1, 0.1),
        ({"trajectory": WAVE, "system": scalar("0", "p", more=RANGE), "slow": True}, 0.1, 0.1, 0.1),
    ],
)  # fmt: skip
def test_sizes_and_rates(sections, size, rate, first):
    (own,) = left(**sections).slow([arb("0.5")])
    for ball, exact in ((own.size, size), (own.rate, rate), (own.first, first)):
        assert exact * (1 - 1e-9) <= float(ball.abs_upper()) <= exact * 1.03 + 1e-6


@pytest.mark.parametrize("delay", ["0", "0.03", "0.1", "0.13"])
def test_rows_change_as_their_derivatives_say(delay):
    A, B, H = arb_mat([[0, 1], [-2, "0.3"]]), arb_mat([[0], [1]]), arb_mat([[1], [2]])
    tables = arb_mat([["0.5"]]), arb_mat([[1, 2]]), arb_mat([[3]]), arb_mat([[-1, -2]])
    text = SCALAR.replace("delay: 0.04", f"delay: {delay}")
    machine = read_sampled_specification(
        Node(json.loads(json.dumps(canonical(load_text(text)))), "spec")
    ).hardware
    loop = Loop(A, B, H, *tables, machine.sample_time, machine.delay)
    for s, later in ((arb("0.05"), True), (arb("0.02"), not loop.rest)):
        h = arb("1e-6")
        moved = (loop.error(s + h, later=later) - loop.error(s - h, later=later)) * (1 / (2 * h))
        for x, y in zip(moved.entries(), loop.error(s, 1, later=later).entries(), strict=True):
            assert abs(x - y) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("ends", [("-0.9", "2.9"), ("-2.9", "0.9")])
def test_a_range_holds_on_both_sides(ends):
    assert why_not(changed(made(SCALAR), "inputs", 0, "range", to=list(ends)))


@pytest.mark.slow
def test_h_is_defined_on_all_of_the_safe_set():
    h = ["0.2*sin(t) + 0.0000001*log(p + 5)"]
    assert why_not(changed(made(CART), "spec", "effective", "uncertainty", "h", to=h))


@pytest.mark.slow
def test_h_is_as_large_as_on_the_widest_stage():
    document = made(SCALAR.replace("limits:", "uncertainty: {h: ['0.1*x']}\nlimits:"), base=SCALAR)
    widths = [float(stage["half_widths"]["x"]) for stage in document["result"]["tube"]]
    found = read_certificate(read(json.dumps(document), "certificate"))
    (own,) = Case(found.specification, found.proven, 2000).slow
    assert max(widths) > 2 * min(widths)
    assert 0.1 * max(widths) <= float(own.size.abs_upper()) <= 0.101 * max(widths)
