"""An input matrix of which parameters are known by ranges: how far its gain is from what the controller takes it for.

B is that of the middles, B(x, theta) = B (I + Delta) + B_u with Delta = B^+ B(x, theta) - I. In: the fields of a model
over a tube. Out: Delta, what it adds to h, and sup |Delta|. Trusted: yes. Implements: theory 8.10.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from tubecert.bounds.constants import GainConstants
from tubecert.coordinates import Fields
from tubecert.expression import is_zero
from tubecert.expression.matrix import Matrix, adjugate, combine, determinant, identity, multiply
from tubecert.model import divide

if TYPE_CHECKING:
    from tubecert.bounds.suprema import Suprema


@dataclass(frozen=True)
class Gain:
    """Delta and what follows, in the coordinates of the tube; the model has a B of the plant."""

    fields: Fields

    @cached_property
    def whole(self) -> Matrix:
        """I + Delta = B^+ B(x, theta), (m, m)."""
        return multiply(self.fields.B_pinv, self._own)

    @cached_property
    def error(self) -> Matrix:
        """Delta, (m, m)."""
        return combine(1, self.whole, -1, identity(len(self.fields.model.inputs)))

    @cached_property
    def inverse(self) -> Matrix:
        """(I + Delta)^-1, (m, m), as a formula: it is one where |Delta| < 1."""
        return divide(adjugate(self.whole), determinant(self.whole))

    @cached_property
    def is_matched(self) -> bool:
        """Whether B_u = 0 is proven: the plant's inputs act where the controller's do."""
        rest = combine(1, self._own, -1, multiply(self.fields.B, self.whole))
        return all(is_zero(e) is True for row in rest for e in row)

    @property
    def _own(self) -> Matrix:
        """B(x, theta) in the coordinates of the tube."""
        return self.fields.of_vector(self.fields.model.gained)

    def joined(self, drift: Matrix, inputs: Matrix) -> Matrix:
        """(I + Delta)^-1 (v + Delta u*) = (I + Delta)^-1 v + (I - (I + Delta)^-1) u*, (m, 1): what joins h.

        `drift` (m, 1) is v, what an input can make of an unknown drift.
        """
        still = combine(1, identity(len(inputs)), -1, self.inverse)
        return combine(1, multiply(self.inverse, drift), 1, multiply(still, inputs))


def gain_constants(suprema: Suprema) -> GainConstants | None:
    """What is not known of B, over the tube; None if all of it is."""
    if not suprema.model.gained:
        return None
    gain = Gain(suprema.fields)
    return GainConstants(error=suprema.norms("gain_error", [gain.error]), matched=gain.is_matched).printable()
