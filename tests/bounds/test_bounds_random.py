"""Constants of random systems with several inputs and a state-dependent B, against another algebra and sampling."""

import math
from fractions import Fraction

import numpy as np
import pytest
import sympy
from systems import at_rest, model_of

from tubecert.bounds.suprema import Suprema
from tubecert.enclosure.branch_and_bound import Effort

NAMES = ("x1", "x2", "x3")
SYMBOLS = sympy.symbols(NAMES)
RHO = 0.3
CENTRE = (Fraction(1, 10), Fraction(-1, 5), Fraction(1, 20))


def random_texts(rng, *, moving_input):
    def c():
        return f"({round(float(rng.uniform(-1, 1)), 2)})"

    # the actuated directions are unstable, the other contracts
    terms = zip((1, 1, -5), NAMES, ("x2", "x3", "x1"), strict=True)
    f = [f"{k}*{v} + {c()}*x1*x2 + {c()}*sin({w}) + {c()}*{w}" for k, v, w in terms]
    lift = f"{c()}*x1" if moving_input else c()
    B = [["1", lift], [c(), f"2 + {c()}*cos(x2)" if moving_input else "2"], [f"0.3*{c()}", f"0.3*{c()}"]]
    W = [["2", "0", "0"], ["0", "3", "0"], ["0", "0", "1.5"]]
    for i in range(3):
        for j in range(i, 3):
            extra = f"{c()}*x1*0.2 + {c()}*x3**2*0.3 + {c()}*0.1"
            W[i][j] = W[j][i] = f"{W[i][j]} + {extra}"
    return f, B, W


def functions_of(f, B, W, rate):
    """Numpy functions of (x1, x2, x3) by sympy."""
    f, B, W = (sympy.Matrix([[sympy.sympify(e) for e in row] for row in m]) for m in ([[e] for e in f], B, W))
    jacobian = f.jacobian(SYMBOLS)
    along = sum((f[i] * W.diff(SYMBOLS[i]) for i in range(3)), start=sympy.zeros(3, 3))
    F = -along + jacobian * W + W * jacobian.T + 2 * rate * W
    parts = {
        "f": f, "f_x": jacobian, "B": B, "W": W, "F": F,
        "W_x": sympy.Matrix.hstack(*[W.diff(s) for s in SYMBOLS]),
        "B_x": sympy.Matrix.hstack(*[B.diff(s) for s in SYMBOLS]),
        "b_x": sympy.Matrix.hstack(*[B[:, j].jacobian(SYMBOLS) for j in range(2)]),
    }  # fmt: skip
    compiled = {}
    for name, m in parts.items():
        function = sympy.lambdify(SYMBOLS, list(m), "numpy")

        def at(x, function=function, shape=m.shape):
            values = function(*x.T)
            return np.stack([np.broadcast_to(v, (len(x),)) for v in values], axis=-1).reshape(len(x), *shape)

        compiled[name] = at
    return compiled


def split(m, width):
    return [m[..., i : i + width] for i in range(0, m.shape[-1], width)]


def norms(m):
    return np.linalg.norm(m, 2, axis=(-2, -1))


def values_at(at, x, rng):
    """Every constant's integrand at sampled points; du at sampled directions."""
    W, B, F = at["W"](x), at["B"](x), at["F"](x)
    M = np.linalg.inv(W)
    pinv = np.linalg.pinv(B)
    h = 1e-6
    pinv_x = [
        (np.linalg.pinv(at["B"](x + h * e)) - np.linalg.pinv(at["B"](x - h * e))) / (2 * h) for e in np.eye(3)
    ]
    v = rng.standard_normal((len(x), 60, 3))
    form = np.einsum("nki,nij,nkj->nk", v, F, v)
    size = np.sqrt(np.einsum("nki,nij,nkj->nk", v, W, v))
    return {
        "f": np.linalg.norm(at["f"](x)[..., 0], axis=-1),
        "f_x": norms(at["f_x"](x)),
        "B": norms(B),
        "B_x": sum(norms(m) for m in split(at["B_x"](x), 2)),
        "b_x": sum(norms(m) for m in split(at["b_x"](x), 3)),
        "B_pinv": norms(pinv),
        "B_pinv_x": sum(norms(m) for m in pinv_x),
        "M_x": sum(norms(M @ m @ M) for m in split(at["W_x"](x), 3)),
        "largest_w": np.linalg.eigvalsh(W)[:, -1],
        "upper": 1 / np.linalg.eigvalsh(W)[:, 0],
        "feedback_gain": np.max(form / (2 * np.linalg.norm(v @ B, axis=-1) * size), axis=1),
    }


@pytest.mark.slow
@pytest.mark.parametrize(("moving_input", "seed"), [(False, 0), (True, 1)], ids=["constant B", "moving B"])
def test_constants_of_random_systems_are_above_sampled_ones(moving_input, seed):
    rng = np.random.default_rng(seed)
    f, B, W = random_texts(rng, moving_input=moving_input)
    model = model_of(NAMES, f, B, W, "1/4")
    s = Suprema(model, at_rest(*CENTRE, inputs=2), RHO, None, Effort(budget=60_000, cheap=300))
    lower, upper = s.metric_bounds()
    found = {
        "f": s.norms("f", [tuple((e,) for e in model.f)]),
        "f_x": s.norms("f_x", [model.f_x]),
        "B": s.norms("B", [model.B]),
        "B_x": s.norms("B_x", model.B_x),
        "b_x": s.norms("b_x", model.b_x),
        "B_pinv": s.norms("B_pinv", [model.B_pinv]),
        "B_pinv_x": s.norms("B_pinv_x", model.B_pinv_x),
        "M_x": s.metric_slope(),
        "upper": upper,
        "feedback_gain": s.feedback_gain(),
    }
    at = functions_of(f, B, W, float(model.rate))
    direction = rng.standard_normal((20_000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    reach = np.where(rng.random((20_000, 1)) < 0.6, 1.0, rng.random((20_000, 1)))
    x = np.array([float(q) for q in CENTRE]) + RHO * reach * direction
    sampled = {name: float(np.max(v)) for name, v in values_at(at, x, rng).items()}
    for name, constant in found.items():
        slack = 1e-9 * abs(sampled[name]) + (1e-7 if name == "B_pinv_x" else 1e-12)
        assert constant.above >= sampled[name] - slack, name
        # 20 000 points come within a few per cent of a supremum, also of one over directions
        near = 0.1 if name == "feedback_gain" else 0.03
        assert constant.above <= sampled[name] * (1 + near) + 1e-9, name
    assert lower.below <= 1 / sampled["largest_w"] <= lower.above * 1.03
    if not moving_input:
        assert found["feedback_gain"].below <= s.feedback_gain_closed_form() < math.inf
