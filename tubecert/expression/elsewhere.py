"""Words that mean something elsewhere, in other formats and languages: what to write here, or what is said of them.

The words are tables of `pages/instead.toml`, read when the first of them is met. None is taken for a typing error.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources


@cache
def elsewhere(table: str) -> Mapping[str, str]:
    """What stands for a word, or is said of it, by the words of a table."""
    text = (resources.files("tubecert") / "pages" / "instead.toml").read_text(encoding="utf-8")
    return {word: said for words, said in tomllib.loads(text)[table].items() for word in words.split()}
