"""Words: claims, advice and assumptions, which are ids with parameters everywhere else, as sentences.

In: `claims`. Out: English, for reports and findings. Nothing is decided by what is written here. Trusted: no.

| module | what it does |
|---|---|
| `claims` | what a claim is called, and why it holds or not |
| `advice` | what would help |
| `assumptions` | what is assumed |
| `conditions` | what the conditions of the certificates say |
"""
