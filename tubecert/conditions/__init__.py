"""Conditions: constants over a tube -> margins of certificates 0, A and B at given gains.

In: `TubeProblem` and a recipe (gains and auxiliary numbers as exact decimals). Out: margins as intervals
whose lower end is proven. Trusted: yes. Implements: theorem 0, (26a)-(26c) and theorem B (docs/theory).
"""
