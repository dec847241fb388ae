"""Reasons and assumptions of a certificate, read from its JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tubecert.claims import Assumption, Outcome, Reason
from tubecert.records import from_json
from tubecert.words.assumptions import assumed


def reason_of(data: Mapping[str, Any]) -> Reason:
    """A reason as it stands in a certificate."""
    return from_json(Reason, data, "reason")


def assumption_of(data: Mapping[str, Any]) -> str:
    """An assumption of a certificate as a sentence."""
    return assumed(from_json(Assumption, data, "assumption"))


def outcome_of(data: Mapping[str, Any]) -> Outcome:
    """What became of an attempt of a synthesis."""
    return from_json(Outcome, data, "outcome")
