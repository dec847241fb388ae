"""The plan of crane.yaml: three metres in eight seconds, the load at rest at both ends. Writes crane.csv."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

M, m, l, g, d, c = 50, 20, 2, 9.81, 40, 4
T = 8


def force(t, p):
    """The force of the drive, a few sines."""
    return sum(part * np.sin((k + 1) * np.pi * t / T) for k, part in enumerate(p))


def speed(t, x, p):
    """x' of the crane."""
    _, th, v, w = x
    D, s, k = M + m * np.sin(th) ** 2, np.sin(th), np.cos(th)
    F = force(t, p) - d * v
    return [
        v,
        w,
        (F + m * s * (l * w**2 + g * k) + c / l * w * k) / D,
        -((F + m * l * w**2 * s) * k + (M + m) * g * s + (M + m) * c / (m * l) * w) / (l * D),
    ]


def missed(p):
    """What the end is away from the target."""
    return solve_ivp(speed, (0, T), np.zeros(4), args=(p,), rtol=1e-9, atol=1e-9).y[:, -1] - [3, 0, 0, 0]


p = least_squares(missed, [20, 20, 0, 0, 0, 0]).x
t = np.linspace(0, T, 161)
x = solve_ivp(speed, (0, T), np.zeros(4), t_eval=t, args=(p,), rtol=1e-10, atol=1e-10).y
rows = np.column_stack([t, *x, force(t, p)])
np.savetxt("crane.csv", rows, delimiter=",", header="t,x,th,v,w,F", comments="")
