"""Certificate C as code: feedback that acts in continuous time, and its adaptation, which is sampled (theory 4b).

In: a certificate whose section `sampled` is certified. Out: files in C99 or Python, what they answer, and runs of
compiled code in the loop. Trusted: no, as `export`.
"""
