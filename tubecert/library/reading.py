"""A certificate's file as a value: of a metric's loop or of a sampled one, by its format."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from tubecert.certificate import file
from tubecert.library import sampled
from tubecert.library.specification import File
from tubecert.sampled_loop.record import FORMAT, of_json

if TYPE_CHECKING:
    from tubecert.library.certification import Certification
    from tubecert.library.sampled import SampledCertification


def read(path: File) -> Certification | SampledCertification:
    """The certificate in a file that `save` or `tubecert certify` wrote.

    Raises `TargetError` for a file that is none, or that was changed afterwards. Its claims are not examined: that is
    what `recheck` does.
    """
    source = os.fspath(path)
    sealed = file.load(source, (file.FORMAT, FORMAT))
    if sealed["format"] == FORMAT:
        return sampled.certification_of(of_json(sealed, source))
    from tubecert.library.certification import read_sealed

    return read_sealed(sealed, source)
