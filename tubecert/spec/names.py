"""The names of a specification, outputs among them, and what each kind of expression may use of them."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final, Literal

from tubecert.expression import (
    MAX_NAME_LENGTH,
    ONE,
    RESERVED,
    UNKNOWN,
    ZERO,
    Expression,
    Lookup,
    Obligation,
    Parsed,
    constant,
    derivative,
    free_symbols,
    is_name,
    rates_of,
    substitute,
    symbol,
    topological,
)
from tubecert.spec import codes
from tubecert.spec.document import Node
from tubecert.spec.lookup import read_lookup
from tubecert.spec.reader import Field
from tubecert.spec.values import Ends, Output, Scope, Term

TIME: Final = "t"
MAX_STATES: Final = 32
_KNOWN: Final = "write one number, or [lower, upper]"
_SHOWN: Final = 40  # characters of an expression
_NO_TABLE: Final = "{} is a table; tables may be used in f, B, h and plans, not in a metric or in E"
_A_RANGE: Final = (
    "{} is known by a range only; such a parameter may be used in f and B alone (elsewhere use its middle, in E "
    "the end at which E is largest, by a name of its own)"
)
_NO_INPUT: Final = (
    "what is proven is how near a controller keeps to a plan: name what it could move, with its column of B; of a "
    "plant that is stable by itself it need not move anything: hardware: {rate: 500} and controller: none"
)
# Words of YAML and other spellings of Python's, and functions that the grammar may learn later.
_RESERVED: Final = frozenset(
    RESERVED
    | {TIME, *(word.lower() for word in RESERVED)}
    | {"nan", "inf", "null", "yes", "no", "on", "off"}
    | {"ln", "atan2", "min", "max", "sign", "floor", "ceil", "deg"}
)


Use = Literal["metric", "plant", "drift", "uncertainty", "definition", "plan"]
_MAY: Final[Mapping[Use, tuple[bool, bool, bool, bool, bool]]] = {
    # the state, parameters of which a range is known, time; abs and norm; tables
    "metric": (True, False, False, False, False),  # and E
    "plant": (True, True, False, False, True),  # B
    "drift": (True, True, True, False, True),  # f
    "uncertainty": (True, False, True, True, True),
    "definition": (True, True, True, True, True),  # whatever any of the others may
    "plan": (False, False, True, False, True),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Names:
    """The names of a system, the values of its parameters, and what its definitions stand for.

    Of the parameters in `ranges` only an interval is known: they are symbols, and f and B alone may use them.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: tuple[tuple[str, Fraction], ...]
    irrational: tuple[tuple[str, Expression], ...] = ()  # parameters that contain pi
    definitions: tuple[tuple[str, Parsed], ...] = ()
    ranges: tuple[tuple[str, Ends], ...] = ()
    tables: tuple[tuple[str, Lookup], ...] = ()
    outputs: tuple[Output, ...] = ()
    rates: tuple[tuple[str, str], ...] = ()  # what people call the derivatives of states, and what to say

    @property
    def lengths(self) -> tuple[str, ...]:
        """What may have a half-width: states and outputs."""
        return *self.states, *(output.name for output in self.outputs)

    @property
    def quantities(self) -> tuple[str, ...]:
        """What may have a unit."""
        return *self.lengths, *self.inputs

    @property
    def values(self) -> dict[str, Expression]:
        """The parameters by name."""
        return {name: constant(value) for name, value in self.parameters} | dict(self.irrational)

    def scope(self, use: Use) -> Scope:
        """What an expression may contain for its use."""
        of_state, of_range, of_time, kinks, tables = _MAY[use]
        variables = [*self.states * of_state, *list(dict(self.ranges)) * of_range, *[TIME] * of_time]
        symbols = self.values | {name: symbol(name) for name in variables}
        refused = {name: why for name, why in self._refused(variables) if name not in variables}
        if not tables:
            refused |= {name: _NO_TABLE.format(name) for name, _ in self.tables}
        owed: dict[str, tuple[Obligation, ...]] = {name: () for name, _ in self.irrational}
        for name, parsed in self.definitions:
            why = _foreign(name, parsed, variables, refused, kinks=kinks, tables=tables)
            if why is None:
                symbols[name], owed[name] = parsed.expression, parsed.obligations
            else:
                refused[name] = why
        known = dict(self.tables) if tables else {}
        return Scope(symbols=symbols, tables=known, refused=refused, kinks=kinks, owed=owed)

    def _refused(self, variables: Collection[str]) -> Iterator[tuple[str, str]]:
        """Why names of the file may not stand where these variables do, which are t alone in a plan."""
        plan = not set(self.states) & set(variables)
        through = (
            "a plan is a function of t alone" if plan else "inputs enter through B only (x' = f(x) + B(x) u)"
        )
        yield TIME, "t is allowed in f, h and a trajectory only; B and the metric depend on the state alone"
        yield from () if plan else self.rates
        yield from ((name, f"{name} is a state; {through}") for name in self.states)
        yield from ((name, f"{name} is an input; {through}") for name in self.inputs)
        yield from ((name, _A_RANGE.format(name)) for name, _ in self.ranges)


