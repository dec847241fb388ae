"""The routes of synthesis by name."""

from __future__ import annotations

from tubecert.synthesis.attempts import Route


def routes(choice: str) -> tuple[tuple[str, Route], ...]:
    """The route that was chosen; for `auto` both: counterexamples for constant W, sums of squares first where it moves.

    Counterexamples treat every expression, sums of squares only polynomials, sines and cosines.
    """
    from tubecert.synthesis import cegis, sos

    known: dict[str, Route] = {"cegis": cegis.propose, "sos": sos.propose_sos}
    names = ("cegis", "sos") if choice == "auto" else (choice,)
    return tuple((name, known[name]) for name in names)
