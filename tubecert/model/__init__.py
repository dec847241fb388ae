"""The control-affine system of a specification: fields and derivatives, whether they exist, and the rank of B.

In: a specification, with definitions expanded and parameters substituted. Out: a `ControlAffineModel` of exact
expressions; what is undefined on the safe set, as findings; a decision about the rank of B. Trusted: yes.

| module | what it does |
|---|---|
| `affine` | f, B, W and what is made of them; the period of what depends on t; zeros on a box |
| `defined` | what the terms of a specification owe: that they are defined and smooth on the set and the horizon |
| `rank` | whether B has full column rank on the safe set |
"""

from tubecert.model.affine import TIME, ControlAffineModel, build, divide, moving_parts, time_period
from tubecert.model.defined import domain_findings, place
from tubecert.model.rank import rank_decision

__all__ = [
    "TIME",
    "ControlAffineModel",
    "build",
    "divide",
    "domain_findings",
    "moving_parts",
    "place",
    "rank_decision",
    "time_period",
]
