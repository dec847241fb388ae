"""The parts of a specification as a certificate holds them, each read into closed types.

Every object has a known set of keys; a key that is missing, unknown or of another kind is an error (TC603). Nothing
has a default: the canonical form writes out all that a claim rests on. `recheck.specification` puts them together.

| module | what it reads |
|---|---|
| `numbers` | kinds of numbers, ranges, rows |
| `plant` | the system on its safe set, and the uncertainty h |
| `trajectory` | the plan |
| `start` | x(0) |
| `metric` | the dual metric, or what one that is to be found must be |
| `loop` | the loop of adaptation |
| `hardware` | the machine that runs the controller, and the disturbance beside the inputs |
| `idle` | what no claim rests on |
"""
