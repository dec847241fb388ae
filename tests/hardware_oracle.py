"""Theorem H written down once more, from its statement, in mpmath: an oracle for the formulas of the package."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import mpmath as mp

mp.mp.dps = 40


@dataclass
class Given:
    """Numbers by the names of the theorem; what is not named is 0."""

    values: dict[str, Any] = field(default_factory=dict)

    def __getattr__(self, name: str) -> Any:
        return mp.mpf(0) if name not in self.values else self.values[name]


def theorem(g: Given) -> dict[str, Any]:
    """Every number of the statement. `g.np` None: without prediction; `g.omega` None: without a filter."""
    q: dict[str, Any] = {}
    Ts, tau, Tf, lam = g.Ts, g.tau, g.Tf, g.lam
    th = mp.mpf(1) if g.omega is None else 1 - mp.exp(-g.omega * Ts)
    predicts = g.np is not None
    nbar, n_M = g.nu * g.n_E, g.nu * g.n_M
    e_fb, n_fb = (g.np, max(n_M, mp.sqrt(g.A) * g.np)) if predicts else (nbar, n_M)
    acts, more = 1 + g.D_b, 1 / (1 - g.D_b)
    kb = more * g.du * (g.dhat + n_fb)
    r_g, r_k = geodesics(g, g.dhat + n_fb) if g.nodes else (mp.mpf(0), mp.mpf(0))
    ups = g.r_u + r_k + (min(2 * g.Dus, g.Lus * (max(Ts, Tf) + tau)) if g.held else mp.mpf(0))
    s1 = g.Dht + g.Dhx * g.Y
    b0 = min(g.DBp * g.DBx, g.DBpx * g.DB)
    step = g.Y * Ts / 2 + nbar
    e_s = (
        s1 * Ts / 2
        + b0 * (g.Dus + acts * (ups + kb + g.R + g.Dh)) * step
        + g.D_pf * (g.Y * Ts / 4 + nbar)
        + g.D_pt * Ts / 4
        + (g.eps_w + g.DBpx * g.D_E * step) * g.wbar
        + g.DBpx * g.D_r * step
        + g.D_b * (kb + ups + g.S + g.N + s1 * (Ts / 2 + tau))
        + g.r_q
    )
    q["bias"] = (1 - th) / th * s1 * Ts + e_s
    q["ripple"] = 2 * th / Ts * g.n_B * g.nu + g.DBpx * (g.Y + 2 * nbar / Ts) * nbar
    if g.drift is not None:
        q["ripple"] = min(q["ripple"], g.n_B * g.drift)
    H1 = min(g.Dh, g.H0 + s1 * (Ts + tau))
    X = min(g.Dh + g.R, max(H1, g.S + max(g.H0 - g.S, 0) + g.N + s1 * (Ts + tau)))
    q["speed"] = g.phi + g.D_r + g.DB * acts * (kb + ups + X) + g.D_E * g.wbar
    if predicts:
        Dp = g.Dfx + g.Dbx * (g.Dus + ups + kb)
        grown = mp.exp(Dp * tau)
        q["prediction"] = (
            nbar * grown
            + (g.DB * (acts * X + g.D_b * (kb + ups) + g.r_u + r_k) + g.D_E * g.wbar + g.D_r)
            * (grown - 1)
            / Dp
            + g.r_p
        )
    # (H.8), (H.9)
    LG, GG = g.L_G * g.rho**2, 2 * g.G * g.rho
    chi = 1 - g.G * g.rho - LG / 8
    j1, j0 = 1 + (LG + GG) / (2 * chi), 1 + (LG + GG) / (8 * chi)
    big = max(g.Y, g.Ystar)
    V = g.phi_rel + g.DB * acts * (kb + ups + X) + g.D_E * g.wbar + g.delta_p + g.D_r
    Q = (LG * big + GG * V) / chi
    delta = g.delta + g.beta_r
    forced = g.beta * acts * (kb + ups + X) + g.beta_w * g.wbar + delta
    V_M, V_J = mp.sqrt(g.A) * (V + Q / 2), big + Q / 8
    V_d = (g.D_F / 2 + lam) * g.dhat + forced
    if g.flat:
        inner = min(g.phi_relM, g.D_A * g.dhat) + forced
        V_M, V_d = min(V_M, inner), min(V_d, inner)
    du = acts * more * g.du
    K = g.D_F + g.beta * du
    wide = g.dhat + n_fb
    ell0 = K * (n_fb + (j1 - 1) * mp.sqrt(g.A) * e_fb) + g.D_Fx / 2 * wide * j0 * e_fb
    ell1 = K * V_M + g.D_Fx / 2 * wide * V_J + du * g.D_cx * g.Ystar * g.dhat
    if g.covariant:
        kr = g.K_R * g.a * g.rho**2
        chi_c = 1 - kr / 8
        gust = min(mp.sqrt(g.A) * g.D_E, g.beta_w * max(1, g.beta_O / g.beta)) * g.wbar
        V_0 = g.D_nX * g.dhat + g.beta_O * acts * (kb + ups + X) + gust + delta
        Y_M = g.phi_M + g.beta_O * acts * (kb + ups + X) + gust + delta
        Qc = kr * Y_M / chi_c
        c0 = K * (1 + kr / (2 * chi_c)) * n_fb + g.D_nF / 2 * wide * (1 + kr / (8 * chi_c)) * n_fb
        c1 = K * (V_0 + Qc / 2) + g.D_nF / 2 * wide * (Y_M + Qc / 8) + du * g.D_nb * Y_M * g.dhat
        if chi_c > 0:
            ell0, ell1 = min(ell0, c0), min(ell1, c1)
    ell0 += r_g
    ell1 += g.D_Ft / 2 * wide
    if g.nodes:
        q["length"] = r_k / g.du
        bend = g.G * (g.dhat + n_fb) / mp.sqrt(g.a)
        q["within"] = min(2 - 5 * bend, 1 - bend * mp.sqrt(g.A / g.a))
    q |= {
        "chi": chi,
        "ell0": ell0,
        "ell1": ell1,
        "V_d": V_d,
        "kb": kb,
        "ups": ups,
        "X": X,
        "H1": H1,
        "s1": s1,
    }
    # (H.12)
    young, old = (mp.mpf(0), Tf) if predicts else (tau, Tf + tau)
    first = max(Tf, tau) if predicts else Tf + tau
    beta = acts * g.beta
    base = delta + beta * ups + g.beta_w * g.wbar + g.r_a / g.f0

    def ell(age: Any) -> Any:
        return ell0 + ell1 * age

    def mu(T: Any) -> Any:
        return T / (1 - mp.exp(-lam * T)) - 1 / lam

    delta_1 = max(lam * g.f0, base + ell(first) * (1 + (V_d * first + n_fb) / g.f0))
    delta_2 = max(lam * g.f0, base + ell(young) + ell(old) * (V_d * old + n_fb) / g.f0)
    t_a = max(Ts, Tf) + tau
    left = mp.exp(-lam * t_a)
    xi = X if Tf > Ts else H1
    d1 = left * max(g.d0, g.f0) + (beta * xi + delta_1) * (1 - left) / lam
    slow, fast = max(Ts, Tf), min(Ts, Tf)
    if not mp.almosteq(slow / fast, mp.nint(slow / fast), 1e-20):
        d1 += (ell1 * mu(Tf) if Tf < Ts else beta * s1 * mu(Ts)) / lam
    push = beta * (g.S + g.N + s1 * (tau + mu(Ts))) + delta_2 + ell1 * mu(Tf)
    q |= {
        "d1": d1,
        "t_a": t_a,
        "push": push,
        "extra": acts * max(g.H0 - g.S, 0),
        "delta_1": delta_1,
        "delta_2": delta_2,
    }
    q["ultimate"] = push / lam
    if omega_of(g) is not None:
        q["omega"] = omega_of(g)
    return q


def geodesics(g: Given, D: Any) -> tuple[Any, Any]:
    """r_g and r_k of (H.41), (H.42)."""
    r, h, J = D / mp.sqrt(g.a), mp.mpf(1) / g.nodes, g.sweeps
    q = g.L_G * r**2 / 8 + g.G * r * (2 + g.G * r) / 2
    b = (1 + h**2) * h / 4 * (g.L_G + 2 * g.G**2) * r**3
    e = q**J * g.G * r**2 + b * mp.fsum(q**i for i in range(J + 1))
    Phi = mp.sqrt(g.A) * (g.phi + g.D_r)
    if g.covariant:
        Phi = min(Phi, g.phi_M, mp.sqrt(g.A) * (g.Ystar + g.delta_p) + g.D_nX * D)
    w = mp.sqrt(g.A) * e
    return w / D * (Phi + g.lam * (D + w / 4) + g.beta * g.du * (2 * D + w / 2)), g.du * w / 2


def needed(g: Given) -> Any:
    """max(d0, f0, d1, sup D)."""
    q = theorem(g)
    forgets = Given(g.values | {"omega": q.get("omega")})
    return max(g.d0, g.f0, q["d1"], supremum(forgets, q["d1"], q["push"], q["extra"]))


def omega_of(g: Given) -> Any:
    """How fast the estimate forgets, (H.35): the larger root of r^2 = (1 - th) r + th D_b, once per sample."""
    if not g.D_b:
        return g.omega
    th = mp.mpf(1) if g.omega is None else 1 - mp.exp(-g.omega * g.Ts)
    r = max(mp.polyroots([1, -(1 - th), -th * g.D_b]))
    return -mp.log(r) / g.Ts


def supremum(g: Given, d1: Any, push: Any, extra: Any) -> Any:
    """sup over t of the solution of D' = -lam D + push + beta extra e^(-omega t), D(0) = d1, by a search over t."""
    A1 = push / g.lam
    if g.omega is None:
        return max(d1, A1)

    def D(t: Any) -> Any:
        if t == mp.inf:
            return A1
        alike = g.omega == g.lam
        K = (
            t * mp.exp(-g.lam * t)
            if alike
            else (mp.exp(-g.lam * t) - mp.exp(-g.omega * t)) / (g.omega - g.lam)
        )
        return A1 + (d1 - A1) * mp.exp(-g.lam * t) + g.beta * extra * K

    end = g.horizon
    times = [mp.mpf(2) ** (k / mp.mpf(4)) * mp.mpf("1e-6") for k in range(130)]
    times = [mp.mpf(0), *[t for t in times if end is None or t < end], mp.inf if end is None else end]
    k = max(range(len(times)), key=lambda i: D(times[i]))
    low, high = times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)]
    if high == mp.inf:
        return D(times[k])
    for _ in range(80):
        first, second = low + (high - low) / 3, high - (high - low) / 3
        low, high = (first, high) if D(first) < D(second) else (low, second)
    return max(D(times[k]), D(low))


