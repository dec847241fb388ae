"""The library: what `import tubecert` offers, and what commands share with it.

In: specifications as files, mappings or texts. Out: frozen values with arrays and units. Trusted: no; what is certified
was made so by the pipeline, and is what the certificate says. A command is a client of these functions like any other.

| module | what it does |
|---|---|
| `certifying`, `metrics`, `simulating`, `sweeping`, `rechecking` | functions with the names of commands |
| `pages`, `comparing`, `exporting` | the same |
| `certification`, `sampled`, `stated`, `simulation`, `reading`, `shown` | what they give, as values |
| `plain`, `specification` | values of Python as a specification; `check` |
| `workers` | who helps: processes, or a cluster |
"""
