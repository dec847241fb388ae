"""Names that read as the derivative of a state (dz, zdot, z_dot): what to write instead.

A derivative is not the state. What it is, f says: by its entry for that state.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from tubecert.expression import rates_of
from tubecert.spec.document import ListNode, Scalar
from tubecert.spec.reader import Field

_SHOWN = 40


def rates_of_states(f: Field | None, states: Sequence[str]) -> dict[str, str]:
    """What to say of each name that reads as a derivative of a state; f as it is written, read or not."""
    nodes = f.node.items if f is not None and isinstance(f.node, ListNode) else ()
    texts = [node.text.strip() if isinstance(node, Scalar) else "" for node in nodes]
    texts = texts if len(texts) == len(states) else [""] * len(states)
    names = {rate for state in states for rate in rates_of(state)} - set(states)
    told: dict[str, str] = {}
    for number, (state, text) in enumerate(zip(states, texts, strict=True), start=1):
        usable = 0 < len(text) <= _SHOWN and not names & set(re.findall(r"[A-Za-z]\w*", text))
        instead = text if text.isidentifier() else f"({text})"
        write = f"by f that is {text}: write {instead}" if usable else _unknown(number, state)
        told |= {
            rate: f"{rate} reads as the derivative of {state}, and is no name here; {write}"
            for rate in rates_of(state)
            if rate in names
        }
    return told


def _unknown(number: int, state: str) -> str:
    entry = f"its entry {number} is that of {state}"
    return f"the derivatives are what f gives: {entry}, a state (its velocity) or an expression of states"
