"""`synth`: a specification in; a proven metric as a file, what was tried, and an exit code out."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tubecert import certificate
from tubecert.asking import SETTINGS, SPEC, Text, words_of
from tubecert.certificate.file import refused, spare
from tubecert.cli import keeper, telling
from tubecert.cli.adapter import Output, command
from tubecert.cli.telling import text_of
from tubecert.errors import ExitCode
from tubecert.library import metrics
from tubecert.library.specification import Specification
from tubecert.printable import visible
from tubecert.report.terminal import Terminal
from tubecert.report.text import Rows, headline
from tubecert.spec import Setting, Spec, load

if TYPE_CHECKING:
    from tubecert.pipeline.synthesised import Synthesised

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
    for place in filter(None, (output, plot)):
        certificate.check_target(place)
        spare(place, inputs={"specification": spec})
    if plot and Path(plot).suffix.lower() != ".svg":
        message = f"cannot write {plot}: the comparison is drawn as SVG"
        raise refused(message, "give a file FILE.svg")
    system = load(spec, settings, "plant")
    spare(output, "metric file", {"plan": telling.plan_of(spec, system)})
    how = replace(how, json=how.json or output == certificate.STDOUT)

    def judged(so_far: Synthesised) -> None:
        """The verdict, before advice is looked for."""
        if not how.quiet:
            Terminal.stderr(color=how.color).show(headline(metrics.metric_of(so_far, system)._page()))

    kept = telling.kept(lambda so_far: _will(so_far, system, output, how))
    telling.warn_of_size(system, how)
    asked["table"] = asked["table"] or plot is not None
    with telling.shown(how, kept, judged) as progress:
        metric = metrics.synth(Specification(spec=system), **asked, progress=progress)
    if metric.proven and output != certificate.STDOUT:
        metric.save(output)
    if plot and metric.found.rows:
        from tubecert.report.figures_file import svg_file
        from tubecert.report.figures_gains import rate_figures

        certificate.write_text(plot, svg_file(*rate_figures(metric.found.search().table)))
    code = telling.answer(how, metric, _closing(metric, system, output))
    if metric.found.cut is not None and not metric.proven:
        keeper.tell({"said": False})  # where it was is worth a word
    return code


def _will(so_far: Synthesised, system: Spec, target: str, how: Output) -> keeper.Will | None:
    """What is left of a search that does not come to its end: the best metric, and the report about it."""
    if so_far.file is None:
        return None
    metric = metrics.metric_of(so_far, system)
    data = metric._json() if how.json else None
    said = text_of(how, metric._page(), _closing(metric, system, target), data)
    files = {} if target == certificate.STDOUT else {target: metric.text()}
    return {"files": files, "said": said, "code": metric.verdict.exit_code.value}


def _closing(metric: metrics.SynthesisedMetric, system: Spec, target: str) -> Rows:
    """What was written and comes next."""
    if not metric.proven:
        return []
    line = shlex.join(["tubecert", "certify", system.path, "--metric", target])
    if system.lacks:
        line = f"to certify with it, add {' and '.join(system.lacks)} to {visible(system.path)}"
    return [("metric file", target), ("next", line)]
