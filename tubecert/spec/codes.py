"""The finding codes of this room; what each of them means is its page in `pages/codes.toml`."""

from __future__ import annotations

import tomllib
from importlib import resources
from typing import Final

UNREADABLE: Final = "TC100"
YAML_SYNTAX: Final = "TC101"
LIMIT: Final = "TC102"
UNKNOWN_KEY: Final = "TC103"
DUPLICATE_KEY: Final = "TC104"
MISSING_KEY: Final = "TC105"
WRONG_TYPE: Final = "TC106"
WRONG_SHAPE: Final = "TC107"
NUMBER: Final = "TC108"
EXPRESSION: Final = "TC109"
UNKNOWN_SYMBOL: Final = "TC110"
NAME: Final = "TC111"
RANGE: Final = "TC112"
NOT_YET: Final = "TC113"
YAML_FEATURE: Final = "TC114"
RANK: Final = "TC115"
SYMMETRY: Final = "TC116"
STABILITY: Final = "TC117"
PLAN_COLUMNS: Final = "TC118"
PLAN_TIMES: Final = "TC119"
TABLE: Final = "TC124"


def title(code: str) -> str:
    """What a code says, in a line of its page."""
    text = (resources.files("tubecert") / "pages" / "codes.toml").read_text(encoding="utf-8")
    return str(tomllib.loads(text)[code]["title"])
