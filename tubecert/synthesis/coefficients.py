"""Coefficients of a metric as other tools keep them -> the text of a metric file.

W(x) = sum_k g_k(x) W_k, from JSON, CSV, .npz or .mat. Such a file has `coefficients` W_k, (K, n, n) or (n, n) - in a
.mat file (n, n, K) -, and of the g_k either `monomials`, K texts in the grammar of specifications, or `powers`, (K, n)
exponents of the states in the order of the specification; neither for a constant W. `rate` in 1/s may stand there as
well. A CSV file has the columns monomial, row, column, value, counted from 1, where of two entries across the diagonal
one suffices; or it is a constant W itself, row by row. A float stands for its shortest decimal. Entries across the
diagonal may differ by rounding; that above it counts. What comes out is read as any metric file is, with its symmetry,
and proven.
"""

from __future__ import annotations

import csv
import io
import json
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, NoReturn, TypeAlias

from tubecert.errors import SpecError
from tubecert.expression import ExpressionError, constant, number_text, parse, symbol
from tubecert.files import Kind, read
from tubecert.findings import Finding, Location
from tubecert.spec import Spec, codes, metric_file
from tubecert.spec.source import METRIC, Source, read_source

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
_HELP: Final = (
    "it holds `coefficients`: W itself where that is constant, else K symmetric matrices with `monomials` or "
    "`powers`; `rate` beside them; docs/synthesis.md has examples"
)

Content: TypeAlias = Mapping[str, Any]
Block: TypeAlias = Sequence[Sequence[str]]


def with_metric_file(spec: Spec, path: str, rate: Fraction | None = None) -> Spec:
    """The specification with the metric of a file, also one of coefficients, in place of its own.

    `rate` stands in for that of coefficients.
    Raises `TargetError` if the file cannot be read, `SpecError` with every problem in it.
    """
    own = _is_of_coefficients(path)
    source = Source.of(path, _metric_text(path, spec, rate)) if own else read_source(path, METRIC)
    return metric_file.with_metric(spec, source)


def _metric_text(path: str, spec: Spec, rate: Fraction | None) -> str:
    """The text of a metric file for the specification's states; raises `SpecError` for what is no such file."""
    file = _File(path, spec)
    content = _READERS[Path(path).suffix.lower()](file)
    blocks, own_rate = file.numbers(content)
    monomials = file.monomials(content, len(blocks))
    file.check_symmetry(blocks)
    if rate is None and own_rate is None:
        file.refuse(codes.MISSING_KEY, "the file has no rate", "add `rate`, in 1/s, or give --rate")
    file.check_monomials(monomials)
    each, n = list(zip(blocks, monomials, strict=True)), range(file.n)
    rows = [[_sum((block[min(i, j)][max(i, j)], own) for block, own in each) for j in n] for i in n]
    text = own_rate if rate is None else number_text(rate)
    return json.dumps({"format": metric_file.FORMAT, "rate": text, "dual_metric": rows})


def _is_of_coefficients(path: str) -> bool:
    """Whether a file is one of these: by its name, and a JSON file by what it holds."""
    suffix = Path(path).suffix.lower()
    if suffix != ".json":
        return suffix in _READERS
    try:
        content = json.loads(read(path, _KIND))
    except (ValueError, RecursionError):
        return False
    return isinstance(content, dict) and "coefficients" in content


def _sum(parts: Iterable[tuple[str, str]]) -> str:
    """The sum of numbers times monomials."""
    terms = [f"({q})" if own == "1" else f"({q})*({own})" for q, own in parts if Fraction(q)]
    return " + ".join(terms) or "0"


