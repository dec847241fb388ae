"""What belongs to one certificate, as a header in C: sizes, tables, limits, the plan, samples of the self-test.

Tables and plan are numbers of single precision, written digit for digit; limits are numbers of the arithmetic that the
controller computes in, rounded to the side on which nothing that is proven is cut off, and nothing else let through.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from string import Template
from typing import Any, Final

import numpy as np

from tubecert.controller.plans import Planned, braces, literal, planned, question, refused
from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.record import Certificate, InputUse, Result
from tubecert.spec import Spec
from tubecert.verdict import Verdict

HOME: Final = Path(__file__).parent
_ROUNDING: Final = (
    2.0**-20
)  # of |x*| and of the width: more than float arithmetic makes of a sample that is right
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
    """The controller of a certificate; raises TC710 if it has none, TC711 if it does not say `certified`."""
    result, tables = certificate.result, certificate.result.controller
    if result.verdict is not Verdict.CERTIFIED:
        error = refused(
            f"the certificate says {result.verdict}, and only what is certified is exported",
            "tubecert report says what is missing",
        )
        error.exit_code = result.verdict.exit_code
        raise error
    if tables is None or not (tables.M.value.any() or tables.N.value.any()):
        raise refused("the certificate has no controller", "certify with `controller: auto`")
    spec = question(result)
    assert spec.hardware is not None
    real: type[np.floating[Any]] = np.float32 if spec.hardware.arithmetic == "single" else np.float64
    plan = planned(result, spec, real)
    return Data(
        name=spec.name,
        hash=certificate.hash,
        real=real,
        sample_time=spec.hardware.sample_time,
        delay=spec.hardware.delayed,
        tables={name: getattr(tables, name).value for name in "FGMN"},
        reach=_reach(result, spec, plan, real),
        memory=_ends(
            [max(own) for own in zip(*(stage.memory for stage in result.tube), strict=True)], real, -1
        ),
        low=_ends([own.range[0] for own in _inputs(result, spec)], real, 1),
        high=_ends([own.range[1] for own in _inputs(result, spec)], real, -1),
        plan=plan,
    )


def _inputs(result: Result, spec: Spec) -> list[InputUse]:
    own = {use.input: use for use in result.inputs}
    return [own[name] for name in spec.inputs]


def _reach(result: Result, spec: Spec, plan: Planned, real: type[np.floating[Any]]) -> Array:
    """The widest half-width and the noise of each state, and what rounding may add to them."""
    assert spec.hardware is not None
    noise = spec.hardware.noise
    each = noise if isinstance(noise, tuple) else (noise,) * len(spec.states)
    widths = [max(stage.half_widths[name] for stage in result.tube) for name in spec.states]
    more = Fraction(_ROUNDING)
    reach = [
        (w + own) * (1 + more) + more * Fraction(x)
        for w, own, x in zip(widths, each, plan.sizes.tolist(), strict=True)
    ]
    return _ends(reach, real, 1)


def _ends(values: list[Fraction], real: type[np.floating[Any]], side: int) -> Array:
    """Numbers of the arithmetic next to exact ones: not below them (side 1), or not above them (-1)."""
    found = np.array([real(float(q)) for q in values], dtype=float)
    wrong = np.array(
        [side * Fraction(x) < side * q for x, q in zip(found.tolist(), values, strict=True)], dtype=bool
    )
    return np.where(wrong, np.nextafter(found.astype(real), real(side * np.inf)), found).astype(float)


def header(data: Data) -> str:
    """The text of `controller_data.h`, but for its first line."""
    (n, m, z), kind, plan = data.sizes, "float" if data.real is np.float32 else "double", data.plan
    samples = np.arange(_SAMPLES) * (min(plan.steps, _FIRST) - 1) // (_SAMPLES - 1)
    part = ((7 * np.arange(_SAMPLES)[:, None] + 5 * np.arange(n + m + z)) % 13 - 6) / 8
    xs, us = (part[:, :n], part[:, n : n + m]) if plan.at is None else plan.at(samples.tolist())
    y = (xs + part[:, :n] * data.reach).astype(data.real).astype(float)
    zeta = (part[:, n + m :] * data.memory).astype(data.real).astype(float)
    exact = [exact_step(data, *own) for own in zip(zeta, y, xs, us, strict=True)]
    u, later = (np.array([[float(q) for q in step[i]] for step in exact]) for i in (0, 1))
    tables = {name: braces("float", own) for name, own in data.tables.items()}
    limits = {name: braces(kind, getattr(data, name)) for name in ("reach", "memory", "low", "high")}
    tests = {name: braces(kind, own) for name, own in {"zeta": zeta, "y": y, "xs": xs, "us": us}.items()}
    tests |= {"u": braces("double", u), "next": braces("double", later)}
    template = Template((HOME / "controller_data.h.in").read_text("utf-8"))
    return template.substitute(
        tables | limits | tests,
        name=data.name,
        real=kind,
        hash=data.hash,
        **{
            "n": n,
            "m": m,
            "z": z,
            "steps": plan.steps,
            "after": plan.after,
            "kind": plan.kind,
            "plan": plan.text,
        },
        period=literal("double", float(data.sample_time)),
        delay=literal("double", float(data.delay)),
        tests=_SAMPLES,
        k=f"{{{', '.join(f'{k}u' for k in samples)}}}",
    )


def exact_step(
    data: Data, zeta: Array, y: Array, xs: Array, us: Array
) -> tuple[list[Fraction], list[Fraction]]:
    """The inputs and the next zeta in exact arithmetic, for a sample that is within reach."""
    dy = [Fraction(a) - Fraction(b) for a, b in zip(y.tolist(), xs.tolist(), strict=True)]
    seen = [*map(Fraction, zeta.tolist()), *dy]

    def of(left: str, right: str) -> list[Fraction]:
        rows = np.hstack([data.tables[left], data.tables[right]]).tolist()
        return [sum((Fraction(c) * v for c, v in zip(row, seen, strict=True)), Fraction(0)) for row in rows]

    def within(values: Iterable[Fraction], low: Array, high: Array) -> list[Fraction]:
        ends = zip(values, low.tolist(), high.tolist(), strict=True)
        return [min(max(value, Fraction(least)), Fraction(most)) for value, least, most in ends]

    u = [Fraction(a) + b for a, b in zip(us.tolist(), of("M", "N"), strict=True)]
    return within(u, data.low, data.high), within(of("F", "G"), -data.memory, data.memory)
