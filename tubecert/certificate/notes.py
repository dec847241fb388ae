"""What of a result explains and claims nothing: in a file it stands in `notes`, at its place in the result.

In: a result as JSON. Out: `result`, which is hashed and which `recheck` examines, and `notes`, which are neither:
advice, curves, slopes, how a metric was searched for, where a constant is attained, points to draw the plan by; and
both as one again. Trusted: yes, for what is not in `notes` is taken for examined.
"""

from __future__ import annotations

from collections.abc import Mapping

from tubecert.records import FormError

Places = Mapping[str, "Places"]

_EVERY = "*"
_WHOLE: Places = {}
_SHORTFALL: Places = dict.fromkeys(("constant", "allowed", "needed", "missing"), _WHOLE)
_GAINS: Places = {"shortfalls": _SHORTFALL, "curve": _WHOLE, "margins_around": _WHOLE}
NOTES: Places = {
    "effort": _WHOLE,
    "elasticities": _WHOLE,
    "synthesis": {"search": _WHOLE},
    "reasons": {"relax": _WHOLE, "binds": _WHOLE},
    "plan": {"samples": _WHOLE},
    "clearance": {"t": _WHOLE, "inside": _WHOLE},
    "constants": {_EVERY: dict.fromkeys(("symbol", "equation", "unit", "at"), _WHOLE)},
    "no_adaptation": {"shortfalls": _SHORTFALL},
    "conditions_26": {**_GAINS, "bandwidth_infimum": _WHOLE, "binds": _WHOLE},
    "distance": _GAINS,
}
"""The places of notes by their keys, `*` for any; those of the entries of a list are those of each entry."""


def split(found: object) -> tuple[object, object]:
    """`result` and `notes` of everything that was found."""
    return _split(found, NOTES)


def joined(result: object, notes: object) -> object:
    """Everything that was found; raises `FormError` if `notes` hold something that is no note."""
    whole = _joined(result, notes)
    if split(whole) != (result, notes):
        raise FormError("certificate.notes", "are not the notes of this result")
    return whole


def _split(value: object, tree: Places) -> tuple[object, object]:
    if isinstance(value, list):
        parts = [_split(item, tree) for item in value]
        noted = [own for _, own in parts]
        return [own for own, _ in parts], noted if any(noted) else {}
    if not isinstance(value, dict):
        return value, {}
    stays, told = {}, {}
    for key, own in value.items():
        inner = tree.get(key, tree.get(_EVERY))
        if inner is _WHOLE:
            told[key] = own
            continue
        stays[key], beside = (own, {}) if inner is None else _split(own, inner)
        if beside:
            told[key] = beside
    return stays, told


def _joined(stays: object, told: object) -> object:
    if not told:
        return stays
    if isinstance(stays, dict) and isinstance(told, dict):
        return {
            **stays,
            **{key: _joined(stays[key], own) if key in stays else own for key, own in told.items()},
        }
    if isinstance(stays, list) and isinstance(told, list) and len(stays) == len(told):
        return [_joined(own, beside) for own, beside in zip(stays, told, strict=True)]
    raise FormError("certificate.notes", "are not the notes of this result")
