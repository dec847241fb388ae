"""The report of a certification: a verdict first, then what it means, then everything one may ask next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.text import Text

from tubecert.certificate.result import Certificate, Result
from tubecert.claims.limits import InputWithinLimits
from tubecert.report import claimed, reach, sections
from tubecert.report.gains import deciding
from tubecert.report.layout import VERDICTS, indented, titled
from tubecert.report.outline import widths
from tubecert.verdict import Verdict
from tubecert.words.claims import sentence

if TYPE_CHECKING:
    from rich.console import RenderableType

STYLES = {verdict: f"bold {color}" for verdict, color in VERDICTS.items()}


def report(
    certificate: Certificate,
    *,
    target: str,
    verbose: bool,
    pages: Sequence[str] = (),
    metric: str | None = None,
) -> list[RenderableType]:
    """The whole report as renderables.

    `target` is the file of the certificate, `pages` are those about it, `metric` that of a metric found for it.
    """
    result = certificate.result
    parts: list[RenderableType] = [verdict_line(result), indented(meaning(result))]
    for title, body in sections.of(result, verbose=verbose):
        parts += titled(title, body)
    parts += [Text(), *_closing(certificate, target, pages)]
    if metric is not None:
        parts.append(_file("metric found for it", metric))
    return parts


def verdict_line(result: Result) -> Text:
    """The verdict and the numbers (or the reason) that go with it, on one line."""
    verdict = result.verdict
    line = Text(no_wrap=True, overflow="ignore")
    line.append(str(verdict), style=STYLES[verdict])
    line.append(f" {name(result)}: ", style="bold")
    if verdict is Verdict.CERTIFIED:
        chosen = deciding(result)
        extent = reach.extent(result)
        numbers = [f"rho = {extent}" if reach.is_radius(result) else extent]
        numbers += [gains.text(titled=len(chosen) > 1) for gains in chosen]
        line.append("; ".join(numbers))
    else:
        line.append(_because(result))
    return line


def name(result: Result) -> str:
    """The name of the specification."""
    return result.spec.effective.name


def _because(result: Result) -> str:
    """The reason that decided: the first with the verdict's own word."""
    return "" if result.reason is None else sentence(result.reason)


def meaning(result: Result) -> Text:
    """One sentence: what the verdict says, and what it does not say."""
    match result.verdict:
        case Verdict.CERTIFIED:
            return _promise(result)
        case Verdict.REFUTED if result.reason is not None and isinstance(
            result.reason.claim, InputWithinLimits
        ):
            return Text("The plan itself asks more of an input than its limits allow, whatever the gains.")
        case Verdict.REFUTED if _tube_is_known(result):
            return Text(
                "The condition below is proven not to hold. It is a sufficient one: that it fails does not "
                "prove that the state leaves the tube."
            )
        case Verdict.REFUTED:
            return Text("The claim below is proven false, so nothing that rests on it is certified.")
        case _:
            return Text("This is neither proven nor refuted; it must not be relied on.")


def _promise(result: Result) -> Text:
    chosen = deciding(result)
    loops = "; or ".join(gains.words() for gains in chosen)
    return Text(
        f"With this metric, {loops}, the state stays within {reach.extent(result)} of "
        f"{claimed.plan_words(result)} {claimed.span(result)} if it starts {claimed.start_words(result)}, under the "
        f"assumptions below.{_by_state(result)}"
    )


def _by_state(result: Result) -> str:
    """What a radius over several states, whose units may differ, says of each of them."""
    known = widths(result)
    if known is None or len(known) == 1 or not reach.is_radius(result):
        return ""
    return f" State by state: {reach.half_widths(result, known)}."


def _tube_is_known(result: Result) -> bool:
    return result.tube is not None and result.tube.rho_r is not None


def _closing(certificate: Certificate, target: str, pages: Sequence[str]) -> list[RenderableType]:
    """Where the certificate is, and how to see again that it is right."""
    again = "To check it later: the same command gives the same hash on this machine with these versions."
    sealed = [Text(certificate.hash, style="dim"), Text(again, style="dim")]
    return [_file("certificate", target), *map(indented, sealed), *(_file("page", page) for page in pages)]


def _file(what: str, path: str) -> Text:
    """A file that was written; its name is neither wrapped nor cut."""
    where = Text(f"{what} ", style="bold", no_wrap=True, overflow="ignore")
    return where.append(path, style="not bold")
