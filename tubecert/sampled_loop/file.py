"""The file of a certificate of a sampled loop: sealed with the hash of its result, read back strictly.

In: a certificate, or the JSON of one. Out: the text of its file, or the certificate. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tubecert.certificate import file
from tubecert.records import FormError, Json, from_json, to_json
from tubecert.sampled_loop.record import FORMAT, Certificate, Notes, Result


def seal(result: Result, notes: Notes, run: Mapping[str, Any]) -> Certificate:
    """The certificate of a result; `run` says how it was made (versions, times, command line)."""
    return Certificate(hash=file.digest(to_json(result)), result=result, notes=notes, run=run)


def certificate_text(certificate: Certificate) -> str:
    """The text of the file."""
    return file.dump({"format": FORMAT, **to_json(certificate)})


def read(text: str, name: str) -> Certificate:
    """The certificate in the text of a file; raises `TargetError` for anything else, or a hash that is not its own."""
    sealed = file.parse(text.encode(), name, (FORMAT,))
    if sealed.get("hash") != file.digest(sealed["result"]):
        raise file.foreign(name, "was changed after it had been written: its hash is not that of its result")
    return of_json(sealed, name)


def of_json(sealed: Json, name: str) -> Certificate:
    """The certificate in JSON whose format and hash are known to be right; raises `TargetError`."""
    try:
        return Certificate(
            hash=sealed["hash"],
            result=from_json(Result, sealed["result"], "certificate.result"),
            notes=from_json(Notes, sealed.get("notes", {}), "certificate.notes"),
            run=dict(sealed.get("run", {})),
        )
    except FormError as error:  # with a hash that is right: somebody sealed what is no result
        raise file.incomplete(name, str(error)) from error
