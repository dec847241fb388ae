"""Search: `TubeProblem` -> the smallest gains, trade-off curves, what binds, and recipes.

In: a problem and, possibly, gains asked for. Out: results whose every pair was verified by `conditions` at
its printed decimals. Trusted: no, and it need not be. Implements: section "Closed form" of certificate A,
"Search and proof" of B.
"""
