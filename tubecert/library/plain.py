"""Values of Python as the text of a specification: mappings, lists, arrays, exact and binary numbers, expressions.

In: what a user writes in code. Out: text that `spec` reads as it reads a file; what it says is decided there. A float
stands for its shortest decimal. Expressions of sympy need no sympy here: what they print is what is read, and what
would print as something else is refused.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from typing import Any, Final, NoReturn, TypeAlias

from tubecert.asking import plain_number, shown
from tubecert.errors import SpecError
from tubecert.findings import Finding, NamedPlace
from tubecert.spec import codes

Data: TypeAlias = Mapping[Any, Any]  # keys are texts, or symbols of sympy
Plain: TypeAlias = "bool | str | list[Plain] | dict[str, Plain] | None"
_DEEPEST: Final = 60  # the reader of specifications refuses less
_VECTORS: Final = (  # keys for which a matrix with one column, or one row, stands for its entries
    "system.f", "uncertainty.h", "trajectory.x", "trajectory.u", "trajectory.at", "trajectory.input",
    "trajectory.start", "trajectory.target", "initial_state.at",
)  # fmt: skip
_ATOMS: Final = ("is_Symbol", "is_Rational", "is_Float")


def document_text(data: Data) -> str:
    """A mapping as text, one entry on a line, so that findings show the entry; raises `SpecError`."""
    return json.dumps(_plain(data, "", 0), indent=1, ensure_ascii=False) + "\n"


def entry_text(value: object, name: str) -> str:
    """A value on one line; raises `SpecError` for what has no place in a specification."""
    found = _plain(value, name, 0)
    return found if isinstance(found, str) else json.dumps(found, ensure_ascii=False)


def _plain(value: object, path: str, depth: int) -> Plain:
    """The value in texts, lists and mappings of them."""
    if depth > _DEEPEST:
        _refuse(path, "the value is nested too deeply, or holds itself", "give lists and mappings of texts")
    if value is None or isinstance(value, (str, bool)):
        return value
    if isinstance(value, Mapping):
        return _mapping(value, path, depth)
    if isinstance(value, (list, tuple)):
        return [_plain(item, f"{path}[{i}]", depth + 1) for i, item in enumerate(value)]
    if not _is(value, "is_Float") and (text := plain_number(value)) is not None:
        return text
    if hasattr(value, "tolist"):  # an array, or a matrix of sympy
        found = _plain(value.tolist(), path, depth + 1)
        return _vector(found) if path in _VECTORS else found
    if hasattr(value, "free_symbols") and hasattr(value, "xreplace"):
        return _expression(value, path)
    message = f"{shown(value)} has no place in a specification"
    return _refuse(path, message, "give a text, a number, a list or a mapping")


def _vector(value: Plain) -> Plain:
    """The entries of a matrix with one column or one row; anything else as it is."""
    rows = [row for row in value if isinstance(row, list)] if isinstance(value, list) else []
    if not rows or rows != value:
        return value
    if all(len(row) == 1 for row in rows):
        return [row[0] for row in rows]
    return rows[0] if len(rows) == 1 else value


def _mapping(value: Data, path: str, depth: int) -> dict[str, Plain]:
    found: dict[str, Plain] = {}
    for each, item in value.items():
        key = _key(each, path)
        if key in found:
            _refuse(path, f"{key} occurs twice, as a text and as a symbol", "keep one")
        found[key] = _plain(item, f"{path}.{key}" if path else key, depth + 1)
    return found


def _key(key: object, path: str) -> str:
    if isinstance(key, str):
        return key
    if _is(key, "is_Symbol"):
        return str(key)
    return _refuse(path, f"the key {shown(key)} is no name", "give a text")


def _expression(value: Any, path: str) -> str:
    """What an expression of sympy prints, if that means the same here; floats are their shortest decimals."""
    for atom in value.atoms():
        _check_atom(atom, path)
    exact = value.xreplace({atom: _decimal(atom, path) for atom in value.atoms() if _is(atom, "is_Float")})
    return str(exact).replace("Abs(", "abs(")


def _is(atom: object, kind: str) -> bool:
    return bool(getattr(atom, kind, False))


def _decimal(atom: object, path: str) -> object:
    """A float of sympy, which prints fewer digits than it has, as the rational of its shortest decimal."""
    rational = sys.modules["sympy"].Rational  # who else made it
    near = repr(float(str(rational(atom).evalf(40))))
    if rational(atom) != rational(float(near)):
        _refuse(path, f"{atom} has more digits than a float", "write the number as a Rational, or a text")
    return rational(near)


def _check_atom(atom: object, path: str) -> None:
    """Refuses an atom that prints as something else than it is: E as a name, a symbol as a sum."""
    text = str(atom)
    if text == "pi" and not _is(atom, "is_Symbol"):
        return
    if not any(_is(atom, kind) for kind in _ATOMS):
        message = f"{text} of {type(atom).__name__} has no meaning here"
        _refuse(path, message, "write it as a text, or as a number")
    if _is(atom, "is_Symbol") and not (text.isidentifier() and text != "pi"):
        _refuse(path, f"the symbol {text[:40]!r} is no name", "use letters, digits and _")


def _refuse(path: str, message: str, help: str) -> NoReturn:
    place = NamedPlace(file=path or "the specification", line=1, column=1)
    raise SpecError([Finding(code=codes.WRONG_TYPE, message=message, location=place, help=help)])
