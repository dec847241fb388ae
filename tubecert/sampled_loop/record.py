"""What a certificate of a sampled loop says: records as JSON and back, and the file that holds them.

In: what was proven. Out: canonical JSON, sealed with the hash of `result`; `notes` explain, `run` says how it was made,
and neither is hashed. Only the specification, the tables, `tube` and `inputs` are claims; all that `recipe` says is
how the proof was found, and a checker may find another. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Final, Literal

import numpy as np

from tubecert.certificate import file
from tubecert.certificate.effective import Effective
from tubecert.enclosure.interval import Array
from tubecert.records import FormError, Json, foreign, from_json, to_json
from tubecert.spec import Afterwards, Hold, Knots
from tubecert.verdict import Verdict

FORMAT: Final = "tubecert-sampled-loop/1"


def _hex(matrix: Array) -> Json:
    """A matrix of floats (p, q) that are exact numbers: as hexadecimal texts, row by row."""
    return {"columns": matrix.shape[1], "rows": [[x.hex() for x in row] for row in matrix.tolist()]}


def _unhex(data: Json, path: str) -> Array:
    rows = data.get("rows") if isinstance(data, dict) and data.keys() == {"columns", "rows"} else None
    if not isinstance(rows, list) or not isinstance(width := data["columns"], int):
        raise FormError(path, "is not a matrix of hexadecimal numbers")
    try:
        value = np.array([[float.fromhex(text) for text in row] for row in rows], dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise FormError(path, "is not a matrix of hexadecimal numbers") from None
    value = value.reshape(len(rows), -1) if rows and width else np.zeros((len(rows), width))
    if value.shape != (len(rows), width) or not np.isfinite(value).all():
        raise FormError(path, "is not a matrix of finite numbers")
    return value


foreign(np.ndarray, _hex, _unhex)


@dataclass(frozen=True, slots=True, eq=False)
class Tables:
    """The controller: delta = M zeta + N dy, zeta+ = F zeta + G dy, with dy = y - x*(t_k) and zeta(0) = 0.

    Row by row, in hexadecimal texts: `F` (z, z), `G` (z, n), `M` (m, z), `N` (m, n), exact, of single precision. z = 0
    with N = 0: none.
    """

    F: Array
    G: Array
    M: Array
    N: Array

    @property
    def size(self) -> int:
        """z, the entries of its state."""
        return len(self.F)


@dataclass(frozen=True, slots=True, eq=False)
class Nominal:
    """The matrices of the error equation, any floats.

    Row by row, in hexadecimal texts: `A` (n, n), `B` (n, m), `E` (n, k) of the disturbance, exact.
    """

    A: Array
    B: Array
    E: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """From sample `start` on, up to that of the next stage: |x_i - x*_i| < half_widths, |u_j - u*_j| <= deviations.

    `deviations` are those from the plan's input as the computer holds it; `memory` bounds the controller's state
    zeta, (z,). Exact numbers.
    """

    start: int
    half_widths: Mapping[str, Fraction]
    deviations: Mapping[str, Fraction]
    memory: tuple[Fraction, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """How the inequalities of the stages are proven; nothing of it is believed.

    `lags` L of the rows; `cuts`, for each of e (n), delta (m), zeta (z) the lags at which the components of eta are
    cut; `pieces` of a sample and `panels` of a quadrature; `windows` of the plan's time or cells of a family;
    `parameters`: what they do along the plan is slow (a component of eta) or sudden.
    """

    lags: int
    cuts: tuple[tuple[int, ...], ...]
    pieces: int
    panels: int
    windows: int
    parameters: Literal["slow", "sudden"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """The specification: canonical data, its hash, the hash of the file, and what the command line set."""

    effective: Effective
    effective_hash: str
    file_hash: str
    settings: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """For which times the tube is proven: up to `horizon` in s, or for ever (None).

    `hold`: what the plan's input is, of the interval in which it acts; before the first command acts the actuators
    hold it as well.
    """

    horizon: Fraction | None
    afterwards: Afterwards
    hold: Hold


@dataclass(frozen=True, slots=True, kw_only=True)
class InputUse:
    """The plan's input and all that the loop adds stay in `range`, an outer bound; `limits` are those asked for."""

    input: str
    range: tuple[Fraction, Fraction]
    limits: tuple[Fraction, Fraction] | None = None

    @property
    def share(self) -> Fraction | None:
        """How much is used of the room between the middle of the limits and their ends; None without limits."""
        if self.limits is None:
            return None
        middle, half = (self.limits[0] + self.limits[1]) / 2, (self.limits[1] - self.limits[0]) / 2
        return max(self.range[1] - middle, middle - self.range[0]) / half


