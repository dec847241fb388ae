"""Re-verification of a certificate of a sampled loop: no metric; its error equation summed again on balls.

In: a document of its format. Out: claims, as of every certificate. Trusted: yes; nothing of the producer is imported.

| module | what it does |
|---|---|
| `record` | the certificate, read into closed types |
| `remainders` | the plan in windows; suprema on the tube |
| `theorem` | the loop over a sample; the inequalities at every sample |
| `claims` | all claims in their order, and those about obstacles |
| `exported` | a controller in C against its certificate |
"""
