"""Simulation of certificate D: the nonlinear plant with the certified controller in the loop, attacked.

In: a specification and what was proven of its sampled loop. Out: runs, the share of the tube that they attained, and
what they falsify. All runs are lanes of one numpy vector. Trusted: no.

| module | what it does |
|---|---|
| `setting` | specification and certificate -> plant, times, tube, plan, all in floats |
| `engine` | lanes, step by step, twice: with steps and with half of them |
| `kernels` | what each signal does to a state, lag by lag, in the loop without remainders |
| `attack` | the lanes: adversaries, who know the kernels, and random signals |
| `families` | random plans of a family |
| `sampled` | samples, delay, held inputs and the peaks of every lane |
| `campaign` | lanes by chunks, and what they come to |
| `record`, `files`, `figures` | the summary, and the folder that it is written to |
"""
