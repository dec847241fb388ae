"""One point of a sweep: certified as `certify --set ...` does it, and kept in a file of its own."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Final, TypeAlias

from tubecert import certificate, pipeline
from tubecert.certificate.result import Certificate
from tubecert.errors import ExitCode, TargetError, TubecertError
from tubecert.files import Kind, read
from tubecert.findings import Finding
from tubecert.libraries import versions
from tubecert.printable import printable_json, visible
from tubecert.records import FormError, from_json, to_json
from tubecert.sampled_loop import record as sampled
from tubecert.spec import Setting, Spec
from tubecert.spec.load import load_source
from tubecert.spec.source import Source
from tubecert.synthesis.coefficients import with_metric_file

ERROR_FORMAT: Final = "tubecert-sweep-error/1"
_KEPT: Final = 256  # proofs that a worker remembers
_ERROR: Final = Kind(most=1_000_000, unreadable="TC600", too_large="TC600")


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What all points have in common; `text` is that of the specification, which may change on disk meanwhile."""

    path: str
    text: str
    fixed: tuple[Setting, ...]
    options: pipeline.Options
    folder: Path

    def load(self, settings: tuple[Setting, ...]) -> Spec:
        """The specification of a point; raises `TubecertError`."""
        spec = load_source(Source.of(self.path, self.text), (*self.fixed, *settings))
        bare = self.options.metric is None or spec.hardware is not None
        return spec if bare else with_metric_file(spec, str(self.options.metric))

    def command(self, settings: tuple[Setting, ...]) -> str:
        """The command that makes the certificate of a point."""
        own, default = self.options, pipeline.Options()
        words = ["tubecert", "certify", self.path]
        for each in (*self.fixed, *settings):
            words += ["--set", str(each)]
        for name in ("metric", "conditions", "gap", "budget"):
            if getattr(own, name) != getattr(default, name):
                words += [f"--{name}", str(getattr(own, name))]
        return visible(shlex.join(words))


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A point by its number, from 1, and its name, which is that of its file."""

    number: int
    name: str
    settings: tuple[Setting, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Failed:
    """Why a point has no certificate: its specification is not valid (2), or tubecert has a defect (3).

    Of findings, without their places: that is the point.
    """

    format: str
    settings: Mapping[str, str]
    exit_code: int
    problems: tuple[Finding, ...]

    @property
    def broken(self) -> bool:
        """Whether tubecert has a defect there."""
        return self.exit_code == ExitCode.INTERNAL


Kept: TypeAlias = Certificate | sampled.Certificate | Failed


@lru_cache(maxsize=1)
def memory_of(task: Task) -> pipeline.Memory:
    """What this process has proven for points of a sweep."""
    del task
    return pipeline.Memory(most=_KEPT)


def certify_point(task: Task, point: Point) -> None:
    """Certify a point and keep what comes out. Raises `TargetError` if it cannot be written."""
    try:
        text = _certificate(task, point)
    except TubecertError as error:
        problems = [replace(finding, location=None) for finding in error.findings]
        _keep_failed(task, point, error.exit_code, problems)
        return
    except MemoryError:
        raise
    except Exception as error:
        words = f"internal error: {type(error).__name__}: {visible(' '.join(str(error).split())[:200])}"
        _keep_failed(task, point, ExitCode.INTERNAL, [Finding(code="", message=words)])
        return
    _write(certificate_file(task.folder, point), text)
    error_file(task.folder, point).unlink(missing_ok=True)


def _certificate(task: Task, point: Point) -> str:
    """The certificate of a point, with no times: the same whenever it is made. Raises `TubecertError`."""
    spec = task.load(point.settings)
    run = {"command": task.command(point.settings), "versions": versions()}
    if spec.hardware is None:
        result = pipeline.certify(spec, task.options, memory=memory_of(task))
        return certificate.dump(certificate.seal(result.to_json(), run))
    from tubecert.loop_design.certification import certify

    return sampled.certificate_text(replace(certify(spec), run=run))


def certificate_file(folder: Path, point: Point) -> Path:
    """Where the certificate of a point is."""
    return folder / "points" / f"{point.name}.certificate.json"


def error_file(folder: Path, point: Point) -> Path:
    """Where it is said why a point has none."""
    return folder / "points" / f"{point.name}.error.json"


def outcome(task: Task, point: Point) -> Kept | None:
    """What is kept of a point, None if there is nothing (or something that tubecert did not write for this point)."""
    wanted = {each.path: each.text for each in (*task.fixed, *point.settings)}
    found: Kept
    try:
        if error_file(task.folder, point).exists():
            data = json.loads(read(str(error_file(task.folder, point)), _ERROR))
            found = from_json(Failed, data, "error")
            return found if (found.format, found.settings) == (ERROR_FORMAT, wanted) else None
        path = str(certificate_file(task.folder, point))
        sealed = certificate.load(path, (certificate.FORMAT, sampled.FORMAT))
        if sealed["format"] == sampled.FORMAT:
            found = sampled.of_json(sealed, path)
            settings = found.result.spec.settings
        else:
            found = Certificate.from_json(sealed)
            settings = found.result.overrides.settings
    except (TargetError, FormError, ValueError):
        return None
    return found if settings == wanted else None


def _keep_failed(task: Task, point: Point, code: ExitCode, problems: list[Finding]) -> None:
    failed = Failed(
        format=ERROR_FORMAT,
        settings={each.path: each.text for each in (*task.fixed, *point.settings)},
        exit_code=int(code),
        problems=tuple(problems),
    )
    text = json.dumps(to_json(failed), sort_keys=True, indent=1, ensure_ascii=False)
    _write(error_file(task.folder, point), printable_json(text) + "\n")


def _write(path: Path, text: str) -> None:
    certificate.write_text(str(path), text, "the folder of a sweep must stay there while it runs")
