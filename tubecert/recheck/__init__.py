"""Re-verification of a certificate in a second arithmetic: python-flint's balls, no solver, nothing of the producer.

In: the text of a certificate. Out: every claim that its verdict rests on, confirmed, contradicted or undecided.
Trusted: yes. Imports of this package only `errors`, `findings` and `expression` (its parser and node types): a wrong
derivative, kernel, formula or rounding in the producer must not pass both.

| module | what it does |
|---|---|
| `balls` | ball arithmetic: exact numbers, ends, norms, positive definite matrices |
| `terms`, `program` | expressions with derivative rules of this room's own; evaluated on balls |
| `identity` | terms that vanish identically, by polynomials over the rationals |
| `boxes`, `statements` | expansions of second order over boxes; norms, definiteness and signs at their vertices |
| `pencils`, `multiplier`, `lipschitz` | statements of other kinds: pencils, columns over a ball, an h with kinks |
| `cover` | a claim over a domain, by splitting boxes that cover it |
| `curve`, `tube` | the plan as segments that enclose it; boxes around it |
| `document`, `system` | the certificate and the specification inside it, read and checked for form |
| `metric`, `place`, `constants`, `start`, `geodesics` | claims about the metric, suprema, the start |
| `filtering`, `predictor`, `conditions`, `sampling`, `gains` | the conditions A, B and C at printed gains |
| `consistency`, `refuted`, `claims` | what must agree; what refutes; all claims in their order |
"""