def _foreign(
    name: str,
    parsed: Parsed,
    variables: Collection[str],
    refused: Mapping[str, str],
    *,
    kinks: bool,
    tables: bool,
) -> str | None:
    """Why a definition may not be used in an expression of some variables."""
    parts = [parsed.expression, *(owed.argument for owed in parsed.obligations)]
    for variable in sorted(free_symbols(parts) - set(variables)):
        return f"{name} depends on {variable}: {refused.get(variable, 'it is not known here')}"
    if not kinks and any(node.op == "norm" for node in topological(parts)):
        return f"{name} contains abs or norm, which are only allowed in h"
    if not tables and any(node.op == "table" for node in topological(parts)):
        return f"{name} contains a table; tables may be used in f, B, h and plans"
    return None


def read_names(system: Mapping[str, Field]) -> Names | None:
    """All that has a name; None if the states or inputs are unusable."""
    taken: dict[str, str] = {}
    states = _name_list(system.get("states"), "state", taken)
    inputs = _name_list(system.get("inputs"), "input", taken)
    values, ranges = _read_parameters(system.get("parameters"), taken)
    if states is None or inputs is None:
        return None
    if len(inputs) > len(states):
        field = system["inputs"]
        return field.fail(
            codes.WRONG_SHAPE,
            f"{len(inputs)} inputs for {len(states)} states: B cannot have independent columns",
        )
    names = Names(
        states=states,
        inputs=inputs,
        parameters=tuple((name, value.fraction) for name, value in values.items() if value.is_constant),
        irrational=tuple((name, value) for name, value in values.items() if not value.is_constant),
        ranges=tuple(ranges.items()),
        rates=tuple(_rates_of_states(system.get("f"), states).items()),
    )
    names = _with_tables(names, system.get("tables"), taken)
    names = _with_definitions(names, system.get("definitions"), taken)
    return _with_outputs(names, system.get("outputs"), taken)


def _name_list(field: Field | None, what: str, taken: dict[str, str]) -> tuple[str, ...] | None:
    if field is not None and field.node.kind == "list" and not 1 <= len(field.node.items) <= MAX_STATES:
        count = len(field.node.items)
        code = codes.LIMIT if count else codes.WRONG_SHAPE
        help = "" if count or what == "state" else _NO_INPUT
        return field.fail(code, f"{field.path} has {count} entries; there must be 1 to {MAX_STATES}", help)
    items = field.items(None, f"{what} names") if field else None
    if items is None:
        return None
    if len(items) == 1 and items[0].node.kind == "list":
        help = f"write [{', '.join(items[0].node.texts)[:60]}]: one pair of brackets is too many"
        message = f"{items[0].path} must be the name of {_with_article(what)}, not a list"
        return items[0].fail(codes.WRONG_TYPE, message, help)
    names = [_new_name(item.text(f"the name of {_with_article(what)}"), item, what, taken) for item in items]
    return tuple(name for name in names if name) if all(names) else None


def _new_name(name: str | None, field: Field, what: str, taken: dict[str, str]) -> str | None:
    """A name that the file gives, if it may be used; it is one of `taken` then."""
    if name is None:
        return None
    problem = _problem(name, taken)
    if problem:
        return field.reader.report(codes.NAME, field.location, *problem)
    taken[name] = what
    return name


