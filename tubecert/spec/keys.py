"""The vocabulary of the table of keys: kinds, which say what may stand at a key, keys, and sections of keys.

From the table alone a file is read (every problem a located finding), unknown keys are compared with those that there
are, the canonical form is written, and docs/generate.py writes the JSON Schema and the reference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace
from fractions import Fraction
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias

from tubecert.expression import Side, constant, full_text, number_text, to_text
from tubecert.spec import codes
from tubecert.spec.reader import Field, whole
from tubecert.spec.values import Matrix, Term, TermMatrix, Vector

if TYPE_CHECKING:
    from tubecert.spec.names import Names, Use  # which reads tables by keys

Whose: TypeAlias = Literal["states", "inputs", "lengths", "quantities"]
Schema: TypeAlias = Mapping[str, Any]

AUTO: Final = "auto"
CHOSEN: Final = object()  # what a kind reads where nothing is fixed: the value is None, and it is sound
NUMBER: Final[Schema] = {"$ref": "#/$defs/number"}
EXPRESSION: Final[Schema] = {"$ref": "#/$defs/expression"}
NAME: Final[Schema] = {"$ref": "#/$defs/name"}
PAIR: Final[Schema] = {"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2}
LIST: Final[Schema] = {"type": "array", "items": NUMBER, "minItems": 1}
TEXTS: Final[Schema] = {"type": "array", "items": EXPRESSION, "minItems": 1}


def _as_it_is(value: Any, _spec: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


@dataclass(frozen=True, slots=True)
class Kind:
    """What may stand at a key, as functions.

    `read`: the value, None if what stands there will not do (which is reported), `CHOSEN` for a sound None; `schema`:
    its JSON Schema, where a section stands for its own; `write`: the canonical form of a value.
    """

    read: Callable[[Field, Names], Any]
    schema: Schema
    write: Callable[[Any, Any], Any] = _as_it_is


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """A key: its kind, and where its value is kept, a dotted path of attributes (empty: nowhere by itself).

    `late`: its section reads it, with what others say; `always`: it is in the canonical form even if nothing is fixed;
    `words` are those of the docstring below it, if it stands in a class; `beside` goes to the schema.
    """

    kind: Kind
    into: str | None = None
    needed: bool = False
    late: bool = False
    always: bool = False
    words: str = ""
    beside: Schema = field(default_factory=dict)


def entry(kind: Kind, into: str | None = None, *, said: Any = None, example: Any = None, **more: Any) -> Key:
    """A key that is no field of a class; `said`: its default as the schema says it; `more` as in `Key`."""
    beside = {"default": said, "examples": example and [example]}
    kept = {name: value for name, value in beside.items() if value is not None}
    return Key(kind=kind, into=into, beside=kept, **more)


def key(kind: Kind, default: Any = MISSING, *, name: str = "", **more: Any) -> Any:
    """A field of a class that is a key, needed without a `default`; `name`, if it is not the field's."""
    own = entry(kind, **{"needed": default is MISSING, **more})
    return field(default=default, metadata={"key": own, "name": name})


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """Keys that stand together; `make` is the class of what they say; `form`: what the schema says beside them."""

    keys: Mapping[str, Key]
    make: type | None = None
    words: str = ""
    reserved: tuple[str, ...] = ()
    form: Schema = field(default_factory=dict)

    @property
    def needed(self) -> tuple[str, ...]:
        """The keys that may not be left out."""
        return tuple(name for name, own in self.keys.items() if own.needed)

    def entries(self, field: Field | None, needed: Sequence[str] | None = None) -> dict[str, Field] | None:
        """The values of the keys that are there; `needed` in place of those that are."""
        needed = self.needed if needed is None else needed
        others = [name for name in self.keys if name not in needed]
        return field.mapping(required=needed, optional=others, reserved=self.reserved) if field else None

    def values(self, entries: Mapping[str, Field], names: Names) -> dict[str, Any]:
        """What is read by itself and will do."""
        found = {name: self.keys[name].kind.read(entries[name], names) for name in self._read(entries)}
        kept = ((name, value) for name, value in found.items() if value is not None)
        return {self._attribute(name): None if value is CHOSEN else value for name, value in kept}

    def holds(self, found: Mapping[str, Any], entries: Mapping[str, Field]) -> bool:
        """Whether all that is there will do, and nothing is missing."""
        return len(found) == len(self._read(entries)) and all(name in entries for name in self.needed)

    def sound(self, entries: Mapping[str, Field] | None, names: Names) -> dict[str, Any] | None:
        """The values if that is so."""
        found = None if entries is None else self.values(entries, names)
        return found if found is not None and entries is not None and self.holds(found, entries) else None

    def read(self, field: Field | None, names: Names) -> Any:
        """The section as a value of its class; None if it is absent or unsound."""
        found = self.sound(self.entries(field), names)
        return None if found is None or self.make is None else self.make(**found)

    def written(self, value: Any, spec: Any = None) -> dict[str, Any]:
        """The canonical form of what the section says."""
        data = {}
        for name, own in self.keys.items():
            said = None if own.into == "" else attrgetter(own.into or name)(value)
            if own.always or (said is not None and said != ()):
                data[name] = own.kind.write(said, spec)
        return data

    def _read(self, entries: Mapping[str, Field]) -> list[str]:
        return [name for name, own in self.keys.items() if name in entries and not own.late]

    def _attribute(self, name: str) -> str:
        return (self.keys[name].into or name).rpartition(".")[2]


