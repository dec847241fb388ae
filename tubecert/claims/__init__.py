"""What can be claimed, assumed and advised: ids with parameters, and beside them what each says in words.

In: what a room found. Out: `Reason`s and `Assumption`s, as they stand in a certificate. The ids and the names of the
parameters are a contract: a reader of certificates decides by them, never by a sentence. Trusted: yes.

| module | what it holds |
|---|---|
| `family` | what a claim, an advice, an assumption and a reason are |
| `statements` | claims, in the order in which a certification meets them |
| `conditions` | what the conditions of certificates are called and say |
| `failures` | why no metric was found, and what became of each attempt |
| `advice` | what would help |
| `assumptions` | what is assumed |
| `written` | points and enclosures as JSON |
"""

# All of them, in this order, wherever one is read: a family of records is whole only when its members are loaded.
from tubecert.claims import (  # noqa: F401  # isort: skip
    statements, failures, advice, assumptions, written,
)  # fmt: skip
