"""Coefficients of a metric as other tools keep them (JSON, CSV, .npz, .mat) -> the text of a metric file.

W(x) = sum_k g_k(x) W_k. A file has `coefficients` W_k, (K, n, n) or (n, n) - in a .mat file (n, n, K) -, and of the
g_k either `monomials`, K texts in the grammar of specifications, or `powers`, (K, n) exponents of the states in the
order of the specification; neither for a constant W. `rate` in 1/s may stand there as well. A CSV file has the columns
monomial, row, column, value, counted from 1, where of two entries across the diagonal one suffices; or it is a constant
W itself, row by row.
A float stands for its shortest decimal. Entries across the diagonal may differ by rounding; that above it counts.
Trusted: what comes out is read as any metric file is, with its symmetry, and proven.
"""

from __future__ import annotations

import csv
import io
import json
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, NoReturn

from tubecert.errors import SpecError
from tubecert.expression import ExpressionError, constant, number_text, parse, symbol
from tubecert.files import Kind, read
from tubecert.findings import Finding, Location
from tubecert.spec import codes
from tubecert.spec.types import Spec

_KIND: Final = Kind(
    most=10_000_000,
    unreadable=codes.UNREADABLE,
    too_large=codes.LIMIT,
    help="give a metric file (tubecert synth writes them), or coefficients as CSV, .npz or .mat",
)
_CLOSE: Final = Fraction(1, 10**9)  # of the largest entry: what rounding may make of symmetry
_MOST: Final = 10_000  # numbers in a file
_KEYS: Final = ("coefficients", "monomials", "powers", "rate")
_COLUMNS: Final = ["monomial", "row", "column", "value"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficients:
    """W_k (K, n, n) as texts of numbers, the g_k as texts, and the rate if the file has one."""

    matrices: tuple[tuple[tuple[str, ...], ...], ...]
    monomials: tuple[str, ...]
    rate: str | None


def metric_text(path: str, spec: Spec, rate: Fraction | None) -> str:
    """The text of a metric file for the specification's states; raises `SpecError` for what is no such file."""
    found = _READERS[Path(path).suffix.lower()](path, spec)
    if rate is None and found.rate is None:
        _refuse(path, codes.MISSING_KEY, "the file has no rate", "add `rate`, in 1/s, or give --rate")
    _check_monomials(path, spec, found.monomials)
    n = len(spec.states)
    rows = [[" + ".join(_terms(found, min(i, j), max(i, j))) or "0" for j in range(n)] for i in range(n)]
    text = found.rate if rate is None else number_text(rate)
    return json.dumps({"format": "tubecert-metric/1", "rate": text, "dual_metric": rows})


def is_of_coefficients(path: str, data: bytes | None = None) -> bool:
    """Whether a file is one of these: by its name, and a JSON file by what it holds."""
    suffix = Path(path).suffix.lower()
    if suffix != ".json":
        return suffix in _READERS
    try:
        content = json.loads(read(path, _KIND) if data is None else data)
    except (ValueError, RecursionError):
        return False
    return isinstance(content, dict) and "coefficients" in content


def _terms(found: Coefficients, i: int, j: int) -> list[str]:
    parts = []
    for matrix, monomial in zip(found.matrices, found.monomials, strict=True):
        value = matrix[i][j]
        if Fraction(value):
            parts.append(f"({value})" if monomial == "1" else f"({value})*({monomial})")
    return parts


def _check_monomials(path: str, spec: Spec, monomials: Sequence[str]) -> None:
    """Each of them is an expression by itself: put together they could read as something else."""
    known = {name: symbol(name) for name in spec.states}
    known |= {name: constant(value) for name, value in spec.parameters}
    for text in monomials:
        try:
            parse(text, symbols=known)
        except ExpressionError as error:
            message = f"the monomial {text[:60]!r}: {error.message}"
            _refuse(path, codes.EXPRESSION, message, error.help)


# -- formats


def _json(path: str, spec: Spec) -> Coefficients:
    try:
        content = json.loads(read(path, _KIND), parse_float=_Written, parse_int=_Written)
    except (ValueError, RecursionError) as error:
        _refuse(path, codes.WRONG_TYPE, f"this is no JSON: {error}", "")
    if not isinstance(content, dict):
        _refuse(path, codes.WRONG_TYPE, "this is no object with coefficients", _help())
    for key in content:
        if key not in _KEYS:
            _refuse(path, codes.UNKNOWN_KEY, f"{key[:40]!r} is not known", _help())
    return _assembled(path, spec, content)


class _Written(str):
    """A number as it is written."""


def _csv(path: str, spec: Spec) -> Coefficients:
    try:
        rows = [row for row in csv.reader(io.StringIO(read(path, _KIND).decode("utf-8-sig"))) if row]
    except (UnicodeDecodeError, csv.Error) as error:
        _refuse(path, codes.WRONG_TYPE, f"this is no CSV: {error}", "")
    n = len(spec.states)
    if len(rows) == n and all(len(row) == n for row in rows) and rows[0][0].strip() != _COLUMNS[0]:
        return _assembled(path, spec, {"coefficients": [[cell.strip() for cell in row] for row in rows]})
    if not rows or [cell.strip() for cell in rows[0]] != _COLUMNS:
        message = f"neither {n} rows of {n} numbers, nor a first line monomial,row,column,value"
        _refuse(path, codes.WRONG_SHAPE, message, _help())
    entries: dict[str, dict[tuple[int, int], str]] = {}
    for number, row in enumerate(rows[1:], start=2):
        cells = [cell.strip() for cell in row]
        try:
            monomial, i, j = cells[0], int(cells[1]) - 1, int(cells[2]) - 1
            value = _number(cells[3])
        except (ValueError, IndexError):
            _refuse(
                path, codes.WRONG_SHAPE, f"line {number} is not monomial,row,column,value", _help(), number
            )
        if not (0 <= i < n and 0 <= j < n):
            _refuse(path, codes.WRONG_SHAPE, f"line {number}: W is {n} x {n}, counted from 1", "", number)
        own = entries.setdefault(monomial, {})
        if (i, j) in own:
            _refuse(path, codes.DUPLICATE_KEY, f"line {number}: the entry occurs twice", "", number)
        own[i, j] = value
    return _assembled(
        path,
        spec,
        {
            "monomials": list(entries),
            "coefficients": [
                [[own.get((i, j), own.get((j, i), "0")) for j in range(n)] for i in range(n)]
                for own in entries.values()
            ],
        },
    )


def _npz(path: str, spec: Spec) -> Coefficients:
    import numpy as np

    data = read(path, _KIND)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(item.file_size for item in archive.infolist()) > _KIND.most:
                _refuse(path, codes.LIMIT, f"the arrays are larger than {_KIND.most:,} bytes", "")
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            content = {key: arrays[key].tolist() for key in arrays.files if key in _KEYS}
    except (ValueError, OSError, zipfile.BadZipFile, KeyError, EOFError) as error:
        _refuse(path, codes.WRONG_TYPE, f"this is no .npz of plain arrays: {error}", _help())
    return _assembled(path, spec, content)


def _mat(path: str, spec: Spec) -> Coefficients:
    import numpy as np
    from scipy.io import loadmat

    data = read(path, _KIND)
    try:
        found = loadmat(io.BytesIO(data), variable_names=_KEYS)  # type: ignore[arg-type]
    except NotImplementedError:
        _refuse(path, codes.WRONG_TYPE, "this is a .mat file of version 7.3", "save it with -v7")
    except Exception as error:  # its reader raises whatever it meets in a broken file
        _refuse(path, codes.WRONG_TYPE, f"this is no .mat file: {error}", _help())
    content: dict[str, Any] = {}
    for key in (key for key in _KEYS if key in found):
        array = np.asarray(found[key])
        if key == "coefficients" and array.ndim == 3:
            array = np.moveaxis(array, -1, 0)
        if key == "monomials":
            content[key] = [str(np.asarray(cell).ravel()[0]).strip() for cell in array.ravel()]
        else:
            content[key] = array.ravel()[0].item() if key == "rate" else array.tolist()
    return _assembled(path, spec, content)


_READERS: Final[Mapping[str, Callable[[str, Spec], Coefficients]]] = {
    ".json": _json,
    ".csv": _csv,
    ".npz": _npz,
    ".mat": _mat,
}


# -- what they have in common


def _assembled(path: str, spec: Spec, content: Mapping[str, Any]) -> Coefficients:
    """The coefficients in a mapping of plain lists; every shape is checked."""
    if "coefficients" not in content:
        _refuse(path, codes.MISSING_KEY, "there are no `coefficients`", _help())
    n = len(spec.states)
    try:
        blocks = _blocks(content["coefficients"])
        if sum(len(row) for block in blocks for row in block) > _MOST:
            _refuse(path, codes.LIMIT, f"there are more than {_MOST:,} coefficients", "")
        matrices = tuple(tuple(tuple(map(_number, row)) for row in block) for block in blocks)
        rate = None if content.get("rate") is None else _number(_single(content["rate"]))
    except (ValueError, TypeError, ZeroDivisionError):
        _refuse(path, codes.NUMBER, "a coefficient, or the rate, is no finite number", _help())
    if any(len(block) != n or any(len(row) != n for row in block) for block in matrices):
        _refuse(path, codes.WRONG_SHAPE, f"the coefficients are not K matrices of {n} x {n}", _help())
    monomials = _monomials(path, spec, content, len(matrices))
    _check_symmetry(path, matrices)
    return Coefficients(matrices=matrices, monomials=monomials, rate=rate)


def _blocks(value: Any) -> list[Any]:
    """K matrices; one may stand alone."""
    return list(value) if isinstance(value[0][0], list) else [value]


def _single(value: Any) -> Any:
    while isinstance(value, list) and len(value) == 1:
        value = value[0]
    return value


def _number(value: Any) -> str:
    """A finite number as text: as written, or the shortest decimal of a float."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise TypeError("no number")
    text = value if isinstance(value, str) else repr(value)
    if len(text) > 60 or abs(int(text.lower().partition("e")[2] or 0)) > 400:
        raise ValueError("no number of moderate size")
    return number_text(Fraction(text))


def _monomials(path: str, spec: Spec, content: Mapping[str, Any], count: int) -> tuple[str, ...]:
    given, powers = content.get("monomials"), content.get("powers")
    if given is not None and powers is not None:
        _refuse(path, codes.DUPLICATE_KEY, "there are `monomials` and `powers`", "one of them is enough")
    if given is None and powers is None and count == 1:
        return ("1",)
    texts: list[Any] | None = None
    if isinstance(given, list):
        texts = given
    elif isinstance(powers, list):
        texts = [_product(row, spec.states) for row in powers]
    if texts is None or len(texts) != count or not all(isinstance(text, str) and text for text in texts):
        what = f"{count} coefficient matrices need as many `monomials`, or rows of `powers`"
        _refuse(path, codes.WRONG_SHAPE, what, _help())
    return tuple(texts)


def _product(row: Any, states: Sequence[str]) -> str:
    """The product of powers of the states; empty if the row is of another kind."""
    if not isinstance(row, list) or len(row) != len(states):
        return ""
    if not all(isinstance(e, int | float | _Written) and len(str(e)) < 5 for e in row):
        return ""
    try:
        exponents = [Fraction(e) for e in row]
    except ValueError:
        return ""
    if not all(e.denominator == 1 and e >= 0 for e in exponents):
        return ""
    parts = [name if e == 1 else f"{name}**{e}" for name, e in zip(states, exponents, strict=True) if e]
    return "*".join(parts) or "1"


def _check_symmetry(path: str, matrices: Sequence[Sequence[Sequence[str]]]) -> None:
    for k, block in enumerate(matrices):
        exact = [[Fraction(e) for e in row] for row in block]
        most = max(abs(e) for row in exact for e in row)
        for i, row in enumerate(exact):
            for j in range(i):
                if abs(row[j] - exact[j][i]) > _CLOSE * most:
                    what = f"coefficient matrix {k + 1} is not symmetric in entry ({i + 1}, {j + 1})"
                    _refuse(path, codes.SYMMETRY, what, "")


def _help() -> str:
    return (
        "it holds `coefficients`: W itself where that is constant, else K symmetric matrices with `monomials` or "
        "`powers`; `rate` beside them; docs/verify.md has examples"
    )


def _refuse(path: str, code: str, message: str, help: str, line: int = 1) -> NoReturn:
    place = Location(file=path, line=line, column=1)
    raise SpecError([Finding(code=code, message=message, location=place, help=help)])
