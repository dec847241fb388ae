"""A certificate's file as a value: of a metric's loop or of a sampled one, by its format."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tubecert.asking import text_of
from tubecert.certificate import file
from tubecert.records import FormError

if TYPE_CHECKING:
    from tubecert.library.certification import Certification
    from tubecert.library.sampled import SampledCertification
    from tubecert.library.specification import File


def read(path: File) -> Certification | SampledCertification:
    """The certificate in a file that `save` or `tubecert certify` wrote.

    Raises `TargetError` for a file that is none, or that was changed afterwards. Its claims are not examined: that is
    what `recheck` does.
    """
    from tubecert.sampled_loop.record import FORMAT, of_json

    source = text_of("result", path)
    sealed = file.load(source, (file.FORMAT, FORMAT))
    if sealed["format"] == FORMAT:
        from tubecert.library.sampled import certification_of

        return certification_of(of_json(sealed, source))
    from tubecert.library.certification import certification_of as of_metric

    try:
        return of_metric(sealed)
    except FormError as error:  # with a hash that is right: somebody sealed what is no result
        raise file.incomplete(source, str(error)) from error


def certificate_of(result: Any) -> Any:
    """A certificate that is given as a value, or as its file; raises `SpecError` for what is neither."""
    return result if hasattr(result, "certificate") else read(result)
