"""A folder of exported code against the certificate of a sampled loop: nothing of what wrote it is believed.

The runtime is files of tubecert that a reader can judge, compared byte by byte. The data are written again here from
the certificate, and compared byte by byte as well; only the numbers of the plan are read, and compared with the curve
of this room at the times that the theorem has.
"""

from __future__ import annotations

import re
import stat
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from hashlib import sha256
from pathlib import Path
from string import Template
from typing import Final

from tubecert.recheck.cover import Outcome
from tubecert.recheck.document import Node
from tubecert.recheck.metric import stated
from tubecert.recheck.sampled_loop.held import HeldPlan, Rows, single
from tubecert.recheck.sampled_loop.record import Certificate, Proven, read_certificate
from tubecert.recheck.sampled_loop.windows import course_of
from tubecert.recheck.specification import SampledSpecification

_SHIPPED: Final = Path(__file__).parents[2] / "controller"
_DATA, _README = "controller_data.h", "README.txt"
_RUNTIME: Final = ("controller.c", "controller.h", "selftest.c")
_ROUNDING: Final = Fraction(1, 2**21)  # of |x| and a width: more than rounding makes of a sample
_PLAN: Final = re.compile(r"XS\[ROWS\]\[NX\] = ([^;]*);.*\n.* US\[ROWS\]\[NU\] = ([^;]*);")


def exported(document: Node, folder: str) -> list[tuple[str, Outcome]]:
    """The claims of a folder of exported code; one that cannot be read contradicts the only one."""
    try:
        files = {path.name: _content(path) for path in sorted(Path(folder).iterdir())}
    except (OSError, ValueError) as error:
        return [("controller: the folder can be read", stated(False, str(error)))]
    return list(compared(document, files))


def _content(path: Path) -> bytes:
    """Of a regular file; no link is followed, and no pipe opened."""
    return path.read_bytes() if stat.S_ISREG(path.lstat().st_mode) else b""


def compared(document: Node, files: Mapping[str, bytes]) -> Iterator[tuple[str, Outcome]]:
    """The claims of files by their names, up to the first that is not so."""
    certificate = read_certificate(document)
    why = _changed(files, certificate.hash)
    yield "controller: the runtime is that of tubecert", stated(not why, why)
    if why:
        return
    spec, proven = certificate.specification, certificate.proven
    texts = document.value["result"]["spec"]["effective"]["trajectory"]
    try:
        if proven is None:
            raise ValueError("nothing is certified")
        held = HeldPlan(course_of(spec, proven.plan), texts.get("x", ()), texts.get("u", ()))
        found = _PLAN.search(files[_DATA].decode("ascii"))
        xs, us = map(_rows, found.groups() if found else ())
        same = files[_DATA] == _marked(_data(certificate, proven, held, xs, us).encode())
        why = held.wrong(xs, us) if same else f"{_DATA} is not what tubecert writes for it"
    except (ValueError, OverflowError, KeyError) as error:
        same, why = False, f"{_DATA} is not as tubecert writes it ({error})"
    yield "controller: the data are those of the certificate, digit for digit", stated(same, why)
    if same:
        yield "controller: the plan is that of the certificate when its commands act", stated(not why, why)


def _changed(files: Mapping[str, bytes], certificate: str) -> str:
    """What is not as it is shipped, or of another certificate; nothing if that is "". What was compiled is none."""
    own = {*_RUNTIME, _DATA, _README}
    for name in sorted(own ^ {name for name in files if name in own or name.endswith((".c", ".h"))}):
        return f"{name[:60]} is {'none of its files' if name in files else 'missing'}"
    for name in _RUNTIME:
        if files[name] != _marked((_SHIPPED / name).read_bytes()):
            return f"{name} is not what tubecert writes"
    text = files[_README].partition(b"\n")[2]
    kept = files[_README] == _marked(text) and certificate.encode() in text
    return "" if kept else f"{_README} is not what tubecert writes"


def _marked(text: bytes) -> bytes:
    return b"/* tubecert export, sha256 of what follows: %s */\n" % sha256(text).hexdigest().encode() + text


def _rows(text: str) -> Rows:
    """The numbers of an array in C as it is written; raises `ValueError`."""
    rows = text.strip("{}").split("},\n{")
    return [[single(float.fromhex(word)) for word in row.split(", ")] for row in rows]


def _data(certificate: Certificate, proven: Proven, held: HeldPlan, xs: Rows, us: Rows) -> str:
    """The text of the data, with the plan that was found."""
    machine, plant = certificate.specification.hardware, certificate.specification.plant
    matrices = {name: [list(map(float, row)) for row in getattr(proven, name).tolist()] for name in "FGMN"}
    matrices |= {"xs": xs, "us": us}
    places: dict[str, object] = {
        **{name: "{" + ",\n".join(map(_array, rows or [[]])) + "}" for name, rows in matrices.items()},
        **{name: _array(own) for name, own in _limits(certificate.specification, proven).items()},
        **{"n": len(plant.states), "m": len(plant.inputs), "z": proven.F.nrows()},
        **{"period": float(machine.sample_time), "delay": float(machine.delay), "lead": float(held.lead)},
        **{"kind": held.kind, "steps": held.steps, "after": held.after, "hash": certificate.hash},
        **{"rows": len(held.written), "formula_x": held.formula[0], "formula_u": held.formula[1]},
        "real": "float" if machine.arithmetic == "single" else "double",
    }
    return Template((_SHIPPED / f"{_DATA}.in").read_text("utf-8")).substitute(places)


def _limits(spec: SampledSpecification, proven: Proven) -> dict[str, list[float]]:
    """The last numbers of the arithmetic within what is proven, and the first reach that is enough."""
    machine, boxes, stages = spec.hardware, spec.plant.safe_set, proven.stages
    noise = machine.noise if isinstance(machine.noise, tuple) else (machine.noise,) * len(boxes)
    widths = zip(*(own.half_widths for own in stages), strict=True)
    off = [(max(w) + v, max(map(abs, box))) for w, v, box in zip(widths, noise, boxes.values(), strict=True)]
    limits = {
        "reach": (1, [far + _ROUNDING * (far + size) for far, size in off]),
        "memory": (-1, [max(own) for own in zip(*(stage.memory for stage in stages), strict=True)]),
        "low": (1, [low for low, _ in proven.ranges]),
        "high": (-1, [high for _, high in proven.ranges]),
    }
    return {name: [_next(q, side, machine.arithmetic) for q in own] for name, (side, own) in limits.items()}


def _next(q: Fraction, side: int, arithmetic: str) -> float:
    """The number next to an exact one: not below it (side 1), or not above it (-1)."""
    rounded, unit = (single, 2.0**-24) if arithmetic == "single" else (float, 2.0**-53)
    near = rounded(float(q))
    return near if side * Fraction(near) >= side * q else rounded(near + side * 1.1 * unit * abs(near))


def _array(values: Sequence[float]) -> str:
    """An array of C; a 0 where it would be empty, which C does not allow."""
    return "{" + ", ".join(x.hex() for x in values or [0.0]) + "}"
