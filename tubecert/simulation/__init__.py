"""Simulation: closed loops, attacked. A run may falsify a certificate and never supports one.

In: a specification and what was proven. Out: runs, what they falsify, summaries, figures. Trusted: no; no trusted room
imports this one.

| module | what it does |
|---|---|
| `adaptive`, `sampled` | the loops of the paper in continuous time; the loop that a computer closes |
| `vectors` | a campaign as vectors of runs; what an interruption keeps |
| `plans` | random plans of a family, as lanes |
| `obstacles` | how near points come to an obstacle |
| `told` | what campaigns tell of their runs: violations, uses of inputs, clearances |
| `figures` | colours, labels, legends, obstacles in a plane; a figure as files |
| `folder` | a folder that is tried before any work is done, and to which the summary comes last |
"""
