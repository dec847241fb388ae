"""Simulation of certificate D: the nonlinear plant with the certified controller in the loop, attacked.

In: a specification and what was proven of its sampled loop. Out: runs, the share of the tube that they attained, and
what they falsify. All runs are lanes of one numpy vector. Trusted: no.

| module | what it does |
|---|---|
| `setting` | specification and certificate -> plant, times, tube, plan, all in floats |
| `kernels` | what each signal does to a state, lag by lag, in the loop without remainders |
| `families` | what lanes follow: the plan, or random plans of a family |
| `attack` | the lanes: adversaries, who know the kernels, and random signals |
| `loop` | samples, delay, held inputs; lanes as a system, and their steps |
| `campaign` | lanes by vectors, what they come to, and its summary |
| `figures` | the files of a campaign |
"""
