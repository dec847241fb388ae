"""Kinds of certificates as recheck knows them: how the section of each is read, and what is examined of it.

In: the members of a certificate, and its constants as balls. Out: claims with their outcomes. Trusted: yes.
The keys are those of `tubecert.kinds`, from which nothing is imported. A new kind is its file here and its line in
`table.KINDS`.

| module | what it is |
|---|---|
| `kind` | what every kind offers, what its claims rest on, printed numbers against those of this room |
| `alone`, `rates`, `distance` | 0, A and B |
"""
