"""Words: how far a command is, and what a certificate of a sampled loop says, as sentences.

In: steps, records. Out: English, for reports and findings. Nothing is decided by what is written here. Trusted: no.
What a claim, an advice or an assumption says stands beside its fields, in `claims`.
"""
