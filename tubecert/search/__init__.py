"""Search: `TubeProblem` -> proposals: the smallest gains, trade-off curves, recipes. The kernel decides about them.

In: a problem and, possibly, gains asked for. Out: proposals, and what explains a result. Trusted: no, and it need not
be. Implements: section "Closed form" of certificate A, "Search and proof" of B.
"""
