"""Proven bounds: (model, metric, tube) -> `BoundConstants`, each an enclosure with its witness.

In: a model and a domain (time window, radius). Out: suprema proven from below and above. Trusted: yes.
Implements: the constants of assumptions 2 to 5 of the paper, (bounds:M_x), (bounds:delta_u) corrected.
"""
