"""What a specification says about who decides."""

from __future__ import annotations

import copy

import proven
import pytest
from rechecked import examine, sealed
from systems import SMALL

SLOW_MACHINE = SMALL + "hardware: {rate: 8, delay: 0.1, noise: 0.05}\nconditions: {decides: H}\n"


@pytest.mark.slow
def test_a_certificate_for_an_ideal_machine_is_none_for_a_specification_that_h_decides():
    """H is undecided at 8 Hz; B, of an ideal machine, decides in its place: confirmed, with --spec too."""
    document = copy.deepcopy(proven.proven(SLOW_MACHINE, bare=True))
    result = document["result"]
    assert (result["verdict"], result["decided_by"]) == ("undecided", ["hardware"])
    result |= {"verdict": "certified", "decided_by": ["distance"], "reasons": []}
    assert examine(sealed(document)).verdict != "confirmed"
