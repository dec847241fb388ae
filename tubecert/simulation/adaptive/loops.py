"""The loops: which terms the right-hand sides of each have. A new loop is a new row.

The plant is the same for all of them, x' = f + B(u + h) with u = u* + k + u_a, (0.1) and (0.4). The others:

| term | right-hand side | theory |
|---|---|---|
| `filters` | u_a' = -omega (u_a + estimate) | (0.8) |
| `knows` | the estimate is h itself, else sigma_hat | 3, the reference system |
| `predicts` | xtilde' = A_m xtilde - B h + what follows | (0.6) less (0.1) |
| `adapts` | ... + B sigma_hat, and sigma_hat' = Gamma Proj(sigma_hat, -B'xtilde) | (0.6), (0.7) |
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

Controller = Literal["nominal", "ccm", "reference", "l1"]


class Terms(NamedTuple):
    """Which terms a loop has."""

    filters: bool = False
    knows: bool = False
    predicts: bool = False
    adapts: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A loop: its terms, whether h acts on it, and the gains that it needs apart from those of a filter."""

    terms: Terms
    disturbed: bool = True
    needs: tuple[str, ...] = ()


DESIGNS: Final[dict[Controller, Design]] = {
    "nominal": Design(terms=Terms(), disturbed=False),
    "ccm": Design(terms=Terms()),
    "reference": Design(terms=Terms(filters=True, knows=True)),
    "l1": Design(terms=Terms(filters=True, predicts=True, adapts=True), needs=("adaptation_rate",)),
}
CONTROLLERS: Final[tuple[Controller, ...]] = tuple(DESIGNS)
