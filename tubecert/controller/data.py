"""What belongs to one certificate, as a header in C: sizes, tables, limits, the plan, samples of the self-test.

Tables and plan are numbers of single precision, written digit for digit; limits are numbers of the arithmetic that the
controller computes in, rounded to the side on which nothing that is proven is cut off, and nothing else let through.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from string import Template
from typing import Any, Final

import numpy as np

from tubecert.controller.plans import Planned, braces, literal, planned, question, refused
from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.record import Certificate
from tubecert.verdict import Verdict

HOME: Final = Path(__file__).parent
_ROUNDING: Final = Fraction(
    1, 2**20
)  # of |x*| and a width: more than rounding adds to a sample that is right
_FAR: Final = 64  # as in controller.c
_SAMPLES: Final = 12  # of the self-test,
_FIRST: Final = 100_000  # among so many


@dataclass(frozen=True, slots=True, kw_only=True)
class Data:
    """A controller: tables (see `sampled_loop.record.Tables`), its limits, its plan; times in s.

    `reach` (n,): how far from the plan a sample may lie; `memory` (z,), `low` and `high` (m,).
    """

    name: str
    hash: str
    real: type[np.floating[Any]]
    sample_time: Fraction
    delay: Fraction
    tables: Mapping[str, Array]
    reach: Array
    memory: Array
    low: Array
    high: Array
    plan: Planned

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of states, inputs, and states of the controller."""
        return len(self.reach), len(self.low), len(self.memory)

    @property
    def work(self) -> int:
        """Multiply-adds of a sample; the tables have as many numbers."""
        n, m, z = self.sizes
        return (z + m) * (z + n)


def data_of(certificate: Certificate) -> Data:
    """The controller of a certificate; raises TC710 if it has none, or does not say `certified`."""
    result, tables = certificate.result, certificate.result.controller
    if result.verdict is not Verdict.CERTIFIED:
        error = refused(f"the certificate says {result.verdict}", "tubecert report tells what is missing")
        error.exit_code = result.verdict.exit_code
        raise error
    if tables is None or not (tables.M.value.any() or tables.N.value.any()):
        raise refused("the certificate has no controller", "certify with `controller: auto`")
    spec = question(result)
    machine, names = spec.hardware, spec.states
    assert machine is not None
    real: type[np.floating[Any]] = np.float32 if machine.arithmetic == "single" else np.float64
    plan = planned(result, spec, real)
    noise = machine.noise if isinstance(machine.noise, tuple) else (machine.noise,) * len(names)
    widths = (max(stage.half_widths[name] for stage in result.tube) for name in names)
    sides = zip(widths, noise, map(Fraction, plan.sizes.tolist()), strict=True)
    ranges = {use.input: use.range for use in result.inputs}
    memory = zip(*(stage.memory for stage in result.tube), strict=True)
    return Data(
        name=spec.name,
        hash=certificate.hash,
        real=real,
        sample_time=machine.sample_time,
        delay=machine.delayed,
        tables={name: getattr(tables, name).value for name in "FGMN"},
        reach=_next([w + n + _ROUNDING * (w + n + x) for w, n, x in sides], real, 1),
        memory=_next([max(own) for own in memory], real, -1),
        low=_next([ranges[name][0] for name in spec.inputs], real, 1),
        high=_next([ranges[name][1] for name in spec.inputs], real, -1),
        plan=plan,
    )


def _next(values: Sequence[Fraction], real: type[np.floating[Any]], side: int) -> Array:
    """Numbers of the arithmetic next to exact ones: not below them (side 1), or not above them (-1)."""
    near = [real(float(q)) for q in values]
    own = [
        x if side * Fraction(float(x)) >= side * q else np.nextafter(x, real(side * np.inf))
        for x, q in zip(near, values, strict=True)
    ]
    return np.array(own, dtype=float)


def header(data: Data) -> str:
    """The text of `controller_data.h`, but for its first line."""
    (n, m, z), kind, plan = data.sizes, "float" if data.real is np.float32 else "double", data.plan
    samples = np.arange(_SAMPLES) * (min(plan.steps, _FIRST) - 1) // (_SAMPLES - 1)
    part = ((7 * np.arange(_SAMPLES)[:, None] + 5 * np.arange(n + m + z)) % 13 - 6) / 64  # no limit acts
    xs, us = (part[:, :n], part[:, n : n + m]) if plan.at is None else plan.at(samples.tolist())
    y = (xs + part[:, :n] * data.reach).astype(data.real).astype(float)
    zeta = (part[:, n + m :] * data.memory).astype(data.real).astype(float)
    exact = [exact_step(data, *own) for own in zip(zeta, y, xs, us, strict=True)]
    u, later = (np.array([[float(q) for q in step[i]] for step in exact]) for i in (0, 1))
    tables = {name: braces("float", own) for name, own in data.tables.items()}
    limits = {name: braces(kind, getattr(data, name)) for name in ("reach", "memory", "low", "high")}
    tests = {name: braces(kind, own) for name, own in {"zeta": zeta, "y": y, "xs": xs, "us": us}.items()}
    tests |= {"u": braces("double", u), "next": braces("double", later)}
    sizes = {"n": n, "m": m, "z": z, "tests": _SAMPLES, "steps": plan.steps, "after": plan.after}
    places: dict[str, Any] = {**tables, **limits, **tests, **sizes}
    return Template((HOME / "controller_data.h.in").read_text("utf-8")).substitute(
        places,
        name=data.name,
        hash=data.hash,
        real=kind,
        kind=plan.kind,
        plan=plan.text,
        period=literal("double", float(data.sample_time)),
        delay=literal("double", float(data.delay)),
        k=f"{{{', '.join(f'{k}u' for k in samples)}}}",
    )


def exact_step(
    data: Data, zeta: Array, y: Array, xs: Array, us: Array
) -> tuple[list[Fraction], list[Fraction]]:
    """The inputs and the next zeta in exact arithmetic, for a sample within reach and a zeta within its memory."""
    dy = [Fraction(a) - Fraction(b) for a, b in zip(y.tolist(), xs.tolist(), strict=True)]
    seen = [*map(Fraction, zeta.tolist()), *dy]

    def of(left: str, right: str) -> list[Fraction]:
        rows = np.hstack([data.tables[left], data.tables[right]]).tolist()
        return [sum((Fraction(c) * v for c, v in zip(row, seen, strict=True)), Fraction(0)) for row in rows]

    planned = zip(
        map(Fraction, us.tolist()), of("M", "N"), data.low.tolist(), data.high.tolist(), strict=True
    )
    most = (_FAR * Fraction(x) for x in data.memory.tolist())
    later = [min(max(v, -x), x) for v, x in zip(of("F", "G"), most, strict=True)]
    return [min(max(u + v, Fraction(a)), Fraction(b)) for u, v, a, b in planned], later
