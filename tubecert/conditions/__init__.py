"""Conditions: constants over a tube -> margins of certificates A, B and C at given gains.

In: `TubeProblem` and a recipe (gains and auxiliary numbers as exact decimals). Out: margins as intervals
whose lower end is proven. Trusted: yes. Implements: (26a)-(26c), theorem B and theorem C (docs/theory).
"""
