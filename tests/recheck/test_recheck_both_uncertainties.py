"""h as an expression with bounds declared beside it: what is printed holds for both of them, or is not confirmed."""

import copy

import pytest
from rechecked import certified, examine, failing, sealed
from systems import SMALL

OWN = 'h: ["0.1*sin(t) + 0.05*x"]'
UNKNOWN = SMALL.replace("  B: [[0], [1]]", "  parameters: {k: [0.99, 1.01]}\n  B: [[0], [1]]").replace(
    "-y + 0.3*sin(x)", "-k*y + 0.3*sin(x)"
)


def both(text: str, h: str, bounds: str) -> str:
    return text.replace(OWN, f'h: ["{h}"], bounds: {bounds}')


@pytest.mark.slow
def test_declared_bounds_do_not_hide_an_expression_where_parameters_are_unknown():
    """Of h + B^+ (f(x, theta) - f(x)) the second part alone had been compared with what the declared bound leaves."""
    text = both(UNKNOWN, "0.001*sin(t) + 0.0005*x", "{h: 0.01, h_x: 0.006, h_t: 0.01}")
    document = certified(text, conditions="distance")
    assert document["result"]["verdict"] == "certified"
    assert failing(examine(document)) == []
    forged = copy.deepcopy(document)
    forged["result"]["spec"]["effective"]["uncertainty"]["h"] = ["100*sin(t) + 30*x"]
    wrong = [name for name, _ in failing(examine(sealed(forged)))]
    for name in ("h", "h_x", "h_t"):
        assert any(item.startswith(f"{name} <= ") for item in wrong)


@pytest.mark.slow
@pytest.mark.parametrize("text", [SMALL, UNKNOWN])
def test_a_declared_bound_does_not_hide_what_an_expression_is_at_the_start(text):
    """h(0, x0) = 0.0225, and yet 0.0001 was confirmed of it, because |h| <= 0.0001 is declared."""
    document = certified(both(text, "0.1*sin(t) + 0.05*x + 0.02", "{h: 0.15}"), conditions="distance")
    memory: dict = {}
    assert failing(examine(document, memory=memory)) == []
    forged = copy.deepcopy(document)
    forged["result"]["spec"]["effective"]["uncertainty"]["bounds"]["h"] = "0.0001"
    forged["result"]["constants"]["h_initial"] |= {"above": 0.02, "below": 0.0}
    found = [name for name, _ in failing(examine(sealed(forged)))]
    assert any(name.startswith("h_initial <= ") for name in found)
