"""Findings as JUnit XML: a suite per file, a case per part of the specification and per claim of its certification."""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.etree import ElementTree as ET

from tubecert.checking import Checked, Claim
from tubecert.findings import Finding, Severity
from tubecert.printable import visible
from tubecert.verdict import Verdict

PARTS = {
    "TC1": "specification",
    "TC2": "model",
    "TC3": "metric",
    "TC4": "plan and tube",
    "TC5": "expectation",
}
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def render(results: Sequence[Checked]) -> str:
    """The report."""
    root = ET.Element("testsuites", name="tubecert check")
    suites = [_suite(root, result) for result in results]
    for key in ("tests", "failures", "errors", "skipped"):
        root.set(key, str(sum(int(suite.get(key, "0")) for suite in suites)))
    root.set("time", f"{sum(result.seconds for result in results):.3f}")
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _suite(root: ET.Element, result: Checked) -> ET.Element:
    suite = ET.SubElement(root, "testsuite", name=_clean(result.path))
    cases = [_part(suite, result, prefix, name) for prefix, name in PARTS.items()]
    failed = any(item.code.startswith("TC5") and item.severity is Severity.ERROR for item in result.findings)
    cases += [_claim(suite, result, claim, failed=failed) for claim in result.claims]
    failures = sum(case.find("failure") is not None for case in cases)
    counts = {"tests": len(cases), "failures": failures, "errors": 0, "skipped": 0}
    suite.attrib.update(
        {key: str(count) for key, count in counts.items()} | {"time": f"{result.seconds:.3f}"}
    )
    return suite


def _part(suite: ET.Element, result: Checked, prefix: str, name: str) -> ET.Element:
    """A case that fails with the errors whose codes begin with `prefix`; other findings are its output."""
    case = _case(suite, result, name)
    own = [item for item in result.findings if item.code.startswith(prefix)]
    errors = [item for item in own if item.severity is Severity.ERROR]
    if errors:
        _failure(case, errors[0].code, errors[0].message, errors)
    rest = [item for item in own if item.severity is not Severity.ERROR]
    if rest:
        ET.SubElement(case, "system-out").text = _clean("\n".join(map(str, rest)))
    return case


def _claim(suite: ET.Element, result: Checked, claim: Claim, *, failed: bool) -> ET.Element:
    """A case per claim; a claim that is refuted as expected passes."""
    case = _case(suite, result, f"claim: {claim.name}")
    said = f"{claim.verdict}: {claim.message}" if claim.message else claim.verdict
    if failed and claim.verdict != Verdict.CERTIFIED:
        _failure(case, claim.verdict, claim.message or claim.verdict, [])
    ET.SubElement(case, "system-out").text = _clean(said)
    return case


def _case(suite: ET.Element, result: Checked, name: str) -> ET.Element:
    return ET.SubElement(
        suite, "testcase", name=_clean(name), classname=_clean(result.path), file=_clean(result.path)
    )


def _failure(case: ET.Element, kind: str, message: str, findings: Sequence[Finding]) -> None:
    failure = ET.SubElement(case, "failure", type=_clean(kind), message=_clean(message))
    failure.text = _clean("\n".join(map(str, findings)) or message)


def _clean(text: str) -> str:
    """Lines of characters that print, and that XML 1.0 can hold."""
    return _NOT_XML.sub("\ufffd", "\n".join(map(visible, text.split("\n"))))
