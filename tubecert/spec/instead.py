"""What other formats, and people, call things: what to write here instead.

In: a key or a value that is not understood, and where it stands. Out: a sentence. Nothing is accepted in its place. The
words are tables of `pages/instead.toml`.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from tubecert.expression import elsewhere, near, suggestion


def same_as(key: str, known: Sequence[str]) -> str | None:
    """The known key that a word stands for, if it plainly stands for one."""
    meant = (elsewhere(table).get(key) for table in ("called", "called_also"))
    return next((other for other in meant if other in known), None)


def glued(key: str, known: Collection[str]) -> str:
    """What to write for {x:1}, which YAML reads as one word; empty if it is none."""
    name, colon, value = key.partition(":")
    return f"write `{name}: {value[:40]}`, with a blank after the colon" if colon and name in known else ""


def example_of(key: str, *, missing: bool) -> str:
    """How a key may be written that is `missing`, as the only one, or has another name."""
    whole = elsewhere("missing").get(key, "...") if missing else "..."
    return f"{key}: {elsewhere('examples').get(key, whole)}"


def of_key(key: str, known: Sequence[str]) -> tuple[str, list[str]]:
    """What to write in place of an unknown key, and the known ones that it may stand for."""
    if key.isdecimal():
        return "if a comma was meant as a decimal point, write the point: 0.1", []
    if (other := same_as(key, known)) is not None:
        return f"it is called {example_of(other, missing=False)}", [other]
    said, close = elsewhere("keys").get(key), near(key, known)
    meant = elsewhere("meant").get(key, "").split() if said else close
    if place := elsewhere("places").get(key):
        return f"it belongs to {place}: {place}.{key}", meant if said else []
    if key in elsewhere("sections") and not close:
        return f"{key} is a section of the file: write it without indentation, beside system", []
    return said or suggestion(key, known, what="known keys"), meant


def of_word(word: str, choices: Sequence[str]) -> str:
    """What to write in place of a word that is none of the choices."""
    if gone := elsewhere("gone").get(word):
        return gone
    other = elsewhere("choices").get(word.lower())
    return (f"here it is {other}; " if other in choices else "") + suggestion(word, choices, what="choices")


def of_value(path: str, text: str) -> str:
    """What to write for a section that is given as one word, or as a list (an empty text); empty if nobody knows."""
    word = text.strip()
    match path:
        case "" if word.count(",") + word.count(";") > 1:
            return "a plan stands in a specification: trajectory: {kind: csv, file: FILE}"
        case "trajectory" if word.lower().endswith((".csv", ".txt", ".dat")):
            return f"write {{kind: csv, file: {word[:60]}}}"
        case "metric" if word.lower().endswith((".json", ".csv", ".npz", ".mat", ".yaml")):
            return f"the file of a metric is given on the command line: --metric {word[:60]}"
        case "uncertainty" if word.replace(".", "", 1).isdecimal():
            bounds = f"{{bounds: {{h: {word[:20]}, h_x: ..., h_t: ...}}}}"
            return f"for a bound write {bounds}, else {{h: [...]}}, an expression per input"
        case "conditions" if word:
            return f"write {{decides: {word[:20]}}}"
        case "hardware" if word:
            return f"write {{rate: {word[:20]}}}, in Hz"
        case "system.states" | "system.inputs" if word.isdecimal():
            return "give them names: [x1, x2]"
    return elsewhere("values").get(path, "")
