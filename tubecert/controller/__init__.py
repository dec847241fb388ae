"""The controller of a certificate as code in C: what is exported is what `simulate` and the tests run.

In: a certificate of the sampled loop. Out: `controller.c`, `controller.h` and `selftest.c`, written by hand and always
the same, and beside them what belongs to the certificate: `controller_data.h`, `README.txt`. Trusted: no; `recheck
--controller` compares them with the certificate.

| module | what it does |
|---|---|
| `plans` | what the computer knows of the plan: a row per sample, a formula, or nothing |
| `data` | what belongs to the certificate: tables, limits, the plan, and their texts |
| `folder` | the files, and how they are written |
| `recursion` | the same recursion in numpy, for drivers in Python and for runs where there is no C compiler |
| `compiled` | the same files, compiled here, for many loops at once |
"""