@dataclass(frozen=True, slots=True, kw_only=True)
class Cleared:
    """Obstacle number `index` of the specification: whether the tube keeps away from it."""

    index: int
    verdict: Verdict


Missing = Literal[
    "no_design", "no_fixed_point", "inputs", "safe_set", "start", "plan", "obstacle", "undefined", "wish",
    "not_proven",
]  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Lack:
    """Why nothing is certified: what kind of thing, where (a state, input or mode), how much of what, and when in s."""

    kind: Missing
    where: str = ""
    needed: float | None = None
    allowed: float | None = None
    at: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What is proven of a sampled loop; without a controller that proves it, stages and recipe are missing.

    Where the plan is one through knots, of a planner or a file, `planned` has them.
    """

    verdict: Verdict
    spec: Source
    claim: Claim
    planned: Knots | None = None
    nominal: Nominal | None = None
    controller: Tables | None = None
    tube: tuple[Stage, ...] = ()
    inputs: tuple[InputUse, ...] = ()
    clearance: tuple[Cleared, ...] = ()
    recipe: Recipe | None = None
    lacks: tuple[Lack, ...] = ()

    @property
    def half_widths(self) -> dict[str, Fraction]:
        """What is proven of every state at all times, the widest of all stages; empty if nothing is certified."""
        proven = self.tube if self.verdict is Verdict.CERTIFIED else ()
        names = self.spec.effective.system.ordered(proven[0].half_widths) if proven else ()
        return {name: max(stage.half_widths[name] for stage in proven) for name in names}


@dataclass(frozen=True, slots=True, kw_only=True)
class Shares:
    """What fills a half-width or a deviation, as numbers in its unit that add up to it."""

    noise: float
    holding: float
    uncertainty: float
    wind: float
    start: float
    remainder: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Notes:
    """What explains a result and claims nothing.

    `start` and `long_run`: what fills each half-width in the first and in the last stage; `deviations`: each input.
    `samples_t`, `samples_x` and `samples_u` are points of the plan, to be drawn.
    `missed`: of a plan that misses its own equations, where that widens the tube, what would hold it if it is at rest,
    empty where nothing is known to.
    `evaluations`: how many controllers were tried.
    """

    start: Mapping[str, Shares] = field(default_factory=dict)
    long_run: Mapping[str, Shares] = field(default_factory=dict)
    deviations: Mapping[str, Shares] = field(default_factory=dict)
    samples_t: tuple[float, ...] = ()
    samples_x: tuple[tuple[float, ...], ...] = ()
    samples_u: tuple[tuple[float, ...], ...] = ()
    missed: str | None = None
    evaluations: int = 0

    @property
    def filled(self) -> dict[str, Shares]:
        """Shares by state, in the long run where it is known, and by input."""
        return {**self.start, **self.long_run, **self.deviations}


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """A sealed certificate."""

    hash: str
    result: Result
    notes: Notes
    run: Mapping[str, Any]


# -- the file


def seal(result: Result, notes: Notes, run: Mapping[str, Any]) -> Certificate:
    """The certificate of a result; `run` says how it was made (versions, times, command line)."""
    return Certificate(hash=file.digest(to_json(result)), result=result, notes=notes, run=run)


def certificate_text(certificate: Certificate) -> str:
    """The text of the file."""
    return file.dump({"format": FORMAT, **to_json(certificate)})


def read(text: str, name: str) -> Certificate:
    """The certificate in the text of a file; raises `TargetError` for anything else, or a hash that is not its own."""
    sealed = file.parse(text.encode(), name, (FORMAT,))
    if sealed.get("hash") != file.digest(sealed["result"]):
        raise file.foreign(name, "was changed after it had been written: its hash is not that of its result")
    return of_json(sealed, name)


def of_json(sealed: Json, name: str) -> Certificate:
    """The certificate in JSON whose format and hash are known to be right; raises `TargetError`."""
    try:
        return Certificate(
            hash=sealed["hash"],
            result=from_json(Result, sealed["result"], "certificate.result"),
            notes=from_json(Notes, sealed.get("notes", {}), "certificate.notes"),
            run=dict(sealed.get("run", {})),
        )
    except FormError as error:  # with a hash that is right: somebody sealed what is no result
        raise file.incomplete(name, str(error)) from error
