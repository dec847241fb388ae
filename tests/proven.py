"""Certificates that tests share: each is made once in a run, and handed out anew.

Not for tests that put something broken in the producer's place: what it makes would be kept for all others.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from shared import once

from tubecert import certificate, pipeline
from tubecert.certificate.result import Result
from tubecert.spec import load_text

CONFIGS = Path(__file__).parents[1] / "configs"


def proven(text: str, **options: Any) -> Any:
    """The certificate of a specification, as a reader of the file finds it."""
    return json.loads(_made(text, pipeline.Options(**options))[1])


def shipped(name: str, **options: Any) -> Any:
    """The certificate of a file in `configs`."""
    return proven((CONFIGS / f"{name}.yaml").read_text(encoding="utf-8"), **options)


def result(text: str, **options: Any) -> Result:
    """The result itself, for what is made of it before there is a file."""
    return _made(text, pipeline.Options(**options))[0]


@cache
def _made(text: str, options: pipeline.Options) -> tuple[Result, str]:
    def make() -> tuple[Result, str]:
        found = pipeline.certify(load_text(text, "spec.yaml"), options)
        return found, certificate.dump(certificate.seal(found.to_json(), {}))

    return once(make, "proven", text, options)
