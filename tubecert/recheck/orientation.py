"""Members of a certificate that claim nothing, read all the same: known keys, known kinds, and nothing beside them.

What of them is a statement after all (points of the plan, margins around the gains) is handed on to be examined.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from tubecert.recheck.document import Node
from tubecert.recheck.kinds.table import KINDS
from tubecert.recheck.reasons import read_outcome, read_reason
from tubecert.recheck.specified.metric import Wanted, read_wanted

NOT_EXAMINED = (
    "effort",
    "elasticities",
    "synthesis",
    "reasons.relax",
    *(f"{kind.key}.{member}" for kind in KINDS for member in kind.unread),
)
"""By path: members that are shown and not verified."""


def run(node: Node) -> None:
    """How the certificate was made: no part of what is hashed."""
    own = node.closed(optional=("command", "started", "seconds", "versions"))
    own.get("command", Node.text)
    own.get("started", Node.text)
    own.get("seconds", Node.number)
    for _, version in own["versions"].items() if "versions" in own else ():
        version.text()


def elasticities(node: Node, kinds: Sequence[str], names: Collection[str]) -> None:
    """How the least rates react to each constant."""
    own = node.closed(*kinds)
    for key in kinds:
        own[key].closed(optional=names)
        for _, slope in own[key].items():
            slope.number()


def synthesis(node: Node, n: int) -> Wanted:
    """What metric was asked for; what was tried to find one is for orientation."""
    texts, numbers = ("floor", "route"), ("rate", "condition_number")
    own = node.closed(
        "asked",
        "objective",
        "verdict",
        "attempts",
        optional=("rate", "table", "limits", "cut", "solver", "reason"),
    )
    for key in ("objective", "verdict"):
        own[key].text()
    own.get("rate", Node.decimal)
    own.get("reason", lambda item: read_reason(item, n))
    for item in own["attempts"].entries():
        attempt = item.closed("rate", "degree", *texts, "outcome", optional=("condition_number",))
        attempt["degree"].count()
        read_outcome(attempt["outcome"])
        for key in texts:
            attempt[key].text()
        for key in numbers:
            attempt.get(key, Node.number)
    if "table" in own:
        for item in own["table"].entries():
            _row(item)
    own.get("limits", _limits)
    own.get("cut", Node.text)
    if "solver" in own:
        solver = own["solver"].closed("route", "degree", "variables", "digits")
        solver["route"].text()
        solver["variables"].texts()
        for key in ("degree", "digits"):
            solver[key].count()
    return read_wanted(own["asked"])


def _row(node: Node) -> None:
    """A metric that was compared."""
    numbers = ("condition_number", "input_gain", "rho", "ultimate_radius", "adaptation_rate", "bandwidth")
    row = node.closed("rate", "floor", "degree", "condition_number", optional=("verdict", *numbers[1:]))
    row["rate"].decimal()
    row["floor"].text()
    row["degree"].count()
    row.get("verdict", Node.text)
    for key in numbers:
        row.get(key, Node.number)


def _limits(node: Node) -> None:
    """What is against other rates than the one that was chosen."""
    own = node.closed(optional=("slower", "faster"))
    for key in ("slower", "faster"):
        own.get(key, _limit)


def _limit(node: Node) -> None:
    own = node.closed("rate", "cause", optional=("factor",))
    own["rate"].decimal()
    own["cause"].text()
    own.get("factor", Node.number)