class _File:
    """A file of coefficients for the `n` states of a specification; what is wrong with it raises `SpecError`."""

    def __init__(self, path: str, spec: Spec) -> None:
        self.path, self.spec, self.n = path, spec, len(spec.states)

    @property
    def data(self) -> bytes:
        """Its bytes."""
        return read(self.path, _KIND)

    def refuse(self, code: str, message: str, help: str = _HELP, line: int = 1) -> NoReturn:
        """Raises."""
        place = Location(file=self.path, line=line, column=1)
        raise SpecError([Finding(code=code, message=message, location=place, help=help)])

    def numbers(self, content: Content) -> tuple[list[Block], str | None]:
        """The W_k, (K, n, n), and the rate if there is one, as texts of numbers."""
        if "coefficients" not in content:
            self.refuse(codes.MISSING_KEY, "there are no `coefficients`")
        found, rate = content["coefficients"], content.get("rate")
        try:
            blocks = list(found) if isinstance(found[0][0], list) else [found]  # one may stand alone
            if sum(len(row) for block in blocks for row in block) > _MOST:
                self.refuse(codes.LIMIT, f"there are more than {_MOST:,} coefficients", "")
            exact: list[Block] = [[[_number(own) for own in row] for row in block] for block in blocks]
            while isinstance(rate, list) and len(rate) == 1:
                rate = rate[0]
            rate = None if rate is None else _number(rate)
        except (ValueError, TypeError, ZeroDivisionError):
            self.refuse(codes.NUMBER, "a coefficient, or the rate, is no finite number")
        if any(len(block) != self.n or any(len(row) != self.n for row in block) for block in exact):
            self.refuse(codes.WRONG_SHAPE, f"the coefficients are not K matrices of {self.n} x {self.n}")
        return exact, rate

    def monomials(self, content: Content, count: int) -> list[str]:
        """The g_k as texts, given or by their powers."""
        given, powers = content.get("monomials"), content.get("powers")
        if given is not None and powers is not None:
            self.refuse(codes.DUPLICATE_KEY, "there are `monomials` and `powers`", "one of them is enough")
        if given is None and powers is None and count == 1:
            return ["1"]
        found = given
        if not isinstance(given, list) and isinstance(powers, list):
            found = [_product(row, self.spec.states) for row in powers]
        texts: list[Any] = found if isinstance(found, list) else []
        if len(texts) != count or not all(isinstance(own, str) and own for own in texts):
            what = f"{count} coefficient matrices need as many `monomials`, or rows of `powers`"
            self.refuse(codes.WRONG_SHAPE, what)
        return texts

    def check_monomials(self, monomials: Sequence[str]) -> None:
        """Each of them is an expression by itself: put together they could read as something else."""
        known = {name: symbol(name) for name in self.spec.states}
        known |= {name: constant(value) for name, value in self.spec.parameters}
        for text in monomials:
            try:
                parse(text, symbols=known)
            except ExpressionError as error:
                self.refuse(codes.EXPRESSION, f"the monomial {text[:60]!r}: {error.message}", error.help)

    def check_symmetry(self, blocks: Sequence[Block]) -> None:
        """Entries across the diagonal are equal, up to rounding."""
        for k, block in enumerate(blocks):
            exact = [[Fraction(e) for e in row] for row in block]
            most = max(abs(e) for row in exact for e in row)
            for i, row in enumerate(exact):
                for j in range(i):
                    if abs(row[j] - exact[j][i]) > _CLOSE * most:
                        what = f"coefficient matrix {k + 1} is not symmetric in entry ({i + 1}, {j + 1})"
                        self.refuse(codes.SYMMETRY, what, "")


