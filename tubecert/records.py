"""Records: frozen dataclasses as JSON and back, strictly; what does not fit is an error that says where.

In: dataclasses whose annotations say what a field holds. Out: JSON values; and from JSON values the same dataclasses.
A field that equals its default is left out; a field without a default is always written, None as null. An exact number
(`Fraction`) is a JSON number where one of at most 17 digits is exact, else a text: a decimal, or `p/q`.
Trusted: yes.
"""

from __future__ import annotations

import math
import re
import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from fractions import Fraction
from functools import cache
from typing import Any, ClassVar, Literal, TypeVar, Union, cast

from tubecert.expression import number_text

T = TypeVar("T")
Json = Any  # what `json` reads and writes
OPEN: set[Any] = set()  # records that are views of part of what is there: other members are left alone
INLINE: Mapping[str, bool] = {"inline": True}  # metadata: the members stand beside those of the record


def keyed(kinds: Callable[[], Mapping[str, Any]]) -> Mapping[str, Any]:
    """Metadata of a mapping whose members stand beside those of the record: the names that it may have, with types."""
    return {"keyed": kinds}


class FormError(ValueError):
    """A JSON value is not what its place needs; `path` says where."""

    def __init__(self, path: str, what: str) -> None:
        super().__init__(f"{path} {what}")
        self.path = path


class Tagged:
    """Base of a family of records that are told apart by a member named `key`: the `tag` of the class.

    A direct subclass is a family; its subclasses are the members, each with a tag of its own: its name with underscores
    (`OtherMetric`: `other_metric`), where it does not say another.
    """

    __slots__ = ()
    key: ClassVar[str] = "id"
    tag: ClassVar[str] = ""
    family: ClassVar[dict[str, type[Tagged]]]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if Tagged in cls.__bases__:
            cls.family = {}
        else:
            cls.tag = cls.__dict__.get("tag") or re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower()
            cls.family[cls.tag] = cls


# -- exact numbers, and types of other rooms


def exact_json(value: Fraction) -> float | str:
    """An exact number: a JSON number whose shortest decimal is it, else a text."""
    try:
        near = float(value)
    except OverflowError:
        return number_text(value)
    return near if Fraction(repr(near)) == value else number_text(value)


_DECIMAL = re.compile(r"-?\d{1,1500}(\.\d{1,1500})?(e[+-]?\d{1,3})?")
_QUOTIENT = re.compile(r"-?\d{1,1500}/0*[1-9]\d{0,1500}")


def _exact(value: Json, path: str) -> Fraction:
    if isinstance(value, str) and (_DECIMAL.fullmatch(value) or _QUOTIENT.fullmatch(value)):
        return Fraction(value)
    if isinstance(value, (int, float)) and not isinstance(value, bool) and _finite(value):
        return Fraction(repr(value))
    raise FormError(path, "is not a number")


def _finite(value: float) -> bool:
    """Whether a number of JSON is one of floats: an integer may be beyond them."""
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


_FOREIGN: dict[Any, tuple[Callable[[Any], Json], Callable[[Json, str], Any]]] = {
    Fraction: (exact_json, _exact)
}


def foreign(kind: type[T], encode: Callable[[T], Json], decode: Callable[[Json, str], T]) -> None:
    """How a type that is no record is written and read."""
    _FOREIGN[kind] = (encode, decode)


# -- out


