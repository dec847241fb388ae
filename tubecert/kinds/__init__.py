"""Kinds of certificates: what each one is called, needs, decides and writes. One table that every room iterates.

In: a problem and a proposal. Out: a section of the certificate. Trusted: yes: a section is written from the kernel's
judgement. A new kind is a theorem in `conditions` (listed in `kernel`), a search in `search` (listed there), its file
here (listed in `table`, named in `letters`) and its file in `recheck`.

| letter | module | theorem |
|---|---|---|
| 0 | `alone` | the feedback alone, without adaptation |
| A | `rates` | (26a)-(26c) of the paper, corrected |
| B | `distance` | the Riemannian distance bounded directly |
"""

from __future__ import annotations

from tubecert.letters import ALONE, DISTANCE, NAMES, RATES, Name, name_of

__all__ = ["ALONE", "DISTANCE", "NAMES", "RATES", "Name", "name_of"]
