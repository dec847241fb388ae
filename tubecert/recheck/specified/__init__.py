"""The parts of a specification as a certificate holds them, each read into closed types.

Every object has a known set of keys; a key that is missing, unknown or of another kind is an error (TC603). Nothing
has a default: the canonical form writes out all that a claim rests on. `recheck.specification` puts them together.

| module | what it reads |
|---|---|
| `numbers` | kinds of numbers, ranges, rows; expressions |
| `plant` | the system on its safe set, the uncertainty h, the dual metric, or what one that is to be found must be |
| `trajectory` | the plan, x(0) |
| `loop` | the loop of adaptation, the machine that runs the controller, the disturbance beside the inputs |
"""
