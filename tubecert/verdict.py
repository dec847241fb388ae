"""Verdicts: three values; undecided is never shown as either of the others."""

from __future__ import annotations

from enum import StrEnum


class Verdict(StrEnum):
    """What is known of a claim."""

    CERTIFIED = "certified"
    REFUTED = "refuted"
    UNDECIDED = "undecided"
