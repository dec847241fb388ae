"""The same loop written otherwise: units of states and inputs, the order of states, the unit of time.

Theorems 0, A and B are about the loop, not about how it is written: omega is 1/s; sigma' = Gamma B'P xt makes Gamma
u^2 (the s of B is that of sigma'); distances have no unit, half-widths those of their states.
"""

from functools import cache
from itertools import product

import pytest
from proven import proven

from tubecert.kinds import ALONE

NAMES = ("p", "v")
TAKEN = ("bandwidth", "adaptation_rate")


def loop(*, s: int = 1, u: int = 1, clock: int = 1, order: tuple[int, int] = (0, 1)) -> str:
    """A mass on a spring: speeds in s m/s, the input in u N, time in units of 1/clock s, states in an order."""
    f = ("s*v", "(-p - v*s + sin(p)/2)/s")
    W = (("1", "-1/s"), ("-1/s", "4/s**2"))
    h, B = "(sin(t/c)/5 + p/10)/u", ("0", "u/s")
    rows = ["[" + ", ".join(f'"{W[i][j]}"' for j in order) + "]" for i in order]
    return f"""tubecert: 1
name: same
system:
  states: [{", ".join(NAMES[i] for i in order)}]
  inputs: [F]
  parameters: {{s: {s}, c: {clock}, u: {u}}}
  f: [{", ".join(f'"({f[i]})/c"' for i in order)}]
  B: [{", ".join(f'["{B[i]}/c"]' for i in order)}]
safe_set: {{p: [-1, 1], v: [-9, 9]}}
uncertainty: {{h: ["{h}"]}}
trajectory: {{kind: equilibrium, at: [0, 0], input: [0]}}
initial_state: {{at: [0, 0]}}
metric: {{rate: 0.5/c, dual_metric: [{", ".join(rows)}]}}
tube: {{half_widths: {{p: 1/5}}}}
"""


@cache
def found(**options):
    """Gains by kind and name, the section of certificate 0, and the half-widths."""
    result = proven(loop(**options), bare=True, conditions="all")["result"]
    gains = {
        (kind, name): result["proof"][kind][name]
        for kind, name in product(("conditions_26", "distance"), TAKEN)
        if name in result["proof"].get(kind, {})
    }
    return gains, result[ALONE.key], result["tube"]["half_widths"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [{"s": 7}, {"u": 3}, {"clock": 5}, {"order": (1, 0)}],
    ids=["states", "inputs", "time", "order"],
)
def test_the_same_loop_has_the_same_gains_in_its_units(options):
    gains, alone, widths = found()
    others, alone_there, widths_there = found(**options)
    u, clock = options.get("u", 1), options.get("clock", 1)
    powers = {"bandwidth": 1 / clock, "adaptation_rate": 1 / u**2}
    assert len(gains) == 4
    assert others == pytest.approx({key: powers[key[1]] * value for key, value in gains.items()}, rel=1e-2)
    assert alone_there["verdict"] == alone["verdict"]
    assert alone_there["distance"] == pytest.approx(alone["distance"], rel=1e-6)
    assert alone_there["uncertainty_limit"] == pytest.approx(alone["uncertainty_limit"] / u, rel=1e-6)
    assert widths_there["v"] == pytest.approx(widths["v"] / options.get("s", 1), rel=1e-4)
