"""The finding codes of this room, each with its one-line meaning."""

from __future__ import annotations

from collections.abc import Mapping
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

CODES: Final[Mapping[str, str]] = {
    UNREADABLE: "the file cannot be read",
    YAML_SYNTAX: "the file is not well-formed YAML",
    LIMIT: "the file, a number or an expression exceeds a limit",
    UNKNOWN_KEY: "a key is not part of the specification",
    DUPLICATE_KEY: "a key occurs twice in one mapping",
    MISSING_KEY: "a required key is missing",
    WRONG_TYPE: "a value is of the wrong kind (text, list, mapping)",
    WRONG_SHAPE: "a list or matrix has the wrong size",
    NUMBER: "a value is not a finite rational number",
    EXPRESSION: "an expression is not well-formed",
    UNKNOWN_SYMBOL: "an expression uses a name that is unknown or not allowed there",
    NAME: "a name is not allowed or is used twice",
    RANGE: "a value is outside its range",
    NOT_YET: "a key is reserved for later work",
    YAML_FEATURE: "a feature of YAML is not allowed (aliases, tags, several documents)",
    RANK: "the input matrix B has dependent columns everywhere",
    SYMMETRY: "the dual metric is not symmetric",
    STABILITY: "the predictor matrix A_m does not suit P = I",
    PLAN_COLUMNS: "a plan file is not a table of t, the states and the inputs",
    PLAN_TIMES: "the times of a plan file do not increase, or not from 0 to the horizon",
    TABLE: "a table of a function is not rows of x and y with increasing x",
}