def given(problem: Any, recipe: Any) -> Given:
    """The constants of a problem and the numbers of a recipe, each by its name in the theorem."""
    machine, c = problem.machine, problem.constants
    m = machine.constants

    def most(constant: Any) -> Any:
        return mp.mpf(0) if constant is None else mp.mpf(constant.above)

    def exact(value: Any) -> Any:
        return None if value is None else mp.mpf(value.numerator) / value.denominator

    values = {
        "a": mp.mpf(c.lower.below),
        "A": most(c.upper),
        "DB": most(c.B),
        "DBx": most(c.B_x),
        "Dbx": most(c.b_x),
        "DBp": most(c.B_pinv),
        "DBpx": most(c.B_pinv_x),
        "Dfx": most(c.f_x),
        "Dus": most(c.u_star),
        "Dh": most(c.h),
        "Dhx": most(c.h_x),
        "Dht": most(c.h_t),
        "H0": most(c.h_initial),
        "du": most(c.feedback_gain),
        "beta": most(c.metric_input_gain),
        "phi": most(c.drift_on_plan),
        "d0": most(c.initial_distance),
        "delta_p": most(c.plan_defect),
        "delta": most(c.plan_defect_metric),
        "lam": exact(problem.rate),
        "rho": exact(problem.rho),
        "horizon": exact(problem.horizon),
        "D_F": most(m.feedback_slope),
        "D_Fx": most(m.feedback_curvature),
        "D_cx": most(m.plan_tilt),
        "Ystar": most(m.plan_speed),
        "phi_rel": most(m.drift_difference),
        "phi_relM": most(m.drift_difference_metric),
        "D_A": most(m.drift_slope_metric),
        "flat": m.drift_slope_metric is not None,
        "D_pf": most(m.drift_explained),
        "D_Ft": most(m.feedback_drift) if m.feedback_drift else mp.mpf(0),
        "D_pt": most(m.drift_rate) if m.drift_rate else mp.mpf(0),
        "n_E": most(m.noise_size),
        "n_M": most(m.noise_metric),
        "n_B": most(m.noise_explained),
        "Lus": most(m.input_rate),
        "held": machine.asked.held,
        "G": most(m.symbols),
        "L_G": most(m.symbols_slope),
        "drift": exact(machine.drift),
        "Ts": exact(recipe.sample_time),
        "tau": exact(recipe.delay),
        "Tf": exact(recipe.feedback_time),
        "omega": exact(recipe.bandwidth),
        "nu": exact(recipe.noise),
        "wbar": exact(recipe.wind),
        "R": exact(recipe.clip_radius),
        "dhat": exact(recipe.level),
        "f0": exact(recipe.floor),
        "Y": exact(recipe.speed),
        "S": exact(recipe.bias),
        "N": exact(recipe.ripple),
        "np": exact(recipe.prediction),
    }
    if machine.asked.geodesic is not None:
        values |= {"nodes": machine.asked.geodesic.nodes, "sweeps": machine.asked.geodesic.sweeps}
    for lost in recipe.rounding:
        values |= {"r_a": exact(lost.feedback), "r_u": exact(lost.input)}
        values |= {"r_q": exact(lost.estimate), "r_p": exact(lost.prediction)}
    if problem.gain is not None:
        values["D_b"] = most(problem.gain.error)
    if problem.wind is not None:
        wind = problem.wind.constants
        values |= {"beta_w": most(wind.push), "D_E": most(wind.size), "eps_w": most(wind.explained)}
    if problem.residual is not None:
        values |= {"D_r": most(problem.residual.size), "beta_r": most(problem.residual.push)}
    if machine.covariant is not None:
        v = machine.covariant
        values |= {
            "covariant": True,
            "D_nX": most(v.drift_slope),
            "D_nF": most(v.form_slope),
            "D_nb": most(v.input_slope),
            "beta_O": most(v.input_gain),
            "phi_M": most(v.drift_metric),
            "K_R": most(v.curvature),
        }
    return Given(values)
