"""The controller of a certificate as code, from code and for the command."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Literal

from tubecert.library.asked import one_of
from tubecert.library.certification import Certification, read
from tubecert.library.specification import File

if TYPE_CHECKING:
    from tubecert.export.controller import Continuous, Controller

Language = Literal["c", "python"]
Precision = Literal["double", "single"]
Platform = Literal["arduino", "ros2", "px4"]
_LANGUAGES: Final[tuple[Language, ...]] = ("c", "python")
_PRECISIONS: Final[tuple[Precision, ...]] = ("double", "single")
_PLATFORMS: Final[tuple[Platform, ...]] = ("arduino", "ros2", "px4")


@dataclass(frozen=True, slots=True, kw_only=True)
class Exported:
    """The controller of a certificate H or C: its `files` by their names, and as a value, all exact."""

    files: Mapping[str, str] = field(repr=False)
    controller: Controller | Continuous = field(repr=False)

    @property
    def certificate(self) -> str:
        """The hash of the certificate."""
        return self.controller.hash

    def __str__(self) -> str:
        return f"controller of {self.controller.name}: {', '.join(sorted(self.files))}"

    def __repr__(self) -> str:
        return f"<Exported: {self}>"


def export(
    result: Certification | File,
    folder: File | None = None,
    *,
    language: Language = "c",
    precision: Precision = "double",
    platform: Platform | None = None,
) -> Exported:
    """The controller that a certificate is about, or that of the file of one, written into a folder if one is given.

    `tubecert export`. `platform`: beside it a program around it, of which what measures and acts is left open (C only;
    `--for`). In C everything is `double`, or `float` if the precision is `single`; in Python `double`.
    Raises `TubecertError` where neither certificate H nor C holds, or what holds cannot be exported, and `TargetError`.
    """
    from tubecert.export.assembly import controller_of
    from tubecert.export.folder import exported

    one_of("language", language, _LANGUAGES)
    one_of("precision", precision, _PRECISIONS)
    one_of("platform", platform, _PLATFORMS)
    found = result if isinstance(result, Certification) else read(result)
    name = "the certificate" if isinstance(result, Certification) else os.fspath(result)
    written = exported(controller_of(found.certificate, name), language, precision)
    if platform is not None:
        written = written.around(platform)
    if folder is not None:
        written.save(os.fspath(folder))
    return Exported(files=written.files, controller=written.controller)
