"""Certificates for the tests of the checker: made once, changed, sealed again, examined."""

import hashlib
import json
import pickle
from fractions import Fraction
from pathlib import Path
from typing import Any

import proven

from tubecert import certificate
from tubecert.errors import TubecertError
from tubecert.library.rechecking import belongs
from tubecert.recheck.certificate import read_result
from tubecert.recheck.claims import Case
from tubecert.recheck.document import Node
from tubecert.recheck.grammar import read
from tubecert.recheck.run import Recheck, recheck
from tubecert.recheck.terms import Term, variable

Document = dict[str, Any]


def certified(text: str, *, bare: bool = True, **options: object) -> Document:
    """The certificate of a specification, of what is claimed alone; by default with all conditions.

    Its constants are enclosed within a tenth, which the checker confirms in a third of the time; a test of claims
    that are just too small asks for its own `gap`.
    """
    return proven.proven(text, bare=bare, **{"conditions": "all", "gap": Fraction(1, 10), **options})


def shipped(name: str) -> Document:
    """The certificate of a shipped configuration, as users have it."""
    return proven.shipped(name, conditions="all")


def written(result: Any) -> Document:
    """A result as the certificate that a reader finds."""
    return json.loads(certificate.dump(certificate.seal(result, {})))


def digest(data: object) -> str:
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return "sha256:" + hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def sealed(document: Document) -> Document:
    """The hashes made right again, and what repeats the specification or says what is claimed with it."""
    document = pickle.loads(pickle.dumps(document))  # a copy, in a tenth of the time of `deepcopy`
    if "result" not in document:
        return document
    inner = document["result"].get("spec")
    if isinstance(inner, dict) and {"effective", "effective_hash"} <= inner.keys():
        inner["effective_hash"] = digest(inner["effective"])
    return {**document, "hash": digest(document["result"])}


def respecified(document: Document, change: Any) -> Document:
    """The specification inside changed, with everything that repeats it, and both hashes."""
    document = pickle.loads(pickle.dumps(document))
    result = document["result"]
    effective = result["spec"]["effective"]
    change(effective)
    if "dual_metric" in effective["metric"]:
        result["metric"]["dual_metric"] = effective["metric"]["dual_metric"]
    claim, start = result["claim"], effective["initial_state"]
    claim |= {"start": start, "domain": effective["safe_set"]}
    if "horizon" in effective["trajectory"]:
        claim |= {"horizon": effective["trajectory"]["horizon"], "for_all_time": None, "period": None}
    return sealed(document)


def confirmed(text: str, **options: Any) -> tuple[Document, dict[str, Any]]:
    """A certificate that is confirmed, and what was examined of it."""
    document, memory = certified(text, **options), {}
    assert document["result"]["verdict"] == "certified"
    assert failing(examine(document, memory=memory)) == []
    return document, memory


OUTCOMES: dict[int, dict[str, Any]] = {}  # of claims that were examined, by the budget


def examine(document: Document, budget: int = 20_000, memory: Any = None, **options: Any) -> Recheck:
    """The recheck of a certificate; equal claims of several are examined once.

    Where something in the checker is replaced, and where what is remembered is the question, with a memory of its own.
    """
    remembered = OUTCOMES.setdefault(budget, {}) if memory is None else memory
    return recheck(json.dumps(document), "certificate", budget, memory=remembered, **options)


def failing(found: Recheck) -> list[tuple[str, str]]:
    return [(item.name, item.outcome.why) for item in found.claims if not item.outcome.holds]


def doubted(document: Document) -> bool:
    """Whether a claim of a certificate does not hold; the rest is not examined."""
    return bool(failing(examine(document, to_first_failure=True)))


def unconfirmed(document: Document) -> bool:
    """Whether a forged certificate, sealed again, is not confirmed: not of the form, or a claim that does not hold."""
    try:
        return doubted(sealed(document))
    except TubecertError:
        return True


def belongs_to(document: Document, text: str, folder: Path) -> str:
    """What is said of a certificate beside a file with this text."""
    path = folder / "plant.yaml"
    path.write_text(text, encoding="utf-8")
    return belongs(Node(document, "certificate"), "certificate", str(path))


def case_of(document: Document, budget: int = 400) -> Case:
    return Case(read_result(Node(document["result"], "certificate.result")), budget)


def terms(expressions: list[str], names: str | list[str]) -> list[Term]:
    """Texts as terms of the checker."""
    symbols = {name: variable(name) for name in names}
    return [read(text, symbols, kinks=True)[0] for text in expressions]
