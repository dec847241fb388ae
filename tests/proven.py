"""Certificates that tests share: each is made once in a run, and handed out anew.

Not for tests that put something broken in the producer's place: what it makes would be kept for all others.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import cache
from typing import Any

import pytest
from shared import once
from texts import CONFIGS

from tubecert import certificate, pipeline
from tubecert.certificate.result import Result
from tubecert.pipeline import certification
from tubecert.search.proposers import Explained, Proposer
from tubecert.spec import load_text


def proven(text: str, *, bare: bool = False, **options: Any) -> Any:
    """The certificate of a specification, as a reader of the file finds it.

    `bare`: without curves, gains beside those that decide and advice, which take longer than all the rest.
    """
    return json.loads(_made(text, pipeline.Options(**options), bare)[1])


def shipped(name: str, **options: Any) -> Any:
    """The certificate of a file in `configs`."""
    return proven((CONFIGS / f"{name}.yaml").read_text(encoding="utf-8"), **options)


def result(text: str, *, bare: bool = False, **options: Any) -> Result:
    """The result itself, for what is made of it before there is a file."""
    return _made(text, pipeline.Options(**options), bare)[0]


@cache
def _made(text: str, options: pipeline.Options, bare: bool) -> tuple[Result, str]:
    def make() -> tuple[Result, str]:
        with barely() if bare else nullcontext():
            found = pipeline.certify(load_text(text, "spec.yaml"), options)
        return found, certificate.dump(certificate.seal(found.to_json(), {}))

    return once(make, "proven", text, options, bare)


@contextmanager
def barely() -> Iterator[None]:
    """What is certified meanwhile is what decides: no curves, no gains beside it, nothing is explained."""
    asked = pipeline.Options.asked

    def unexplained(proposer: Proposer) -> Explained:
        return Explained(slopes=None if proposer.slopes is None else {})

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline.Options, "asked", lambda self, *, curve: asked(self, curve=False))
        patch.setattr(certification, "_explained", lambda judged, key, proposer: unexplained(proposer))
        yield
