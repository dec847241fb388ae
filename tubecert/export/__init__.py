"""Controllers from certificates: certificate H as code that a machine runs, and such code driven and compared.

In: a certificate whose section `hardware` is certified. Out: files in C99 or Python. Trusted: no; what is exported is
about the certificate that is named in it, and `recheck` examines that one.
"""
