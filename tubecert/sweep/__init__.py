"""Sweeps: the certification of every point of a grid of keys of a specification, kept as files.

In: a specification, ranges of keys, options. Out: a folder with a certificate (or an error) for every point, complete
at last however often it was interrupted. Each is the certificate that `certify --set ...` writes. Trusted: no; it runs
the pipeline and keeps what comes out.

| module | what it does |
|---|---|
| `grid` | ranges of keys as texts, and their product |
| `point` | one point: certified, or why it could not be, in a file of its own |
| `folder` | whose sweep a folder holds, and what of it is there |
| `run` | the points that are missing, by an executor |
"""
