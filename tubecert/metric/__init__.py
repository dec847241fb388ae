"""Metrics: verification of C1-C3 on the whole safe set (`verify`, trusted).

In: a model with its dual metric and rate, and the safe set. Out: a verdict with margin or witness.
"""
