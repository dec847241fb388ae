"""The library: what `import tubecert` offers, and what commands share with it.

In: specifications as files, mappings or texts. Out: frozen values with arrays and units. Trusted: no; what is certified
was made so by the pipeline, and is what the certificate says. A command is a client of these functions like any other.

| module | what it does |
|---|---|
| `numbers`, `asked` | what is asked for beside a specification: exact numbers, words that go together |
| `plain`, `specification` | values of Python as a specification |
| `certification`, `certifying` | a certificate as a value; how one is made |
| `metrics` | metrics found, or decided |
| `workers` | who helps: processes, or a cluster |
| `simulating`, `simulation`, `rechecking`, `pages` | what can be done with a certificate |
| `comparing` | certificates side by side |
| `sweeping` | many values of some keys |
| `figures` | the tube and the trade-off, drawn into axes |
"""
