"""`synth`: a specification in; a proven metric as a file, what was tried, and an exit code out."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tubecert.asking import SETTINGS, SPEC, Text, words_of
from tubecert.cli import keeper
from tubecert.cli.adapter import Output, command
from tubecert.errors import ExitCode
from tubecert.library import metrics

if TYPE_CHECKING:
    from tubecert.pipeline.synthesised import Synthesised
    from tubecert.report.page import Page
    from tubecert.report.text import Rows
    from tubecert.spec import Setting, Spec

_WORDS: Final = {
    "spec": SPEC,
    "settings": SETTINGS,
    **words_of(metrics.synth),
    "plot": Text("Draw the comparison (SVG); implies --table.", "FILE"),
    "output": Text(
        "The metric file; - is stdout.  [SPEC's stem.metric.json]", "FILE", short="-o", ending=".metric.json"
    ),
}


@command(_WORDS)
def synth(
    how: Output,
    spec: str,
    *,
    output: str,
    settings: Sequence[Setting] = (),
    plot: str | None = None,
    **asked: Any,
) -> ExitCode:
    """Find a dual metric, round it, and write it only if C1-C3 are proven on the whole safe set."""
    from tubecert import certificate
    from tubecert.cli import telling
    from tubecert.cli.telling import plan_of, present, refused, spare
    from tubecert.library.specification import Specification
    from tubecert.report import synthesis, text
    from tubecert.report.terminal import Terminal
    from tubecert.spec import load

    for place in filter(None, (output, plot)):
        certificate.check_target(place)
        spare(place, {"specification": spec})
    if plot and Path(plot).suffix.lower() != ".svg":
        raise refused(f"cannot write {plot}: the comparison is drawn as SVG", "give a file FILE.svg")
    system = load(spec, settings, "plant")
    spare(output, {"plan": plan_of(spec, system)})
    terminal = Terminal.stderr(color=how.color)

    def judged(found: Synthesised) -> None:
        """The verdict, before advice is looked for."""
        if not how.quiet:
            terminal.show(text.headline(synthesis.page_of(found.search(), found.file, system.name)))

    kept = telling.kept(lambda so_far: _will(so_far, system, output, how))
    telling.warn_of_size(system, how)
    asked["table"] = asked["table"] or plot is not None
    with telling.shown(how, kept, judged) as progress:
        metric = metrics.synth(Specification(spec=system), **asked, progress=progress)
    found = metric.found
    if metric.proven and output != certificate.STDOUT:
        metric.save(output)
    if plot and found.rows:
        from tubecert.report.figures_file import svg_file
        from tubecert.report.figures_gains import rate_figures

        certificate.write_text(plot, svg_file(*rate_figures(found.search().table)))
    present(how, *_presented(found, system, output, how))
    if found.cut is not None and not metric.proven:
        keeper.tell({"said": False})  # where it was is worth a word
    return ExitCode.INTERRUPTED if found.cut == "interrupted" else found.verdict.exit_code


def _will(found: Synthesised, system: Spec, target: str, how: Output) -> keeper.Will | None:
    """What is left of a search that does not come to its end: the best metric, and the report about it."""
    if found.file is None:
        return None
    from tubecert import certificate
    from tubecert.cli.telling import text_of

    files = {} if target == certificate.STDOUT else {target: certificate.dump(found.file.to_json())}
    said = text_of(how, *_presented(found, system, target, how))
    return {"files": files, "said": said, "code": found.verdict.exit_code.value}


def _presented(found: Synthesised, system: Spec, target: str, how: Output) -> tuple[Page, Rows, str | None]:
    """The page, what was written and comes next and, where data are wanted, the metric file."""
    from tubecert import certificate
    from tubecert.printable import visible
    from tubecert.records import to_json
    from tubecert.report import synthesis

    data, file = found.search(), found.file
    certify = shlex.join(["tubecert", "certify", system.path, "--metric", target])
    if system.lacks:
        certify = f"to certify with it, add {' and '.join(system.lacks)} to {visible(system.path)}"
    closing = [] if file is None else [("metric file", target), ("next", certify)]
    page = synthesis.page_of(data, file, system.name, system.states)
    wanted = how.json or target == certificate.STDOUT
    return page, closing, certificate.dump(to_json(file or data)) if wanted else None
