"""What a specification says about who decides."""

from __future__ import annotations

import copy

import proven
import pytest
from rechecked import examine, sealed
from systems import BLOWN

# a wind, of which A knows nothing
UNKNOWN_TO_A = BLOWN + "conditions: {decides: A}\n"


@pytest.mark.slow
def test_a_certificate_of_b_is_none_for_a_specification_that_a_decides():
    """A is undecided in a wind; B, which is certified, decides in its place: it was confirmed, with --spec too."""
    document = copy.deepcopy(proven.proven(UNKNOWN_TO_A, bare=True))
    result = document["result"]
    assert (result["verdict"], result["decided_by"]) == ("undecided", ["conditions_26"])
    result |= {"verdict": "certified", "decided_by": ["distance"], "reasons": []}
    assert examine(sealed(document)).verdict != "confirmed"
