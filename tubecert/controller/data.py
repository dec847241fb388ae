"""What belongs to one certificate: sizes, tables, limits and the plan, as a header in C and in a text for people.

Tables and limits are written in hexadecimal digits, exactly as they are. Limits are numbers of the arithmetic that the
controller computes in, rounded to the side on which nothing that is proven is cut off, and nothing else let through.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from string import Template
from typing import Any, Final

import numpy as np

from tubecert.controller.plans import Planned, question, refused
from tubecert.sampled_loop.record import Certificate, Tables
from tubecert.verdict import Verdict

HOME: Final = Path(__file__).parent
_OWN: Final = ("controller_data.h", "README.txt")
_ROUNDING: Final = Fraction(1, 2**21)  # of |x| and a width: more than rounding makes of a sample


class Data:
    """A controller with the `name` of its specification: its plan, `tables`, and `limits` by the names that C has.

    `limits`: `reach` (n,), how far from the plan a sample may lie, `memory` (z,), `low` and `high` (m,), all `real`.
    `sizes`: numbers of states, inputs, and states of the controller. `work`: multiply-adds of a sample; the tables have
    as many numbers. `sample_time` and `delay` in s.
    """

    def __init__(self, certificate: Certificate, tables: Tables) -> None:
        result, (m, n), z = certificate.result, tables.N.shape, tables.size
        spec = question(result)
        machine, stages = spec.hardware, result.tube
        assert machine is not None
        self.name, self.hash = spec.name, certificate.hash
        self.tables, self.plan = tables, Planned(result, spec)
        self.sizes, self.work, self.sample_time = (n, m, z), (z + m) * (z + n), machine.sample_time
        self.delay, self.real = machine.delayed, np.float32 if machine.arithmetic == "single" else np.float64
        noise = machine.noise if isinstance(machine.noise, tuple) else (machine.noise,) * n
        off = [result.half_widths[name] + error for name, error in zip(spec.states, noise, strict=True)]
        sizes = (max(map(abs, box)) for box in spec.safe_set)
        ranges = {use.input: use.range for use in result.inputs}
        limits = {
            "reach": (1, [far + _ROUNDING * (far + size) for far, size in zip(off, sizes, strict=True)]),
            "memory": (-1, [max(own) for own in zip(*(stage.memory for stage in stages), strict=True)]),
            "low": (1, [ranges[name][0] for name in spec.inputs]),
            "high": (-1, [ranges[name][1] for name in spec.inputs]),
        }
        self.limits = {
            name: np.array([_next(q, side, self.real) for q in own]) for name, (side, own) in limits.items()
        }


def data_of(certificate: Certificate) -> Data:
    """The controller of a certificate; raises TC710 if it has none, or does not say `certified`."""
    result, tables = certificate.result, certificate.result.controller
    if result.verdict is not Verdict.CERTIFIED:
        message, help = f"the certificate says {result.verdict}", "tubecert report tells what is missing"
        raise refused(message, help, result.verdict.exit_code)
    if tables is None or not (tables.M.any() or tables.N.any()):
        raise refused("the certificate has no controller", "certify with `controller: auto`")
    return Data(certificate, tables)


def _next(q: Fraction, side: int, real: type[np.floating[Any]]) -> float:
    """The number of the arithmetic next to an exact one: not below it (side 1), or not above it (-1)."""
    near = real(float(q))
    inside = side * Fraction(float(near)) >= side * q
    return float(near if inside else np.nextafter(near, real(side * np.inf)))


def texts(data: Data) -> dict[str, str]:
    """The files that belong to the certificate, by their names."""
    (n, m, z), plan = data.sizes, data.plan
    over = f"after {plan.steps} samples: the last command is held from then on, and STATUS_END is told"
    tables = ((name, getattr(data.tables, name)) for name in "FGMN")
    matrices = [*tables, *zip(("xs", "us"), plan.rows, strict=True)]
    places: dict[str, object] = {
        **{name: "{" + ",\n".join(map(_row, own.tolist() or [[]])) + "}" for name, own in matrices},
        **{name: _row(own.tolist()) for name, own in data.limits.items()},
        **{"name": data.name, "hash": data.hash, "n": n, "m": m, "z": z, "work": data.work},
        **{"period": float(data.sample_time), "delay": float(data.delay), "lead": float(plan.lead)},
        **{"kind": plan.kind, "steps": plan.steps, "after": plan.after, "rows": len(plan.rows[0])},
        **{"formula_x": plan.formula[0], "formula_u": plan.formula[1]},
        "real": "float" if data.real is np.float32 else "double",
        "handed": "xs, us, " if plan.handed else "",
        "end": over if plan.after == plan.steps else "never",
    }
    return {name: Template((HOME / f"{name}.in").read_text("utf-8")).substitute(places) for name in _OWN}


def _row(values: Sequence[float]) -> str:
    """An array of C; a 0 where it would be empty, which C does not allow."""
    return "{" + ", ".join(x.hex() for x in values or [0.0]) + "}"
