"""`certify`: a specification in; a certificate, a report and an exit code out."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tubecert.asking import Text, asked_by, words_of
from tubecert.cli import keeper
from tubecert.cli.adapter import SET, SPEC, Output, command
from tubecert.errors import ExitCode, TubecertError
from tubecert.library import certifying

if TYPE_CHECKING:
    from tubecert.library.certification import Certification
    from tubecert.library.sampled import SampledCertification
    from tubecert.pipeline.synthesised import Synthesised
    from tubecert.spec import Setting, Spec

_OF_SEARCH: Final = Fraction(1, 2)  # of the time that is given: the certification has the rest
_WORDS: Final = {
    "spec": SPEC,
    "set_": SET,
    **words_of(certifying.certify),
    "output": Text("The certificate; - is stdout.  [SPEC's stem.certificate.json]", "FILE", short="-o"),
    "report": Text("A page about it, too: FILE.html or FILE.md; may be repeated.", "FILE", many=True),
}


@command(_WORDS, certifying.PAIR)
def certify(
    how: Output,
    spec: str,
    *,
    set_: Sequence[Setting] = (),
    output: str | None = None,
    report: Sequence[str] = (),
    **asked: Any,
) -> ExitCode:
    """Prove the tube around the plan and find the smallest gains; always write the certificate."""
    if seconds := asked.get("deadline"):
        asked["deadline"] = Fraction(keeper.left_of(float(seconds), interrupted=True)) * _OF_SEARCH
    from tubecert import certificate
    from tubecert.cli import telling
    from tubecert.cli.report import check_pages, write_pages
    from tubecert.cli.telling import spare
    from tubecert.library.specification import Specification
    from tubecert.spec import load

    metric = asked.get("metric")
    target = output or f"{Path(spec).stem}.certificate.json"
    certificate.check_target(target)
    inputs = {"specification": spec, "metric file": metric}
    spare(target, inputs)
    check_pages(report, {**inputs, "certificate": None if target == certificate.STDOUT else target})
    system = load(spec, set_)
    if system.hardware is not None:
        asked.pop("deadline", None)  # the command is ended then, whatever it does
    kept = _kept_place(spec, system, target, synthesised=metric is None)
    if kept is not None:
        telling.warn_of_size(system, how)
    heard = telling.kept(lambda so_far: _will(so_far, kept))
    with telling.shown(how) as progress, asked_by(heard=heard):
        found = certifying.certify(Specification(spec=system), **asked, progress=progress)
    if target != certificate.STDOUT:
        found.save(target)
    new = _kept_metric(found, kept)
    write_pages(report, found.certificate)
    written = [("certificate", target), *(("page", page) for page in report)]
    _show(found, [*([("metric", new)] if new else []), *written, *_next(found, system, target)], how)
    return found.verdict.exit_code


def _next(found: Certification | SampledCertification, spec: Spec, target: str) -> Iterator[tuple[str, str]]:
    """The commands that come next."""
    name, exported = shlex.quote(target), spec.hardware is not None and spec.controller != "none"
    if found.certified:
        yield "next", f"tubecert recheck {name}"
        yield "", f"tubecert simulate {shlex.quote(spec.path)} --certificate {name}"
    if found.certified and exported:
        yield "", f"tubecert export {name} -o {shlex.quote(spec.name)}.controller"
    else:
        yield "more", f"-v here; tubecert report {name}: a page with figures"


def _will(found: Synthesised, target: str | None) -> keeper.Will | None:
    """The metric that was found, if the certification does not come to its end."""
    if target is None or found.file is None:
        return None
    from tubecert import certificate
    from tubecert.cli import telling
    from tubecert.digits import exact

    telling.found(f"metric proven, rate {exact(found.file.rate)} 1/s: kept in {target}")
    text = certificate.dump(found.file.to_json())
    return {"files": {target: text}, "said": "", "code": ExitCode.UNDECIDED.value}


def _kept_place(file: str, system: Spec, beside: str, *, synthesised: bool) -> str | None:
    """Where a metric that is synthesised on the way is kept: beside the certificate; None if there will be none.

    Raises `TargetError` if it cannot go there, or would take the place of an input or of what somebody wrote by hand.
    """
    from tubecert import certificate
    from tubecert.cli.telling import plan_of, refused, spare

    plan = plan_of(file, system)
    spare(beside, {"plan": plan})
    if beside == certificate.STDOUT or not synthesised or system.metric or system.synthesis is None:
        return None
    name = Path(beside).name.removesuffix(".json").removesuffix(".certificate")
    target = str(Path(beside).with_name(f"{name}.metric.json"))
    certificate.check_target(target)
    spare(target, {"specification": file, "plan": plan})
    if Path(target).exists() and not _by_tubecert(target):
        raise refused(
            f"{target} was not written by tubecert and would be overwritten by the metric that is synthesised"
        )
    return target


def _by_tubecert(path: str) -> bool:
    """Whether a file is a metric that tubecert wrote: it can write it again."""
    from tubecert.files import read
    from tubecert.spec.source import METRIC

    try:
        content = json.loads(read(path, METRIC))
    except (TubecertError, ValueError, RecursionError):
        return False
    return isinstance(content, dict) and "solver" in content and "verified_on" in content


def _kept_metric(found: Certification | SampledCertification, target: str | None) -> str | None:
    """The file in which a synthesised metric was kept, None if there is none."""
    if target is None:
        return None
    from tubecert import certificate
    from tubecert.certificate.result import metric_file
    from tubecert.library.certification import Certification
    from tubecert.verdict import Verdict

    assert isinstance(found, Certification)
    metric, synthesis = found.metric, found.result.synthesis
    solver = None if synthesis is None or synthesis.search is None else synthesis.search.solver
    if solver is None or metric is None or metric.verdict is not Verdict.CERTIFIED:
        return None
    certificate.write(target, metric_file(found.result.safe_set, metric, solver).to_json())
    return target


def _show(
    found: Certification | SampledCertification, closing: Iterable[tuple[str, str]], how: Output
) -> None:
    """The page on stdout, with what is written and comes next; or the certificate, with the verdict on stderr."""
    from tubecert import certificate
    from tubecert.cli.telling import present
    from tubecert.library.stated import page_of

    lines, page = list(closing), page_of(found.certificate, all_of_it=how.verbose)
    data = found.text if how.json or dict(lines)["certificate"] == certificate.STDOUT else None
    present(how, page, lines, data)
