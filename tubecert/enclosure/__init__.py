"""Enclosures: outward-rounded intervals, verified spectra, and branch and bound for suprema.

In: expressions and a domain. Out: numbers proven below and above. Trusted: yes.
"""
