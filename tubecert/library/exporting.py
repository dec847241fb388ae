"""The controller of a certificate as files in C: `tubecert export`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tubecert.asking import text_of
from tubecert.controller.data import data_of
from tubecert.controller.folder import files_of, write
from tubecert.controller.plans import refused
from tubecert.library.reading import certificate_of
from tubecert.library.sampled import SampledCertification
from tubecert.library.specification import File
from tubecert.library.stated import Stated


@dataclass(frozen=True, slots=True, kw_only=True)
class Exported:
    """What was written: names of `files` in a `folder`; `work`: multiply-adds of a sample, numbers in the tables."""

    folder: str
    files: tuple[str, ...]
    work: int


def export(result: Stated[Any] | File, folder: File) -> Exported:
    """Writes the controller of a certificate of the sampled loop, or of the file of one, into a folder.

    Raises `TubecertError` for a certificate that says less than `certified` or has no controller (TC710), and
    `TargetError` where a file of the folder is none that tubecert wrote, or was changed.
    """
    found = certificate_of(result)
    if not isinstance(found, SampledCertification):
        help = "give the specification a section hardware (rate, delay, noise), and certify again"
        raise refused("it is about a loop in continuous time, which no computer runs", help)
    certificate = found.certificate
    plan = certificate.result.spec.effective.part("trajectory")
    if certificate.result.claim.hold == "continuous" and plan.get("kind") != "equilibrium":
        message = "it is proven for an input of the plan that changes within a sample, and code holds it"
        raise refused(message, "certify with hardware: {hold: middle}, which is how a computer holds it")
    data = data_of(certificate)
    target, files = text_of("folder", folder), files_of(data)
    write(target, files)
    return Exported(folder=target, files=tuple(sorted(files)), work=data.work)
