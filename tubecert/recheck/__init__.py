"""Re-verification of a certificate in a second arithmetic: python-flint's balls, no solver, nothing of the producer.

In: the text of a certificate. Out: every claim that its verdict rests on, confirmed, contradicted or undecided.
Trusted: yes. Imports of this package only `errors`, `findings` and `expression` (its parser and node types): a wrong
derivative, kernel, formula or rounding in the producer must not pass both.

| module | what it does |
|---|---|
| `balls` | ball arithmetic: exact numbers, ends, norms, positive definite matrices |
| `terms` | expressions with derivative rules of this room's own, evaluated on balls |
| `identity` | terms that vanish identically, by polynomials over the rationals |
| `boxes` | bounds over boxes: second-order Taylor forms at vertices |
| `cover` | a claim over a domain, by splitting boxes that cover it |
| `curve`, `tube` | the plan as segments that enclose it; boxes around it |
| `document`, `system` | the certificate and the specification inside it, read and checked for form |
| `metric`, `constants`, `start`, `geodesics` | claims about the metric, suprema, the start |
| `filtering`, `conditions`, `gains` | the conditions A, B and C at printed gains |
| `consistency`, `refuted`, `claims` | what must agree; what refutes; all claims in their order |
"""
