"""Stages of a certification, as values: each holds what was proven and the stage before it, and cannot exist otherwise.

In: a question; what planners and searches propose. Out: the next stage, or `Stopped` with the claim that failed.
Trusted: yes; it calls no planner, no solver and no search.

| module | stage | what it adds |
|---|---|---|
| `question` | `Question`, `Stopped` | what is asked and known; a claim that is not proven |
| `metric` | `ProvenMetric` | B has full rank, C1-C3 hold on the safe set, declared bounds hold |
| `tube` | `Planned`, `TubeFound` | the plan; a radius for which the tube lies in the safe set |
| `bounded` | `Enclosed`, `Bounded` | every constant; that those suffice; half-widths, uniqueness of geodesics |
| `judged` | `Judged` | a section per kind, the verdict |
| `result` | | any stage -> `result` of a certificate |
"""
