"""Checking files: findings of the text and of the mathematics, locked results, and what is remembered of them.

In: the path of a specification. Out: `Checked`, and an exit code. Trusted: it adds nothing to what a certification
says. What was found for a file that has not changed is read back without loading any numerics.

| module | what it does |
|---|---|
| `file` | one file |
| `expectations` | a certification in short, and its comparison with `expect:` |
| `cache` | what was found before |
"""

from tubecert.checking.expectations import Claim, Outcome, compared, outcome
from tubecert.checking.file import Checked, CheckOptions, check

__all__ = ["CheckOptions", "Checked", "Claim", "Outcome", "check", "compared", "outcome"]
