"""Texts of specifications: where those of the house lie, and how others are made of them."""

from pathlib import Path

ROOT = Path(__file__).parents[1]
CONFIGS = ROOT / "configs"


def replaced(text: str, *changes: tuple[str, str]) -> str:
    """With changes, each of something that is there."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text
