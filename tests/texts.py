"""Texts of specifications: where those of the house lie, and how others are made of them."""

from pathlib import Path

ROOT = Path(__file__).parents[1]
CONFIGS = ROOT / "configs"
OLDER_METRIC = '{"format": 1, "solver": 1, "verified_on": 1}'  # a file of tubecert, as far as it is looked at


def replaced(text: str, *changes: tuple[str, str]) -> str:
    """With changes, each of something that is there."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text