def section(make: type, *, within: str = "", reserved: tuple[str, ...] = (), **form: Any) -> Section:
    """The section of a class; its words are the first paragraph of the docstring."""
    words = " ".join((make.__doc__ or "").partition("\n\n")[0].split())
    return Section(keys=_keys_of(make, within), make=make, words=words, reserved=reserved, form=form)


def _keys_of(make: type, within: str) -> dict[str, Key]:
    """The keys of a class, fields and others; the values of fields are kept in it, `within` another one."""
    of_fields: dict[str, Mapping[str, Any]] = {}
    if is_dataclass(make):
        of_fields = {own.name: own.metadata for own in fields(make)}
    found = {}
    for name in (*make.__annotations__, *vars(make)):
        if isinstance(own := vars(make).get(name), Key):
            found[name] = own
        elif own := of_fields.get(name, {}).get("key"):
            found[of_fields[name]["name"] or name] = replace(own, into=f"{within}.{name}".lstrip("."))
    return found


# kinds


def number(*, whole: str | None = None, side: Side = "nearest", **bounds: int) -> Kind:
    """A number, `above`, at `least`, at `most`; rounded to a side if irrational; `whole`: what to say if it is not."""

    def read(field: Field, names: Names) -> Fraction | int | None:
        value = field.number(names.values, side=side, **bounds)
        if value is None or whole is None or value.denominator == 1:
            return value if value is None or whole is None else int(value)
        return field.fail(codes.RANGE, f"{field.path} must be a whole number", whole)

    return Kind(read, NUMBER, lambda value, _: number_text(Fraction(value)))


SIZE: Final = number(least=0, side="above")  # of what is at most that


def word(*choices: str, also: Sequence[Any] = (), means: Mapping[str, Any] | None = None) -> Kind:
    """One of the words, kept as what it `means`; `also`: how YAML may write them."""
    kept = means or {choice: choice for choice in choices}
    back = {kept[choice]: choice for choice in reversed(choices)}

    def read(field: Field, _: Names) -> Any:
        found = field.word(choices)
        return None if found is None else kept[found]

    return Kind(read, {"enum": [*choices, *also]}, lambda value, _: back[value])


YES: Final = word("true", "false", also=(True, False), means={"true": True, "false": False})


def several(whose: Whose | tuple[str, ...], what: str, many: str, **schema: Any) -> Kind:
    """Some of the words, each once; at least one if they are known beforehand."""

    def read(field: Field, names: Names) -> tuple[str, ...] | None:
        items, known = field.items(None, many), whose if isinstance(whose, tuple) else getattr(names, whose)
        chosen: list[str] = []
        for item in items or ():
            found = item.word(known)
            if found in chosen:
                item.fail(codes.RANGE, f"{item.path}: {found} occurs twice", f"name each {what} once")
            elif found:
                chosen.append(found)
        if known is whose and items is not None and not items:
            field.fail(codes.RANGE, f"{field.path} is empty", f"choose from {', '.join(known)}")
        return None if items is None else tuple(chosen)

    return Kind(read, {"type": "array", **schema})


def or_auto(kind: Kind) -> Kind:
    """The same, or auto, which fixes nothing."""
    return Kind(
        lambda field, names: CHOSEN if says(field, AUTO) else kind.read(field, names),
        {"anyOf": [{"const": AUTO}, kind.schema]},
        lambda value, spec: AUTO if value is None else kind.write(value, spec),
    )


def numbers(count: Whose | Literal[2], schema: Schema = LIST) -> Kind:
    """A list of numbers, one per state or input, or two."""

    def read(field: Field, names: Names) -> Vector | None:
        return field.numbers(count if isinstance(count, int) else len(getattr(names, count)), names.values)

    return Kind(read, schema, numbers_text)


