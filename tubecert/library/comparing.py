"""Certificates side by side, from code and for the command: `tubecert compare`."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar

from tubecert.asking import refuse
from tubecert.certificate.effective import Tree
from tubecert.library.certification import Certification
from tubecert.library.reading import certificate_of
from tubecert.library.sampled import SampledCertification
from tubecert.library.shown import Paged
from tubecert.library.specification import File
from tubecert.printable import json_text
from tubecert.report.comparison import Comparison as Sides
from tubecert.report.comparison import page_of
from tubecert.report.page import Page
from tubecert.report.quantities import Value


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Comparison(Paged):
    """What certificates say, side by side; every sequence is in the order in which they were given.

    `quantities`: each number or word that one of them has, by its key (`rho`, `half_width.px`,
    `distance.least_adaptation.bandwidth`); None where a certificate has none. `differences`: the keys, by path, in
    which the specifications differ.
    """

    sides: Sides = field(repr=False)
    forms: ClassVar[Mapping[str, str]] = {**Paged.forms, ".csv": "csv", ".json": "json"}
    known = "a comparison is a page or a table"
    remedy = "give a file FILE.html, FILE.md, FILE.csv or FILE.json in a folder that exists"

    @property
    def names(self) -> tuple[str, ...]:
        """What the certificates are called."""
        return self.sides.names

    @property
    def quantities(self) -> Mapping[str, tuple[Value, ...]]:
        """Every quantity by its key."""
        return MappingProxyType(dict(self.sides.values))

    @property
    def differences(self) -> Mapping[str, tuple[Tree, ...]]:
        """The values of keys of the specification that are not the same in all."""
        return MappingProxyType(dict(self.sides.differences))

    @property
    def csv(self) -> str:
        """As comma-separated values."""
        return self.sides.csv()

    @property
    def json(self) -> str:
        """As JSON."""
        return json_text(self.sides.json())

    def _page(self) -> Page:
        return page_of(self.sides)


def compare(
    *certificates: Certification | SampledCertification | File, names: Sequence[str] | None = None
) -> Comparison:
    """Put certificates side by side: values, or files of some. Nothing is examined; `recheck` does that.

    `names` are what they are called; without, a file is called by its name, a value by that of its specification.
    Raises `TargetError` for a file that cannot be read, `SpecError` for fewer than two.
    """
    if len(certificates) < 2:
        refuse("certificates", str(len(certificates)), "two certificates or more are compared")
    if names is not None and len(names) != len(certificates):
        refuse("names", ", ".join(names), f"{len(names)} names for {len(certificates)} certificates")
    found = [certificate_of(each) for each in certificates]
    files = [os.fspath(each) if isinstance(each, (str, os.PathLike)) else each.name for each in certificates]
    named = zip(names or files, found, strict=True)
    return Comparison(sides=Sides.of([(name, each.certificate) for name, each in named]))
