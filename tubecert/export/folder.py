"""The files of an exported controller: the same bytes for the same certificate, language and precision."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

from tubecert.certificate.file import write_text
from tubecert.errors import TargetError
from tubecert.export import c as c99
from tubecert.export.c_language import C
from tubecert.export.continuous import c as continuous_c
from tubecert.export.continuous import python as continuous_python
from tubecert.export.continuous import vectors as continuous_vectors
from tubecert.export.continuous import words as continuous_words
from tubecert.export.controller import Continuous, Controller, refused
from tubecert.export.followed import UncoveredError
from tubecert.export.python import python
from tubecert.export.rounding import within
from tubecert.export.skeletons import Platform, skeleton
from tubecert.export.vectors import vectors
from tubecert.export.words import readme
from tubecert.findings import Finding
from tubecert.printable import visible

Language = Literal["c", "python"]
Precision = Literal["double", "single"]
FORMAT: Final = "tubecert-controller/1"
MANIFEST: Final = "controller.json"
_REMEDY: Final = "choose another folder with -o FOLDER"


@dataclass(frozen=True, slots=True, kw_only=True)
class Exported:
    """A controller as files, by their names."""

    controller: Controller | Continuous
    language: Language
    precision: Precision
    files: Mapping[str, str]

    def save(self, folder: str) -> None:
        """Write them into a folder, which is made if there is none; raises `TargetError`."""
        target = Path(folder)
        try:
            target.mkdir(exist_ok=True)
        except OSError as error:
            message = f"cannot make the folder {visible(folder)}: {error.strerror or error}"
            raise TargetError([Finding(code="TC120", message=message, help=_REMEDY)]) from error
        for name, text in self.files.items():
            write_text(str(target / name), text, _REMEDY)

    def around(self, platform: Platform) -> Exported:
        """The same, with a program around it for a machine; raises TC710 where there can be none."""
        if self.language == "python":
            raise refused(f"a program for {platform} is about code in C", "leave --language out")
        if isinstance(self.controller, Continuous):
            raise refused(
                f"a program for {platform} acts at samples, and certificate C is about feedback in continuous time",
                "give the specification a section hardware, and export certificate H",
            )
        if self.controller.boxes is not None:
            raise refused(
                f"a program for {platform} would need the planner, as the plan is handed in at every sample",
                "write it around step, which is given x* and u*",
            )
        name, text = skeleton(self.controller, platform)
        return replace(self, files={**self.files, name: text})


def exported(
    controller: Controller | Continuous, language: Language = "c", precision: Precision = "double"
) -> Exported:
    """A controller in a language; in Python everything is `double`.

    Raises `TubecertError` (TC710) where the certificate is about rounding, and the code can lose more than it allows.
    """
    if isinstance(controller, Continuous):
        own = _continuous_c(controller, precision) if language == "c" else _continuous_python(controller)
    else:
        _require_digits(controller, precision if language == "c" else "double")
        own = _c(controller, precision) if language == "c" else _python(controller)
    manifest = {
        "format": FORMAT,
        "certificate": controller.hash,
        "language": language,
        "name": controller.name,
        "precision": precision,
    }
    said = {name: what for name, (what, _) in own.items()} | {MANIFEST: "what these files are, for tubecert"}
    files = {name: text for name, (_, text) in own.items()}
    files[MANIFEST] = json.dumps(manifest, indent=1, sort_keys=True) + "\n"
    told = precision if language == "c" else None
    files["README.md"] = (
        continuous_words.readme(controller, said, precision=told)
        if isinstance(controller, Continuous)
        else readme(controller, said, precision=told)
    )
    return Exported(controller=controller, language=language, precision=precision, files=files)


def _continuous_c(controller: Continuous, precision: Precision) -> dict[str, tuple[str, str]]:
    single, language = precision == "single", C(precision == "single")
    test = continuous_c.self_test(controller, language, continuous_vectors.vectors(controller, single=single))
    return _files_of_c(
        controller.name,
        continuous_c.header(controller, language),
        continuous_c.source(controller, language),
        test,
    )


def _continuous_python(controller: Continuous) -> dict[str, tuple[str, str]]:
    return _file_of_python(
        controller.name, continuous_python.python(controller, continuous_vectors.vectors(controller))
    )


def _require_digits(controller: Controller, precision: Precision) -> None:
    if controller.lost is None:
        return  # the certificate assumes a computer that is exact, and the files say so
    try:
        covered = within(controller, precision)
    except UncoveredError as error:
        help = f"{error.help}, or certify" if error.help else "certify"
        raise refused(
            f"no bound of rounding is known for {error}", f"{help} without hardware.arithmetic"
        ) from error
    if not covered:
        raise refused(
            f"the certificate does not allow for what {precision} loses",
            f"export it in double, or certify with hardware: {{arithmetic: {precision}}}",
        )


def _c(controller: Controller, precision: Precision) -> dict[str, tuple[str, str]]:
    single = precision == "single"
    language = C(single)
    test = c99.self_test(controller, language, vectors(controller, single=single))
    header, source = c99.header(controller, language), c99.source(controller, language)
    return _files_of_c(controller.name, header, source, test)


def _files_of_c(name: str, header: str, source: str, test: str) -> dict[str, tuple[str, str]]:
    return {
        f"{name}.h": ("the types, and what is called", header),
        f"{name}.c": ("the controller: C99, with math.h only", source),
        f"{name}_test.c": ("a program that tests it against numbers of the producer", test),
    }


def _python(controller: Controller) -> dict[str, tuple[str, str]]:
    return _file_of_python(controller.name, python(controller, vectors(controller)))


def _file_of_python(name: str, text: str) -> dict[str, tuple[str, str]]:
    return {f"{name}.py": ("the controller, with numpy only; run it, and it tests itself", text)}
