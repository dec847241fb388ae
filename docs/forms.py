"""The JSON Schema of records: what `tubecert.records` reads and writes, said to others."""

from __future__ import annotations

import types
import typing
from collections.abc import Mapping
from dataclasses import Field, fields, is_dataclass
from enum import Enum
from fractions import Fraction
from typing import Any, Literal, Union

from tubecert.certificate.effective import Effective
from tubecert.enclosure.constant import Constant, Witness
from tubecert.enclosure.interval import Array
from tubecert.records import Json, Tagged, default, members, required

_REFERRED: dict[Any, str] = {  # types with a definition of their own
    Fraction: "decimal",
    Witness: "point",
    Constant: "enclosure",
    Array: "matrix",
    Effective: "specification",
}


def schema(kind: Any) -> Json:
    """The JSON Schema of the values of a type; a record is described by the first line of its docstring."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (Union, types.UnionType):
        (inner,) = (each for each in arguments if each is not types.NoneType)
        return {"anyOf": [schema(inner), {"type": "null"}]}
    if kind in _REFERRED:
        return {"$ref": f"#/$defs/{_REFERRED[kind]}"}
    if origin is tuple and arguments[-1] is Ellipsis:
        return {"type": "array", "items": schema(arguments[0])}
    if origin is tuple:
        return {"type": "array", "prefixItems": list(map(schema, arguments)), "minItems": len(arguments)}
    if origin is not None and isinstance(origin, type) and issubclass(origin, Mapping):
        return {"type": "object", "additionalProperties": schema(arguments[1])}
    if origin is Literal:
        return {"enum": list(arguments)}
    if isinstance(kind, type) and issubclass(kind, Enum):
        return {"enum": [member.value for member in kind]}
    if isinstance(kind, type) and issubclass(kind, Tagged) and not kind.tag:
        return {"anyOf": [_record_schema(member) for member in kind.family.values()]}
    if is_dataclass(kind):
        return _record_schema(kind)
    return {"type": {str: "string", bool: "boolean", int: "integer", float: "number"}[kind]}


def _record_schema(kind: Any) -> Json:
    inlined = [hint for item, hint in members(kind) if item.metadata.get("inline")]
    if inlined and issubclass(inlined[0], Tagged):
        own = _own_schema(kind)
        return {"anyOf": [_joined(_record_schema(each), own) for each in inlined[0].family.values()]}
    return _own_schema(kind)


def _own_schema(kind: Any) -> dict[str, Json]:
    own = [(item, hint) for item, hint in members(kind) if not item.metadata]
    properties = {item.name: schema(_written(item, hint)) for item, hint in own}
    for item in fields(kind):
        if kinds := item.metadata.get("keyed"):
            properties |= {name: schema(each) for name, each in kinds().items()}
    needed = [item.name for item, _ in own if required(item)]
    if issubclass(kind, Tagged):
        properties, needed = {kind.key: {"const": kind.tag}, **properties}, [kind.key, *needed]
    words = " ".join((kind.__doc__ or "").partition("\n\n")[0].split())
    found = {"type": "object", "description": words, "properties": properties, "required": needed}
    return found if needed else {key: value for key, value in found.items() if key != "required"}


def _written(item: Field[Any], hint: Any) -> Any:
    """The type of a member where it is written: a None that is the default is left out."""
    kinds = typing.get_args(hint)
    left_out = not required(item) and default(item) is None and types.NoneType in kinds
    return next(kind for kind in kinds if kind is not types.NoneType) if left_out else hint


def _joined(one: dict[str, Json], other: dict[str, Json]) -> dict[str, Json]:
    return {
        **one,
        "properties": {**one["properties"], **other["properties"]},
        "required": [*one.get("required", ()), *other.get("required", ())],
    }
