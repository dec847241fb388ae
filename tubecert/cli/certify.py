"""`certify`: a specification in; a certificate, a report and an exit code out."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tubecert import certificate
from tubecert.asking import SETTINGS, SPEC, Text, words_of
from tubecert.certificate.file import spare
from tubecert.cli import keeper, telling
from tubecert.cli.adapter import Output, command
from tubecert.cli.report import check_pages
from tubecert.cli.telling import plan_of
from tubecert.digits import exact
from tubecert.errors import ExitCode
from tubecert.files import stem_of
from tubecert.library import certifying
from tubecert.library.pages import Report
from tubecert.library.specification import Specification
from tubecert.spec import Setting, Spec, load
from tubecert.verdict import Verdict

if TYPE_CHECKING:
    from tubecert.library.certification import Certification
    from tubecert.library.sampled import SampledCertification
    from tubecert.pipeline.synthesised import Synthesised

_WORDS: Final = {
    "spec": SPEC,
    "settings": SETTINGS,
    **words_of(certifying.certify),
    "output": Text(
        "The certificate; - is stdout.  [SPEC's stem.certificate.json]",
        "FILE",
        short="-o",
        ending=".certificate.json",
    ),
    "report": Text("A page about it, too: FILE.html or FILE.md; may be repeated.", "FILE", many=True),
}


@command(_WORDS, certifying.PAIR)
def certify(
    how: Output,
    spec: str,
    *,
    output: str,
    settings: Sequence[Setting] = (),
    report: Sequence[str] = (),
    **asked: Any,
) -> ExitCode:
    """Prove the tube around the plan and find the smallest gains; always write the certificate."""
    from tubecert.library.stated import page_of
    from tubecert.lint.plan import held, of_file

    metric = asked.get("metric")
    certificate.check_target(output)
    inputs = {"specification": spec, "metric file": metric}
    spare(output, inputs=inputs)
    check_pages(report, {**inputs, "certificate": None if output == certificate.STDOUT else output})
    system = load(spec, settings)
    if system.hardware:  # which has no search that could look at the time: the command is ended then
        asked.pop("deadline", None)
    taken = {"specification": spec, "plan": plan_of(spec, system)}
    spare(output, "certificate", taken)
    kept = _kept_place(output, system, taken) if metric is None else None
    if kept is not None:
        telling.warn_of_size(system, how)
    with telling.shown(how, telling.kept(lambda so_far: _will(so_far, kept))) as progress:
        found = certifying.certify(Specification(spec=system), **asked, progress=progress)
    if output != certificate.STDOUT:
        found.save(output)
    new = _kept_metric(found, kept)
    for target in report:
        Report(certificate=found.certificate).save(target)
    said = [*held(system), *([] if found.certified else of_file(system))]
    told = [("plan", item.message) for item in said]
    written = [("certificate", output), *(("page", page) for page in report), *_next(found, system, output)]
    page = page_of(found.certificate, all_of_it=how.verbose)
    data = found.text if how.json or output == certificate.STDOUT else None
    telling.present(how, page, [*told, *([("metric", new)] if new else []), *written], data)
    return found.verdict.exit_code


def _next(found: Certification | SampledCertification, spec: Spec, target: str) -> Iterator[tuple[str, str]]:
    """The commands that come next."""
    name, exported = shlex.quote(target), spec.hardware is not None and spec.controller != "none"
    if found.certified:
        yield "next", f"tubecert recheck {name}"
        yield "", f"tubecert simulate {shlex.quote(spec.path)} --certificate {name}"
    if found.certified and exported:
        yield "", f"tubecert export {name} -o {shlex.quote(f'{stem_of(target)}.controller')}"
    else:
        yield "more", f"-v here; tubecert report {name}: a page with figures"


def _will(found: Synthesised, target: str | None) -> keeper.Will | None:
    """The metric that was found, if the certification does not come to its end."""
    if target is None or found.file is None:
        return None
    telling.found(f"metric proven, rate {exact(found.file.rate)} 1/s: kept in {target}")
    text = certificate.dump(found.file.to_json())
    return {"files": {target: text}, "said": "", "code": ExitCode.UNDECIDED.value}


def _kept_place(beside: str, system: Spec, inputs: Mapping[str, str | Path | None]) -> str | None:
    """Where a metric that is synthesised on the way is kept: beside the certificate; None if there will be none.

    Raises `TargetError` if it cannot go there, or would take the place of an input or of what somebody wrote by hand.
    """
    if beside == certificate.STDOUT or system.metric or system.synthesis is None:
        return None
    target = str(Path(f"{stem_of(beside)}.metric.json"))
    certificate.check_target(target)
    spare(target, "metric file", inputs)
    return target


def _kept_metric(found: Certification | SampledCertification, target: str | None) -> str | None:
    """The file in which a synthesised metric was kept, None if there is none."""
    if target is None:
        return None
    from tubecert.certificate.result import metric_file
    from tubecert.library.certification import Certification

    assert isinstance(found, Certification)
    metric, synthesis = found.metric, found.result.synthesis
    solver = None if synthesis is None or synthesis.search is None else synthesis.search.solver
    if solver is None or metric is None or metric.verdict is not Verdict.CERTIFIED:
        return None
    certificate.write(target, metric_file(found.result.safe_set, metric, solver).to_json())
    return target
