"""A certificate as a page, from code and for the command: HTML with figures, or Markdown."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from html import escape
from importlib.util import find_spec
from typing import TYPE_CHECKING, Final

from tubecert import files
from tubecert.asking import Text, question, text_of
from tubecert.certificate.file import refused, write_bytes
from tubecert.errors import TargetError
from tubecert.findings import Finding
from tubecert.library.reading import certificate_of
from tubecert.library.shown import Paged
from tubecert.library.specification import File
from tubecert.report.page import Page
from tubecert.report.page_simulation import TITLES, Simulated

if TYPE_CHECKING:
    from tubecert.library.certification import Certification
    from tubecert.library.sampled import SampledCertification
    from tubecert.report.quantities import AnyCertificate

_HELP: Final = "give a folder that tubecert simulate --certificate wrote for this certificate"
_MOST: Final = 20_000_000  # bytes of a file in such a folder


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Report(Paged):
    """The page of a certificate; the same for the same certificate."""

    certificate: AnyCertificate
    simulated: Simulated | None = None

    def _page(self) -> Page:
        from tubecert.library.stated import page_of

        return page_of(self.certificate, self.simulated)

    def save_figures(self, folder: File) -> list[str]:
        """Write every figure into a folder, as SVG, PDF and PNG, and what they show as captions.md; their names.

        PDF and PNG need matplotlib (the extra `simulate`), without which there are none. Raises `TargetError`.
        """
        from tubecert.report.figures_file import painted, svg_file

        told = self._page().figures
        data = {f"{each.key}.svg": svg_file(each).encode() for each in told}
        endings = ("pdf", "png") if find_spec("matplotlib") is not None else ()
        data |= {f"{each.key}.{own}": painted(own, each) for each in told for own in endings}
        target = text_of("folder", folder)
        try:
            os.makedirs(target, exist_ok=True)
        except OSError as error:
            raise refused(f"cannot write into {target}: {error.strerror}", "choose another folder") from None
        data["captions.md"] = "".join(f"- {each.key}: {each.told}\n" for each in told).encode()
        for name, content in data.items():
            write_bytes(os.path.join(target, name), content, self.remedy)
        return list(data)

    def __repr__(self) -> str:
        return f"<Report: a page about {self.certificate.result.spec.effective.name}>"

    def _repr_html_(self) -> str:
        """The page in a frame of its own: its style touches nothing around it."""
        style = "width: 100%; height: 45em; border: 1px solid #8884"
        return f'<iframe srcdoc="{escape(self.html)}" style="{style}" title="tubecert certificate"></iframe>'


@question({"simulation": Text("Show the figures that simulate drew for it.", "FOLDER")})
def report(result: Certification | SampledCertification | File, *, simulation: File | None = None) -> Report:
    """The page of a certificate, or of the file of one: `tubecert report`. Raises `TargetError`.

    `simulation` is a folder that `tubecert simulate` wrote for this certificate; its figures are shown in HTML.
    """
    sealed = certificate_of(result).certificate
    shown = None if simulation is None else _simulated_in(os.fspath(simulation), sealed)
    return Report(certificate=sealed, simulated=shown)


def _simulated_in(folder: str, certificate: AnyCertificate) -> Simulated:
    """What a folder of `simulate` shows; raises `TargetError` for another folder, and for another certificate's."""
    kind = files.Kind(most=_MOST, unreadable="TC600", too_large="TC600", help=_HELP)
    try:
        summary = json.loads(files.read(os.path.join(folder, "summary.json"), kind))
        outcome, of = summary["outcome"], summary["certificate"]
        if not isinstance(outcome, str) or not isinstance(of, str):
            raise TypeError
    except (ValueError, RecursionError, KeyError, TypeError):
        raise _refused("TC601", f"{folder} holds no simulation of tubecert") from None
    if of != certificate.hash:
        raise _refused("TC604", f"the simulation in {folder} was compared with another certificate")
    names = ((name, os.path.join(folder, f"{name}.png")) for name in TITLES)
    figures = {name: files.read(path, kind) for name, path in names if os.path.exists(path)}
    return Simulated(outcome=outcome, figures=figures)


def _refused(code: str, message: str) -> TargetError:
    return TargetError([Finding(code=code, message=message, help=_HELP)])