def _problem(name: str, taken: Mapping[str, str]) -> tuple[str, str] | None:
    if not name.isascii():
        return f"the name {name[:60]} contains letters outside ASCII", "spell Greek letters out, e.g. theta"
    if name == TIME:
        return "t is the time; it cannot be a name", "choose another name"
    if name in _RESERVED:
        return f"{name} is a reserved word", f"choose another name, e.g. {name}_"
    if re.fullmatch(r"[0-9]+(?:[eE][-+]?[0-9]+)?", name):
        return (
            f"{name[:60]!r} is not a name",
            "after a decimal comma it would be a key: write a decimal point",
        )
    if "=" in name:
        before, _, after = name.partition("=")
        return f"{name[:60]!r} is not a name", f"write {before.strip()[:60]}: {after.strip()[:60]}"
    if " " in name:
        return f"{name[:60]!r} is not a name", f"separate names by commas: {', '.join(name.split())[:60]}"
    if not is_name(name):
        rule = f"a name is a letter followed by letters, digits and _ (at most {MAX_NAME_LENGTH})"
        return f"{name[:60]!r} is not a name", rule
    if name in taken:
        return f"{name} is already the name of {_with_article(taken[name])}", "names are unique"
    return None


def _with_article(what: str) -> str:
    return f"an {what}" if what[0] in "aeiou" else f"a {what}"


def _read_parameters(
    field: Field | None, taken: dict[str, str]
) -> tuple[dict[str, Expression], dict[str, Ends]]:
    """Parameters in the order of the file: numbers, which may use those before them, and ranges.

    An unreadable value stands as 1, a range as [0, 1].
    """
    values: dict[str, Expression] = {}
    ranges: dict[str, Ends] = {}
    found = list(_new_names(field, "of names to numbers", "parameter", taken))
    for i, (name, entry, _) in enumerate(found):
        later = [other for _, _, other in found[i + 1 :]]
        if entry.node.kind == "list":
            ends = entry.ends(
                values, counted=_KNOWN, help="write [lower, upper], or one number if it is known"
            )
            if name is not None:
                ranges[name] = ends or (Fraction(0), Fraction(1))
            continue
        value = None if _is_range(entry) or _is_early(entry, later) else entry.constant(values)
        if name is not None:  # of a value that is wrong the finding stands; users of it are not wrong too
            values[name] = ONE if value is None else value
    return values, ranges


_RANGE = re.compile(r"([0-9.eE]+) *(?:-|\.\.+|\u2013|to) *([0-9.eE]+)|.*(?:\+-|\+/-|\u00b1).*")


def _is_range(field: Field) -> bool:
    """Reports a parameter whose text reads as a range or a tolerance: it would be a difference or a sum."""
    text = field.node.text.strip()
    found = _RANGE.fullmatch(text)
    if found is None or (found[1] and not _rises(found[1], found[2])):
        return False
    message = f"{text[:40]} reads as a range; a parameter is one exact number, or [lower, upper]"
    help = "write the nominal value, or [lower, upper] for a parameter of f or B that lies anywhere between"
    field.fail(codes.NUMBER, message, f"{help}; a difference may stand in parentheses" if found[1] else help)
    return True


def _is_early(field: Field, later: Collection[str]) -> bool:
    """Reports a parameter that uses one from further down."""
    text = field.node.text
    early = next((word for word in re.findall(r"[A-Za-z]\w*", text) if word in later), None)
    if early is not None:
        message = f"{early} is defined further down; a parameter may use those above it"
        field.fail(codes.UNKNOWN_SYMBOL, message, f"move {early} up")
    return early is not None


def _rises(first: str, second: str) -> bool:
    try:
        return Fraction(first) < Fraction(second)
    except ValueError:
        return False


def _with_tables(names: Names, field: Field | None, taken: dict[str, str]) -> Names:
    """Tables by name; one that cannot be read stands as 1 everywhere."""
    for name, entry, written in _new_names(field, "of names to tables", "table", taken):
        found = read_lookup(written, entry, names.values)
        if name is not None:
            names = replace(names, tables=(*names.tables, (name, found or UNKNOWN)))
    return names


