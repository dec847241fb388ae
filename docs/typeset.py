"""Sets the formulas of the theory as mathematics: a hook of mkdocs, `hooks` in mkdocs.yml.

In: pages below theory/, and the errata, in the notation of the code. There a text between single backticks, and every
line of a `text` block, is a formula; what stands between two backticks is code. Out: MathML, which browsers show
without scripts and without the network. Letters change their looks and nothing else: a solidus stays a solidus.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from typing import Any, Final

_GREEK: Final = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "zeta": "ζ", "eta": "η", "theta": "θ",
    "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν", "xi": "ξ", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ",
    "psi": "ψ", "omega": "ω", "pi": "π", "perp": "⊥", "Gamma": "Γ", "Delta": "Δ", "Theta": "Θ", "Xi": "Ξ", "Phi": "Φ",
    "Psi": "Ψ",
}  # fmt: skip
_NAMES: Final = {  # names of several letters: how they are written, in the notation itself
    "Df": "Delta_f", "Dfx": "Delta_fx", "DB": "Delta_B", "DBp": "Delta_B^+", "DBx": "Delta_Bx", "Dbx": "Delta_bx",
    "DBpx": "Delta_Bx^+", "DMx": "Delta_Mx", "Dh": "Delta_h", "Dhx": "Delta_hx", "Dht": "Delta_ht", "Dus": "Delta_u*",
    "Dxt": "Delta_xt", "Deta": "Delta_eta", "Dtheta": "Delta_theta", "Dxdot": "Delta_xdot", "DPsix": "Delta_Psix",
    "DPsidot": "Delta_Psidot", "Dgs": "Delta_gs", "du": "delta_u", "kmax": "k_max", "lmax": "lambda_max",
    "lmin": "lambda_min", "smax": "sigma_max", "smin": "sigma_min", "eps": "epsilon", "th": "theta",
}  # fmt: skip
_INDICES: Final = {  # what a constant is indexed by: `fx` is f_x
    "fx": "f_x", "Bx": "B_x", "bx": "b_x", "Mx": "M_x", "hx": "h_x", "ht": "h_t", "Psix": "Psi_x", "gs": "g_s",
}  # fmt: skip
_ACCENTS: Final = {
    "dbar": "d\u0304", "nbar": "n\u0304", "wbar": "w\u0304", "ubar": "u\u0304", "rhobar": "rho\u0304",
    "wdot": "w\u0307", "xdot": "x\u0307", "Psidot": "Psi\u0307", "xhat": "x\u0302", "xt": "x\u0303",
    "zb": "z\u0304", "Xt": "X\u0303", "sigma_hat": "sigma\u0302",
}  # fmt: skip
_BIG: Final = {"sum": "∑", "int": "∫"}
_UPRIGHT: Final = {
    "sup", "inf", "max", "min", "log", "exp", "sin", "cos", "tan", "det", "diag", "sign", "clip", "Proj", "Lip",
}  # fmt: skip
_SIGNS: Final = {
    "<=": "≤", ">=": "≥", "!=": "≠", "->": "→", ":=": "≔", "+-": "±", "-": "−", "*": "×", "..": "…", "oo": "∞",
    "[]": "□", "'": "′",
}  # fmt: skip
_SPLIT: Final = {"=", "<=", ">=", "<", ">", ",", ";", ":=", "->", "!="}  # a line may be broken after these
_TOKEN: Final = re.compile(r"sigma_hat|oo\b|\d*\.?\d+(?:e-\d+)?|[A-Za-z]+\d*|\.\.+|<=|>=|!=|->|:=|\+-|\S")
_SUB: Final = re.compile(r"-?[A-Za-z0-9]+\*?(?:[-+,]\w+)*")
_SUB_OF_BIG: Final = re.compile(r"[^\s|^(\[]+(?:\([^)]*\))?")
_SUP: Final = re.compile(r"\*(?=\W|$)|\+|T\b|-?(?:\d*\.?\d+|[A-Za-z]+\d?)")
_STAR: Final = re.compile(r"\*(?=\W|_|$)")
_ACCENT_SIGNS: Final = {"\u0304": "¯", "\u0307": "˙", "\u0302": "ˆ", "\u0303": "˜"}


@dataclass
class _Reader:
    """What is left of a formula, from `at` on."""

    text: str
    at: int = 0
    spaced: bool = False

    def token(self) -> str:
        """The next one; `spaced` says whether there was room before it."""
        rest = self.text[self.at :]
        self.spaced = rest[:1].isspace()
        self.at += len(rest) - len(rest.lstrip())
        found = _TOKEN.match(self.text, self.at)
        if found is None:
            return ""
        self.at = found.end()
        return found[0]

    def take(self, pattern: re.Pattern[str]) -> str | None:
        """What comes next, if it is of a pattern."""
        found = pattern.match(self.text, self.at)
        if found is None:
            return None
        self.at = found.end()
        return found[0]

    def follows(self, start: str) -> bool:
        """Whether this comes next, and is taken."""
        if not self.text.startswith(start, self.at):
            return False
        self.at += len(start)
        return True

    def group(self) -> str:
        """The text up to the parenthesis that closes the one which was read."""
        depth, start = 1, self.at
        while depth and self.at < len(self.text):
            depth += {"(": 1, ")": -1}.get(self.text[self.at], 0)
            self.at += 1
        return self.text[start : self.at - (not depth)]


def _node(tag: str, inside: str, **how: str) -> str:
    attributes = "".join(f' {name}="{value}"' for name, value in how.items())
    return f"<{tag}{attributes}>{inside}</{tag}>"


def _is_word(name: str) -> bool:
    """Words of a sentence, which formulas in blocks contain: of three small letters and more, or listed."""
    return bool(re.fullmatch(r"[A-Z]?[a-z]{3,}", name)) or name in {
        "of", "on", "in", "if", "is", "at", "to", "or", "by", "as", "no", "it", "QED", "iff",
    }  # fmt: skip


def _letters(name: str) -> str:
    """A name: a Greek letter, a word, or letters beside each other; digits at its end are below it."""
    if name in _ACCENTS:
        base, accent = _ACCENTS[name][:-1], _ACCENTS[name][-1]
        return _node(
            "mover", _letters(base) + _node("mo", _ACCENT_SIGNS[accent], stretchy="false"), accent="true"
        )
    if name in _NAMES:
        return _row(_NAMES[name])
    stem = name.rstrip("0123456789")
    if stem != name:
        return _node("msub", _letters(stem) + _node("mn", name[len(stem) :]))
    if name in _GREEK:
        return _node("mi", _GREEK[name], **({"mathvariant": "normal"} if name[0].isupper() else {}))
    if name in _UPRIGHT or _is_word(name):
        return _node("mi", name)
    letters = "".join(_node("mi", letter) for letter in name)
    return letters if len(name) == 1 else _node("mrow", letters)


def _below(text: str) -> str:
    """What stands below."""
    return _row(_INDICES.get(text, text))


def _scripted(reader: _Reader, base: str, *, big: bool = False) -> str:
    """A base with what follows it without room: accents, indices, powers, stars, primes, factorials."""
    sub, sup, primes = "", "", ""
    while reader.at < len(reader.text):
        if reader.follows("~"):
            base = _node("mover", base + _node("mo", "˜", stretchy="false"), accent="true")
        elif reader.text.startswith("^_", reader.at):
            reader.at += 1
            base = _node("mover", base + _node("mo", "ˆ", stretchy="false"), accent="true")
        elif reader.text.startswith("_", reader.at) and (reader.at + 1) < len(reader.text):
            reader.at += 1
            sub += _below(reader.take(_SUB_OF_BIG if big else _SUB) or "")
        elif reader.follows("^("):
            sup += _row(reader.group())
        elif reader.follows("^"):
            sup += _row(reader.take(_SUP) or "")
        elif reader.take(_STAR):
            sup += _node("mo", "∗")
        elif reader.follows("'"):
            primes += _node("mo", "′", lspace="0", rspace="0")
        elif reader.follows("!"):
            base = _node("mrow", base + _node("mo", "!"))
        else:
            break
    place = "under" if base == _node("mo", "∑") else "sub"
    tag = f"m{place if sub else ''}{('over' if place == 'under' else 'sup') if sup else ''}"
    shown = _node(tag, base + "".join(_wrap(each) for each in (sub, sup) if each)) if sub or sup else base
    return _wrap(shown + primes) if primes else shown


def _wrap(inside: str) -> str:
    return _node("mrow", inside)


def _pieces(text: str) -> Iterator[tuple[str, str]]:
    """The formula from left to right: tokens as they are written, and as MathML."""
    reader = _Reader(text)
    before = ""
    while part := reader.token():
        spaced = reader.spaced
        if part in _BIG or part in _UPRIGHT:
            sign = _node("mo", _BIG[part]) if part in _BIG else _letters(part)
            shown = _scripted(reader, sign, big=True)
        elif re.match(r"[\d.]*\d", part):
            shown = _scripted(reader, _node("mn", part))
        elif part == "oo":
            shown = _node("mi", "∞")
        elif part == "D" and re.match(r"\+ \w", reader.text[reader.at :]):
            reader.at += 1
            shown = _node("msup", _node("mi", "D") + _node("mo", "+"))
        elif part == "sqrt" and reader.follows("("):
            shown = _scripted(reader, _node("msqrt", _row(reader.group())))
        elif part[0].isalpha():
            article = part == "a" and _says(before) and re.match(r" [a-z]{3}", reader.text[reader.at :])
            says = article or (_says(part) and reader.text[reader.at : reader.at + 1] not in ("_", "^", "'"))
            shown = _node("mtext", part) if says else _scripted(reader, _letters(part))
        elif part in "([{":
            shown = _node("mo", part, stretchy="false")
        elif part in ")]}|":
            closes = (
                part != "|" or not spaced or reader.text[reader.at : reader.at + 1] in ("", " ", "_", "^")
            )
            bar = _node("mo", part, stretchy="false", lspace="0", rspace="0")
            shown = _scripted(reader, bar) if closes else bar
        else:
            prefix = {"form": "prefix"} if part in "+-" and before in ("", "(", "[", ",", *_SPLIT) else {}
            shown = _node("mo", escape(_SIGNS.get(part, part)), **prefix)
        if spaced and before and _beside(before) and _beside(part):
            yield " ", _node("mspace", "", width="0.3em" if _says(part) or _says(before) else "0.2em")
        yield part, shown
        before = part


def _says(part: str) -> bool:
    return _is_word(part) and part not in {*_GREEK, *_NAMES, *_ACCENTS, *_UPRIGHT, *_BIG}


def _beside(part: str) -> bool:
    """Whether a part is no operator, so that room beside it means a product."""
    return part[0].isalnum() or part in "()[]|"


def _row(text: str) -> str:
    return "".join(shown for _, shown in _pieces(text))


def inline(text: str) -> str:
    """A formula within a line, in pieces between which the line may be broken."""
    parts: list[list[str]] = [[]]
    depth = 0
    for (part, shown), (after, _) in pairwise((*_pieces(text), ("", ""))):
        depth += {"(": 1, "[": 1, ")": -1, "]": -1}.get(part, 0)
        parts[-1].append(shown)
        if part in _SPLIT and not depth and after:
            parts.append([])
    return " ".join(_node("math", "".join(part)) for part in parts)


def display(block: str) -> str:
    """A block: a row for each line, its tag at the right; texts that begin at one place are below each other."""
    lines = [
        (re.sub(r"\s{2,}\((\w\.\d+)\)$", "", line), re.search(r"\((\w\.\d+)\)$", line))
        for line in block.splitlines()
    ]
    rows = []
    places = _columns([text for text, _ in lines])
    for text, tag in lines:
        cells = [""] * len(places)
        for start, part in _parts(text):
            column = max(index for index, place in enumerate(places) if place <= start)
            gap = _node("mspace", "", width="2em") if cells[column] else ""
            cells[column] += gap + _row(part)
        shown = "".join(
            f"<td>{_node('math', cell, displaystyle='true') if cell else ''}</td>" for cell in cells
        )
        rows.append(f"<tr>{shown}<td>{tag[0] if tag else ''}</td></tr>")
    return f'<div class="formulas"><table class="formulas">{"".join(rows)}</table></div>'


def _parts(line: str) -> list[tuple[int, str]]:
    """What two blanks or more set apart in a line, and where it begins."""
    return [(found.start(), found[0]) for found in re.finditer(r"\S+(?: \S+)*", line)]


def _columns(lines: list[str]) -> list[int]:
    """Where parts of two lines and more begin; the first column begins at the margin."""
    starts = [start for line in lines for start, _ in _parts(line)]
    return sorted({0, *(start for start in starts if starts.count(start) > 1)})


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Formulas out of the way of Markdown: a mark for each, which `on_page_content` replaces."""
    if not page.file.src_uri.startswith("theory/") and page.file.src_uri != "errata.md":
        return markdown
    page.formulas = []
    if page.file.src_uri.endswith("sampled-loop.md"):  # there d marks what rounding changes: no gain du
        markdown = re.sub(r"\bdu(?![A-Za-z])", "d u", markdown)

    def keep(shown: str) -> str:
        page.formulas.append(shown)
        return f"\ue000{len(page.formulas) - 1}\ue001"

    markdown = re.sub(
        r"^```text\n(.*?)^```$", lambda found: keep(display(found[1])), markdown, flags=re.M | re.S
    )
    return re.sub(r"(?<!`)`([^`]+)`(?!`)", lambda found: keep(inline(" ".join(found[1].split()))), markdown)


def on_page_content(html: str, page: Any, **_: Any) -> str:
    """MathML in the place of every mark."""
    formulas = getattr(page, "formulas", [])
    html = re.sub(r"<p>\ue000(\d+)\ue001</p>", lambda found: formulas[int(found[1])], html)
    return re.sub("\ue000(\\d+)\ue001", lambda found: formulas[int(found[1])], html)
