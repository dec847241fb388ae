"""Reasons and assumptions of a certificate, read from its JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tubecert.claims import Assumption, Outcome, Reason
from tubecert.enclosure.constant import Witness
from tubecert.records import from_json
from tubecert.report.numbers import short
from tubecert.words.assumptions import assumed


def reason_of(data: Mapping[str, Any]) -> Reason:
    """A reason as it stands in a certificate."""
    return from_json(Reason, data, "reason")


def place(states: Sequence[str], at: Witness) -> str:
    """A witness: `t = 0.2 s, x1 = 0.1, ...`."""
    parts = [] if at.t is None else [f"t = {short(at.t, 6)} s"]
    parts += [f"{name} = {short(value, 6)}" for name, value in zip(states, at.x, strict=False)]
    return ", ".join(parts)


def assumption_of(data: Mapping[str, Any]) -> str:
    """An assumption of a certificate as a sentence."""
    return assumed(from_json(Assumption, data, "assumption"))


def outcome_of(data: Mapping[str, Any]) -> Outcome:
    """What became of an attempt of a synthesis."""
    return from_json(Outcome, data, "outcome")
