"""What belongs to one certificate: sizes, tables, limits and the plan, as a header in C and in a text for people.

Tables and limits are written in hexadecimal digits, exactly as they are. Limits are numbers of the arithmetic that the
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

from tubecert.controller.plans import Planned, planned, question, refused
from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.record import Certificate
from tubecert.verdict import Verdict

HOME: Final = Path(__file__).parent
_OWN: Final = ("controller_data.h", "README.txt")
_ROUNDING: Final = Fraction(1, 2**21)  # of |x| and a width: more than rounding makes of a sample


@dataclass(frozen=True, slots=True, kw_only=True)
class Data:
    """A controller: its plan and arrays by the names that they have in C; times in s.

    `tables` as in `sampled_loop.record.Tables`; `limits`: `reach` (n,), how far from the plan a sample may lie,
    `memory` (z,), `low` and `high` (m,).
    """

    name: str
    hash: str
    real: type[np.floating[Any]]
    sample_time: Fraction
    delay: Fraction
    tables: Mapping[str, Array]
    limits: Mapping[str, Array]
    plan: Planned

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of states, inputs, and states of the controller."""
        m, n = self.tables["N"].shape
        return n, m, len(self.tables["F"])

    @property
    def work(self) -> int:
        """Multiply-adds of a sample; the tables have as many numbers."""
        return sum(table.size for table in self.tables.values())


def data_of(certificate: Certificate) -> Data:
    """The controller of a certificate; raises TC710 if it has none, or does not say `certified`."""
    result, tables = certificate.result, certificate.result.controller
    if result.verdict is not Verdict.CERTIFIED:
        error = refused(f"the certificate says {result.verdict}", "tubecert report tells what is missing")
        error.exit_code = result.verdict.exit_code
        raise error
    if tables is None or not (tables.M.any() or tables.N.any()):
        raise refused("the certificate has no controller", "certify with `controller: auto`")
    spec = question(result)
    machine = spec.hardware
    assert machine is not None
    real: type[np.floating[Any]] = np.float32 if machine.arithmetic == "single" else np.float64
    noise = machine.noise if isinstance(machine.noise, tuple) else (machine.noise,) * len(spec.states)
    widths = (max(stage.half_widths[name] for stage in result.tube) for name in spec.states)
    off = [(w + n, max(map(abs, box))) for w, n, box in zip(widths, noise, spec.safe_set, strict=True)]
    ranges = {use.input: use.range for use in result.inputs}
    limits = {
        "reach": (1, [far + _ROUNDING * (far + size) for far, size in off]),
        "memory": (-1, [max(own) for own in zip(*(stage.memory for stage in result.tube), strict=True)]),
        "low": (1, [ranges[name][0] for name in spec.inputs]),
        "high": (-1, [ranges[name][1] for name in spec.inputs]),
    }
    return Data(
        name=spec.name,
        hash=certificate.hash,
        real=real,
        sample_time=machine.sample_time,
        delay=machine.delayed,
        tables={name: getattr(tables, name) for name in "FGMN"},
        limits={name: np.array([_next(q, side, real) for q in own]) for name, (side, own) in limits.items()},
        plan=planned(result, spec, machine),
    )


def _next(q: Fraction, side: int, real: type[np.floating[Any]]) -> float:
    """The number of the arithmetic next to an exact one: not below it (side 1), or not above it (-1)."""
    near = real(float(q))
    inside = side * Fraction(float(near)) >= side * q
    return float(near if inside else np.nextafter(near, real(side * np.inf)))


def texts(data: Data) -> dict[str, str]:
    """The files that belong to the certificate, by their names."""
    (n, m, z), plan = data.sizes, data.plan
    over = f"after {plan.steps} samples: the last command is held from then on, and STATUS_END is told"
    matrices = {**data.tables, "xs": plan.rows[0], "us": plan.rows[1]}
    places: dict[str, object] = {
        **{name: "{" + ",\n".join(map(_row, own.tolist() or [[]])) + "}" for name, own in matrices.items()},
        **{name: _row(own.tolist()) for name, own in data.limits.items()},
        **{"name": data.name, "hash": data.hash, "n": n, "m": m, "z": z, "work": data.work},
        **{"period": float(data.sample_time), "delay": float(data.delay), "lead": float(plan.lead)},
        **{"kind": plan.kind, "steps": plan.steps, "after": plan.after, "rows": len(plan.rows[0])},
        **{"formula_x": plan.formula[0], "formula_u": plan.formula[1]},
        "real": "float" if data.real is np.float32 else "double",
        "handed": "xs, us, " if plan.at is None else "",
        "end": over if plan.after == plan.steps else "never",
    }
    return {name: Template((HOME / f"{name}.in").read_text("utf-8")).substitute(places) for name in _OWN}


def _row(values: Sequence[float]) -> str:
    """An array of C; a 0 where it would be empty, which C does not allow."""
    return "{" + ", ".join(x.hex() for x in values or [0.0]) + "}"
