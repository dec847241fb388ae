"""`recheck --spec`: whether a certificate is of the specification in a file."""

from __future__ import annotations

from tubecert.certificate.belonging import ForeignError, compared
from tubecert.certificate.file import incomplete
from tubecert.certificate.result import Result
from tubecert.recheck.certificate import read_certificate
from tubecert.recheck.document import Node
from tubecert.records import FormError
from tubecert.sampled_loop.record import read

__all__ = ["ForeignError", "belongs", "sampled_belongs"]


def belongs(document: Node, name: str, path: str) -> str:
    """A sentence that says that the certificate is of the specification at `path`; raises TC604 if it is not."""
    from tubecert import spec

    read_certificate(document)  # its form: what is compared below is there, and what is examined is the same
    loaded = spec.load(path)
    try:
        result = Result.from_json(document.mapping()["result"])
    except FormError as error:
        raise incomplete(name, str(error)) from error
    found = compared(loaded, result)
    found.require(loaded, name)
    return found.words(path)


def sampled_belongs(text: str, name: str, path: str) -> str:
    """The same of the file of a certificate of a sampled loop."""
    from tubecert import spec
    from tubecert.library.sampled import compared as sampled_compared

    loaded = spec.load(path)
    found = sampled_compared(loaded, read(text, name).result)
    found.require(loaded, name)
    return found.words(path)
