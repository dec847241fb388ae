"""The certificate: what was proven as canonical JSON, sealed with a hash, written atomically.

In: the values of a certification. Out: the JSON of the contract (design: `result`, `hash`, `run`). Trusted: yes.
"""

from tubecert.certificate.file import (
    FORMAT,
    KIND,
    STDOUT,
    canonical_bytes,
    check_target,
    digest,
    dump,
    incomplete,
    load,
    parse,
    seal,
    unreadable,
    write,
    write_text,
)

__all__ = [
    "FORMAT",
    "KIND",
    "STDOUT",
    "canonical_bytes",
    "check_target",
    "digest",
    "dump",
    "incomplete",
    "load",
    "parse",
    "seal",
    "unreadable",
    "write",
    "write_text",
]
