"""Search: `TubeProblem` -> proposals: the smallest gains, trade-off curves, recipes. The kernel decides about them.

In: a problem and, possibly, gains asked for. Out: proposals, and what explains a result. Trusted: no, and it need not
be. Implements: what is proposed for theory sections 3 and 4.
"""