def to_json(value: Any) -> Json:
    """A value as JSON."""
    for kind, (encode, _) in _FOREIGN.items():
        if isinstance(value, kind):
            return encode(value)
    if is_dataclass(value) and not isinstance(value, type):
        return _record_json(value)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Mapping):
        return {str(key): to_json(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [to_json(item) for item in value]
    if value is None or isinstance(value, (str, bool, int)):
        return value
    if isinstance(value, float) and math.isfinite(value):
        return float(value)
    raise TypeError(f"{value!r} has no place in JSON")


def _record_json(record: Any) -> dict[str, Json]:
    data: dict[str, Json] = {record.key: record.tag} if isinstance(record, Tagged) else {}
    for item in fields(record):
        value = getattr(record, item.name)
        if item.metadata.get("inline") or item.metadata.get("keyed"):
            data |= to_json(value)
        elif required(item) or value != default(item):
            data[item.name] = to_json(value)
    return data


def required(item: Field[Any]) -> bool:
    """Whether a field is always written: it has no default."""
    return item.default is MISSING and item.default_factory is MISSING


def default(item: Field[Any]) -> Any:
    """What a field is where it is left out."""
    return item.default if item.default_factory is MISSING else item.default_factory()


# -- in


def from_json(kind: type[T], data: Json, path: str) -> T:
    """The value of type `kind` in JSON data.

    Raises `FormError` for what is missing, not known, or of another type.
    """
    return cast(T, _read(kind, data, path))


def _read(kind: Any, data: Json, path: str) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (Union, types.UnionType):
        return _optional(arguments, data, path)
    if (known := _FOREIGN.get(kind) or _FOREIGN.get(origin)) is not None:
        return known[1](data, path)
    if origin is tuple:
        return _sequence(arguments, data, path)
    if origin is not None and isinstance(origin, type) and issubclass(origin, Mapping):
        return {
            key: _read(arguments[1], value, f"{path}.{key}") for key, value in _object(data, path).items()
        }
    if origin is Literal:
        return _one_of(arguments, data, path)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(_one_of([member.value for member in kind], data, path))
    if isinstance(kind, type) and issubclass(kind, Tagged) and not kind.tag:
        return _member(kind, _object(data, path), path)
    if is_dataclass(kind):
        return _record(kind, _object(data, path), path)
    return _scalar(kind, data, path)


def _optional(kinds: tuple[Any, ...], data: Json, path: str) -> Any:
    (inner,) = (kind for kind in kinds if kind is not types.NoneType)
    return None if data is None else _read(inner, data, path)


def _sequence(kinds: tuple[Any, ...], data: Json, path: str) -> tuple[Any, ...]:
    if not isinstance(data, list):
        raise FormError(path, "is not a list")
    if kinds[-1] is Ellipsis:
        kinds = (kinds[0],) * len(data)
    if len(kinds) != len(data):
        raise FormError(path, f"has {len(data)} entries, not {len(kinds)}")
    return tuple(
        _read(kind, item, f"{path}[{i}]") for i, (kind, item) in enumerate(zip(kinds, data, strict=True))
    )


def _object(data: Json, path: str) -> dict[str, Json]:
    if not isinstance(data, dict):
        raise FormError(path, "is not an object")
    return data


def _one_of(known: typing.Sequence[Any], data: Json, path: str) -> Any:
    if not isinstance(data, (str, int, float)) or data not in known:
        raise FormError(path, f"is none of {', '.join(map(str, known))}")
    return data


def _scalar(kind: Any, data: Json, path: str) -> Any:
    words = {str: "a text", bool: "true or false", int: "an integer", float: "a number"}
    if kind not in words:
        raise TypeError(f"{path}: no record can hold {kind}")
    fits = isinstance(data, (int, float)) if kind is float else isinstance(data, kind)
    if not fits or (kind is not bool and isinstance(data, bool)):
        raise FormError(path, f"is not {words[kind]}")
    if kind is float and not _finite(data):
        raise FormError(path, "is not finite")
    return data


def _member(family: type[Tagged], data: dict[str, Json], path: str) -> Any:
    if family.key not in data:
        raise FormError(f"{path}.{family.key}", "is missing")
    kind = family.family[_one_of(list(family.family), data[family.key], f"{path}.{family.key}")]
    return _record(kind, data, path)


def _record(kind: Any, data: dict[str, Json], path: str) -> Any:
    left = dict(data)
    if issubclass(kind, Tagged):
        tag = left.pop(kind.key, None)
        if tag != kind.tag:
            raise FormError(f"{path}.{kind.key}", f"is not {kind.tag}")
    values: dict[str, Any] = {}
    for item, hint in members(kind):
        if item.metadata.get("inline"):
            names = _names(hint, left, path)
            values[item.name] = _read(hint, {name: left.pop(name) for name in names if name in left}, path)
        elif kinds := item.metadata.get("keyed"):
            own = {name: each for name, each in kinds().items() if name in left}
            values[item.name] = {
                name: _read(each, left.pop(name), f"{path}.{name}") for name, each in own.items()
            }
        elif item.name in left:
            values[item.name] = _read(hint, left.pop(item.name), f"{path}.{item.name}")
        elif required(item):
            raise FormError(f"{path}.{item.name}", "is missing")
    if left and kind not in OPEN:
        raise FormError(f"{path}.{sorted(left)[0]}", "is not known")
    try:
        return kind(**values)
    except (ValueError, AssertionError) as error:  # what the record asserts of its values
        raise FormError(path, f"is inconsistent: {error}") from error


def _names(hint: Any, data: dict[str, Json], path: str) -> list[str]:
    """The members that belong to a record whose members stand beside others."""
    if issubclass(hint, Tagged) and not hint.tag:
        if hint.key not in data:
            raise FormError(f"{path}.{hint.key}", "is missing")
        tag = _one_of(list(hint.family), data[hint.key], f"{path}.{hint.key}")
        hint = hint.family[tag]
    own = [hint.key] if issubclass(hint, Tagged) else []
    return own + [item.name for item in fields(hint)]


@cache
def members(kind: Any) -> tuple[tuple[Field[Any], Any], ...]:
    """The fields of a record with their types."""
    hints = typing.get_type_hints(kind)
    return tuple((item, hints[item.name]) for item in fields(kind))