def _with_definitions(names: Names, field: Field | None, taken: dict[str, str]) -> Names:
    """Definitions in the order of the file; each may use those before it. One that cannot be read stands as 1."""
    found = list(_new_names(field, "of names to expressions", "definition", taken))
    for i, (name, entry, _) in enumerate(found):
        later = [other for _, _, other in found[i + 1 :]]
        scope = names.scope("definition")
        refused = {
            word: f"{word} is defined further down; a definition may use those above it" for word in later
        }
        if name is not None:
            refused[name] = f"{name} is defined by itself"
        term = entry.term(replace(scope, refused={**scope.refused, **refused}))
        if name is not None:
            known = (ONE, ()) if term is None else (term.expression, term.obligations)
            meant = Parsed(expression=known[0], obligations=known[1])
            names = replace(names, definitions=(*names.definitions, (name, meant)))
    return names


def _new_names(
    field: Field | None, purpose: str, what: str, taken: dict[str, str], shown: str = "NAME: ..."
) -> Iterator[tuple[str | None, Field, str]]:
    """The names that a mapping gives, None for those that may not be used, with the values and what is written."""
    for key, node in (field.pairs(purpose, shown) or ()) if field else ():
        assert field is not None
        yield _new_name(key.text, key_field(field, key), what, taken), field.child(key, node), key.text


def key_field(field: Field, key: Node) -> Field:
    """A key, to report about it."""
    return Field(reader=field.reader, path=f"{field.path}.{key.text[:60]}", node=key)


def _with_outputs(names: Names, field: Field | None, taken: dict[str, str]) -> Names:
    """Outputs by name; one that cannot be read stands for the first state."""
    found: list[Output] = []
    example = f"{names.states[-1]} - 0.5*{names.states[0]}"
    purpose = "of names to linear combinations of states"
    for name, entry, written in _new_names(field, purpose, "output", taken, "tip: x + 0.5*y"):
        term = entry.term(names.scope("metric"))
        output = None if term is None else _linear(written, term, names)
        if term is not None and output is None:
            message = f"{entry.path} is not a sum of states times rational numbers"
            help = f"an output is linear: write e.g. {example}, without a constant"
            entry.fail(codes.RANGE, message, help)
        if name is not None:
            first = tuple(Fraction(state == names.states[0]) for state in names.states)
            found.append(output or Output(name=name, row=first))
    return replace(names, outputs=tuple(found))


def _linear(name: str, term: Term, names: Names) -> Output | None:
    """The coefficients, where the term is a sum of states times rational numbers."""
    e = term.expression
    slopes = [derivative(e, state) for state in names.states]
    if term.obligations or not all(slope.is_constant for slope in slopes):
        return None
    if all(slope is ZERO for slope in slopes) or substitute([e], dict.fromkeys(names.states, ZERO)) != [ZERO]:
        return None
    return Output(name=name, row=tuple(slope.fraction for slope in slopes))


def _rates_of_states(f: Field | None, states: Sequence[str]) -> dict[str, str]:
    """What to say of each name that reads as the derivative of a state (dz, zdot), which is what f says, and not z.

    f is taken as it is written, read or not.
    """
    texts = [node.text.strip() for node in f.node.items] if f else []
    texts = texts if len(texts) == len(states) else [""] * len(states)
    names = {rate for state in states for rate in rates_of(state)} - set(states)
    told: dict[str, str] = {}
    for number, (state, text) in enumerate(zip(states, texts, strict=True), start=1):
        usable = 0 < len(text) <= _SHOWN and not names & set(re.findall(r"[A-Za-z]\w*", text))
        instead = text if text.isidentifier() else f"({text})"
        write = f"by f that is {text}: write {instead}" if usable else _unknown(number, state)
        told |= {
            rate: f"{rate} reads as the derivative of {state}, and is no name here; {write}"
            for rate in rates_of(state)
            if rate in names
        }
    return told


def _unknown(number: int, state: str) -> str:
    entry = f"its entry {number} is that of {state}"
    return f"the derivatives are what f gives: {entry}, a state (its velocity) or an expression of states"
