"""Theorem H-G against geodesics in closed form: flat metrics in coordinates that are not, M = J'J, J = d psi/dx.

psi = (x1 + k sin(x2), x2 + c x1^2/2): geodesics are lines in psi, and the columns of J^-1 are Killing fields.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest


@dataclass
class Warped:
    """A flat metric on the ball |x| <= rho, every function of points (N, 2)."""

    k: float
    c: float
    w: float

    def psi(self, x):
        return np.stack(
            [x[:, 0] + self.k * np.sin(self.w * x[:, 1]), x[:, 1] + self.c * x[:, 0] ** 2 / 2], axis=1
        )

    def J(self, x):
        one = np.ones(len(x))
        return np.array(
            [[one, self.k * self.w * np.cos(self.w * x[:, 1])], [self.c * x[:, 0], one]]
        ).transpose(2, 0, 1)

    def bent(self, x, v, u):
        """The second derivative of psi along v and u."""
        return np.stack(
            [
                -self.k * self.w**2 * np.sin(self.w * x[:, 1]) * v[:, 1] * u[:, 1],
                self.c * v[:, 0] * u[:, 0],
            ],
            axis=1,
        )

    def symbols(self, x, v, u):
        """Gamma(v, u) = J^-1 psi_xx(v, u)."""
        return np.linalg.solve(self.J(x), self.bent(x, v, u)[..., None])[..., 0]

    def bounds(self, rho):
        """G, L_G, a, A over the ball, sampled: no more than they are, so that the test is the sharper."""
        generator, e = np.random.default_rng(3), 1e-5
        x, v, u, z = (unit(generator.normal(size=(4000, 2))) for _ in range(4))
        x = x * rho * generator.uniform(size=(4000, 1)) ** 0.5
        u[::2] = v[::2]
        G = np.linalg.norm(self.symbols(x, v, u), axis=1).max()
        L = np.linalg.norm(self.symbols(x + e * z, v, u) - self.symbols(x - e * z, v, u), axis=1).max()
        s = np.linalg.svd(self.J(x), compute_uv=False)
        return G, L / (2 * e), s.min() ** 2, s.max() ** 2


def unit(x):
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def swept(m, y, nodes, sweeps):
    """Speeds at both ends of the computed geodesic from 0 to y, (H.39)."""
    h, w = 1 / nodes, np.zeros((nodes, *y.shape))
    for sweep in range(sweeps + 1):
        x, v = np.zeros_like(y), np.zeros_like(y)
        for each in w:
            x, v = x + h * v + h**2 / 2 * each, v + h * each
        first = y - x
        if sweep == sweeps:
            return first, first + v
        x, v, new = np.zeros_like(y), first, np.zeros_like(w)
        for i, each in enumerate(w):
            speed = v + h / 2 * each
            new[i] = -m.symbols(x + h / 2 * v + h**2 / 8 * each, speed, speed)
            x, v = x + h * v + h**2 / 2 * each, v + h * each
        w = new
    raise AssertionError


def dot(a, b):
    return np.sum(a * b, axis=-1)


def times(A, x):
    return np.einsum("nij,nj->ni", A, x)


@pytest.mark.parametrize(("nodes", "sweeps"), [(1, 1), (2, 2), (8, 1), (4, 6)])
def test_computed_geodesics_lose_no_more_than_is_said(nodes, sweeps):
    generator, worst = np.random.default_rng(nodes), dict.fromkeys(("ends", "d", "law", "beyond"), 0.0)
    for k, c, w in ((0.3, 0.4, 1.0), (0.1, 0.1, 3.0), (0.0, 0.9, 1.0), (0.5, 0.0, 1.5)):
        m, rho, N = Warped(k, c, w), 0.5, 300
        G, L, a, A = m.bounds(rho)
        y = (
            unit(generator.normal(size=(N, 2)))
            * 0.48
            * np.sqrt(a / A)
            * 10 ** generator.uniform(-1, 0, (N, 1))
        )
        origin = np.zeros_like(y)
        line = m.psi(y)
        d = np.linalg.norm(line, axis=1)
        r = d / np.sqrt(a)
        J0, J1 = m.J(origin), m.J(y)
        asked = (G * r <= 0.4) & (G * r <= np.sqrt(a / A)) & (r <= rho)
        assert asked.mean() > 0.5
        # drift X at both ends, whatever it is; B = J^-1 b
        X0 = generator.normal(size=(N, 2)) * generator.choice([0, 1, 4], size=(N, 1))
        X1 = X0 + generator.normal(size=(N, 2)) * d[:, None]
        rate, b = generator.uniform(0.2, 3, size=N), unit(generator.normal(size=(N, 2)))
        Phi = np.maximum(np.linalg.norm(times(J0, X0), axis=1), np.linalg.norm(times(J1, X1), axis=1))
        alpha = dot(line, times(J1, X1)) - dot(line, times(J0, X0)) + rate * d**2
        inner, beta = dot(line, b), np.ones(N)
        du = np.maximum(alpha, 0) / (d * np.abs(inner)) * generator.choice([1, 1.5], size=N) + 0.01
        first, last = swept(m, y, nodes, sweeps)
        p0, p1 = times(J0, first), times(J1, last)  # what they are in psi
        found = np.linalg.norm(p1, axis=1)
        alpha_ = dot(p1, times(J1, X1)) - dot(p0, times(J0, X0)) + rate * found**2
        c_ = dot(p0, b)
        kappa = -np.sign(c_) * np.minimum(np.maximum(alpha_, 0) / np.abs(c_), du * found)
        held = np.clip(kappa, -du * d, du * d)
        g, h = G * r, 1 / nodes
        q, between = L * r**2 / 8 + g * (2 + g) / 2, (1 + h**2) * h / 4 * (L + 2 * G**2) * r**3
        e = q**sweeps * G * r**2 + between * sum(q**i for i in range(sweeps + 1))
        off = np.sqrt(A) * e
        loss = off * (Phi + rate * (d + off / 4) + beta * du * (2 * d + off / 2))
        exact = np.linalg.solve(J0, line[..., None])[..., 0], np.linalg.solve(J1, line[..., None])[..., 0]
        ends = np.maximum(np.linalg.norm(first - exact[0], axis=1), np.linalg.norm(last - exact[1], axis=1))
        shares = {
            "ends": ends / (e / 2),
            "d": np.abs(found - d) / (off / 2),
            "law": (alpha + inner * held) / loss,
            "beyond": (np.abs(kappa) - du * d) / (du * off / 2),
        }
        worst = {name: max(worst[name], float(shares[name][asked].max())) for name in shares}
    assert all(share <= 1 for share in worst.values()), worst
    assert worst["ends"] > 0.03  # it is no bound of something else
