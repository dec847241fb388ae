"""Text from outside, as it may be shown: it steers no terminal, and no workflow takes it for a command.

Names of files, members of certificates and lines of specifications are written by others. What they hold is shown, but
every character that does not print (control characters, ESC, marks that reverse the direction of writing, what is left
of a file name that is not UTF-8) is shown as an escape, so that nothing can pass for something else.
"""

from __future__ import annotations

import json
import re
from typing import Any, Final

_COMMAND: Final = re.compile(r"##(?=\w*\[)|^\s*::")
_IN_JSON: Final = re.compile(r"[^\n\x20-\x7e\xa1-\xac\xae-\u02ff]")  # candidates; most of them do print


def visible(text: str) -> str:
    r"""The text on one line, with an escape (`\n`, `\x1b`, `\u202e`) for every character that does not print."""
    return text if text.isprintable() else "".join(c if c.isprintable() else _escape(c) for c in text)


def blanked(line: str) -> str:
    """The text with a space for every character that does not print: what is left stays at its column."""
    return line if line.isprintable() else "".join(c if c.isprintable() else " " for c in line)


def harmless(line: str) -> str:
    """A line of output that no workflow takes for a command.

    GitHub reads a line that begins with `::`, and `##[...]` anywhere; others read `##word[...]`.
    """
    if "::" not in line and "##" not in line:
        return line
    return _COMMAND.sub(lambda match: match[0][:-1] + _escape(match[0][-1]), line)


def printable_lines(text: str) -> str:
    """Lines that were put together from visible parts, or not: line breaks stay, everything else is made harmless."""
    return "\n".join(harmless(visible(line)) for line in text.split("\n"))


def printable_json(text: str) -> str:
    r"""JSON with `\u....` in place of characters that do not print: it says the same."""
    return _IN_JSON.sub(lambda match: match[0] if match[0].isprintable() else _units(match[0]), text)


def json_text(data: Any) -> str:
    """Data as a file of JSON, in which every character prints."""
    return printable_json(json.dumps(data, indent=1, ensure_ascii=False)) + "\n"


def _escape(character: str) -> str:
    if character in "\n\r\t":
        return {"\n": r"\n", "\r": r"\r", "\t": r"\t"}[character]
    code = ord(character)
    return f"\\x{code:02x}" if code < 256 else f"\\u{code:04x}" if code < 65536 else f"\\U{code:08x}"


def _units(character: str) -> str:
    """A character as JSON writes it: in units of UTF-16."""
    data = character.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{data[i : i + 2].hex()}" for i in range(0, len(data), 2))
