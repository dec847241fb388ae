"""Simulation of certificate D: the nonlinear plant with the certified controller in the loop, attacked.

In: a specification and what was proven of its sampled loop. Out: runs, the share of the tube that they attained, and
what they falsify. All runs are lanes of one numpy vector. Trusted: no.

| module | what it does |
|---|---|
| `setting` | specification and certificate -> plant, times, tube, all in floats; the plan or plans that lanes follow |
| `attack` | the lanes: adversaries, who know what each signal does lag by lag, and random signals |
| `loop` | samples, delay, held inputs; lanes from start to end, in steps that are short enough |
| `campaign` | lanes by vectors, what they come to, and its summary |
| `figures` | the files of a campaign |
"""
