"""Certificate D: a sampled, delayed, noisy loop about its plan, proven by one theorem.

In: a specification with `hardware`, and the tables of a linear controller. Out: a tube that the loop never leaves.
No metric: the error of the loop is summed by convolution, sample by sample. Implements: theory of the sampled loop,
sections 1 to 5.
Trusted: yes; "certified" is said in `theorem` alone.

| module | holds |
|---|---|
| `record` | what a certificate says, and its file |
| `setting` | specification and matrices -> the loop and its signals |
| `matrices` | interval matrices; e^(A s) and its integrals |
| `responses` | the loop's answers to every signal, lag by lag |
| `remainders` | what is not linear, bounded on the tube |
| `theorem` | the inequalities, and the verdict |
"""
