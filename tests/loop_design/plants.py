"""Plants that tables are designed for: the smallest, and two that fly."""

import numpy as np

from tubecert.loop_design.plant import Plant


def plant(A, B, *, H=None, E=None, rho=None, **given):
    """Without what is not given: no signals, no limits, no remainder."""
    A, B = np.array(A, float), np.array(B, float)
    n, m = B.shape
    H = np.array(B if H is None else H, float).reshape(n, -1)
    E = np.zeros((n, 0)) if E is None else np.array(E, float).reshape(n, -1)
    r, k = H.shape[1], E.shape[1]
    sizes = {"noise": n, "magnitude": r, "rate": r, "wind": k, "start": n, "eta_start": r}
    sizes |= {"room": m, "wishes": n, "space": n}
    usual = {"room": np.inf, "wishes": np.inf, "space": np.inf}
    arrays = {name: np.zeros(size) + given.pop(name, usual.get(name, 0.0)) for name, size in sizes.items()}
    E = E * arrays.pop("wind")
    units = tuple(np.ones(size) for size in (n, m, r))
    rest = {"sample_time": 1.0, "delay": 0.0, "noise_ball": False, "wind_ball": False} | given
    return Plant(
        A=A, B=B, H=H, E=E, units=units, remainder=rho or (lambda W, U: np.zeros(n + m)), **arrays, **rest
    )


def scalar(noise, **given):
    return plant([[0]], [[1]], noise=noise, rate=1.0, magnitude=1e6, **given)


def double(noise=(1.0, 1.0), delay=0.0, **given):
    given = {"rate": 1.0, "magnitude": 1e6} | given
    return plant([[0, 1], [0, 0]], [[0], [1]], noise=noise, delay=delay, **given)


def pvtol(noise):
    """A planar quadrotor about hovering, 250 Hz, with a bound of its second order terms."""
    g, mass, inertia = 9.81, 0.486, 0.00383
    A = np.zeros((6, 6))
    A[0, 3] = A[1, 4] = A[2, 5] = 1
    A[3, 2] = -g
    B = np.zeros((6, 2))
    B[4, 0], B[5, 1] = 1 / mass, 0.01 / inertia

    def rho(W, U):
        _, _, f, x, z, w = W
        bent = [x * f**2 / 2 + z * f, x * f + z * f**2 / 2, 0, z * w + g * f**3 / 6, x * w + g * f**2 / 2, 0]
        return np.array([*bent, 0, 0])

    bounds = {"magnitude": [0.02, 0.1], "rate": [0.02, 0.1], "wind": 0.01, "room": [1.75, 2.0]}
    E = np.eye(6)[:, 3:5]
    return plant(A, B, E=E, rho=rho, sample_time=0.004, noise=noise, wind_ball=True, **bounds)
