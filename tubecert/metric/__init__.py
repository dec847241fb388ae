"""Metrics: verification of C1-C3 on the whole safe set (`verify`, trusted); synthesis comes later (untrusted).

In: a model with its dual metric and rate, and the safe set. Out: a verdict with margin or witness.
"""
