"""Words that mean something in other languages: what to write in this one. None of them is taken for a typing error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

_SMOOTH_STEP = "tanh(x/0.05) is a smooth one that turns over within 0.05"
_LARGER = "a smooth form of max(a, b) is (a + b + sqrt((a - b)**2 + 0.01))/2, of min(a, b) with - sqrt"
_LIMIT = "a smooth limit at s is s*tanh(x/s)"
_MODULES = ("np", "numpy", "math", "cmath", "sympy", "jnp", "torch", "casadi", "Math")
_TABLES = ("table", "lookup", "interp", "interp1", "interpolate", "spline", "pwl", "piecewise")

ELSEWHERE: Final[Mapping[str, str]] = {
    **dict.fromkeys(("sign", "sgn", "signum"), f"sign has a jump; {_SMOOTH_STEP}"),
    **dict.fromkeys(
        ("step", "heaviside", "Heaviside"),
        f"a step has a jump; with {_SMOOTH_STEP}: (1 + tanh(x/0.05))/2",
    ),
    **dict.fromkeys(("min", "max", "Min", "Max", "fmin", "fmax"), _LARGER),
    **dict.fromkeys(
        ("sat", "saturation", "saturate", "clip", "clamp", "limit"), f"there is no hard limit; {_LIMIT}"
    ),
    **dict.fromkeys(
        ("deadzone", "dead_zone", "relay", "hysteresis"),
        "write it with tanh or sqrt: expressions are differentiable",
    ),
    **dict.fromkeys(
        ("if", "where", "ifelse", "Piecewise"),
        "expressions have no cases; write one smooth expression, e.g. with tanh",
    ),
    **dict.fromkeys(
        _TABLES,
        "a table is a function by its own name: system.tables: {NAME: {file: NAME.csv}}, then NAME(x)",
    ),
    **dict.fromkeys(
        ("floor", "ceil", "round", "mod", "fmod", "rem"), "it has jumps; expressions are differentiable"
    ),
    **dict.fromkeys(_MODULES, "functions are written without their module: sin(x), sqrt(x)"),
    "arcsin": "write asin",
    "arccos": "write acos",
    "arctan": "write atan",
    **dict.fromkeys(
        ("atan2", "arctan2"),
        "where x > 0, atan2(y, x) is atan(y/x); elsewhere 2*atan(y/(x + sqrt(x**2 + y**2)))",
    ),
    **dict.fromkeys(("ln", "loge"), "write log: it is the natural logarithm"),
    "e": "write exp(x) for e**x",
    "h": "h enters with the input, B (u + h); what it is stands in uncertainty.h",
    **dict.fromkeys(("null", "None", "none", "nil"), "write 0 if zero is meant"),
    "log10": "write log(x)/log(10)",
    "log2": "write log(x)/log(2)",
    "log1p": "write log(1 + x)",
    "expm1": "write exp(x) - 1",
    **dict.fromkeys(("asinh", "arcsinh"), "write log(x + sqrt(x**2 + 1))"),
    **dict.fromkeys(("acosh", "arccosh"), "write log(x + sqrt(x**2 - 1))"),
    **dict.fromkeys(("atanh", "arctanh"), "write log((1 + x)/(1 - x))/2"),
    "sec": "write 1/cos(x)",
    "csc": "write 1/sin(x)",
    "cot": "write cos(x)/sin(x)",
    "sech": "write 1/cosh(x)",
    "csch": "write 1/sinh(x)",
    "coth": "write cosh(x)/sinh(x)",
    "sinc": "write sin(x)/x, where x is not 0",
    "sind": "write sin(x*pi/180)",
    "cosd": "write cos(x*pi/180)",
    "tand": "write tan(x*pi/180)",
    **dict.fromkeys(("pow", "power"), "write x**2; exponents are whole numbers"),
    **dict.fromkeys(("sqr", "square"), "write x**2"),
    "cbrt": "write exp(log(x)/3), for x > 0; at 0 a cube root is not differentiable",
    "hypot": "write sqrt(x**2 + y**2) where it is not 0, or norm(x, y) in h",
    "fabs": "write abs(x), in h only; elsewhere sqrt(x**2 + 0.01) may serve",
    **dict.fromkeys(("erf", "erfc"), "tanh(1.2*x) is within 0.02 of erf(x)"),
    **dict.fromkeys(
        ("dot", "diff", "der", "ddt"), "f lists the derivatives of the states; an expression contains none"
    ),
    **dict.fromkeys(
        ("rand", "random", "randn", "noise", "white_noise"),
        "nothing is random: bound it in uncertainty.bounds",
    ),
    **dict.fromkeys(("time", "tt"), "the time is t, in h and in plans"),
}
"""What to write instead, by the word."""