def constants(whose: Whose) -> Kind:
    """The same, as expressions."""

    def read(field: Field, names: Names) -> tuple[Term, ...] | None:
        values = field.numbers(len(getattr(names, whose)), names.values)
        items = zip(field.items() or (), values, strict=True) if values else ()
        return tuple(constant_term(*each) for each in items) or None

    return Kind(read, LIST, texts)


def expressions(whose: Whose, use: Use) -> Kind:
    """A list of expressions, one per state or input, in the names that their use allows."""

    def read(field: Field, names: Names) -> tuple[Term, ...] | None:
        what = f"expressions, one per {whose.removesuffix('s')}"
        return field.terms(len(getattr(names, whose)), names.scope(use), what)

    return Kind(read, TEXTS, texts)


def ends(*, inward: str = "", order: str = "", **more: Any) -> Kind:
    """[lower, upper], rounded outward if it has pi in it; `inward`: what an end is called of a set that is rounded
    inward, as what stays in it stays in the one that was written; else as in `Field.ends`.
    """
    if inward:
        order = f"the lower {inward} must be below the upper {'one' if inward == 'limit' else inward}"
        more = {"sides": ("above", "below")}
    return Kind(lambda field, names: field.ends(names.values, order=order, **more), PAIR, numbers_text)


def named(whose: Whose, kind: Kind, shown: str = "") -> Kind:
    """Values of some states, inputs or outputs as (name, value), in their order; `shown`: one of at least one."""

    def read(field: Field, names: Names) -> tuple[tuple[str, Any], ...] | None:
        known = getattr(names, whose)
        entries = field.mapping(optional=known, named=True)
        if entries is None:
            return None
        if shown and not field.pairs():
            return field.fail(
                codes.RANGE, f"{field.path} is empty", f"write {{{known[0]}: {shown}}} or the like"
            )
        there = [name for name in known if name in entries]
        found = whole(kind.read(entries[name], names) for name in there)
        return None if found is None else tuple(zip(there, found, strict=True))

    form = by_name(kind.schema) | ({"minProperties": 1} if shown else {})
    return Kind(read, form, lambda values, spec: {name: kind.write(value, spec) for name, value in values})


def each(whose: Whose, kind: Kind) -> Kind:
    """A value of every state or input, in their order."""

    def read(field: Field, names: Names) -> tuple[Any, ...] | None:
        known = getattr(names, whose)
        entries = field.mapping(required=known, named=True) or {}
        return whole((kind.read(entries[name], names) for name in known if name in entries), len(known))

    def write(values: Iterable[Any], spec: Any) -> dict[str, Any]:
        return {name: kind.write(own, spec) for name, own in zip(getattr(spec, whose), values, strict=True)}

    return Kind(read, by_name(kind.schema) | {"minProperties": 1}, write)


def by_name(schema: Schema) -> dict[str, Any]:
    """The schema of values by names of the file's own."""
    return {"type": "object", "propertyNames": NAME, "additionalProperties": schema}


def inside(
    own: Section,
    read: Callable[[Field, Names], Any] | None = None,
    write: Callable[[Any, Any], Any] | None = None,
) -> Kind:
    """A section within another one, perhaps with a reader and a writer of its own."""
    return Kind(read or own.read, {"section": own}, write or own.written)


def form(schema: Schema, write: Callable[[Any, Any], Any] = _as_it_is) -> Kind:
    """What a reader of its own reads."""
    return Kind(lambda _field, _names: None, schema, write)


def says(field: Field | None, text: str) -> bool:
    """Whether a word stands there."""
    return field is not None and field.node.kind == "scalar" and field.node.text == text


def constant_term(field: Field, value: Fraction) -> Term:
    """A number as an expression that stands there."""
    e = constant(value)
    return Term(expression=e, obligations=(), places=(), text=to_text(e), location=field.location)


def texts(terms: Iterable[Term], _spec: Any = None) -> list[str]:
    """Expressions with what they owe."""
    return [full_text(term.expression, term.obligations) for term in terms]


def rows_of_texts(matrix: TermMatrix, _spec: Any = None) -> list[list[str]]:
    """The same, row by row."""
    return [texts(row) for row in matrix]


def numbers_text(values: Iterable[Fraction], _spec: Any = None) -> list[str]:
    """Numbers, exactly."""
    return [number_text(value) for value in values]


def rows_of_numbers(matrix: Matrix, _spec: Any = None) -> list[list[str]]:
    """The same, row by row."""
    return [numbers_text(row) for row in matrix]