def _number(value: Any) -> str:
    """A finite number as text: as written, or the shortest decimal of a float."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise TypeError("no number")
    text = value if isinstance(value, str) else repr(value)
    if len(text) > 60 or abs(int(text.lower().partition("e")[2] or 0)) > 400:
        raise ValueError("no number of moderate size")
    return number_text(Fraction(text))


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


class _Written(str):
    """A number as it is written."""


def _json(file: _File) -> Content:
    try:
        content = json.loads(file.data, parse_float=_Written, parse_int=_Written)
    except (ValueError, RecursionError) as error:
        file.refuse(codes.WRONG_TYPE, f"this is no JSON: {error}", "")
    if not isinstance(content, dict):
        file.refuse(codes.WRONG_TYPE, "this is no object with coefficients")
    if unknown := next((key for key in content if key not in _KEYS), None):
        file.refuse(codes.UNKNOWN_KEY, f"{unknown[:40]!r} is not known")
    return content


def _csv(file: _File) -> Content:
    try:
        rows = [row for row in csv.reader(io.StringIO(file.data.decode("utf-8-sig"))) if row]
    except (UnicodeDecodeError, csv.Error) as error:
        file.refuse(codes.WRONG_TYPE, f"this is no CSV: {error}", "")
    rows, n = [[cell.strip() for cell in row] for row in rows], file.n
    if len(rows) == n and all(len(row) == n for row in rows) and rows[0][0] != _COLUMNS[0]:
        return {"coefficients": rows}
    if not rows or rows[0] != _COLUMNS:
        message = f"neither {n} rows of {n} numbers, nor a first line monomial,row,column,value"
        file.refuse(codes.WRONG_SHAPE, message)
    entries: dict[str, dict[tuple[int, int], str]] = {}
    for line, cells in enumerate(rows[1:], start=2):
        try:
            i, j, value = int(cells[1]) - 1, int(cells[2]) - 1, _number(cells[3])
        except (ValueError, IndexError):
            file.refuse(codes.WRONG_SHAPE, f"line {line} is not monomial,row,column,value", line=line)
        if not (0 <= i < n and 0 <= j < n):
            file.refuse(codes.WRONG_SHAPE, f"line {line}: W is {n} x {n}, counted from 1", "", line)
        own = entries.setdefault(cells[0], {})
        if (i, j) in own:
            file.refuse(codes.DUPLICATE_KEY, f"line {line}: the entry occurs twice", "", line)
        own[i, j] = value
    blocks = [
        [[own.get((i, j), own.get((j, i), "0")) for j in range(n)] for i in range(n)]
        for own in entries.values()
    ]
    return {"monomials": list(entries), "coefficients": blocks}


def _npz(file: _File) -> Content:
    import numpy as np

    data = file.data
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(item.file_size for item in archive.infolist()) > _KIND.most:
                file.refuse(codes.LIMIT, f"the arrays are larger than {_KIND.most:,} bytes", "")
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            return {key: arrays[key].tolist() for key in arrays.files if key in _KEYS}
    except (ValueError, OSError, zipfile.BadZipFile, KeyError, EOFError) as error:
        file.refuse(codes.WRONG_TYPE, f"this is no .npz of plain arrays: {error}")


def _mat(file: _File) -> Content:
    import numpy as np
    from scipy.io import loadmat

    data = file.data
    try:
        found = loadmat(io.BytesIO(data), variable_names=_KEYS)  # type: ignore[arg-type]
    except NotImplementedError:
        file.refuse(codes.WRONG_TYPE, "this is a .mat file of version 7.3", "save it with -v7")
    except Exception as error:  # its reader raises whatever it meets in a broken file
        file.refuse(codes.WRONG_TYPE, f"this is no .mat file: {error}")
    content: dict[str, Any] = {}
    for key in (key for key in _KEYS if key in found):
        array = np.asarray(found[key])
        if key == "coefficients" and array.ndim == 3:
            array = np.moveaxis(array, -1, 0)
        if key == "monomials":
            content[key] = [str(np.asarray(cell).ravel()[0]).strip() for cell in array.ravel()]
        else:
            content[key] = array.ravel()[0].item() if key == "rate" else array.tolist()
    return content


_READERS: Final[Mapping[str, Callable[[_File], Content]]] = {
    ".json": _json,
    ".csv": _csv,
    ".npz": _npz,
    ".mat": _mat,
}
